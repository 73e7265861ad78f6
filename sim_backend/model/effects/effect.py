"""What an effect is: one file with one scalar function, used by the plant and by the fit alike.

The function's arguments are signals by name (`motor_position`, `output_torque`, ...), then, for an effect that
remembers, `step` and `memory`, then the effect's parameters by name; it returns what the effect adds. It is plain
scalar code that numba can compile and uses nothing but its arguments, `math`, builtins and the shared `operators`. Only
the base terms are in the plant in another form: the inverses of their springs, a rim that slides, equations of motion.
"""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from types import MappingProxyType
from typing import Protocol

from sim_backend.errors import ModelError, shown
from sim_backend.model.checks import is_series, require

DERIVED_SIGNALS: Mapping[str, str] = MappingProxyType(
    {
        "motor_acceleration": "rad/s^2",
        "locked": "1",
        "flexspline_torsion": "rad",
        "base_friction": "N*m",
    }
)
"""Signals that an effect may take besides those of a log, with their unit.

`locked`: 1 while the fixture holds the output, else 0. `flexspline_torsion`: f(T_F) of the base model.
`base_friction`: the base model's running friction, seen at the motor, at least 0. `motor_acceleration`: for the
base term `inertia` alone.
"""


class Memory(Protocol):
    """What an effect remembers: its own slice of an array of float64, which its function changes in place."""

    @property
    def size(self) -> int:
        """How many numbers there are."""

    def __getitem__(self, place: int, /) -> float: ...

    def __setitem__(self, place: int, value: float, /) -> None: ...


class Enters(StrEnum):
    """Where an effect acts."""

    BASE = "base"
    """A term of the base model: always there; its parameters are those of the drive or the bench."""
    TORSION = "torsion"
    """Adds an angle (rad, at the output) to the torsion: a spring, gap or error in series with the flexspline."""
    MOTOR_BALANCE = "motor balance"
    """Adds a torque (N*m) that the motor must overcome."""
    OUTPUT_BALANCE = "output balance"
    """Adds a torque (N*m) that the output must overcome."""
    FRICTION = "friction"
    """Adds to the level (N*m, magnitude, seen at the motor) of the dry friction in the mesh, which opposes motion."""
    READING = "reading"
    """Adds to what an instrument shows of the signal `reads`; the signals it takes are the true ones."""


class Shape(StrEnum):
    """How an effect depends on its variable."""

    STATIC = "static"
    PERIODIC = "periodic"
    HYSTERETIC = "hysteretic"
    LAG = "lag"
    RATE = "rate"
    PRODUCT = "product"
    EVENT = "event"


class Energy(StrEnum):
    """What a closed cycle of the effect does with energy."""

    CONSERVATIVE = "conservative"
    """Nothing."""
    DISSIPATIVE = "dissipative"
    """Takes energy or nothing, whatever the cycle."""
    ACTIVE = "active"
    """Can put energy in: it comes from current or heat, not from the shaft."""
    NONE = "none"
    """An instrument's error moves nothing by itself."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter: unit, physically possible range, its typical size and usual range on a size-17, ratio-100 drive.

    `usual`: where the value is expected to lie, a working range that is not verified. It comes from the same reference
    as the law, or is derived as the effect's `source` says.
    `known`: not estimated in a fit but taken from the device, the bench or the conditions (a ratio, a reference
    temperature, a count).
    """

    name: str
    unit: str
    low: float
    high: float
    typical: float
    usual: tuple[float, float]
    meaning: str
    known: bool = False


@dataclass(frozen=True, slots=True)
class Effect:
    """One entry of the catalogue.

    `function(signals..., [step, memory,] parameters...)` returns the addition in `unit`. With `amplitudes` at zero the
    effect is absent; where `linear`, the addition is linear in them taken together. A base term has no amplitudes: its
    function gives the whole term.
    `slope`, with the same arguments, is for effects in the torsion that depend on `motor_position`: the torque with
    which the effect helps to drive the motor, per N*m of output torque. That is the derivative of its coenergy
    (integral of the addition over the output torque) by motor_position, divided by the output torque; for an addition
    that does not depend on the torque, simply its derivative. It is called after `function` and leaves `memory` alone.
    `memory`: how many numbers the effect remembers, all zero before the first call, which starts at the equilibrium of
    its signals; `step`: s since the last call, above 0.
    `reads`: the signal whose reading it changes (READING only, else empty).
    `variable` and `shape` say what it depends on and how; `shows` names the procedures that show it, with the condition
    if there is one: `(loaded)`, a free run under a load torque; `(fast)`, a sweep far above 4 N*m/s; `(warming up)`, a
    temperature that moves. `confusable` are the ids it can be taken for and `separated_by` the experiment that tells
    them apart. `parameters` are in order.
    """

    id: str
    summary: str
    equation: str
    source: str
    enters: Enters
    variable: str
    shape: Shape
    unit: str
    parameters: tuple[Parameter, ...]
    amplitudes: tuple[str, ...]
    function: Callable[..., float]
    energy: Energy
    shows: tuple[str, ...]
    confusable: tuple[str, ...]
    separated_by: str
    linear: bool = True
    slope: Callable[..., float] | None = None
    memory: int = 0
    reads: str = ""

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of the signals which the function takes, in order."""
        names = _arguments(self.function)
        return names[: len(names) - len(self.parameters) - (2 if self.memory else 0)]


@cache
def _arguments(function: Callable[..., float]) -> tuple[str, ...]:
    return tuple(inspect.signature(function).parameters)


@dataclass(frozen=True, slots=True)
class ActiveEffect:
    """An effect with its parameter values, in the order of `effect.parameters`."""

    effect: Effect
    values: tuple[float, ...]

    def __post_init__(self) -> None:
        _check_kinds(self.effect, self.values)
        missing = self.effect.parameters[len(self.values) :]
        if missing or len(self.values) > len(self.effect.parameters):
            wanted = ", ".join(map(_wanted, missing or self.effect.parameters))
            raise ModelError(
                f"{self.effect.id}: {len(self.values)} values for {len(self.effect.parameters)} parameters; "
                f"{'missing are' if missing else 'it takes'} {wanted}; {self.effect.equation} needs them."
            )
        for parameter, value in zip(self.effect.parameters, self.values, strict=True):
            name, unit = f"{self.effect.id}: {parameter.name}", "" if parameter.unit == "1" else parameter.unit
            require(name, value, unit, self.effect.equation, low=parameter.low, high=parameter.high)
        object.__setattr__(self, "values", tuple(map(float, self.values)))  # also of a list or an array


def _check_kinds(effect: object, values: object) -> None:
    """Raise ModelError unless these are an effect and several values, whatever the values are."""
    if not isinstance(effect, Effect):
        raise ModelError(f"effect = {shown(effect)} is not possible: it must be an Effect, such as CATALOGUE['creep'].")
    if not is_series(values):
        raise ModelError(
            f"{effect.id}: values = {shown(values)} are not possible: they must be a tuple with a number for each of "
            f"{', '.join(map(_wanted, effect.parameters))}; {effect.equation} needs them."
        )


def _wanted(parameter: Parameter) -> str:
    """Give a parameter as a message asks for it."""
    return f"{parameter.name} ({parameter.unit}, {parameter.low:g} to {parameter.high:g}: {parameter.meaning})"

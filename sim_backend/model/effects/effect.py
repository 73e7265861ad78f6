"""What an effect is: one file with one scalar function, used by the plant and by the fit alike.

The function's arguments are contract signals by name (`motor_position`, `output_torque`, ...) followed by the
effect's parameters by name; it returns what the effect adds. It is plain scalar code that numba can compile.
"""

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

from sim_backend.errors import ModelError


class Enters(StrEnum):
    """Where an effect acts."""

    TORSION = "torsion"
    """Adds an angle (rad, at the output) to the torsion."""
    MOTOR_BALANCE = "motor balance"
    """Adds a torque (N*m) that the motor must overcome."""
    OUTPUT_BALANCE = "output balance"
    """Adds a torque (N*m) that the output must overcome."""
    READING = "reading"
    """Adds to what an instrument shows."""


class Shape(StrEnum):
    """How an effect depends on its variable."""

    STATIC = "static"
    PERIODIC = "periodic"
    HYSTERETIC = "hysteretic"
    LAG = "lag"
    RATE = "rate"
    PRODUCT = "product"
    EVENT = "event"


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter: unit, physically possible range, and its typical size on a size-17, ratio-100 drive."""

    name: str
    unit: str
    low: float
    high: float
    typical: float
    meaning: str


@dataclass(frozen=True, slots=True)
class Effect:
    """One entry of the catalogue.

    `function(signals..., parameters...)` returns the addition in `unit`, linear in the parameter `amplitude`.
    `slope` is its derivative with respect to `motor_position` at the same arguments, for effects in the torsion
    that react on the motor; None where there is none. `variable` and `shape` say what it depends on and how;
    `shows` names the procedures that show it, `confusable` the ids it can be taken for and `separated_by` the
    experiment that tells them apart. `conservative`: a closed cycle takes no energy.
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
    amplitude: str
    function: Callable[..., float]
    slope: Callable[..., float] | None
    conservative: bool
    shows: tuple[str, ...]
    confusable: tuple[str, ...]
    separated_by: str

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of the signals which the function takes, in order."""
        names = tuple(inspect.signature(self.function).parameters)
        return names[: len(names) - len(self.parameters)]


@dataclass(frozen=True, slots=True)
class ActiveEffect:
    """An effect with its parameter values, in the order of `effect.parameters`."""

    effect: Effect
    values: tuple[float, ...]

    def __post_init__(self) -> None:
        for parameter, value in zip(self.effect.parameters, self.values, strict=True):
            if not parameter.low <= value <= parameter.high:
                raise ModelError(
                    f"{self.effect.id}: {parameter.name} = {value!r} {parameter.unit} is outside "
                    f"{parameter.low:g} to {parameter.high:g} {parameter.unit}."
                )

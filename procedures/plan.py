"""How a procedure is described: parameters with unit and range, what it needs, and the runs it consists of."""

import dataclasses
import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from drivers.errors import ConfigError, Mistake
from drivers.spelling import did_you_mean
from drivers.types import Limits
from procedures.intents import Result, Steps

_WHOLE = re.compile(r"[-+]?[0-9]+")
_DECIMAL = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")
_MOST_LETTERS = 60
"""Letters of a value that a message repeats, and more than any number here needs."""


@dataclass(frozen=True, slots=True)
class BenchFacts:
    """What a procedure may know of the bench before it starts. SI; counts per revolution.

    `ratio` of the gear; `rated_torque` and `backdriving_torque` N*m at the output; `starting_torque` N*m,
    `wave_generator_stiffness` N*m/rad and `motor_inertia` kg*m^2 at the motor; `limits` of the bench; `cycle_time` s.
    `opposed`: the output turns against the wave generator, torsion = output_position + motor_position / ratio.
    `assumed`: one line for each of these that the dut file does not name and the application guessed.
    """

    ratio: float
    rated_torque: float
    starting_torque: float
    backdriving_torque: float
    wave_generator_stiffness: float
    motor_inertia: float
    motor_counts: int
    cycle_time: float
    limits: Limits
    has_load_drive: bool
    has_lock: bool
    has_output_encoder: bool
    has_torque_sensor: bool
    opposed: bool = True
    assumed: tuple[str, ...] = ()

    @property
    def rotor_swing(self) -> float:
        """Angular frequency of the rotor on the wave generator's spring while the teeth stick, rad/s."""
        return math.sqrt(self.wave_generator_stiffness / self.motor_inertia)


@dataclass(frozen=True, slots=True)
class PlannedRun:
    """One run to be logged.

    `name` is unique within the plan; runs with the same `replicate` group repeat the same conditions;
    `start_angle` is the wave-generator angle (rad) from which the run starts, None where it does not matter;
    a `set_up` run only brings the bench into position and is logged apart. `duration` is the expected length, s.
    """

    name: str
    steps: Callable[[], Steps]
    duration: float
    replicate: str | None = None
    start_angle: float | None = None
    set_up: bool = False


@dataclass(frozen=True, slots=True)
class Procedure:
    """One entry of the registry.

    `parameters` is a frozen dataclass whose fields come from `parameter`; `plan` gives the runs for one set of
    parameters on one bench, `summarise` joins the results of the measuring runs, in order. `needs` names the
    signals without which it cannot start, `needs_load_drive` and `needs_lock` the equipment. `on_abort`
    says what the motor does when the procedure is stopped at any moment.
    """

    name: str
    summary: str
    parameters: type
    plan: Callable[[Any, BenchFacts], tuple[PlannedRun, ...]]
    summarise: Callable[[tuple[Result, ...]], Result]
    needs: tuple[str, ...]
    on_abort: str
    needs_load_drive: bool = False
    needs_lock: bool = False


@dataclass(frozen=True, slots=True)
class ParameterInfo:
    """Unit, range and meaning of one parameter of a procedure."""

    name: str
    default: Any
    unit: str
    low: float
    high: float
    meaning: str
    kind: type


def parameter(default: Any, unit: str, low: float, high: float, meaning: str) -> Any:
    """Declare a field of a parameter class: default, unit, inclusive range, meaning.

    A default of None stands for "from dut": worked out from the device under test as the meaning says; its type is then
    float. A tuple default takes a comma-separated list, the range holding for every entry. A bool or str default
    ignores the range.
    """
    return dataclasses.field(default=default, metadata={"unit": unit, "low": low, "high": high, "meaning": meaning})


def parameter_table(parameters: type) -> tuple[ParameterInfo, ...]:
    """List the parameters of a parameter class, in order."""
    return tuple(
        ParameterInfo(
            name=f.name,
            default=f.default,
            unit=f.metadata["unit"],
            low=f.metadata["low"],
            high=f.metadata["high"],
            meaning=f.metadata["meaning"],
            kind=float if f.default is None else type(f.default),
        )
        for f in dataclasses.fields(parameters)
    )


def build_parameters(procedure: Procedure, settings: dict[str, str]) -> Any:
    """Give the procedure's parameters with `settings` (name to text) applied.

    Raises ConfigError with every unknown name, unreadable value and value out of range at once.
    """
    table = {info.name: info for info in parameter_table(procedure.parameters)}
    values: dict[str, Any] = {}
    mistakes: list[Mistake] = []
    for name, text in settings.items():
        path = f"{procedure.name}.{_shown(name)}"
        info = table.get(name)
        if info is None:
            rule = f"no such parameter{did_you_mean(name, table)}; {procedure.name} has {', '.join(table)}"
            mistakes.append(Mistake(path, _shown(text), rule))
            continue
        try:
            values[name] = _read(text, info)
        except ValueError as error:
            mistakes.append(Mistake(path, _shown(text), str(error)))
    if mistakes:
        raise ConfigError("--set", mistakes, hint="`rig procedures` lists every parameter with unit and range.")
    return procedure.parameters(**values)


def _read(text: str, info: ParameterInfo) -> Any:
    if info.kind is bool:
        words = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}
        if text.lower() not in words:
            raise ValueError("expected true or false")
        return words[text.lower()]
    if info.kind is str:
        return text
    if info.kind is tuple:
        return tuple(_number(part, info, float) for part in text.split(",") if part.strip())
    return _number(text, info, info.kind)


def _shown(text: str) -> str:
    return text if len(text) <= _MOST_LETTERS else f"{text[: _MOST_LETTERS - 3]}..."


def _number(text: str, info: ParameterInfo, kind: type) -> Any:
    # Python itself also reads 1_0, digits of other scripts and numbers with thousands of digits
    if not (_WHOLE if kind is int else _DECIMAL).fullmatch(text.strip()) or len(text) > _MOST_LETTERS:
        raise ValueError(f"expected {'a whole number' if kind is int else 'a number'} in {info.unit}")
    value = kind(text)
    if not (math.isfinite(value) and info.low <= value <= info.high):
        raise ValueError(f"out of range {info.low:g} to {info.high:g} {info.unit}")
    return value

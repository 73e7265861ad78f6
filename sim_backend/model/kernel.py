"""The plant's kernel for one set of effects: one flat generated module of the stepper and the effects' functions."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim_backend.errors import ModelError
from sim_backend.model import constants, coupling, drive_loop, effect_sums, rim, series, springs, stepper
from sim_backend.model.compliance import Compliance
from sim_backend.model.effects import ActiveEffect, Effect, Enters
from sim_backend.model.machine_code import Bound, bind
from sim_backend.model.source import definitions, function_source, operators_of

FLEXSPLINE_SIGNALS = ("output_torque", "flexspline_torsion")
"""Signals besides `effect_sums.Signals`; an effect in the torsion that takes one lies in series with the flexspline."""

COUPLING_SIGNALS = ("motor_torque",)
"""Signals of an effect in the torsion without memory that lies in series with the wave generator; there it is -T_w."""

SIGNALS = (*effect_sums.Signals._fields, *FLEXSPLINE_SIGNALS)
"""Signals that an effect in the plant may take."""

READABLE = ("motor_position", "motor_torque", "output_position", "output_torque")
"""Readings that an effect may change, in the order of `effect_sums.reading_errors`."""

Array = NDArray[np.float64]

_CALLS = (
    ("start", "start(*arrays)"),
    ("advance", "advance(count, *arrays)"),
    ("change_lock", "change_lock(float(count), *arrays)"),
)


class Stepper(NamedTuple):
    """Functions of the stepper for the arrays of one plant.

    start(0) once; advance(steps); change_lock(1) before the inputs say that the output is locked, 0 before it is free.
    """

    start: Bound
    advance: Bound
    change_lock: Bound


@dataclass(frozen=True, slots=True)
class Kernel:
    """The source of the stepper with its effects, their parameters, and the size of the state with their memory.

    `yielding`: an effect makes `change_lock` necessary. `readings`: an effect changes readings.
    """

    source: str
    compiled: bool
    effect_parameters: Array
    state_size: int
    yielding: bool
    readings: bool

    def bind(self, state: Array, inputs: Array, constants: Array) -> Stepper:
        """Give the stepper's functions for these arrays; they are compiled once and then come from the user's cache.

        Raises ModelError if an array is not of float64.
        """
        arrays = (state, inputs, constants, self.effect_parameters)
        return Stepper(**bind("The plant of a simulated bench", self.source, _CALLS, arrays, compiled=self.compiled))


@dataclass(frozen=True, slots=True)
class _Placed:
    """An active effect with its number and the places of its parameters and of its memory."""

    effect: Effect
    number: int
    parameters: int
    memory: int

    def call(self, what: str = "", memory_offset: int = 0) -> str:
        """Give the source of a call of its function, or of its `_slope`."""
        effect = self.effect
        given = COUPLING_SIGNALS if _couples(effect) else FLEXSPLINE_SIGNALS
        arguments = [name if name in given else f"now.{name}" for name in effect.signals]
        if effect.memory:
            begin = self.memory + memory_offset
            arguments += ["step", f"state[{begin}:{begin + effect.memory}]"]
        arguments += [f"effect_parameters[{self.parameters + i}]" for i in range(len(effect.parameters))]
        return f"effect_{self.number}{what}({', '.join(arguments)})"


def plant_kernel(
    effects: Sequence[ActiveEffect], law: Compliance = Compliance.ARCTAN, *, compiled: bool = True
) -> Kernel:
    """Give the kernel for these effects and this law of the flexspline.

    Raises ModelError if an effect takes or changes a signal that the plant does not have, or enters where it cannot.
    """
    kinds = [active.effect for active in effects]
    values = [value for active in effects for value in active.values]
    return Kernel(
        source=kernel_source(kinds, law),
        compiled=compiled,
        effect_parameters=np.array(values or [0.0], dtype=np.float64),
        state_size=stepper.STATE_SIZE + sum(effect.memory * (2 if _in_series(effect) else 1) for effect in kinds),
        yielding=any(_in_series(effect) and "locked" in effect.signals for effect in kinds),
        readings=any(effect.enters is Enters.READING for effect in kinds),
    )


def kernel_source(effects: Sequence[Effect], law: Compliance = Compliance.ARCTAN) -> str:
    """Give the source of everything the kernel consists of; it depends on the effects, not on their values."""
    for effect in effects:
        _check(effect)
    placed = _place(effects)
    entering = {enters: [p for p in placed if p.effect.enters is enters] for enters in Enters}
    in_series = [p for p in placed if _in_series(p.effect)]
    coupled = [p for p in entering[Enters.TORSION] if _couples(p.effect)]
    in_torsion = [p for p in entering[Enters.TORSION] if p not in in_series and p not in coupled]
    readings = [[p for p in entering[Enters.READING] if p.effect.reads == name] for name in READABLE]
    remembered = sum(p.effect.memory for p in in_series)
    trial = stepper.STATE_SIZE + sum(p.effect.memory for p in placed)

    def of(group: Iterable[_Placed], what: str = "", memory_offset: int = 0) -> str:
        calls = [p.call(what, memory_offset) for p in group if not what or p.effect.slope is not None]
        return " + ".join(["0.0", *calls])

    first = stepper.STATE_SIZE
    called = [f for p in placed for f in (p.effect.function, p.effect.slope) if f is not None]
    functions = [operators_of(called), *(function_source(p.effect.function, f"effect_{p.number}") for p in placed)]
    functions += [
        function_source(p.effect.slope, f"effect_{p.number}_slope") for p in placed if p.effect.slope is not None
    ]
    closed = [p for p in in_torsion if p.effect.slope is not None and not p.effect.memory]
    open_ = [p for p in in_torsion if p not in closed]
    return "\n\n".join(
        [
            definitions(constants, "Constants"),
            _unpack(),
            _springs(law),
            definitions(rim),
            definitions(drive_loop),
            *functions,
            definitions(effect_sums, "Signals"),
            f"FRICTION, SERIES = {bool(entering[Enters.FRICTION])}, {bool(in_series)}",
            f"COUPLED, READINGS = {bool(coupled)}, {any(readings)}",
            _sum(
                "torsion_effects",
                f"closed, open_ = {of(closed)}, {of(open_)}",
                f"slope, open_slope = {of(closed, '_slope')}, {of(open_, '_slope')}",
                "return closed + open_, slope + open_slope, open_, open_slope",
            ),
            _sum(
                "series_effects",
                *_copy(remembered, first, trial),
                f"return {of(in_series, memory_offset=trial - first)}",
            ),
            "@compiled\ndef keep_series(state):\n" + _lines([*_copy(remembered, trial, first), "return"]),
            f"@compiled\ndef coupling_effects(motor_torque, effect_parameters):\n    return {of(coupled)}",
            _sum("series_slope", f"return {of(in_series, '_slope')}"),
            _sum("friction_effects", f"return {of(entering[Enters.FRICTION])}"),
            _sum("motor_effects", f"return {of(entering[Enters.MOTOR_BALANCE])}"),
            _sum("output_effects", f"return {of(entering[Enters.OUTPUT_BALANCE])}"),
            _sum("reading_errors", f"return {', '.join(of(group) for group in readings)}"),
            definitions(coupling),
            definitions(series),
            definitions(stepper),
        ]
    )


def _check(effect: Effect) -> None:
    """Raise ModelError unless the plant can simulate the effect."""
    if effect.enters is Enters.BASE:
        raise ModelError(
            f"{effect.id} is a term of the base model: the plant has it always, with the parameters of its drive "
            f"(HarmonicDrive, PlantConfig), and not as an active effect."
        )
    offered = [name for name in SIGNALS if effect.enters is not Enters.FRICTION or name != "flexspline_torsion"]
    unknown = [name for name in effect.signals if name not in offered]
    if unknown:
        raise ModelError(
            f"{effect.id} takes {', '.join(unknown)}, which the plant does not have for an effect that enters the "
            f"{effect.enters}; it has {', '.join(offered)}."
        )
    if effect.enters is Enters.READING and effect.reads not in READABLE:
        raise ModelError(
            f"{effect.id} changes the reading of {effect.reads or 'nothing'}; in the plant an effect can change those "
            f"of {', '.join(READABLE)}."
        )


def _in_series(effect: Effect) -> bool:
    return effect.enters is Enters.TORSION and any(name in FLEXSPLINE_SIGNALS for name in effect.signals)


def _couples(effect: Effect) -> bool:
    return effect.enters is Enters.TORSION and effect.signals == COUPLING_SIGNALS and not effect.memory


def _place(effects: Sequence[Effect]) -> list[_Placed]:
    """Lay out parameters in order and memory behind the state, that of what lies in series first."""
    parameters = np.cumsum([0, *(len(effect.parameters) for effect in effects)]).tolist()
    memory, places = stepper.STATE_SIZE, dict[int, int]()
    for number in sorted(range(len(effects)), key=lambda k: not _in_series(effects[k])):
        places[number] = memory
        memory += effects[number].memory
    return [_Placed(effect, k, parameters[k], places[k]) for k, effect in enumerate(effects)]


def _sum(name: str, *body: str) -> str:
    arguments = "now, output_torque, flexspline_torsion, step, state, effect_parameters"
    return f"@compiled\ndef {name}({arguments}):\n{_lines(body)}"


def _copy(count: int, source: int, target: int) -> list[str]:
    """Give the lines that copy so many numbers of the state, if any."""
    return [f"for k in range({count}):", f"    state[{target} + k] = state[{source} + k]"] if count else []


def _lines(body: Iterable[str]) -> str:
    return "\n".join(f"    {line}" for line in body)


def _springs(law: Compliance) -> str:
    """Give torque and energy of the two springs, the flexspline's under the names that rim and stepper call."""
    chosen, called = _FLEXSPLINES[law], _FLEXSPLINES[Compliance.ARCTAN]
    source = definitions(springs, "_bent_and_straight", *chosen, "wave_generator_torque", "wave_generator_energy")
    renamed = "\n".join(f"{name} = {law_name}" for name, law_name in zip(called, chosen, strict=True))
    return source if chosen == called else f"{source}\n\n{renamed}"


_FLEXSPLINES = {
    Compliance.ARCTAN: ("flexspline_torque", "flexspline_energy"),
    Compliance.CUBIC: ("cubic_flexspline_torque", "cubic_flexspline_energy"),
    Compliance.PIECEWISE: ("piecewise_flexspline_torque", "piecewise_flexspline_energy"),
}


def _unpack() -> str:
    """Give an `unpack` that numba can compile: one index per constant."""
    places = ", ".join(f"values[{i}]" for i in range(len(constants.Constants._fields)))
    return f"@compiled\ndef unpack(values):\n    return Constants({places})"

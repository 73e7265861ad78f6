"""Effects of the catalogue that are no lines: their additions over a run, and the derivatives by their parameters.

One function serves the plant and the fit: what an effect adds is evaluated from its catalogue entry, over the signals
that the run recorded or the model predicts. Where it acts decides how the addition reaches a prediction:

    angle      the torsion (an angle's reading at the motor counts 1/N); what bends it with the motor's angle, and so
               acts back on the motor, is a line
    motor      what the motor must overcome; a wrong reading of the motor torque acts alike
    load       what the output must overcome; a wrong reading of the output torque acts alike
    friction   level of the dry friction, seen at the motor
"""

import math
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from rig.loop.model.curves import Curve, basis
from rig.loop.model.equations import Equation
from rig.loop.model.terms import is_line
from sim_backend.model.arrays import evaluate
from sim_backend.model.effects import CATALOGUE, Effect, Enters, Shape

Floats = NDArray[np.float64]

SWEPT_TORQUE, CORNERS = "swept_torque", "corners"
"""Names of the polyline that the output torque follows, and of lines that have its corners, beside the signals of the
contract; several values a sample."""

FAST_MOTOR_TORQUE = "fast_motor_torque"
"""Name of the motor torque of a run that does not turn, several values a sample."""

UNDOING, BEYOND = 4, 10.0
"""Iterations after which the torque is known that a late reading shows, and times by which it is late for which the
last slope goes on beyond the record: what the torque was at the end is read when the record is over."""

DIFFERENCE = 1e-4
"""Relative step of a parameter over which a derivative is taken."""


class Place(StrEnum):
    """Where an addition reaches the equations."""

    ANGLE = "angle"
    MOTOR = "motor"
    LOAD = "load"
    FRICTION = "friction"


@dataclass(frozen=True, slots=True)
class ShapeClass:
    """An effect as a kind of term, beside `TermClass`."""

    law: Effect | Curve

    @property
    def id(self) -> str:
        """The name in the result."""
        return self.law.id

    @property
    def effect(self) -> str | None:
        """The catalogue's id, None for a curve."""
        return None if isinstance(self.law, Curve) else self.law.id

    @property
    def variable(self) -> str:
        """The signal that it follows."""
        return self.law.variable

    @property
    def shape(self) -> str:
        """How it follows it."""
        return str(self.law.shape)

    @property
    def enters(self) -> str:
        """Where it acts, as the model file says it."""
        if isinstance(self.law, Curve):
            return self.law.place
        return f"{self.law.enters} of {self.law.reads}" if self.law.reads else str(self.law.enters)

    @property
    def is_angle(self) -> bool:
        """Whether it is an angle, not a torque."""
        return place_of(self.law) is Place.ANGLE

    @property
    def equation(self) -> Equation:
        """The equation in which it shows first."""
        effect = self.law
        if effect.reads == "output_torque":
            return Equation.TORSION
        return {
            Place.ANGLE: Equation.TORSION,
            Place.MOTOR: Equation.MOTOR_TORQUE,
            Place.LOAD: Equation.OUTPUT_TORQUE,
            Place.FRICTION: Equation.MOTOR_TORQUE,
        }[place_of(effect)]


def units_of(effect: Effect | Curve, equation: Equation) -> dict[str, str]:
    """Give the unit of every parameter where the effect shows in `equation`.

    In that of the current, of whose torque constant nothing is known, a torque that the motor must overcome is in A.
    """
    if isinstance(effect, Curve):
        motor = equation.unit if equation is Equation.MOTOR_CURRENT else "N*m"
        return {parameter.name: parameter.unit for parameter in effect.parameters_in(motor)}
    found = {parameter.name: parameter.unit for parameter in effect.parameters}
    if equation is Equation.MOTOR_CURRENT and effect.enters in (Enters.MOTOR_BALANCE, Enters.FRICTION):
        found |= {name: "A" for name in effect.amplitudes if found[name] == "N*m"}
    return found


@dataclass(frozen=True, slots=True)
class ShapeTerm:
    """An effect of the catalogue, or a curve, with its parameters' values in the order of `effect.parameters`."""

    effect: Effect | Curve
    values: tuple[float, ...]

    @property
    def free(self) -> tuple[int, ...]:
        """Places of the parameters that a fit estimates."""
        return tuple(k for k, p in enumerate(self.effect.parameters) if not p.known)

    @property
    def kind(self) -> ShapeClass:
        """Its kind."""
        return ShapeClass(self.effect)

    @property
    def frequencies(self) -> tuple[float, ...]:
        """Parameters that are frequencies, Hz."""
        return tuple(v for p, v in zip(self.effect.parameters, self.values, strict=True) if p.unit == "Hz")

    @property
    def rings(self) -> bool:
        """Whether it swings by itself where the output torque has a corner."""
        return bool(self.frequencies) and self.effect.signals == ("output_torque",)

    @property
    def is_late(self) -> bool:
        """Whether it makes the output torque's reading late, which shows where the torque turns."""
        free = [self.effect.parameters[k] for k in self.free]
        return self.effect.reads == "output_torque" and all(p.unit == "s" for p in free)

    @property
    def is_of_motor_torque(self) -> bool:
        """Whether it follows the motor torque alone, without memory."""
        return self.effect.shape is Shape.STATIC and self.effect.signals == ("motor_torque",)

    def value(self, name: str) -> float:
        """Give one parameter."""
        return self.values[[p.name for p in self.effect.parameters].index(name)]

    def moved(self, change: Floats) -> "ShapeTerm":
        """Give the term with its free parameters changed, inside their physical range; see `is_logarithmic`."""
        values = list(self.values)
        for step, k in zip(change.tolist(), self.free, strict=True):
            parameter = self.effect.parameters[k]
            moved = values[k] * math.exp(min(max(step, -1.0), 1.0)) if self.is_logarithmic(k) else values[k] + step
            values[k] = min(max(moved, parameter.low), parameter.high)
        return ShapeTerm(self.effect, tuple(values))

    def scaled(self, k: int, factor: float) -> "ShapeTerm":
        """Give the term with one parameter multiplied, inside its physical range."""
        parameter = self.effect.parameters[k]
        return _with(self, k, min(max(self.values[k] * factor, parameter.low), parameter.high))

    def is_logarithmic(self, k: int) -> bool:
        """Whether a parameter is estimated as a logarithm: all that are no amplitudes."""
        return self.effect.parameters[k].name not in self.effect.amplitudes


def catalogue_shapes() -> tuple[Effect, ...]:
    """Give the effects that a fit can add and that are no lines; events have no repeatable column."""
    return tuple(
        effect
        for effect in CATALOGUE.values()
        if effect.enters is not Enters.BASE and effect.shape is not Shape.EVENT and not is_line(effect)
    )


def named_effect(name: str, parameters: Set[str]) -> Effect | None:
    """Give the effect that an id of a result stands for; of an ambiguous set the one that has these parameters."""
    members = name.removeprefix("ambiguous:").split("|")
    known = [CATALOGUE[member] for member in members if member in CATALOGUE]
    if len(members) == 1:
        return known[0] if known else None
    return next((effect for effect in known if {p.name for p in effect.parameters} == parameters), None)


def place_of(effect: Effect | Curve) -> Place:
    """Give where the effect's addition reaches the equations."""
    if effect.enters is Enters.READING:
        return {"motor_torque": Place.MOTOR, "output_torque": Place.LOAD}.get(effect.reads, Place.ANGLE)
    return {
        Enters.TORSION: Place.ANGLE,
        Enters.MOTOR_BALANCE: Place.MOTOR,
        Enters.OUTPUT_BALANCE: Place.LOAD,
        Enters.FRICTION: Place.FRICTION,
    }[effect.enters]


def addition(term: ShapeTerm, signals: Mapping[str, Floats], step: float) -> Floats | None:
    """Give what the term adds, shape (n,), in its unit; None where a signal it takes was not recorded."""
    if any(name not in signals for name in term.effect.signals):
        return None
    if isinstance(term.effect, Curve):
        fitted = np.array([term.values[k] for k in term.free])
        return np.asarray(basis(term.effect, term.values[: term.effect.knots], signals, step) @ fitted)
    if term.rings:  # noise would set it ringing too
        return _ringing(term.effect, term.values, signals, step) if CORNERS in signals else None
    late = added_late(term, signals, step)
    if late is not None:
        return _means(late, signals)
    fast = signals.get(FAST_MOTOR_TORQUE)
    if fast is not None and term.is_of_motor_torque:
        # the mean of what lies about a corner is less than what lies at the mean
        return _means(evaluate(term.effect, {"motor_torque": fast}, term.values, step=step), signals)
    return evaluate(term.effect, signals, term.values, step=step)


def _ringing(effect: Effect, values: Sequence[float], signals: Mapping[str, Floats], step: float) -> Floats:
    """Give what a torque sets ringing by its corners: samples averaged before would bend there."""
    fast = signals[CORNERS]
    step = step * signals["output_torque"].size / fast.size
    return _means(evaluate(effect, {"output_torque": fast}, values, step=step), signals)


def added_late(
    term: ShapeTerm, signals: Mapping[str, Floats], step: float, swept_by: str = SWEPT_TORQUE
) -> Floats | None:
    """Give what has been added to the swept torque, a reading that came late: it less the torque that makes it.

    `swept_by`: name of the signal with that reading. As many values as it has. None for other effects, and where it is
    not known. The torque is first the reading as much early, and then what the effect turns into the reading: what is
    still missing of that, as much early, is added (Landweber's iteration, 1951). A corner that a lag has rounded stays
    wrong by a seventh of what was added, in the mean by nothing.
    """
    if not term.is_late or isinstance(term.effect, Curve) or swept_by not in signals:
        return None
    effect, swept = term.effect, signals[swept_by]
    step = step * signals["output_torque"].size / swept.size
    beyond = np.arange(1, 2 + math.ceil(BEYOND * max(term.values) / step))
    reading = np.concatenate([swept, swept[-1] + beyond * (swept[-1] - swept[-2])])

    def late(torque: Floats) -> Floats:
        return torque + evaluate(effect, {"output_torque": torque}, term.values, step=step)

    def early(torque: Floats) -> Floats:
        return late(torque[::-1])[::-1]

    torque = early(reading)
    for _ in range(UNDOING):
        torque = torque + early(reading - late(torque))
    return (reading - torque)[: swept.size]


def _means(fast: Floats, signals: Mapping[str, Floats]) -> Floats:
    return np.asarray(fast.reshape(signals["output_torque"].size, -1).mean(axis=1))


def derivatives(term: ShapeTerm, signals: Mapping[str, Floats], step: float) -> list[Floats] | None:
    """Give the derivative of the addition by every free parameter, each (n,), in the scale of the fit."""
    if isinstance(term.effect, Curve):
        return unit_columns(term.effect, term.values, signals, step)
    found = []
    for k in term.free:
        parameter = term.effect.parameters[k]
        width = DIFFERENCE * max(abs(term.values[k]), 1e-2 * abs(parameter.typical))
        up, down = (addition(_with(term, k, term.values[k] + sign * width), signals, step) for sign in (1.0, -1.0))
        if up is None or down is None:
            return None
        found.append((up - down) / (2.0 * width) * (term.values[k] if term.is_logarithmic(k) else 1.0))
    return found


def unit_columns(
    curve: Curve, values: Sequence[float], signals: Mapping[str, Floats], step: float
) -> list[Floats] | None:
    """Give what each fitted value of a curve adds at size 1, each (n,); None where a signal was not recorded."""
    if any(name not in signals for name in curve.signals):
        return None
    return list(basis(curve, values[: curve.knots], signals, step).T)


def _with(term: ShapeTerm, k: int, value: float) -> ShapeTerm:
    return ShapeTerm(term.effect, (*term.values[:k], value, *term.values[k + 1 :]))

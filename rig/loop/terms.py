"""Terms: what can be added to the base model, each with a column in every equation it enters.

A periodic term is e = s sin(k x) + c cos(k x) of an angle x; where it acts decides what it does (logged
signals, sense `opposed`):

    torsion            torsion += e, and the motor feels -T e' (T: output torque)
    motor balance      motor torque += e; the wave generator then carries M - e
    output balance     output torque += e; the flexspline then carries T - e
    angle only         torsion += e, nothing else: an angle that is measured wrongly, or not understood
    against motion     motor or output torque += sign of the speed * e: friction, not a conservative torque
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from rig.loop.equations import Equation
from sim_backend.model.effects import CATALOGUE, Effect, Enters, Shape

Floats = NDArray[np.float64]


class Entry(StrEnum):
    """Where a term acts."""

    TORSION = "torsion"
    MOTOR = "motor balance"
    OUTPUT = "output balance"
    ANGLE_ONLY = "angle only"
    MOTOR_AGAINST_MOTION = "motor balance, against motion"
    OUTPUT_AGAINST_MOTION = "output balance, against motion"

    @property
    def is_angle(self) -> bool:
        """Whether the term is an angle (rad), not a torque."""
        return self in (Entry.TORSION, Entry.ANGLE_ONLY)

    @property
    def equation(self) -> Equation:
        """The equation in which the term shows first."""
        if self.is_angle:
            return Equation.TORSION
        return Equation.MOTOR_TORQUE if self in (Entry.MOTOR, Entry.MOTOR_AGAINST_MOTION) else Equation.OUTPUT_TORQUE


ENTRY_OF: Mapping[Enters, Entry] = {
    Enters.TORSION: Entry.TORSION,
    Enters.MOTOR_BALANCE: Entry.MOTOR,
    Enters.OUTPUT_BALANCE: Entry.OUTPUT,
}
"""How a catalogue effect enters; those in a reading, in the friction and of the base model are no terms yet."""


@dataclass(frozen=True, slots=True)
class TermClass:
    """One kind of term: catalogue id or None, where it acts, of which angle, and its order if that is fixed."""

    effect: str | None
    entry: Entry
    variable: str
    fixed_order: float | None = None

    @property
    def id(self) -> str:
        """The name in the result."""
        if self.effect is not None:
            return self.effect
        flips = self.entry in (Entry.MOTOR_AGAINST_MOTION, Entry.OUTPUT_AGAINST_MOTION)
        return f"unnamed:{self.variable}:{'product' if flips else 'periodic'}"


@dataclass(frozen=True, slots=True)
class Line:
    """One line of a term: order in cycles per revolution, sine and cosine amplitude in the term's unit."""

    kind: TermClass
    order: float
    sine: float = 0.0
    cosine: float = 0.0

    @property
    def amplitude(self) -> float:
        """Half of the peak-to-peak size."""
        return math.hypot(self.sine, self.cosine)

    @property
    def phase(self) -> float:
        """Phase in amplitude * sin(order * variable + phase), rad."""
        return math.atan2(self.cosine, self.sine)


def periodic_effects() -> tuple[TermClass, ...]:
    """Give a term class for every catalogue effect that is periodic in an angle of the bench."""
    found = []
    for effect in CATALOGUE.values():
        if effect.shape is Shape.PERIODIC and effect.enters in ENTRY_OF and _is_one_line(effect):
            has_order = any(parameter.name == "order" for parameter in effect.parameters)
            found.append(TermClass(effect.id, ENTRY_OF[effect.enters], effect.variable, None if has_order else 1.0))
    return tuple(found)


def _is_one_line(effect: Effect) -> bool:
    """Whether the effect is amplitude * sin(order * variable + phase) of one angle, and of nothing else."""
    names = {parameter.name for parameter in effect.parameters}
    takes_one = effect.signals == (effect.variable,) and not effect.memory
    return {"amplitude", "phase"} <= names <= {"amplitude", "phase", "order"} and takes_one


@dataclass(frozen=True, slots=True)
class LineValues:
    """A line at the angles of a run: value, slope d/dx, and their derivatives by sine, cosine, order; shape (n,)."""

    value: Floats
    slope: Floats
    by_sine: Floats
    by_cosine: Floats
    by_order: Floats
    slope_by_sine: Floats
    slope_by_cosine: Floats
    slope_by_order: Floats


def line_values(line: Line, angle: Floats) -> LineValues:
    """Evaluate a line at `angle` (n,) rad."""
    k, s, c = line.order, line.sine, line.cosine
    sine, cosine = np.sin(k * angle), np.cos(k * angle)
    value, quadrature = s * sine + c * cosine, s * cosine - c * sine
    return LineValues(
        value=value,
        slope=k * quadrature,
        by_sine=sine,
        by_cosine=cosine,
        by_order=angle * quadrature,
        slope_by_sine=k * cosine,
        slope_by_cosine=-k * sine,
        slope_by_order=quadrature - k * angle * value,
    )

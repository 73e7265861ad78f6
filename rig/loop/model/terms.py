"""Terms: what can be added to the base model, each with a column in every equation it enters.

A periodic term is e = s sin(k x) + c cos(k x) of an angle x; where it acts decides what it does (logged
signals, sense `opposed`):

    torsion            torsion += e, and the motor feels -T e' (T: output torque)
    motor balance      motor torque += e; the wave generator then carries M - e
    output balance     output torque += e; the flexspline then carries T - e
    angle only         torsion += e, nothing else: an angle that is measured wrongly, or not understood
    angle of the motor torsion += e/N: the reading of the motor's angle
    times torque       torsion += T e, and the motor feels -T^2 e'/2; or motor torque += M e (M: motor torque)
    against motion     level of the friction at the motor += e, or output torque += sign of the speed * e
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from rig.loop.model.equations import Equation
from sim_backend.model.effects import CATALOGUE, Effect, Enters

Floats = NDArray[np.float64]


class Entry(StrEnum):
    """Where a term acts."""

    TORSION = "torsion"
    MOTOR = "motor balance"
    OUTPUT = "output balance"
    ANGLE_ONLY = "angle only"
    MOTOR_ANGLE = "angle of the motor"
    TORSION_TIMES_TORQUE = "torsion, times torque"
    MOTOR_TIMES_TORQUE = "motor balance, times torque"
    MOTOR_AGAINST_MOTION = "motor balance, against motion"
    OUTPUT_AGAINST_MOTION = "output balance, against motion"

    @property
    def is_angle(self) -> bool:
        """Whether the term is an angle (rad), not a torque."""
        return self in (Entry.TORSION, Entry.ANGLE_ONLY, Entry.MOTOR_ANGLE, Entry.TORSION_TIMES_TORQUE)

    @property
    def is_product(self) -> bool:
        """Whether the line is multiplied by something that is no angle: a torque, or the direction."""
        return self in _PRODUCTS

    @property
    def equation(self) -> Equation:
        """The equation in which the term shows first."""
        if self.is_angle:
            return Equation.TORSION
        return Equation.MOTOR_TORQUE if self.value.startswith("motor") else Equation.OUTPUT_TORQUE

    def unit_in(self, equation: Equation) -> str:
        """Give the unit of an amplitude where the term shows in `equation`: of a product with a torque, by that."""
        by_torque = {Entry.TORSION_TIMES_TORQUE: "rad/(N*m)", Entry.MOTOR_TIMES_TORQUE: "1"}
        return by_torque.get(self, equation.unit)


_PRODUCTS = frozenset(
    (
        Entry.TORSION_TIMES_TORQUE,
        Entry.MOTOR_TIMES_TORQUE,
        Entry.MOTOR_AGAINST_MOTION,
        Entry.OUTPUT_AGAINST_MOTION,
    )
)

_ENTRY_OF: Mapping[tuple[Enters, str], Entry] = {
    (Enters.TORSION, ""): Entry.TORSION,
    (Enters.TORSION, "output_torque"): Entry.TORSION_TIMES_TORQUE,
    (Enters.MOTOR_BALANCE, ""): Entry.MOTOR,
    (Enters.MOTOR_BALANCE, "motor_torque"): Entry.MOTOR_TIMES_TORQUE,
    (Enters.OUTPUT_BALANCE, ""): Entry.OUTPUT,
    (Enters.FRICTION, ""): Entry.MOTOR_AGAINST_MOTION,
    (Enters.READING, "motor_position"): Entry.MOTOR_ANGLE,
    (Enters.READING, "output_position"): Entry.ANGLE_ONLY,
}
"""By where a periodic effect enters, and what else it takes (for a reading: which one) than its angle."""


@dataclass(frozen=True, slots=True)
class TermClass:
    """One kind of term: catalogue id or None, where it acts, of which angle, its order if fixed, else its range."""

    effect: str | None
    entry: Entry
    variable: str
    fixed_order: float | None = None
    orders: tuple[float, float] = (0.0, math.inf)

    @property
    def id(self) -> str:
        """The name in the result."""
        if self.effect is not None:
            return self.effect
        return f"unnamed:{self.variable}:{self.shape}"

    @property
    def shape(self) -> str:
        """The shape in the result."""
        return "product" if self.entry.is_product else "periodic"

    @property
    def enters(self) -> str:
        """Where it acts, as the model file says it."""
        return self.entry.value

    @property
    def is_angle(self) -> bool:
        """Whether it is an angle, not a torque."""
        return self.entry.is_angle

    @property
    def equation(self) -> Equation:
        """The equation in which it shows first."""
        return self.entry.equation


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
        if is_line(effect):
            order = next((parameter for parameter in effect.parameters if parameter.name == "order"), None)
            fixed, orders = (1.0, (1.0, 1.0)) if order is None else (None, (order.low, order.high))
            found.append(TermClass(effect.id, entry_of(effect), effect.variable, fixed, orders))
    return tuple(found)


def is_line(effect: Effect) -> bool:
    """Whether the effect is amplitude * sin(order * variable + phase) of an angle, perhaps times a torque."""
    names = {parameter.name for parameter in effect.parameters}
    return {"amplitude", "phase"} <= names <= {"amplitude", "phase", "order"}


def entry_of(effect: Effect) -> Entry:
    """Give how a periodic effect of the catalogue acts."""
    others = [name for name in effect.signals if name != effect.variable]
    key = effect.reads if effect.enters is Enters.READING else "".join(others)
    return _ENTRY_OF[effect.enters, key]


Derivative = tuple[Floats, Floats]
"""Derivative by one parameter of a line, and of the line's slope, each (n,)."""


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

    @property
    def derivatives(self) -> tuple[Derivative, Derivative, Derivative]:
        """By sine, cosine and order."""
        return (
            (self.by_sine, self.slope_by_sine),
            (self.by_cosine, self.slope_by_cosine),
            (self.by_order, self.slope_by_order),
        )


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


def line_derivatives(order: float, angle: Floats) -> tuple[Derivative, Derivative]:
    """Give the derivatives by sine and cosine of a line of this order at `angle` (n,) rad."""
    sine, cosine = np.sin(order * angle), np.cos(order * angle)
    return (sine, order * cosine), (cosine, -order * sine)

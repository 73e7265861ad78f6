"""Shapes without a formula: what a run shows where no effect of the catalogue fits.

A curve adds the sum of value_j * basis_j(signals) to an angle, a balance or the level of friction. The basis depends on
its form and on the knots `at` (values of the variable, radii of a play, or time constants):

    curve   straight lines between (at_j, value_j), held constant beyond the outer knots; 0 at the knot nearest to zero
            where the variable changes sign; perhaps times a further signal
    rate    value_1 d + value_2 |d|, d: derivative of the variable
    play    sum of value_j * (play of the variable with radius at_j): Maxwell slip without friction levels
    peak    (value_1 + value_2 v) * (largest |v| so far), v: the variable
    lag     sum of value_j * (v - v through a first-order low pass with time constant at_j)
    wave    a line of order at_1 of the angle, its sine and cosine each times value |f| + value f^2, f: the factor
"""

import math
import re
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from drivers.signals import BY_NAME
from sim_backend.model.effects import Enters, Parameter, Shape
from sim_backend.model.friction import play

Floats = NDArray[np.float64]

RATE_SIDE = 0.1
"""s on either side over which a signal is differentiated."""

STRAIGHT, BENT, MOST_BENT = 1e-6, 3.0, 10.0
"""Bend of one side of a sample, relative to the range of a signal, or over the median bend, from which on that side
counts less; and how bent one is taken for that reaches beyond the record, in these units."""

ANGLES = ("motor_position", "output_position")
"""Signals that lines may follow."""

TURNING_LOAD = "turning_load"
"""Name of the size of the output torque, 0 where the motor is held, as in a backdrive: what makes a drag, and no
friction that a held mesh has as well."""

UNNAMED = "unnamed:"
_TIMES = ", times "
_KNOT = re.compile(r"at_\d+")


class Form(StrEnum):
    """How a curve follows its variable."""

    CURVE = "curve"
    RATE = "rate"
    PLAY = "play"
    PEAK = "peak"
    LAG = "lag"
    WAVE = "wave"


SHAPES: Mapping[Form, Shape] = {
    Form.CURVE: Shape.STATIC,
    Form.RATE: Shape.RATE,
    Form.PLAY: Shape.HYSTERETIC,
    Form.PEAK: Shape.HYSTERETIC,
    Form.LAG: Shape.LAG,
    Form.WAVE: Shape.PRODUCT,
}
WITHOUT_KNOTS = (Form.RATE, Form.PEAK)
"""These have two values and no knots."""


@dataclass(frozen=True, slots=True)
class Curve:
    """A shape without a formula, in place of an effect of the catalogue; its numbers are those of the term.

    `enters`: where it acts; `factor`: signal that it is multiplied with, empty for none; `knots`: how many; `zero`: at
    which one it is 0 (-1: at none).
    """

    enters: Enters
    variable: str
    form: Form
    factor: str = ""
    knots: int = 0
    zero: int = -1

    @property
    def id(self) -> str:
        """The name in the result."""
        return f"{UNNAMED}{self.variable}:{self.shape}"

    @property
    def shape(self) -> Shape:
        """The shape in the result."""
        return Shape.PRODUCT if self.factor else SHAPES[self.form]

    @property
    def reads(self) -> str:
        """No instrument's error is assumed."""
        return ""

    @property
    def place(self) -> str:
        """Where it acts, as the model file says it."""
        return f"{self.enters}{_TIMES}{self.factor}" if self.factor else str(self.enters)

    @property
    def linear(self) -> bool:
        """It is linear in its values."""
        return True

    @property
    def signals(self) -> tuple[str, ...]:
        """Signals that it takes."""
        return (self.variable, self.factor) if self.factor else (self.variable,)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The knots, which no fit moves, and the values, all but the one at `zero` fitted."""
        return self.parameters_in("N*m")

    def parameters_in(self, motor: str) -> tuple[Parameter, ...]:
        """Give the parameters where the motor's torque is in this unit: A where no torque constant is known."""
        count = {Form.RATE: 2, Form.PEAK: 2, Form.WAVE: 4}.get(self.form, self.knots)
        at = {Form.LAG: "s", Form.WAVE: "1/rev"}.get(self.form, unit_of(self.variable, motor))
        knots = [_parameter(f"at_{k + 1}", at, known=True) for k in range(self.knots)]
        unit = self._unit(motor)
        return (*knots, *(_parameter(f"value_{k + 1}", unit, known=k == self.zero) for k in range(count)))

    @property
    def amplitudes(self) -> tuple[str, ...]:
        """The values that are fitted."""
        return tuple(p.name for p in self.parameters if not p.known)

    @property
    def unit(self) -> str:
        """Unit of what it adds, by that of the factor or the derivative where there is one."""
        return self._unit("N*m")

    def _unit(self, motor: str) -> str:
        at_motor = self.enters in (Enters.MOTOR_BALANCE, Enters.FRICTION)
        added = "rad" if self.enters is Enters.TORSION else motor if at_motor else "N*m"
        if self.form is Form.WAVE:
            return "1"  # two of them per unit of the factor, two per its square
        if self.factor:
            return f"{added}/({unit_of(self.factor, motor)})"
        variable = unit_of(self.variable, motor)
        per = {Form.CURVE: "", Form.RATE: f"{variable}/s", Form.PEAK: variable}
        divisor = per.get(self.form, variable)
        return f"{added}/({divisor})" if divisor else added


def unit_of(signal: str, motor: str = "N*m") -> str:
    """Give the unit of a signal of a log; 1 for one that the program does not know. `motor`: of the motor's torque."""
    own = {"time": "s", TURNING_LOAD: "N*m"}
    if signal == "motor_torque":
        return motor
    return BY_NAME[signal].unit if signal in BY_NAME else own.get(signal, "1")


def _parameter(name: str, unit: str, *, known: bool) -> Parameter:
    return Parameter(name, unit, -math.inf, math.inf, 1.0, (-math.inf, math.inf), "", known)


def curve_of(effect: str, enters: str, parameters: Set[str], values: Mapping[str, float]) -> Curve | None:
    """Give the curve that an effect of a result or a model file stands for; None if it is none.

    `effect`: its id, `enters`: where it acts, `parameters`: their names, `values`: those of the parameters.
    """
    place, _, factor = enters.partition(_TIMES)
    variable, _, shape = effect.removeprefix(UNNAMED).rpartition(":")
    knots = sum(bool(_KNOT.fullmatch(name)) for name in parameters)
    angle = variable in ANGLES
    forms = [form for form, its in SHAPES.items() if its == (shape if angle or not factor else Shape.STATIC)]
    forms = [form for form in forms if (form in WITHOUT_KNOTS) == (knots == 0)]
    if not effect.startswith(UNNAMED) or not variable or not forms or place not in set(Enters):
        return None
    if factor and shape != Shape.PRODUCT:
        return None
    at = [values.get(f"at_{k + 1}", math.nan) for k in range(knots)]
    zero = zero_of(at, Enters(place), factor) if forms[0] is Form.CURVE else -1
    if values.get(f"value_{zero + 1}", 0.0) != 0.0:  # the file says otherwise: none of its knots is held at 0
        zero = -1
    return Curve(Enters(place), variable, forms[0], factor, knots, zero)


def zero_of(at: Sequence[float], enters: Enters, factor: str) -> int:
    """Give the knot at which a curve is 0: the one nearest to zero, -1 where all lie on one side of it.

    A temperature or a voltage has no natural zero: a constant counts, where anything acts on more than one equation.
    Not so in an angle times the torque: there a constant is the flexspline's compliance, and the middle knot is 0.
    """
    knots = np.asarray(at)
    if knots.size and knots.min() <= 0.0 <= knots.max():
        return int(np.argmin(np.abs(knots)))
    return knots.size // 2 if factor and enters is Enters.TORSION else -1


def basis(curve: Curve, at: Sequence[float], signals: Mapping[str, Floats], step: float) -> Floats:
    """Give the basis at every sample, shape (n, fitted values). `step`: s between samples."""
    v = signals[curve.variable]
    match curve.form:
        case Form.CURVE:
            weights = tents(v, np.asarray(at))
            found = weights if curve.zero < 0 else np.delete(weights, curve.zero, axis=1)
        case Form.RATE:
            d = _derivative(v, step)
            found = np.column_stack([d, np.abs(d)])
        case Form.PLAY:
            found = np.column_stack([play(v, radius) for radius in at])
        case Form.PEAK:
            peak = np.maximum.accumulate(np.abs(v))
            found = np.column_stack([peak, peak * v])
        case Form.LAG:
            found = np.column_stack([v - _low_pass(v, tau, step) for tau in at])
        case Form.WAVE:
            factor = signals[curve.factor]
            sine, cosine = np.sin(at[0] * v), np.cos(at[0] * v)
            sizes = (np.abs(factor), factor**2)
            return np.column_stack([wave * size for size in sizes for wave in (sine, cosine)])
    if curve.factor:
        factor = signals[curve.factor]
        found = found * (np.abs(factor) if curve.enters is Enters.FRICTION else factor)[:, None]
    return np.asarray(found)


def tents(v: Floats, at: Floats) -> Floats:
    """Give the weights (n, k) by which straight lines between the knots `at` (k,), ascending, take their values."""
    inside = np.clip(v, at[0], at[-1])
    left = np.clip(np.searchsorted(at, inside, side="right") - 1, 0, at.size - 2)
    share = (inside - at[left]) / (at[left + 1] - at[left])
    found, rows = np.zeros((v.size, at.size)), np.arange(v.size)
    found[rows, left], found[rows, left + 1] = 1.0 - share, share
    return found


def _derivative(v: Floats, step: float) -> Floats:
    """Differentiate before and behind every sample; where one side bends, the other counts: corners are kept."""
    side = max(1, round(RATE_SIDE / step))
    index = np.arange(v.size)
    sides = ((np.maximum(index - side, 0), index), (index, np.minimum(index + side, v.size - 1)))
    slopes = [(v[high] - v[low]) / (np.maximum(high - low, 1) * step) for low, high in sides]
    bends = np.array(
        [np.abs(v[(low + high) // 2] + v[(low + high + 1) // 2] - v[low] - v[high]) for low, high in sides]
    )
    bends = bends / max(BENT * float(np.median(bends)), STRAIGHT * float(np.ptp(v)), 1e-300)
    cut = np.array([high - low < side for low, high in sides])
    weights = np.exp(-(np.where(cut, MOST_BENT, np.minimum(bends, MOST_BENT)) ** 2))
    return np.asarray((weights * slopes).sum(axis=0) / weights.sum(axis=0))


def _low_pass(v: Floats, tau: float, step: float) -> Floats:
    keep = math.exp(-step / tau)
    filtered, _ = lfilter([1.0 - keep], [1.0, -keep], v, zi=np.array([keep * v[0]]))
    return np.asarray(filtered)


def mirrored(curve: Curve, values: Sequence[float], *, variable: bool, added: bool) -> tuple[Curve, tuple[float, ...]]:
    """Give the same curve where the sign of its variable, or of what it adds, is turned."""
    at, size = np.asarray(values[: curve.knots]), (-1.0 if added else 1.0) * np.asarray(values[curve.knots :])
    zero = curve.zero
    if variable:
        match curve.form:
            case Form.CURVE:
                at, size = -at[::-1], size[::-1]
                zero = curve.zero if curve.zero < 0 else curve.knots - 1 - curve.zero
            case Form.RATE | Form.PEAK:
                odd = 0 if curve.form is Form.RATE else 1
                size = size * np.where(np.arange(2) == odd, -1.0, 1.0)
            case Form.PLAY | Form.LAG:
                size = -size
            case Form.WAVE:
                size = size * np.array([-1.0, 1.0, -1.0, 1.0])
    turned = Curve(curve.enters, curve.variable, curve.form, curve.factor, curve.knots, zero)
    return turned, (*at.tolist(), *size.tolist())

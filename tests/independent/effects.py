"""Second formulas of the effects: one function per catalogue id, in SI and contract signs.

Periodic effects are sums of rotating vectors; gravity is the moment of a weight about the output axis.
Each function says where it acts; the bench (`bench.py`) lets it act there.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

KINEMATIC_ERROR = "kinematic-error"
COGGING = "cogging"
GRAVITY_LOAD = "gravity-load"

POLES, SLOTS = 14, 12
"""Motor of the generator: seven pole pairs on twelve slots; uneven parts also show the two numbers themselves."""


@dataclass(frozen=True, slots=True)
class Line:
    """amplitude * sin(order * angle + phase): cycles per revolution, rad or N*m, rad."""

    order: float
    amplitude: float
    phase: float


@dataclass(frozen=True, slots=True)
class Arm:
    """Weight on the output: moment m*g*r (N*m) when level, `phase` (rad) of the arm from hanging straight down."""

    moment: float
    phase: float


@dataclass(frozen=True, slots=True)
class Effects:
    """What acts on the bench beyond the base model; empty means absent."""

    kinematic_error: tuple[Line, ...] = ()
    cogging: tuple[Line, ...] = ()
    gravity_load: Arm = Arm(0.0, 0.0)


def kinematic_error(motor_position: ArrayLike, lines: Sequence[Line]) -> Floats:
    """Give the error that adds to the torsion, rad at the output."""
    return _rotating_vectors(motor_position, lines, turned_ahead=False)


def kinematic_error_slope(motor_position: ArrayLike, lines: Sequence[Line]) -> Floats:
    """Give d(error)/d(motor_position): the output torque times this helps to drive the motor."""
    return _rotating_vectors(motor_position, lines, turned_ahead=True)


def cogging(motor_position: ArrayLike, lines: Sequence[Line]) -> Floats:
    """Give the motor torque needed to hold the rotor against its magnets, N*m, whatever current or direction."""
    return _rotating_vectors(motor_position, lines, turned_ahead=False)


def gravity_load(output_position: ArrayLike, arm: Arm) -> Floats:
    """Give the outside torque that would hold the arm, N*m: minus the moment (lever cross weight) of gravity."""
    angle = np.asarray(output_position, dtype=float) + arm.phase
    lever_x, lever_y = np.cos(angle - math.pi / 2.0), np.sin(angle - math.pi / 2.0)
    weight_x, weight_y = 0.0, -arm.moment
    return np.asarray(-(lever_x * weight_y - lever_y * weight_x))


def draw(effect: str, rng: np.random.Generator) -> Effects:
    """Give one effect by id, with parameters drawn inside its working range; ValueError for an unknown id."""
    phase = float(rng.uniform(-math.pi, math.pi))
    if effect == KINEMATIC_ERROR:
        return Effects(kinematic_error=(Line(2.0, float(rng.uniform(5e-5, 2e-4)), phase),))
    if effect == COGGING:
        amplitude = float(rng.uniform(1e-3, 3e-3))
        lines = [Line(float(math.lcm(POLES, SLOTS)), amplitude, phase)]
        if rng.random() < 0.5:
            lines.append(Line(float(POLES), 0.5 * amplitude, float(rng.uniform(-math.pi, math.pi))))
        return Effects(cogging=tuple(lines))
    if effect == GRAVITY_LOAD:
        return Effects(gravity_load=Arm(float(rng.uniform(0.2, 1.0)), phase))
    raise ValueError(f"no second formula for effect {effect!r}")


def _one_kinematic_error(motor_position: ArrayLike, amplitude: float, order: float, phase: float) -> Floats:
    return kinematic_error(motor_position, [Line(order, amplitude, phase)])


def _one_kinematic_error_slope(motor_position: ArrayLike, amplitude: float, order: float, phase: float) -> Floats:
    return kinematic_error_slope(motor_position, [Line(order, amplitude, phase)])


def _one_cogging(motor_position: ArrayLike, amplitude: float, order: float, phase: float) -> Floats:
    return cogging(motor_position, [Line(order, amplitude, phase)])


def _one_gravity_load(output_position: ArrayLike, amplitude: float, phase: float) -> Floats:
    return gravity_load(output_position, Arm(amplitude, phase))


def _rotating_vectors(angle: ArrayLike, lines: Sequence[Line], *, turned_ahead: bool) -> Floats:
    """Sum the imaginary parts of amplitude * exp(j(order * angle + phase)), or of its derivative by the angle."""
    theta = np.asarray(angle, dtype=float)
    total = np.zeros(theta.shape, dtype=complex)
    for line in lines:
        vector = line.amplitude * np.exp(1j * line.phase) * np.exp(1j * line.order * theta)
        total = total + (1j * line.order * vector if turned_ahead else vector)
    return np.asarray(total.imag)


SECOND_FORMULAS: Mapping[str, Callable[..., Floats]] = MappingProxyType(
    {
        KINEMATIC_ERROR: _one_kinematic_error,
        COGGING: _one_cogging,
        GRAVITY_LOAD: _one_gravity_load,
    }
)
"""By catalogue id: the effect as a function of its signals and parameters, by name."""

SECOND_SLOPES: Mapping[str, Callable[..., Floats]] = MappingProxyType({KINEMATIC_ERROR: _one_kinematic_error_slope})
"""By catalogue id: the derivative by motor_position of the effects in the torsion."""

"""Second formulas of the effects in the torsion: rad at the output, contract signs.

One function per catalogue id over whole records. Those that remember take `time` (s, evenly spaced) first.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import expit

from tests.independent.laws import play
from tests.independent.memory import filtered, lagged
from tests.independent.terms import Line
from tests.independent.waves import rotating_vectors, wave

Floats = NDArray[np.float64]

TINY = 1e-30
"""N*m or rad: step of a complex derivative, which has no cancellation."""


def kinematic_error(motor_position: ArrayLike, amplitude: float, order: float, phase: float) -> Floats:
    """Give the error of one order per motor turn."""
    return wave(motor_position, amplitude, order, phase)


def kinematic_error_slope(motor_position: ArrayLike, amplitude: float, order: float, phase: float) -> Floats:
    """Give its derivative by the motor angle, rad/rad."""
    return rotating_vectors(motor_position, [Line(order, amplitude, phase)], turned_ahead=True)


def soft_windup(output_torque: ArrayLike, amplitude: float, zone: float) -> Floats:
    """Give amplitude * tanh(T/zone), as the share of two states between which T decides (Boltzmann)."""
    upper = expit(2.0 * np.asarray(output_torque, dtype=float) / zone)
    return np.asarray(amplitude * (upper - (1.0 - upper)))


def backlash(motor_torque: ArrayLike, amplitude: float, contact: float, ratio: float) -> Floats:
    """Give the angle lost in a gap of half width `amplitude` (rad at the motor): the torque decides at which end.

    Contact closes over +-`contact` (N*m at the motor): a soft spring with hard stops.
    """
    torque = np.asarray(motor_torque, dtype=float)
    at_an_end = np.abs(torque) >= contact
    return np.asarray(amplitude / ratio * np.where(at_an_end, np.sign(torque), torque / contact))


def creep(
    time: ArrayLike, output_torque: ArrayLike, amplitude: float, time_constant: float, stiffness: float
) -> Floats:
    """Give the delayed part of a Kelvin-Voigt element: spring stiffness/amplitude with a damper, relaxing."""
    spring = stiffness / amplitude if amplitude else math.inf
    return lagged(time, output_torque, time_constant) / spring


def maxwell_slip(output_torque: ArrayLike, amplitude: float, radius: float) -> Floats:
    """Give the compliance `amplitude` (rad/(N*m)) behind a slider that holds up to `radius` (N*m)."""
    return amplitude * play(output_torque, radius)


def rate_dependent_hysteresis(
    time: ArrayLike, output_torque: ArrayLike, amplitude: float, radius: float, time_constant: float
) -> Floats:
    """Give the same slider behind a lag: the loop changes with the rate."""
    return amplitude * play(lagged(time, output_torque, time_constant), radius)


def stiffness_modulation(
    output_torque: ArrayLike, motor_position: ArrayLike, amplitude: float, order: float, phase: float
) -> Floats:
    """Give the torsion of a compliance that turns with the wave generator."""
    return np.asarray(output_torque, dtype=float) * wave(motor_position, amplitude, order, phase)


def stiffness_modulation_slope(
    output_torque: ArrayLike, motor_position: ArrayLike, amplitude: float, order: float, phase: float
) -> Floats:
    """Give the torque on the motor per N*m of output torque: the coenergy T^2 c(theta)/2, derived by theta, over T."""
    torque = np.asarray(output_torque, dtype=float)

    def coenergy(angle: NDArray[np.complex128]) -> NDArray[np.complex128]:
        return np.asarray(torque**2 / 2.0 * amplitude * np.sin(order * angle + phase), dtype=complex)

    driving = np.imag(coenergy(np.asarray(motor_position, dtype=float) + 1j * TINY)) / TINY
    return np.asarray(np.divide(driving, torque, out=np.zeros_like(driving), where=torque != 0.0))


def temperature_dependent_stiffness(
    temperature: ArrayLike, flexspline_torsion: ArrayLike, amplitude: float, reference: float
) -> Floats:
    """Give what the torsion of the flexspline gains when all stiffness falls by 1 + amplitude * warming."""
    cold = np.asarray(flexspline_torsion, dtype=float)
    share_left = 1.0 / (1.0 + amplitude * (np.asarray(temperature, dtype=float) - reference))
    return np.asarray(cold / share_left - cold)


def fixture_compliance(output_torque: ArrayLike, locked: ArrayLike, amplitude: float) -> Floats:
    """Give the yielding of the lock, rad, where there is one (`locked` 1); `amplitude` is 1/K_fix."""
    return np.where(np.asarray(locked) > 0.5, amplitude * np.asarray(output_torque, dtype=float), 0.0)


def thermal_expansion(
    time: ArrayLike, temperature: ArrayLike, amplitude: float, time_constant: float, reference: float
) -> Floats:
    """Give the angle by which a mount of thermal time constant `time_constant` has expanded."""
    return amplitude * lagged(time, np.asarray(temperature, dtype=float) - reference, time_constant)


def structural_resonance(
    time: ArrayLike, output_torque: ArrayLike, amplitude: float, frequency: float, damping: float
) -> Floats:
    """Give the ringing of a frame excited by the torque: amplitude * w * s^2/(s^2 + 2 D w s + w^2) of T."""
    w = 2.0 * math.pi * frequency
    return filtered(time, output_torque, [amplitude * w, 0.0, 0.0], [1.0, 2.0 * damping * w, w * w])


SLOPES: dict[str, Callable[..., Floats]] = {
    "kinematic-error": kinematic_error_slope,
    "stiffness-modulation": stiffness_modulation_slope,
}

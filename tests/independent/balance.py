"""Second formulas of the effects in the torque balance, N*m, contract signs.

The friction ones give what they add to the level of the dry friction at the motor, a magnitude.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tests.independent.waves import wave

Floats = NDArray[np.float64]


def stribeck_friction(motor_velocity: ArrayLike, amplitude: float, velocity: float, exponent: float) -> Floats:
    """Give the share of the static friction that the film has not yet taken over; falls with the speed."""
    speed = np.abs(np.asarray(motor_velocity, dtype=float))
    in_film = np.float_power(speed, exponent) / velocity**exponent
    return np.asarray(amplitude * np.float_power(math.e, -in_film))


def load_dependent_friction(output_torque: ArrayLike, amplitude: float, ratio: float) -> Floats:
    """Give the friction of a mesh that is pressed by the load: a cone of half slope `amplitude`, seen at the motor."""
    load = np.asarray(output_torque, dtype=float)
    return np.maximum(amplitude * load, -amplitude * load) / ratio


def position_dependent_friction(motor_position: ArrayLike, amplitude: float, order: float, phase: float) -> Floats:
    """Give the part of the friction that changes with the motor angle; it may be negative."""
    return wave(motor_position, amplitude, order, phase)


def temperature_dependent_friction(
    temperature: ArrayLike, base_friction: ArrayLike, amplitude: float, reference: float
) -> Floats:
    """Give what warmth takes off the friction: it falls by the e-th part every 1/amplitude K."""
    warming = np.asarray(temperature, dtype=float) - reference
    return np.asarray(base_friction, dtype=float) * np.expm1(-amplitude * warming)


def cogging(motor_position: ArrayLike, amplitude: float, order: float, phase: float) -> Floats:
    """Give the motor torque needed to hold the rotor against its magnets, whatever current or direction."""
    return wave(motor_position, amplitude, order, phase)


def torque_ripple(
    motor_torque: ArrayLike, motor_position: ArrayLike, amplitude: float, order: float, phase: float
) -> Floats:
    """Give the share of the motor's torque that is missing at this angle."""
    return np.asarray(motor_torque, dtype=float) * wave(motor_position, amplitude, order, phase)


def gravity_load(output_position: ArrayLike, amplitude: float, phase: float) -> Floats:
    """Give the outside torque that would hold the arm: minus the moment (lever cross weight) of gravity."""
    angle = np.asarray(output_position, dtype=float) + phase
    lever_x, lever_y = np.cos(angle - math.pi / 2.0), np.sin(angle - math.pi / 2.0)
    weight_x, weight_y = 0.0, -amplitude
    return np.asarray(-(lever_x * weight_y - lever_y * weight_x))

"""What the active effects add, as the stepper calls it: here none; `kernel` writes the versions with effects.

Arguments are the signals at the end of the step (rad, rad/s, N*m, degC, s; `output_torque` is that of the step
before, because it depends on the effects) and the flat array of the effects' parameters.
"""

import numpy as np
from numpy.typing import NDArray


def torsion_effects(
    time: float,
    motor_position: float,
    motor_velocity: float,
    motor_torque: float,
    output_position: float,
    output_velocity: float,
    output_torque: float,
    temperature: float,
    motor_temperature: float,
    effect_parameters: NDArray[np.float64],
) -> tuple[float, float]:
    """Give (angle added to the torsion rad, its derivative with respect to motor_position rad/rad)."""
    return 0.0, 0.0


def motor_effects(
    time: float,
    motor_position: float,
    motor_velocity: float,
    motor_torque: float,
    output_position: float,
    output_velocity: float,
    output_torque: float,
    temperature: float,
    motor_temperature: float,
    effect_parameters: NDArray[np.float64],
) -> float:
    """Give the torque which the motor must overcome, N*m."""
    return 0.0


def output_effects(
    time: float,
    motor_position: float,
    motor_velocity: float,
    motor_torque: float,
    output_position: float,
    output_velocity: float,
    output_torque: float,
    temperature: float,
    motor_temperature: float,
    effect_parameters: NDArray[np.float64],
) -> float:
    """Give the torque which the output must overcome, N*m."""
    return 0.0

"""Viscous friction: the part of the running friction that grows with the speed.

    motor_torque = b * motor_velocity        N*m at the motor

Source: Zhang, Ahmad & Liu 2014, equations (7)-(9); Castejon, Garcia-Prada & Lara 2009, equation (12).
"""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from sim_backend.model.effects.effect import Effect, Energy, Enters, Parameter, Shape

Real = TypeVar("Real", float, NDArray[np.float64])


def viscous_friction(motor_velocity: Real, b: float) -> Real:
    """Give the torque that the motor must overcome, N*m."""
    return b * motor_velocity


EFFECT = Effect(
    id="viscous-friction",
    summary="running friction that grows with the speed",
    equation="motor_torque = b * motor_velocity",
    source="Zhang, Ahmad & Liu 2014 (7)-(9)",
    enters=Enters.BASE,
    variable="motor_velocity",
    shape=Shape.STATIC,
    unit="N*m",
    parameters=(Parameter("b", "N*m*s", 0.0, 1e3, 1e-4, (1e-5, 1e-3), "torque per speed, at the motor"),),
    amplitudes=(),
    function=viscous_friction,
    energy=Energy.DISSIPATIVE,
    shows=("free-run",),
    confusable=(
        "coulomb-friction",
        "stribeck-friction",
        "temperature-dependent-friction",
        "rate-dependent-hysteresis",
        "channel-delay",
        "torque-sensor-lag",
        "creep",
    ),
    separated_by="a ladder of speeds in both directions, at one temperature",
)

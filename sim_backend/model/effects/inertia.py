"""Inertia of rotor and wave generator.

    motor_torque = J * motor_acceleration        N*m at the motor, J = J_m + J_wg

Source: Castejon, Garcia-Prada & Lara 2009, equations (9) and (15) (with J_wg, which (15) drops).
Left out: the inertia of the output, behind the flexspline's spring.
"""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from sim_backend.model.effects.effect import Effect, Energy, Enters, Parameter, Shape

Real = TypeVar("Real", float, NDArray[np.float64])


def inertia(motor_acceleration: Real, J: float) -> Real:
    """Give the torque that the motor must overcome, N*m."""
    return J * motor_acceleration


EFFECT = Effect(
    id="inertia",
    summary="rotor and wave generator resist a change of speed",
    equation="motor_torque = J * motor_acceleration",
    source="Castejon et al. 2009 (9), (15); usual J: rotor of 1e-6 to 3e-4 kg*m^2, wave generator 7.9e-6",
    enters=Enters.BASE,
    variable="motor_velocity",
    shape=Shape.RATE,
    unit="N*m",
    parameters=(
        Parameter("J", "kg*m^2", 0.0, 1e3, 3e-5, (9e-6, 3.1e-4), "rotor and wave generator together, at the motor"),
    ),
    amplitudes=(),
    function=inertia,
    energy=Energy.CONSERVATIVE,
    shows=("free-run", "locked-output (fast)"),
    confusable=("kinematic-error", "structural-resonance"),
    separated_by="ramps at several accelerations: it is gone at constant speed",
)

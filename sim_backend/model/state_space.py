"""Linear state-space model of motor, drive and load: the non-linear one at small errors.

    x' = A x + B u,  y = C x + D u                                                              (32), (38)
    x = [theta_l, theta_l', theta_m, theta_m'],  u = [tau_m, tau_l, theta_p],  y = [theta_l, transmitted torque]

(26)-(40) corrected: the motor angle is a state and no input, the load is driven by tau_l and not by N tau_m (what the
drive transmits is internal), signs of (35), J_m + J_wg. dtheta_p/dtheta_m is dropped, theta_p enters as a disturbance.
Source: Castejon, Garcia-Prada & Lara 2009.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim_backend.model.transmission import Transmission

Floats = NDArray[np.float64]

STATES = ("load_position", "load_velocity", "motor_position", "motor_velocity")
INPUTS = ("motor_torque", "load_torque", "pure_error")
OUTPUTS = ("load_position", "transmitted_torque")


@dataclass(frozen=True, slots=True)
class StateSpace:
    """Matrices A (4, 4), B (4, 3), C (2, 4), D (2, 3); SI, in the order of STATES, INPUTS and OUTPUTS."""

    A: Floats
    B: Floats
    C: Floats
    D: Floats


def state_space(transmission: Transmission) -> StateSpace:
    """Give the matrices of a transmission."""
    t = transmission
    K, N, B_sp, J_l, J = t.stiffness, t.ratio, t.mesh_damping, t.load_inertia, t.shaft_inertia
    crossed = t.bearing_sense * t.bearing_damping - B_sp / N
    load = np.array([-K, -(t.load_damping + t.bearing_damping + B_sp), K / N, -crossed])
    motor = np.array([K / N, -crossed, -K / N**2, -(t.motor_damping + t.bearing_damping + B_sp / N**2)])
    return StateSpace(
        A=np.array([[0.0, 1.0, 0.0, 0.0], load / J_l, [0.0, 0.0, 0.0, 1.0], motor / J]),
        B=np.array([[0.0, 0.0, 0.0], [0.0, 1.0 / J_l, -K / J_l], [0.0, 0.0, 0.0], [1.0 / J, 0.0, K / (N * J)]]),
        C=np.array([[1.0, 0.0, 0.0, 0.0], [-K, -B_sp, K / N, B_sp / N]]),
        D=np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -K]]),
    )

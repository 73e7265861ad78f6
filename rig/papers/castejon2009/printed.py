"""Equations as the paper prints them, to show what they give; nothing else in this program uses them."""

import numpy as np
from numpy.typing import NDArray

from sim_backend.model.transmission import Transmission

Floats = NDArray[np.float64]


def matrix_35(t: Transmission) -> Floats:
    """Give A (35) of x = [theta_l, theta_l', theta_p, theta_m']; rows 2 and 4 with the printed signs."""
    crossed, load, motor = _damping(t)
    return np.array(
        [
            [0.0, 1.0, 0.0, 0.0],
            [-t.stiffness / t.load_inertia, load, -t.stiffness / t.load_inertia, crossed / t.load_inertia],
            [0.0, 0.0, 0.0, 0.0],
            [-t.stiffness / t.motor_inertia, crossed / t.motor_inertia, -t.stiffness / t.motor_inertia, motor],
        ]
    )


def matrix_of_28_to_31(t: Transmission) -> Floats:
    """Give the matrix that (28)-(31) say, whose entries (35) misquotes."""
    crossed, load, motor = _damping(t)
    stiffness = t.stiffness / t.ratio / t.motor_inertia
    return np.array(
        [
            [0.0, 1.0, 0.0, 0.0],
            [-t.stiffness / t.load_inertia, -load, -t.stiffness / t.load_inertia, -crossed / t.load_inertia],
            [0.0, 0.0, 0.0, 0.0],
            [stiffness, -crossed / t.motor_inertia, stiffness, -motor],
        ]
    )


def double_count(t: Transmission, motor_torque: float) -> float:
    """Give the wind-up (rad) that -v N of (27) adds: N tau_m on the load's spring, although the spring brings it."""
    return t.ratio * motor_torque / t.stiffness


def _damping(t: Transmission) -> tuple[float, float, float]:
    """Give B_ml - B_sp/N, (B_l + B_ml + B_sp)/J_l and (B_m + B_ml + B_sp/N^2)/J_m; J_wg is dropped in print."""
    crossed = t.bearing_damping - t.mesh_damping / t.ratio
    load = (t.load_damping + t.bearing_damping + t.mesh_damping) / t.load_inertia
    motor = (t.motor_damping + t.bearing_damping + t.mesh_damping / t.ratio**2) / t.motor_inertia
    return crossed, load, motor

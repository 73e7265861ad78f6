"""Second formulas of the base laws of a harmonic drive, by other routes than the printed ones.

Compliances are integrated from the stiffnesses, inverses are found as roots, play is a machine with named states,
the catalogue estimate is a linear system. Torques in contract signs: T acts on the output from outside, M drives the
wave generator, so that torsion = f(T) + g(M)/N.

Source: Zhang, Ahmad & Liu 2014, equations in brackets.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

Floats = NDArray[np.float64]

NODES, WEIGHTS = np.polynomial.legendre.leggauss(48)
"""48 Gauss points integrate both compliances to 1e-13 of their value up to three times the rated torque."""

SHD_17_100_CATALOGUE = {"K1": 8.4e3, "K2": 9.4e3, "T1": 3.9, "T2": 12.0}


@dataclass(frozen=True, slots=True)
class Drive:
    """Base parameters: springs N*m/rad and 1/(N*m), T_fs and T_c N*m at the motor, T_fb at the output, b N*m*s."""

    ratio: float
    K_F0: float
    C_F: float
    K_w0: float
    C_w: float
    T_fs: float
    T_fb: float
    T_c: float
    b: float


def flexspline_stiffness(T: Floats, K_F0: float, C_F: float) -> Floats:
    """Give the local stiffness of the flexspline (22), N*m/rad."""
    return K_F0 * (1.0 + (C_F * T) ** 2)


def wave_generator_stiffness(M: Floats, K_w0: float, C_w: float) -> Floats:
    """Give the local stiffness of the wave generator (25), N*m/rad at the motor."""
    return K_w0 * np.exp(C_w * np.abs(M))


def flexspline_torsion(T: ArrayLike, K_F0: float, C_F: float) -> Floats:
    """Integrate dT/K_FL from zero to T: the law (24), rad at the output."""
    return _integral_from_zero(lambda x: 1.0 / flexspline_stiffness(x, K_F0, C_F), T)


def wave_generator_torsion(M: ArrayLike, K_w0: float, C_w: float) -> Floats:
    """Integrate dM/K_wL from zero to M: the law (27), rad at the motor."""
    return _integral_from_zero(lambda x: 1.0 / wave_generator_stiffness(x, K_w0, C_w), M)


def total_torsion(T: ArrayLike, M: ArrayLike, drive: Drive) -> Floats:
    """Give the torsion (28) for the output torque T and the torque M through the wave generator, rad at the output."""
    at_output = flexspline_torsion(T, drive.K_F0, drive.C_F)
    return at_output + wave_generator_torsion(M, drive.K_w0, drive.C_w) / drive.ratio


def flexspline_torque(torsion: float, K_F0: float, C_F: float) -> float:
    """Find the torque whose torsion is given; ValueError beyond the quarter period of the arctangent."""
    if abs(torsion) >= math.pi / (2.0 * C_F * K_F0):
        raise ValueError(f"no torque gives a flexspline torsion of {torsion} rad")
    return _root(lambda x: float(flexspline_torsion(x, K_F0, C_F)) - torsion, 1.0)


def wave_generator_torque(torsion: float, K_w0: float, C_w: float) -> float:
    """Find the torque whose torsion is given; ValueError at or beyond the spring's largest deflection 1/(C_w K_w0)."""
    if abs(torsion) >= 1.0 / (C_w * K_w0):
        raise ValueError(f"no torque gives a wave-generator torsion of {torsion} rad")
    return _root(lambda x: float(wave_generator_torsion(x, K_w0, C_w)) - torsion, 1e-3)


class Contact(StrEnum):
    """Which wall of the play pushes the follower."""

    NONE = "none"
    LOWER = "lower"
    UPPER = "upper"


def play(drive_signal: ArrayLike, radius: float, start: float = 0.0) -> Floats:
    """Follow `drive_signal` with a play of +-radius, as a follower between two walls.

    The follower rests until a wall reaches it, then moves with that wall until the wall turns round.
    Shape as the input. The first sample is already confronted with `start`.
    """
    u = np.asarray(drive_signal, dtype=float).ravel()
    followed = np.empty_like(u)
    follower, contact = start, Contact.NONE
    for k, value in enumerate(u.tolist()):
        lower_wall, upper_wall = value - radius, value + radius
        if lower_wall > follower:
            contact = Contact.LOWER
        elif upper_wall < follower:
            contact = Contact.UPPER
        else:
            contact = Contact.NONE
        if contact is Contact.LOWER:
            follower = lower_wall
        elif contact is Contact.UPPER:
            follower = upper_wall
        followed[k] = follower
    return followed.reshape(np.shape(drive_signal))


def backdrive_torque(T: ArrayLike, ratio: float, T_fb: float, start: float = 0.0) -> Floats:
    """Give the motor torque that holds the wave generator against T: (36) with its second line corrected.

    Written as printed for T_w, the torque of the wave generator on the shaft; returned as M = -T_w.
    """
    torques = np.asarray(T, dtype=float).ravel()
    held = np.empty_like(torques)
    T_w = -start
    for k, T_F in enumerate(torques.tolist()):
        if T_F + ratio * T_w > T_fb:
            T_w = -(T_F - T_fb) / ratio
        elif T_F + ratio * T_w < -T_fb:
            T_w = -(T_F + T_fb) / ratio
        held[k] = -T_w
    return held.reshape(np.shape(T))


def flexspline_from_catalogue(K1: float, K2: float, T1: float, T2: float) -> tuple[float, float]:
    """Give (K_F0, C_F): the stiffness (22) passes through K1 at T1/2 and K2 at (T1+T2)/2, (29)-(32)."""
    at = np.array([T1 / 2.0, (T1 + T2) / 2.0])
    K_F0, growth = np.linalg.solve(np.column_stack([np.ones(2), at**2]), np.array([K1, K2]))
    return float(K_F0), math.sqrt(growth / K_F0)


def wave_generator_from_tests(ratio: float, hysteresis_loss: float, T_fs: float) -> tuple[float, float]:
    """Give (K_w0, C_w): half the loss is the linear torsion at T_fs (33) and the largest torsion of all (34), (35)."""
    half_loss_at_motor = ratio * hysteresis_loss / 2.0
    K_w0 = T_fs / half_loss_at_motor
    return K_w0, 1.0 / (half_loss_at_motor * K_w0)


def shd_17_100() -> Drive:
    """Give the drive of the paper: catalogue values, two tests; running friction as in the size-17 scales."""
    K_F0, C_F = flexspline_from_catalogue(**SHD_17_100_CATALOGUE)
    K_w0, C_w = wave_generator_from_tests(100.0, 1.8e-4, 0.012)
    return Drive(100.0, K_F0, C_F, K_w0, C_w, T_fs=0.012, T_fb=2.0, T_c=0.012, b=1e-4)


def _integral_from_zero(integrand: Callable[[Floats], Floats], upper: ArrayLike) -> Floats:
    end = np.asarray(upper, dtype=float)
    half = 0.5 * end[..., None]
    return np.asarray((half * integrand(half * (1.0 + NODES))) @ WEIGHTS)


def _root(function: Callable[[float], float], scale: float) -> float:
    reach = scale
    while function(-reach) > 0.0 or function(reach) < 0.0:
        reach *= 2.0
    return float(brentq(function, -reach, reach, xtol=1e-15, rtol=1e-14))

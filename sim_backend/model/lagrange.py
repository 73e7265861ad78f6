"""Two-mass model of a motor, a harmonic drive and a load from Lagrange's equations, non-linear.

    e = theta_l - theta_m/N + theta_p(theta_m),  p = -1/N + dtheta_p/dtheta_m,  e' = theta_l' + p theta_m'
    T = (J_m + J_wg) theta_m'^2/2 + J_l theta_l'^2/2                                                       (9)
    V = K e^2/2                                                             (10), printed with the other sign
    D = [B_m theta_m'^2 + B_l theta_l'^2 + B_ml (theta_m' + s theta_l')^2 + B_sp e'^2] / 2                 (12)
    (J_m + J_wg) theta_m'' + K e p + B_m theta_m' + B_ml (theta_m' + s theta_l') + B_sp e' p = tau_m       (15)
    J_l theta_l'' + K e + B_l theta_l' + s B_ml (theta_m' + s theta_l') + B_sp e' = tau_l                  (16)

s = -1 for `same`, +1 for `opposed` (`Transmission`). dtheta_p/dtheta_m feeds the error back to the motor as a ripple of
its torque. Scalar code, which numba compiles in `driven`. Source: Castejon, Garcia-Prada & Lara 2009.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Laws(NamedTuple):
    """Constants of the equations, SI; J is J_m + J_wg, s the sense."""

    J: float
    J_l: float
    B_m: float
    B_ml: float
    B_sp: float
    B_l: float
    K: float
    N: float
    s: float


def error_and_slope(theta_m: float, coefficients: Sequence[float] | NDArray[np.float64]) -> tuple[float, float]:
    """Give (theta_p rad, dtheta_p/dtheta_m) of (17) from a_0, a_1 ... a_k, b_1 ... b_k."""
    orders = (len(coefficients) - 1) // 2
    cosine, sine = math.cos(theta_m), math.sin(theta_m)
    value, slope = 0.5 * coefficients[0], 0.0
    c, s = 1.0, 0.0
    for n in range(1, orders + 1):
        c, s = c * cosine - s * sine, s * cosine + c * sine
        a, b = coefficients[n], coefficients[orders + n]
        value += a * c + b * s
        slope += n * (b * c - a * s)
    return value, slope


def kinetic_energy(omega_m: float, omega_l: float, c: Laws) -> float:
    """Give T (9), J."""
    return 0.5 * (c.J * omega_m * omega_m + c.J_l * omega_l * omega_l)


def potential_energy(
    theta_m: float, theta_l: float, coefficients: Sequence[float] | NDArray[np.float64], c: Laws
) -> float:
    """Give V (10) with its sign corrected, J."""
    error, _ = error_and_slope(theta_m, coefficients)
    e = theta_l - theta_m / c.N + error
    return 0.5 * c.K * e * e


def dissipation(
    theta_m: float, omega_m: float, omega_l: float, coefficients: Sequence[float] | NDArray[np.float64], c: Laws
) -> float:
    """Give D (12), W: half the power which friction takes."""
    _, slope = error_and_slope(theta_m, coefficients)
    bearing = omega_m + c.s * omega_l
    rate = omega_l + (slope - 1.0 / c.N) * omega_m
    loss = c.B_m * omega_m * omega_m + c.B_l * omega_l * omega_l + c.B_ml * bearing * bearing
    return 0.5 * (loss + c.B_sp * rate * rate)


def transmitted_torque(
    theta_m: float,
    omega_m: float,
    theta_l: float,
    omega_l: float,
    coefficients: Sequence[float] | NDArray[np.float64],
    c: Laws,
) -> float:
    """Give the torque with which spring and mesh damper drive the load, -K e - B_sp e', N*m."""
    error, slope = error_and_slope(theta_m, coefficients)
    e = theta_l - theta_m / c.N + error
    return -c.K * e - c.B_sp * (omega_l + (slope - 1.0 / c.N) * omega_m)


def accelerations(
    theta_m: float,
    omega_m: float,
    theta_l: float,
    omega_l: float,
    tau_m: float,
    tau_l: float,
    coefficients: Sequence[float] | NDArray[np.float64],
    c: Laws,
) -> tuple[float, float]:
    """Solve (15) and (16) for (theta_m'', theta_l''), rad/s^2; torques in N*m, each at its own shaft."""
    error, slope = error_and_slope(theta_m, coefficients)
    p = slope - 1.0 / c.N
    drive = c.K * (theta_l - theta_m / c.N + error) + c.B_sp * (omega_l + p * omega_m)
    bearing = c.B_ml * (omega_m + c.s * omega_l)
    return (
        (tau_m - drive * p - c.B_m * omega_m - bearing) / c.J,
        (tau_l - drive - c.B_l * omega_l - c.s * bearing) / c.J_l,
    )

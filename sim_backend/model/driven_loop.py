"""Motor, drive and load in time by the classical Runge-Kutta method, as scalar code for compilation; see `driven`."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sim_backend.model.lagrange import Laws, accelerations, transmitted_torque


def driven_rates(
    theta_m: float,
    omega_m: float,
    theta_l: float,
    omega_l: float,
    current: float,
    voltage: float,
    tau_l: float,
    resistance: float,
    inductance: float,
    constant: float,
    coefficients: Sequence[float] | NDArray[np.float64],
    c: Laws,
) -> tuple[float, float, float, float, float]:
    """Give the rates of the first five arguments, the state of a driven transmission; SI."""
    alpha_m, alpha_l = accelerations(theta_m, omega_m, theta_l, omega_l, constant * current, tau_l, coefficients, c)
    return omega_m, alpha_m, omega_l, alpha_l, (voltage - resistance * current - constant * omega_m) / inductance


def advance(
    rows: NDArray[np.float64],
    steps: int,
    h: float,
    voltage: float,
    tau_l: float,
    resistance: float,
    inductance: float,
    constant: float,
    coefficients: NDArray[np.float64],
    c: Laws,
) -> None:
    """Fill `rows` (n, 6), whose first row holds the start, with the state and the transmitted torque.

    There are `steps` steps of `h` (s) from row to row.
    """
    x0, x1, x2, x3, x4 = rows[0, 0], rows[0, 1], rows[0, 2], rows[0, 3], rows[0, 4]
    rows[0, 5] = transmitted_torque(x0, x1, x2, x3, coefficients, c)
    for row in range(1, len(rows)):
        for _ in range(steps):
            a0, a1, a2, a3, a4 = driven_rates(
                x0, x1, x2, x3, x4, voltage, tau_l, resistance, inductance, constant, coefficients, c
            )
            k = 0.5 * h
            b0, b1, b2, b3, b4 = driven_rates(
                x0 + k * a0, x1 + k * a1, x2 + k * a2, x3 + k * a3, x4 + k * a4,
                voltage, tau_l, resistance, inductance, constant, coefficients, c,
            )  # fmt: skip
            c0, c1, c2, c3, c4 = driven_rates(
                x0 + k * b0, x1 + k * b1, x2 + k * b2, x3 + k * b3, x4 + k * b4,
                voltage, tau_l, resistance, inductance, constant, coefficients, c,
            )  # fmt: skip
            d0, d1, d2, d3, d4 = driven_rates(
                x0 + h * c0, x1 + h * c1, x2 + h * c2, x3 + h * c3, x4 + h * c4,
                voltage, tau_l, resistance, inductance, constant, coefficients, c,
            )  # fmt: skip
            k = h / 6.0
            x0 += k * (a0 + 2.0 * (b0 + c0) + d0)
            x1 += k * (a1 + 2.0 * (b1 + c1) + d1)
            x2 += k * (a2 + 2.0 * (b2 + c2) + d2)
            x3 += k * (a3 + 2.0 * (b3 + c3) + d3)
            x4 += k * (a4 + 2.0 * (b4 + c4) + d4)
        rows[row, 0], rows[row, 1], rows[row, 2], rows[row, 3], rows[row, 4] = x0, x1, x2, x3, x4
        rows[row, 5] = transmitted_torque(x0, x1, x2, x3, coefficients, c)

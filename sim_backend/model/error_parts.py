"""Kinematic error taken apart: dtheta = theta_p + theta_s, geometric and elastic part.

    dtheta = theta_m/N - theta_l (4);  theta_s = dtheta - theta_p (5) = -e, the deflection of the spring with its sign

Source: Castejon, Garcia-Prada & Lara 2009.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim_backend.model.fourier_error import FourierError, pure_error

Floats = NDArray[np.float64]


class ErrorParts(NamedTuple):
    """Parts of the kinematic error, rad at the output, shape (n,)."""

    total: Floats
    pure: Floats
    flexible: Floats


def error_parts(motor_position: Floats, load_position: Floats, ratio: float, series: FourierError) -> ErrorParts:
    """Take the error apart; angles in rad, shape (n,), counted so that load_position = motor_position / ratio."""
    total = np.asarray(motor_position / ratio - load_position)
    pure = pure_error(motor_position, series)
    return ErrorParts(total, pure, total - pure)


def flexible_share(parts: ErrorParts) -> float:
    """Give the peak-to-peak of the flexible part over that of the total, 1; a constant wind-up does not count."""
    return float(np.ptp(parts.flexible) / np.ptp(parts.total))

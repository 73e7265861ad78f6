"""Poles of a linear model."""

import math

import numpy as np
from numpy.typing import NDArray

Poles = NDArray[np.complex128]


def poles(matrix: NDArray[np.float64]) -> Poles:
    """Give the eigenvalues of A, 1/s."""
    return np.linalg.eigvals(matrix).astype(np.complex128)


def mode(values: Poles) -> float:
    """Give the frequency of the fastest pole, Hz."""
    return float(np.max(values.imag) / (2.0 * math.pi))


def largest_real_part(values: Poles) -> float:
    """Give the growth of the least damped pole, 1/s."""
    return float(np.max(values.real))


def decay(values: Poles) -> float:
    """Give the real pole farthest from zero, 1/s: the decay of the speed."""
    return float(np.min(values.real[np.abs(values.imag) < 1.0]))

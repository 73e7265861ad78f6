"""Periodic effects as sums of rotating vectors: amplitude * sin(order * angle + phase) is a projection."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tests.independent.terms import Line

Floats = NDArray[np.float64]


def rotating_vectors(angle: ArrayLike, lines: Sequence[Line], *, turned_ahead: bool = False) -> Floats:
    """Sum the imaginary parts of amplitude * exp(j(order * angle + phase)), or of its derivative by the angle."""
    theta = np.asarray(angle, dtype=float)
    total = np.zeros(theta.shape, dtype=complex)
    for line in lines:
        vector = line.amplitude * np.exp(1j * line.phase) * np.exp(1j * line.order * theta)
        total = total + (1j * line.order * vector if turned_ahead else vector)
    return np.asarray(total.imag)


def wave(angle: ArrayLike, amplitude: float, order: float, phase: float) -> Floats:
    """Give one line."""
    return rotating_vectors(angle, [Line(order, amplitude, phase)])

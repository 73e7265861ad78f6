"""PySINDy: sequentially thresholded least squares, and forward selection by the error-reduction ratio.

Threshold and ridge, or the number of terms, are what a quarter of the runs is predicted best with.
"""

import numpy as np
import pysindy
from numpy.typing import NDArray

from tests.challenge.peers.columns import Task

Floats = NDArray[np.float64]

THRESHOLDS = np.geomspace(0.003, 1.0, 11).tolist()
"""Coefficients of columns and target of unit size: 1 explains all of it."""

RIDGES = (1e-3, 200.0)
"""A weak one, and one that was found to work on such campaigns."""

MOST_TERMS = 10


def stlsq(task: Task) -> Floats:
    """Give the coefficients of thresholded least squares."""
    fitted, checked = task.split()
    tried = [(_error(_thresholded(fitted, t, a), checked), t, a) for t in THRESHOLDS for a in RIDGES]
    _, threshold, ridge = min(tried)
    return _thresholded(task, threshold, ridge)


def frols(task: Task) -> Floats:
    """Give the coefficients of forward selection."""
    fitted, checked = task.split()
    tried = [(float(np.mean(checked.y**2)), 0)]
    tried += [(_error(_forward(fitted, count), checked), count) for count in range(1, MOST_TERMS + 1)]
    _, count = min(tried)
    return _forward(task, count) if count else np.zeros(task.X.shape[1])


def _thresholded(task: Task, threshold: float, ridge: float) -> Floats:
    model = pysindy.STLSQ(threshold=threshold, alpha=ridge)
    return np.asarray(model.fit(task.X, task.y[:, None]).coef_).ravel()


def _forward(task: Task, count: int) -> Floats:
    model = pysindy.FROLS(max_iter=count)
    return np.asarray(model.fit(task.X, task.y[:, None]).coef_).ravel()


def _error(coefficients: Floats, task: Task) -> float:
    return float(np.mean((task.y - task.X @ coefficients) ** 2))

"""PySINDy: sequentially thresholded least squares, and forward selection by the error-reduction ratio.

Threshold and ridge, or the number of terms: the sparsest that predicts a quarter of the runs, which was not fitted, as
well as the best, within a standard error.
"""

import numpy as np
import pysindy
from numpy.typing import NDArray

from tests.challenge.peers.columns import Task, sparsest_as_good

Floats = NDArray[np.float64]

THRESHOLDS = np.geomspace(0.003, 1.0, 11).tolist()
"""Coefficients of columns and target of unit size: 1 explains all of it."""

RIDGES = (1e-3, 200.0)
"""A weak one, and one that was found to work on such campaigns."""

MOST_TERMS = 10


def stlsq(task: Task) -> Floats:
    """Give the coefficients of thresholded least squares."""
    fitted, checked = task.split()
    choices = [(threshold, ridge) for threshold in THRESHOLDS for ridge in RIDGES]
    best = sparsest_as_good([_thresholded(fitted, *choice) for choice in choices], checked)
    return _thresholded(task, *choices[best])


def frols(task: Task) -> Floats:
    """Give the coefficients of forward selection."""
    fitted, checked = task.split()
    nothing = np.zeros(task.X.shape[1])
    count = sparsest_as_good([nothing, *(_forward(fitted, n) for n in range(1, MOST_TERMS + 1))], checked)
    return _forward(task, count) if count else nothing


def _thresholded(task: Task, threshold: float, ridge: float) -> Floats:
    model = pysindy.STLSQ(threshold=threshold, alpha=ridge)
    return np.asarray(model.fit(task.X, task.y[:, None]).coef_).ravel()


def _forward(task: Task, count: int) -> Floats:
    model = pysindy.FROLS(max_iter=count)
    return np.asarray(model.fit(task.X, task.y[:, None]).coef_).ravel()

"""The run that bends the base model most: without it all others would fit better, and without no other as much."""

import numpy as np

from rig.loop.fitting.fit import Fit
from rig.loop.fitting.normal import solve

STANDS_OUT = 4.0
"""Times what leaving out any other run would improve."""

FEWEST_OTHERS = 3
"""Runs that must remain."""


def odd_run(fit: Fit) -> str | None:
    """Give the run whose being left out lets the others fit far better than that of any other run; None without one.

    To first order about the fit, from the runs' normal equations.
    """
    normal = fit.normal
    if len(normal.runs) <= FEWEST_OTHERS:
        return None
    every_A, every_g = normal.A.sum(axis=0), normal.g.sum(axis=0)
    gained = np.zeros(len(normal.runs))
    for k in range(len(normal.runs)):
        A, g = every_A - normal.A[k], every_g - normal.g[k]
        step = solve(A + np.diag(fit.prior), g + fit.pull)
        before = float(normal.squares.sum() - normal.squares[k])
        gained[k] = (2.0 * step @ g - step @ A @ step) / max(before, 1e-300)
    first, second = np.argsort(gained)[::-1][:2]
    return normal.runs[int(first)] if gained[first] > STANDS_OUT * max(gained[second], 0.0) else None

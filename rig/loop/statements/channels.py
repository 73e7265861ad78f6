"""Does what is left follow a recorded signal that no term uses? Correlations over runs, with honest p-values.

Within a run both may drift as slowly as they like, so that samples say little of chance. Runs are independent: if the
residual has nothing to do with the signal, their covariance has either sign from run to run.
"""

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import ttest_1samp

from rig.loop.statements.colour import means, rows_of
from rig.loop.statements.residuals import Residual

FEWEST_RUNS = 3
"""Runs below which nothing is said of chance."""


@dataclass(frozen=True, slots=True)
class Correlation:
    """Correlation of slow parts over all `runs`; `p_value`: that chance alone gives it, None with too few runs."""

    value: float
    p_value: float | None
    runs: int


def correlations(residuals: Sequence[Residual], used: Collection[str]) -> dict[str, Correlation]:
    """Give the correlation of residuals of one equation with every further signal of their runs, by its name.

    used: signals that terms of the model have taken up already. Source of the test: Student's t of the runs' means.
    """
    names = {name for residual in residuals for name in residual.piece.track.auxiliary} - set(used)
    found = {}
    for name in sorted(names):
        products, ones, others, weights = [], [], [], []
        for residual in residuals:
            track = residual.piece.track
            if name not in track.auxiliary:
                continue
            x = means(residual.values, track.period)
            y = means(track.auxiliary[name][rows_of(residual)], track.period)
            if x.size < 2 or np.ptp(y) == 0.0:
                continue
            x, y = x - x.mean(), y - y.mean()
            products.append(float(np.mean(x * y)))
            ones.append(float(np.mean(x**2)))
            others.append(float(np.mean(y**2)))
            weights.append(x.size)
        size = math.sqrt(np.dot(weights, ones) * np.dot(weights, others)) if products else 0.0
        if size > 0.0:
            chance = float(ttest_1samp(products, 0.0).pvalue) if len(products) >= FEWEST_RUNS else None
            found[name] = Correlation(float(np.dot(weights, products)) / size, chance, len(products))
    return found

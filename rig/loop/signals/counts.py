"""The count of an encoder, read off the steps between samples: a log need not say it."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

FINEST = 1e-7
"""rad below which a difference is no count; the finest encoders of a bench have some 1e-6."""

OFF = 0.1
"""Counts by which steps may miss whole multiples, rms, and still be counted."""


def count_of(positions: Sequence[Floats]) -> float | None:
    """Give the count (rad) of the encoder that these angles (n,) rad come from; None where no steps are seen."""
    steps = np.sort(np.concatenate([np.abs(np.diff(position)) for position in positions] or [np.zeros(0)]))
    gaps = np.diff(steps, prepend=0.0)
    gaps = gaps[gaps > FINEST]
    if not gaps.size:
        return None
    # a first guess from the smallest difference of steps, then the best fit to all of them
    count = float(gaps.min())
    for _ in range(3):
        times = np.round(steps / count)
        power = float(times @ times)
        if power == 0.0:
            return None
        count = float((steps @ times) / power)
    off = float(np.sqrt(np.mean((steps / count - np.round(steps / count)) ** 2)))
    return count if off < OFF else None

"""The noise of a recorded torque: how large it is around every sample, and how long it remembers."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

Floats = NDArray[np.float64]

NOISE_BLOCK, LEAST_BLOCK, NOISE_BLOCKS = 0.25, 10, 9
"""s and samples at least of a block over which the noise is measured, and the blocks of which the median counts."""

LAGS = (1, 2, 4, 8, 16, 32)
"""Samples between the three of a second difference: how it grows with them tells how long the noise remembers."""

LONGEST_LAG = 0.35
"""s: over longer times a swept torque bends by itself."""

COLOURED = 1.4
"""Ratio of the noise seen at 8 samples to that at 1 beyond which it remembers."""

MEMORIES = (0.7, 0.8, 0.86, 0.9, 0.93, 0.95, 0.96, 0.97, 0.98, 0.985, 0.99)
"""Correlations of neighbouring samples that are tried."""

MEDIAN_OF_SQUARE = 0.4549
"""Median of the square of a normal variable of unit variance."""


def noise_and_memory(values: Floats, period: float) -> tuple[Floats, float]:
    """Give the variance of the noise around every sample, (n,), and the correlation of neighbouring samples.

    values: (n,), any unit, whose square the variance has; period: s between samples. 0 is the correlation of white
    noise, above it the noise is taken for a first-order autoregression.
    """
    memory = _memory(values, period)
    return _noise_variance(values, period) / _second_difference(memory, 1), memory


def left_in_mean(memory: float, count: int) -> float:
    """Give the share of the noise's variance that is left in the mean of `count` samples.

    memory: correlation of neighbouring samples, as `noise_and_memory` gives it; 0 leaves 1/count.
    """
    k = np.arange(1, count)
    return float((1.0 + 2.0 * np.sum((1.0 - k / count) * memory**k)) / count)


def _noise_variance(values: Floats, period: float) -> Floats:
    """Give the variance of white noise around every sample, shape (n,), from second differences: a slope has none.

    Of short blocks in a row the median counts, so that a corner, which lies in one of them, does not.
    """
    bend = values[2:] - 2.0 * values[1:-1] + values[:-2]
    squares = np.concatenate([bend[:1], bend, bend[-1:]]) ** 2 / 6.0
    block = max(round(NOISE_BLOCK / period), LEAST_BLOCK)
    starts = np.arange(0, max(squares.size - block, 0) + 1, block)
    means = np.add.reduceat(squares, starts) / np.diff(np.append(starts, squares.size))
    level = median_filter(means, size=NOISE_BLOCKS, mode="nearest")
    return np.asarray(np.interp(np.arange(squares.size), starts + 0.5 * block, level))


def _memory(values: Floats, period: float) -> float:
    """Give the correlation of neighbouring samples of the noise, 0 for a white one.

    A slope has no second difference, and the few that span a corner do not move a median.
    """
    lags = [lag for lag in LAGS if lag * period <= LONGEST_LAG and values.size > 8 * lag]
    bends = (values[2 * lag :] - 2.0 * values[lag:-lag] + values[: -2 * lag] for lag in lags)
    seen = np.array([np.median(bend**2) / (6.0 * MEDIAN_OF_SQUARE) for bend in bends])
    if len(lags) < 4 or seen[0] <= 0.0 or seen[3] < COLOURED**2 * seen[0]:
        return 0.0
    tried = np.array([[_second_difference(memory, lag) for lag in lags] for memory in MEMORIES])
    misfit = np.log(seen / seen[0]) - np.log(tried / tried[:, :1])
    return MEMORIES[int(np.argmin((misfit**2).sum(axis=1)))]


def _second_difference(memory: float, lag: int) -> float:
    """Give the variance of a second difference over that of white noise of the same size; 1 without memory."""
    return (3.0 - 4.0 * memory**lag + memory ** (2 * lag)) / 3.0

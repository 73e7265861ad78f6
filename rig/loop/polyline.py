"""A torque that was swept in straight lines, without its noise: knots found, placed and held against the noise.

A play remembers the extremes of its input, so that the noise of a held torque ratchets it on, and a line that runs on
past a corner sets it for good. Where the whole record is a polyline within its noise, that is what the play gets.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter, uniform_filter1d
from scipy.signal import savgol_filter

Floats = NDArray[np.float64]

TOLERANCE, TOLERANCE_COLOURED = 6.3, 4.0
"""By how many standard deviations of the ends of smoothing lines a polyline may miss the smoothed torque before it gets
a further knot; of a noise that remembers, of a sample, because smoothing leaves most of it."""

MOST_KNOTS, MOST_POINTS = 200, 3000
"""Knots of a polyline, and means of neighbouring samples that place them."""

SHORTEST = 1.0
"""s that a straight piece lasts on average at least; what bends more often is no polyline."""

BLOCK, TYPICAL, WORST = 0.5, 1.5, 6.0
"""s of the blocks whose means judge the polyline; their rms and their largest size, in standard deviations."""

SPANS = (0.6, 2.0, 6.0)
"""s over which a torque that is no polyline is smoothed by cubics, where it follows them."""

CUBIC_CENTRE = 2.25
"""Variance of the centre of a fitted cubic over that of the mean of its samples."""

SCATTERS, AGREE = 3.0, 4.0
"""Standard deviations within which samples scatter about a cubic, and cubics of different length agree."""

PASSES = 5
RIDGE = 1e-10
NOISE_BLOCK, NOISE_BLOCKS = 0.25, 9
"""s of a block over which the noise is measured, and the blocks of which the median counts."""

LAGS = (1, 2, 4, 8, 16, 32)
"""Samples between the three of a second difference: how it grows with them tells how long the noise remembers."""

LONGEST_LAG = 0.35
"""s: over longer times a swept torque bends by itself."""

COLOURED = 1.4
"""Ratio of the noise seen at 8 samples to that at 1 beyond which it remembers."""

ROUNDS = 3
"""Times that a noise which remembers is measured anew."""

MEMORIES = (0.7, 0.8, 0.86, 0.9, 0.93, 0.95, 0.96, 0.97, 0.98, 0.985, 0.99)
"""Correlations of neighbouring samples that are tried."""

MEDIAN_OF_SQUARE = 0.4549
"""Median of the square of a normal variable of unit variance."""


def polyline(values: Floats, smoothed: Floats, side: int, period: float) -> Floats | None:
    """Give the polyline that `values` (n,) follow within their noise, shape (n,); None if they follow none.

    smoothed: the same without most of the noise, corners kept, from lines over `side` samples on either side.
    """
    n = values.size
    if n < 4 * side:
        return None
    rest = values
    for _ in range(ROUNDS):
        # what corners add to second differences is gone once a first polyline has been taken off
        noise, memory = _noise(rest, period)
        tolerance = TOLERANCE_COLOURED if memory else TOLERANCE * math.sqrt(4.0 / side)
        knots = _knots(smoothed, tolerance * np.sqrt(np.maximum(noise, 1e-300)))
        if not noise.all() or len(knots) > min(n * period / SHORTEST + 2, MOST_KNOTS):
            return None
        line = _placed(values, np.array(knots, dtype=float))
        if not memory:
            break
        rest = values - line
    block = max(round(BLOCK / period), 1)
    whole = n // block * block
    means = (values - line)[:whole].reshape(-1, block).mean(axis=1)
    variance = noise[:whole].reshape(-1, block).mean(axis=1) * _of_mean(memory, block)
    sizes = np.abs(means) / np.sqrt(np.maximum(variance, 1e-300))
    good = np.sqrt(np.mean(sizes**2)) <= TYPICAL and sizes.max(initial=0.0) <= WORST
    return line if good else None


def curve(values: Floats, smoothed: Floats, side: int, period: float) -> Floats:
    """Give `smoothed` (n,) with less noise wherever `values` follow a cubic over longer than `side` on either side.

    A longer cubic counts where the samples scatter about it no more than their noise, and where it agrees with the
    shorter one.
    """
    noise, memory = _noise(values, period)
    found, least = smoothed.copy(), noise * _of_mean(memory, 2 * side + 1)
    short = np.sqrt(noise * _of_mean(memory, 4 * side + 1))
    for width in (2 * round(0.5 * span / period) + 1 for span in SPANS):
        if not 4 * side < width <= values.size:
            continue
        cubic = savgol_filter(values, width, 3)
        scatter = uniform_filter1d((values - cubic) ** 2, width)
        variance = CUBIC_CENTRE * noise * _of_mean(memory, width)
        good = scatter <= noise * (1.0 + SCATTERS * math.sqrt(2.0 / width))
        good &= np.abs(uniform_filter1d(cubic - smoothed, 4 * side + 1)) <= AGREE * short
        good &= variance < least
        found[good], least[good] = cubic[good], variance[good]
    return found


def _noise(values: Floats, period: float) -> tuple[Floats, float]:
    """Give the variance of the noise around every sample, (n,), and the correlation of neighbouring samples."""
    memory = _memory(values, period)
    return noise_variance(values, period) / _second_difference(memory, 1), memory


def noise_variance(values: Floats, period: float) -> Floats:
    """Give the variance of white noise around every sample, shape (n,), from second differences: a slope has none.

    Of short blocks in a row the median counts, so that a corner, which lies in one of them, does not.
    """
    bend = values[2:] - 2.0 * values[1:-1] + values[:-2]
    squares = np.concatenate([bend[:1], bend, bend[-1:]]) ** 2 / 6.0
    block = max(round(NOISE_BLOCK / period), 1)
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


def _of_mean(memory: float, count: int) -> float:
    """Give the variance of the mean of `count` samples over that of one."""
    k = np.arange(1, count)
    return float((1.0 + 2.0 * np.sum((1.0 - k / count) * memory**k)) / count)


def _knots(smoothed: Floats, tolerance: Floats) -> list[int]:
    """Split the record where a straight line misses it most, until none misses it by more than `tolerance` (n,)."""
    found, open_ = {0, smoothed.size - 1}, [(0, smoothed.size - 1)]
    while open_:
        first, last = open_.pop()
        if last - first < 2:
            continue
        inner = smoothed[first : last + 1]
        miss = np.abs(inner - np.linspace(inner[0], inner[-1], inner.size)) / tolerance[first : last + 1]
        worst = int(miss.argmax())
        if miss[worst] > 1.0:
            found.add(first + worst)
            open_ += [(first, first + worst), (first + worst, last)]
    return sorted(found)


def _placed(values: Floats, knots: Floats) -> Floats:
    """Fit heights and places of the knots by least squares; give the polyline at every sample."""
    factor = -(-values.size // MOST_POINTS)
    whole = values.size // factor * factor
    every = np.arange(values.size, dtype=float)
    index, values = (x[:whole].reshape(-1, factor).mean(axis=1) for x in (every, values))
    for _ in range(PASSES):
        hats = _hats(index, knots)
        heights = _least_squares(hats, values)
        if knots.size < 3:
            break
        slopes = np.diff(heights) / np.diff(knots)
        before = index[:, None] < knots[None, 1:-1]
        columns = -hats[:, 1:-1] * np.where(before, slopes[:-1], slopes[1:])
        moves = _least_squares(np.hstack([hats, columns]), values - hats @ heights)[knots.size :]
        gaps = np.diff(knots)
        knots = knots.copy()
        knots[1:-1] += np.clip(moves, -0.3 * gaps[:-1], 0.3 * gaps[1:])
    return np.asarray(np.interp(every, knots, _least_squares(_hats(index, knots), values)))


def _least_squares(columns: Floats, values: Floats) -> Floats:
    """Solve by scaled normal equations: there are few columns; a knot on a straight line has no place of its own."""
    scale = np.sqrt(np.maximum((columns**2).sum(axis=0), 1e-300))
    scaled = columns / scale
    matrix = scaled.T @ scaled + RIDGE * np.eye(scale.size)
    return np.asarray(np.linalg.solve(matrix, scaled.T @ values) / scale)


def _hats(index: Floats, knots: Floats) -> Floats:
    """Give the hat function of every knot at every sample, shape (n, knots)."""
    return np.column_stack([np.interp(index, knots, unit) for unit in np.eye(knots.size)])

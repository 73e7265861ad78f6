"""Torques smoothed by straight lines and cubics, so that corners stay and nothing but noise goes."""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.signal import savgol_filter

from rig.loop.noise import noise_and_memory, noise_variance, of_mean

Floats = NDArray[np.float64]

SPRING_SIDES = (0.025, 0.1, 0.3, 1.0, 3.0)
"""s on either side over which torques are smoothed by straight lines before they enter a spring: at least the first,
and wherever the torque is straight enough the longest."""

STRAIGHT = 6.0
"""Standard deviations by which the scatter about a line may exceed the noise."""

AGREE = 5.0
"""Standard deviations within which a longer line must agree with the shortest."""

SPANS = (0.6, 2.0, 6.0)
"""s over which a torque that is no polyline is smoothed by cubics, where it follows them."""

CUBIC_CENTRE = 2.25
"""Variance of the centre of a fitted cubic over that of the mean of its samples."""

SCATTERS, CUBICS_AGREE = 3.0, 4.0
"""Standard deviations within which samples scatter about a cubic, and cubics of different length agree."""

FEWEST, MIN_SIDE = 7, 4
"""Samples of a log, and on a side, without which torques are left as they are."""


def straightened(values: Floats, period: float) -> Floats:
    """Smooth a torque by straight lines over the longest of `SPRING_SIDES` that takes nothing but noise away.

    Noise of a torque is in what it predicts, so that an effect that follows the torque less noisily would be found for
    it. A longer line counts where the samples scatter about it no more than about their neighbours, and where it agrees
    with the shortest.
    """
    if values.size < FEWEST:
        return values
    first = round(SPRING_SIDES[0] / period)
    smoothed = corners_kept(values, first)
    noise = noise_variance(values, period)
    least = noise / (1.0 if smoothed is values else 2.0 * first + 1.0)
    best, best_variance = smoothed.copy(), least.copy()
    for side in (round(side / period) for side in SPRING_SIDES[1:]):
        if side < MIN_SIDE or values.size <= 2 * side:
            continue
        for low, high, share in ((-side, side, 1.0), (-side, 0, 4.0), (0, side, 4.0)):
            line, scatter, count = _straight(values, low, high)
            variance = share * noise / count
            good = scatter <= noise * (1.0 + STRAIGHT * np.sqrt(2.0 / count))
            good &= np.abs(line - smoothed) <= AGREE * (np.sqrt(least) + np.sqrt(variance))
            good &= variance < best_variance
            best[good], best_variance[good] = line[good], variance[good]
    return best


def curve(values: Floats, smoothed: Floats, side: int, period: float) -> Floats:
    """Give `smoothed` (n,) with less noise wherever `values` follow a cubic over longer than `side` on either side.

    A longer cubic counts where the samples scatter about it no more than their noise, and where it agrees with the
    shorter one.
    """
    noise, memory = noise_and_memory(values, period)
    found, least = smoothed.copy(), noise * of_mean(memory, 2 * side + 1)
    short = np.sqrt(noise * of_mean(memory, 4 * side + 1))
    for width in (2 * round(0.5 * span / period) + 1 for span in SPANS):
        if not 4 * side < width <= values.size:
            continue
        cubic = savgol_filter(values, width, 3)
        scatter = uniform_filter1d((values - cubic) ** 2, width)
        variance = CUBIC_CENTRE * noise * of_mean(memory, width)
        good = scatter <= noise * (1.0 + SCATTERS * math.sqrt(2.0 / width))
        good &= np.abs(uniform_filter1d(cubic - smoothed, 4 * side + 1)) <= CUBICS_AGREE * short
        good &= variance < least
        found[good], least[good] = cubic[good], variance[good]
    return found


def corners_kept(values: Floats, side: int) -> Floats:
    """Smooth by straight lines fitted before, around and after each sample, the better fitting ones weighing more.

    A mean across the corner of a triangle cuts the corner: there only the line on the sample's own side fits. `side`:
    samples on either side.
    """
    if side < MIN_SIDE or values.size <= 2 * side:
        return values
    before, around, after = (_straight(values, low, high) for low, high in ((-side, 0), (-side, side), (0, side)))
    scatter = np.stack([before[1], around[1], after[1]])
    least = np.maximum(scatter.min(axis=0), 1e-300)
    # the variance of a fitted end point is four times, that of a centre once the mean's over half as many samples
    weight = np.array([0.25, 2.0, 0.25])[:, None] * np.exp(-0.5 * side * (scatter / least - 1.0))
    smoothed = (weight * np.stack([before[0], around[0], after[0]])).sum(axis=0) / weight.sum(axis=0)
    return np.asarray(smoothed)


def _straight(values: Floats, low: int, high: int) -> tuple[Floats, Floats, Floats]:
    """Fit a line to the samples from k+low to k+high around every k.

    Gives its value at k, the variance of the residual, and to how many samples it was fitted; each (n,).
    """
    n = values.size
    k = np.arange(n)
    first, last = np.clip(k + low, 0, n - 3), np.clip(k + high, 2, n - 1)
    first, last = np.minimum(first, last - 2), np.maximum(last, first + 2)
    offset = values - values.mean()
    sums = [np.concatenate([[0.0], np.cumsum(x)]) for x in (offset, offset * k, offset**2)]
    count = (last - first + 1).astype(float)
    y, ty, yy = (s[last + 1] - s[first] for s in sums)
    middle = 0.5 * (first + last)
    spread = count * (count**2 - 1.0) / 12.0
    slope = (ty - middle * y) / spread
    variance = np.maximum(yy - y**2 / count - slope**2 * spread, 0.0) / np.maximum(count - 2.0, 1.0)
    return values.mean() + y / count + slope * (k - middle), variance, count

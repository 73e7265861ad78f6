"""Torques and temperatures smoothed by lines and cubics, so that corners stay and nothing but noise goes."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.polynomial.polynomial import polyfit, polyval
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.signal import fftconvolve, savgol_coeffs

from rig.loop.signals.noise import left_in_mean, noise_and_memory

Floats = NDArray[np.float64]

SPANS, THERMAL_SPANS = (0.2, 0.6, 2.0, 6.0), (2.0, 6.0, 20.0, 60.0)
"""s over which a torque that is no polyline, and a temperature, are smoothed by cubics, where they follow them."""

CUBIC_CENTRE = 2.25
"""Variance of the centre of a fitted cubic over that of the mean of its samples."""

SCATTERS, AGREE, AGREE_AT_ENDS = 3.0, 3.0, 6.0
"""Standard deviations within which samples scatter about a cubic, and cubics of different length agree; at the ends of
a record the shorter ones are twice as uncertain."""

FEWEST, MIN_SIDE = 7, 4
"""Samples of a log, and on a side, without which torques are left as they are."""

LEAST_SCATTER = 1e-200
"""Variance of a line through samples that lie on it."""


def smooth(values: Floats, side: int, period: float, spans: Sequence[float] = SPANS) -> Floats:
    """Take the noise from a signal (n,): corners are kept, and cubics fitted wherever the signal follows them.

    side: samples on either side over which all is smoothed. period: s between samples. `spans`: s of the cubics. A
    longer one counts where the samples scatter about it no more than their noise, and where it agrees with what the
    shorter ones gave.
    """
    if values.size < FEWEST:
        return values
    found = corners_kept(values, side)
    noise, memory = noise_and_memory(values, period)
    shorter = 1 if found is values else 2 * side + 1
    least = noise * left_in_mean(memory, shorter)
    found = found.copy()
    for width in (2 * round(0.5 * span / period) + 1 for span in spans):
        if not max(4 * side, FEWEST) < width <= values.size:
            continue
        cubic = _cubics(values, width)
        scatter = uniform_filter1d((values - cubic) ** 2, width)
        about = uniform_filter1d(noise, width)  # what a few blocks say is too uncertain for as many samples
        variance = CUBIC_CENTRE * about * left_in_mean(memory, width)
        good = scatter <= about * (1.0 + SCATTERS * math.sqrt(2.0 / width))
        apart = np.abs(uniform_filter1d(cubic - found, shorter))
        agree = np.full(values.size, AGREE)
        agree[:shorter] = agree[-shorter:] = AGREE_AT_ENDS
        good &= apart <= agree * np.sqrt(noise * left_in_mean(memory, 2 * shorter))
        good &= variance < least
        found[good], least[good] = cubic[good], variance[good]
        shorter = width
    return found


def _cubics(values: Floats, width: int) -> Floats:
    """Give, at every sample, the cubic fitted to the `width` samples about it; towards the ends to the last `width`.

    As `savgol_filter` does, whose time grows with the width as well: at 300 000 samples and a width of 6001 it takes
    0.7 s, this 0.02 s.
    """
    middle = values.mean()
    found = fftconvolve(values - middle, savgol_coeffs(width, 3), mode="same") + middle
    half, place = width // 2, np.linspace(-1.0, 1.0, width)
    for ends, kept in ((slice(None, width), slice(None, half)), (slice(-width, None), slice(-half, None))):
        found[ends][kept] = polyval(place[kept], polyfit(place, values[ends], 3))
    return np.asarray(found)


def corners_kept(values: Floats, side: int) -> Floats:
    """Smooth `values` (n,) by straight lines before, around and after each sample, the better fitting weighing more.

    A mean across the corner of a triangle cuts the corner: there only the line on the sample's own side fits. `side`:
    samples on either side; where they are too few, or the record is no longer than both sides, gives `values` itself.
    """
    if side < MIN_SIDE or values.size <= 2 * side:
        return values
    spans = ((-side, 0), (-side, side), (0, side))
    lines, scatter = (np.stack(found) for found in zip(*(_straight(values, *span) for span in spans), strict=True))
    # a few samples at an end of the record lie on a line by chance
    scatter[0, : side // 2], scatter[2, values.size - side // 2 :] = math.inf, math.inf
    worse = np.maximum(scatter / np.maximum(scatter.min(axis=0), LEAST_SCATTER), 1.0)
    # the variance of a fitted end point is four times, that of a centre once the mean's over half as many samples
    weight = np.array([0.25, 2.0, 0.25])[:, None] * np.exp(-0.5 * side * (worse - 1.0))
    return np.asarray((weight * lines).sum(axis=0) / weight.sum(axis=0))


def _straight(values: Floats, low: int, high: int) -> tuple[Floats, Floats]:
    """Fit a line to the samples from k+low to k+high around every k.

    Gives its value at k, and the variance of the residual; each (n,).
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
    return values.mean() + y / count + slope * (k - middle), variance

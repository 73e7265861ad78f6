"""Least-squares spectrum of unevenly sampled values over an angle (Lomb-Scargle, each run with a mean of its own).

For every order k the amplitude of `a cos(k x) + b sin(k x)` that fits the values of all runs best, each run with its
own constant (Zechmeister & Kürster, A&A 496 (2009) 577). The sums over the samples are taken by fast transforms of
values and counts in fine bins of the angle, as in Press & Rybicki, ApJ 338 (1989) 277.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

BINS_A_CYCLE = 8
"""Bins of the angle per cycle of the highest order."""

MOST_BINS = 1 << 21

OVERSAMPLED = 4
"""Orders per resolution (one cycle over the travel): a line between two of them loses 3 % of its amplitude at most."""

LEAST_CYCLES = 1.0
"""Cycles over the travel below which an order is a slope."""

LEAST_TOLD = 0.05
"""Determinant of the normalised 2 x 2 equations (1: sine and cosine apart) below which the samples cannot tell an
order."""


@dataclass(frozen=True, slots=True)
class Signal:
    """One run: `x` (rad, or s times 2 pi) and any number of `values` over it, each of shape (n,)."""

    x: Floats
    values: tuple[Floats, ...]


def amplitudes(signals: Sequence[Signal], highest: float) -> tuple[Floats, tuple[Floats, ...]]:
    """Give the orders (k,) up to `highest` that the samples can tell, and the amplitude (k,) of each of the values.

    Both are empty where there is no travel.
    """
    nothing = np.empty(0)
    used = [signal for signal in signals if signal.x.size]
    count = len(used[0].values) if used else 0
    low = min((float(s.x.min()) for s in used), default=0.0)
    travel = max((float(s.x.max()) for s in used), default=0.0) - low
    if travel <= 0.0:
        return nothing, (nothing,) * count
    width = max(2.0 * math.pi / (BINS_A_CYCLE * highest), travel / MOST_BINS)
    size = 1 << (OVERSAMPLED * (int(travel / width) + 1) - 1).bit_length()
    orders = np.arange(size // 4) * (2.0 * math.pi / (size * width))
    keep = (orders >= LEAST_CYCLES * 2.0 * math.pi / travel) & (orders <= highest)
    cc, ss, cs = (np.zeros(int(keep.sum())) for _ in range(3))
    by_cosine, by_sine = np.zeros((count, cc.size)), np.zeros((count, cc.size))
    total = float(sum(signal.x.size for signal in used))
    for signal in used:
        bins = ((signal.x - low) / width).astype(np.intp)
        number = float(signal.x.size)
        counts = np.fft.rfft(np.bincount(bins).astype(float), size)
        first, second = counts[: keep.size][keep], counts[: 2 * keep.size : 2][keep]
        mean_cosine, mean_sine = first.real / number, -first.imag / number
        cc += 0.5 * (number + second.real) - number * mean_cosine**2
        ss += 0.5 * (number - second.real) - number * mean_sine**2
        cs += -0.5 * second.imag - number * mean_cosine * mean_sine
        for row, values in enumerate(signal.values):
            transformed = np.fft.rfft(np.bincount(bins, weights=values - values.mean()), size)[: keep.size][keep]
            by_cosine[row] += transformed.real
            by_sine[row] -= transformed.imag
    determinant = cc * ss - cs**2
    told = determinant > LEAST_TOLD * (0.5 * total) ** 2
    shrunk = np.sinc(orders[keep] * width / (2.0 * math.pi))[told]
    found = []
    for row in range(count):
        c, s = by_cosine[row][told], by_sine[row][told]
        a = (c * ss[told] - s * cs[told]) / determinant[told]
        b = (s * cc[told] - c * cs[told]) / determinant[told]
        found.append(np.asarray(np.hypot(a, b) / shrunk))
    return np.asarray(orders[keep][told]), tuple(found)

"""A torque that was swept at one rate: its corners are placed more closely, because all its pieces share one slope."""

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

ALIKE, ALIKE_TOGETHER = 4.5, 1.6
"""Standard deviations by which the slope of one piece, and the rms of all, may differ from the common rate."""

BY_CHANCE = 5.0
"""Standard deviations of chance by which the squares may grow more than one for every slope that is given up: a small
bump in a hold has level pieces too, and goes with its knots."""

FEWEST, LEAST_GAP = 3, 2.0
"""Pieces that rise or fall without which nothing is shared, and samples of a piece at least."""

PASSES = 5
"""Times that the samples are shared out among the pieces anew."""


def at_one_rate(values: Floats, knots: Floats, heights: Floats, variance: Floats) -> tuple[Floats, Floats] | None:
    """Give knots (k,), in samples, and heights (k,), N*m, of the polyline that follows `values` (n,) at one rate.

    Every piece rises or falls by the common rate or is level: one number instead of a slope for each. None where the
    slopes differ by more than the noise, of `variance` (n,), leaves open, or where the lines do not meet in order.
    knots, heights: the polyline with slopes of its own.
    """
    own, index = np.diff(heights) / np.diff(knots), np.arange(values.size, dtype=float)
    of_the_largest = own[np.abs(np.diff(heights)).argmax()]
    if of_the_largest == 0.0:
        return None
    with_own = np.interp(index, knots, heights)
    signs = np.clip(np.rint(own / of_the_largest), -1.0, 1.0)
    bends = np.diff(signs) != 0.0
    knots, signs = knots[np.r_[True, bends, True]], signs[np.r_[True, bends]]
    if np.count_nonzero(signs) < FEWEST:
        return None
    for _ in range(PASSES):
        if np.diff(knots).min() < LEAST_GAP:
            return None
        piece = np.clip(np.searchsorted(knots, index, side="right") - 1, 0, signs.size - 1)
        count = np.bincount(piece, minlength=signs.size)
        middle, height, noise = (np.bincount(piece, what, signs.size) / count for what in (index, values, variance))
        away = index - middle[piece]
        spread = np.bincount(piece, away**2, signs.size)
        slopes = np.bincount(piece, away * values, signs.size) / spread
        weights = signs * spread / noise
        rate = float(weights @ slopes / (weights @ signs))
        starts = height - signs * rate * middle
        knots = np.array([knots[0], *(-np.diff(starts) / (rate * np.diff(signs))), knots[-1]])
    apart = np.abs(slopes - signs * rate) * np.sqrt(spread / noise)
    if np.diff(knots).min() < LEAST_GAP or apart.max() > ALIKE or np.sqrt(np.mean(apart**2)) > ALIKE_TOGETHER:
        return None
    heights = np.append(starts, starts[-1]) + rate * np.append(signs, signs[-1]) * knots
    missed = (values - np.interp(index, knots, heights)) ** 2 - (values - with_own) ** 2
    return (
        (knots, heights)
        if float((missed / variance).sum()) < own.size + BY_CHANCE * math.sqrt(2.0 * own.size)
        else None
    )

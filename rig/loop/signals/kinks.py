"""Where a torque bends at once, in a run whose torque follows no straight lines: what rings answers to that alone.

A sine that begins and ends in a dwell has two such corners. Its own curvature is slow, and sets nothing ringing.
"""

import math

import numpy as np
from numpy.typing import NDArray

from rig.loop.signals.noise import noise_and_memory

Floats = NDArray[np.float64]

SIDE, FEWEST = 0.25, 8
"""s, and samples at least, of the lines on either side of a corner."""

BENT, SHARE, STANDS_OUT = 6.0, 0.3, 5.0
"""Standard deviations, and share of the largest change of slope, that a corner has at least; and by how much the
largest exceeds what nine tenths of the samples do, or the torque has none."""

APART = 2
"""Samples on either side of a corner that take no part in finding where it is."""


def kinks(values: Floats, period: float) -> Floats | None:
    """Give straight lines (n,) that bend where `values` (n,), N*m, do, and by as much; None where they do not.

    Their height means nothing. period: s between samples.
    """
    side = max(round(SIDE / period), FEWEST)
    if values.size < 4 * side:
        return None
    change = _changes(values, side)
    noise, _ = noise_and_memory(values, period)
    least = BENT * math.sqrt(24.0 * float(np.median(noise)) / side**3)
    size = np.abs(change)
    most = float(size.max())
    if most < max(least, STANDS_OUT * float(np.quantile(size, 0.9))):
        return None
    found, sample = np.zeros(values.size), np.arange(values.size, dtype=float)
    while (k := int(np.argmax(size))) and size[k] > max(least, SHARE * most):
        found += _placed(values, k, side, sample)
        size[max(k - 2 * side, 0) : k + 2 * side] = 0.0
    return found


def _changes(values: Floats, side: int) -> Floats:
    """Give by how much the slope (per sample) changes at every sample, 0 within `side` of the ends."""
    weights = np.arange(side) - 0.5 * (side - 1)
    weights = weights / (weights @ weights)
    slopes = np.correlate(values, weights, mode="valid")  # of the samples k to k + side - 1
    found = np.zeros(values.size)
    found[side - 1 : values.size - side + 1] = slopes[side - 1 :] - slopes[: slopes.size - side + 1]
    return found


def _placed(values: Floats, k: int, side: int, sample: Floats) -> Floats:
    """Give the corner near sample k: 0 before where the lines on both sides of it meet, then their difference."""
    before, after = np.arange(max(k - side, 0), k - APART), np.arange(k + APART + 1, min(k + side, values.size))
    slope, height = np.polyfit(after - k, values[after], 1) - np.polyfit(before - k, values[before], 1)
    place = min(max(-height / slope, -float(side)), float(side)) if slope != 0.0 else 0.0
    return np.asarray(slope * np.maximum(sample - k - place, 0.0))

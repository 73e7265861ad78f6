"""Search for lines at any order: a coarse spectrum over the angle, then continuous refinement.

Samples are uneven in angle, so that the residual is summed into fine angle bins over the whole travel of all runs and
transformed once; peaks are judged against the median of their neighbourhood, so that coloured noise makes none. The
spectrum only proposes: size and significance come from exact columns (rig.loop.search.trial).
"""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.loop.fitting.normal import LinearPiece

Floats = NDArray[np.float64]

BINS_A_CYCLE = 3
"""Angle bins per cycle of the highest order."""

MOST_BINS = 1 << 23

NEIGHBOURHOOD = 301
"""Spectral points whose median is the level that a peak must stand out from."""

LEAST_CYCLES = 0.9
"""Cycles over the travel below which a line is a slope or a bow, not a line."""

HIGHEST_ORDER = 2000.0
USUAL_HIGHEST_ORDER = 200.0
"""Cycles per revolution searched at least where legs differ in speed, although a log may sample them less than twice:
at several speeds most aliases differ; those that do not are dealt with in `rig.loop.search.aliases`."""

OTHER_SPEED = 0.02
"""Relative difference from which legs differ in speed."""


@dataclass(frozen=True, slots=True)
class Peak:
    """A proposed order (cycles per revolution) and its power relative to the neighbourhood."""

    order: float
    height: float


@dataclass(frozen=True, slots=True)
class Spectrum:
    """A scan: orders and powers, shape (k,); `resolution` in cycles per revolution; `tests`: independent orders."""

    orders: Floats
    power: Floats
    resolution: float
    tests: float


def scan(items: Sequence[LinearPiece], variable: str, *, against_motion: bool = False) -> Spectrum | None:
    """Give the spectrum of the weighted residual of `items` over an angle; None where there is no travel."""
    angles, values = [], []
    for item in items:
        position = item.evaluation.positions.get(variable)
        if position is None:
            continue
        direction = item.evaluation.direction[item.piece.index] if against_motion else 1.0
        angles.append(position[item.piece.index])
        values.append(item.weight * item.residual * direction)
    if not angles:
        return None
    angle, value = np.concatenate(angles), np.concatenate(values)
    low, travel = float(angle.min()), float(np.ptp(angle))
    if travel < 1e-3:
        return None
    turning = [
        a
        for a, item in zip(angles, (i for i in items if variable in i.evaluation.positions), strict=True)
        if item.piece.track.moves
    ]
    steps = np.concatenate([np.abs(np.diff(a)) for a in turning or angles])
    moving = steps[steps > 0]
    finest = float(np.percentile(moving, 25)) if moving.size else travel
    sampled = 0.45 * 2.0 * np.pi / finest
    alone = variable == "time" or one_speed(items)
    highest = min(HIGHEST_ORDER, sampled if alone else max(USUAL_HIGHEST_ORDER, sampled))
    width = max(2.0 * np.pi / (BINS_A_CYCLE * highest), travel / MOST_BINS)
    bins = np.minimum((angle - low) / width, MOST_BINS).astype(np.int64)
    summed = np.bincount(bins, weights=value)
    size = 1 << (2 * summed.size - 1).bit_length()
    power: Floats = (np.abs(np.fft.rfft(summed, size)) ** 2).astype(np.float64)
    orders: Floats = np.arange(power.size, dtype=np.float64) * (2.0 * np.pi / (size * width))
    resolution = 2.0 * np.pi / travel
    keep = (orders >= LEAST_CYCLES * resolution) & (orders <= highest)
    return Spectrum(orders[keep], power[keep], resolution, max(1.0, 2.0 * highest / resolution))


def one_speed(items: Sequence[LinearPiece]) -> bool:
    """Whether all turning samples were taken at one speed."""
    speeds = [np.abs(item.piece.track.speed[item.piece.index]) for item in items if item.piece.track.moves]
    if not speeds:
        return False
    slowest, fastest = min(float(s.min()) for s in speeds), max(float(s.max()) for s in speeds)
    return fastest <= (1.0 + OTHER_SPEED) * slowest


def peaks(spectrum: Spectrum, count: int) -> tuple[Peak, ...]:
    """Give the `count` highest peaks, at least one resolution apart, highest first."""
    if spectrum.power.size == 0:
        return ()
    height = spectrum.power / _level(spectrum.power)
    found: list[Peak] = []
    for place in np.argsort(height)[::-1]:
        order = float(spectrum.orders[place])
        if all(abs(order - other.order) > spectrum.resolution for other in found):
            found.append(Peak(order, float(height[place])))
        if len(found) == count:
            break
    return tuple(found)


def _level(power: Floats) -> Floats:
    """Give the median of the neighbourhood of every point, by segments."""
    edges = np.arange(0, power.size + NEIGHBOURHOOD, NEIGHBOURHOOD)
    medians = np.array([np.median(power[a:b]) for a, b in itertools.pairwise(edges) if a < power.size])
    centres = edges[: medians.size] + NEIGHBOURHOOD / 2
    level = np.interp(np.arange(power.size), centres, medians)
    return np.asarray(np.maximum(level, 1e-12 * max(float(power.max()), 1e-300)))


def refine(gain: Callable[[float], float], order: float, resolution: float) -> float:
    """Maximise `gain` near `order`: by the vertex of a parabola through three orders, then through three close to it.

    The gain of a line falls off with the square of its distance from the best order, up to half a resolution.
    """
    best = order
    for reach in (0.5 * resolution, 0.1 * resolution):
        low = max(best - reach, 1e-6)
        middle, high = low + reach, low + 2.0 * reach
        at = [gain(low), gain(middle), gain(high)]
        bend = at[0] - 2.0 * at[1] + at[2]
        shift = 0.5 * (at[0] - at[2]) / bend if bend < 0.0 else float(np.sign(at[2] - at[0]))
        best = middle + reach * min(max(shift, -1.0), 1.0)
    return best

"""Search for lines at any order: a coarse spectrum over the angle, then continuous refinement.

Samples are uneven in angle, so that the residual is summed into fine angle bins over the whole travel of all runs and
transformed once; peaks are judged against the median of their neighbourhood, so that coloured noise makes none. The
spectrum only proposes: size and significance come from exact columns (rig.loop.search.trial).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from rig.loop.fitting.fit import Fit
from rig.loop.fitting.normal import Kind, LinearPiece

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

SHARES = np.linspace(0.0, 1.0, 101)
"""Shares of a piece's steps by which they are told."""

MOST_STEPS = 0.9
"""Share of the steps by which samples are judged."""

OTHER_SPEED = 0.02
"""Relative difference from which legs differ in speed."""


class Times(StrEnum):
    """What the residual is multiplied by before it is scanned: a line that flips with it would cancel otherwise."""

    NOTHING = "nothing"
    DIRECTION = "direction"
    TORQUE = "output torque"


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


@dataclass(frozen=True, slots=True)
class _Travel:
    """An angle in a piece: extremes (rad), and the steps between samples at even shares of all that are not 0 (rad)."""

    low: float
    high: float
    moves: bool
    steps: Floats
    moving: int


def scan(
    fit: Fit, kind: Kind, variable: str, *, times: Times = Times.NOTHING, turning_only: bool = False
) -> Spectrum | None:
    """Give the spectrum of the weighted residual over an angle, of the pieces of a kind; None where there is no travel.

    `turning_only`: of runs that turn alone.
    """
    seen = fit.linear.map(_travel, kind, variable, turning_only)
    known = [one for one in seen if one is not None]
    if not known:
        return None
    low, travel = min(one.low for one in known), max(one.high for one in known) - min(one.low for one in known)
    if travel < 1e-3:
        return None
    finest = _finest([one for one in known if one.moves] or known) or travel
    sampled = 0.45 * 2.0 * np.pi / finest
    alone = variable == "time" or one_speed(fit, kind)
    highest = min(HIGHEST_ORDER, sampled if alone else max(USUAL_HIGHEST_ORDER, sampled))
    width = max(2.0 * np.pi / (BINS_A_CYCLE * highest), travel / MOST_BINS)
    summed = np.zeros(int(min(travel / width, MOST_BINS)) + 1)
    for bins in fit.linear.map(_binned, kind, variable, turning_only, times, low, width):
        if bins is not None:
            np.add.at(summed, bins[0], bins[1])
    size = 1 << (2 * summed.size - 1).bit_length()
    power: Floats = (np.abs(np.fft.rfft(summed, size)) ** 2).astype(np.float64)
    orders: Floats = np.arange(power.size, dtype=np.float64) * (2.0 * np.pi / (size * width))
    resolution = 2.0 * np.pi / travel
    keep = (orders >= LEAST_CYCLES * resolution) & (orders <= highest)
    return Spectrum(orders[keep], power[keep], resolution, max(1.0, 2.0 * highest / resolution))


def _angle(item: LinearPiece, kind: Kind, variable: str, turning_only: bool) -> Floats | None:
    if item.piece.kind != kind or (turning_only and not item.piece.track.moves):
        return None
    position = item.evaluation.positions.get(variable)
    return None if position is None else position[item.piece.index]


def _travel(item: LinearPiece, kind: Kind, variable: str, turning_only: bool) -> _Travel | None:
    angle = _angle(item, kind, variable, turning_only)
    if angle is None:
        return None
    steps = np.abs(np.diff(angle))
    moving = steps[steps > 0]
    shares = np.quantile(moving, SHARES) if moving.size else moving
    return _Travel(float(angle.min()), float(angle.max()), item.piece.track.moves, shares, moving.size)


def _finest(known: Sequence[_Travel]) -> float:
    """Give the step that a quarter of all steps are shorter than, rad; 0 where nothing moves."""
    some = [one for one in known if one.moving]
    if not some:
        return 0.0
    steps = np.concatenate([one.steps for one in some])
    counts = np.concatenate([np.full(one.steps.size, one.moving / one.steps.size) for one in some])
    order = np.argsort(steps)
    return float(steps[order][np.searchsorted(np.cumsum(counts[order]), 0.25 * counts.sum())])


def _binned(
    item: LinearPiece, kind: Kind, variable: str, turning_only: bool, times: Times, low: float, width: float
) -> tuple[NDArray[np.intp], Floats] | None:
    """Sum the weighted residual into bins of an angle: their numbers and the sums, of those that hold any."""
    angle = _angle(item, kind, variable, turning_only)
    if angle is None:
        return None
    factor = _factor(item, times)
    bins = np.minimum((angle - low) / width, MOST_BINS).astype(np.intp)
    first = int(bins.min())
    sums = np.bincount(bins - first, weights=item.weight * item.residual * factor)
    held = np.flatnonzero(sums)
    return (held + first).astype(np.intp), np.asarray(sums[held], dtype=float)


def _factor(item: LinearPiece, times: Times) -> Floats | float:
    match times:
        case Times.DIRECTION:
            return item.evaluation.direction[item.piece.index]
        case Times.TORQUE:
            return item.evaluation.torque[item.piece.index]
        case _:
            return 1.0


def averaged_over(fit: Fit, variable: str) -> float:
    """Give what most samples of runs that do not turn, which are means, may be averaged over, rad; 0 without any."""
    return max(fit.linear.map(_usual_step, variable), default=0.0)


def _usual_step(item: LinearPiece, variable: str) -> float:
    position = item.evaluation.positions.get(variable)
    if item.piece.track.moves or position is None or item.piece.index.size < 2:
        return 0.0
    return float(np.quantile(np.abs(np.diff(position[item.piece.index])), MOST_STEPS))


def one_speed(fit: Fit, kind: Kind) -> bool:
    """Whether all turning samples of a kind of piece were taken at one speed."""
    speeds = [pair for pair in fit.linear.map(_speeds, kind) if pair is not None]
    if not speeds:
        return False
    slowest, fastest = min(pair[0] for pair in speeds), max(pair[1] for pair in speeds)
    return fastest <= (1.0 + OTHER_SPEED) * slowest


def _speeds(item: LinearPiece, kind: Kind) -> tuple[float, float] | None:
    if item.piece.kind != kind or not item.piece.track.moves:
        return None
    speed = np.abs(item.piece.track.speed[item.piece.index])
    return float(speed.min()), float(speed.max())


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
    full = power.size - power.size % NEIGHBOURHOOD
    medians = np.median(power[:full].reshape(-1, NEIGHBOURHOOD), axis=1)
    medians = np.append(medians, np.median(power[full:])) if full < power.size else medians
    centres = (np.arange(medians.size) + 0.5) * NEIGHBOURHOOD
    level = np.interp(np.arange(power.size), centres, medians)
    return np.asarray(np.maximum(level, 1e-12 * max(float(power.max()), 1e-300)))


def refine(gains: Callable[[Sequence[float]], Sequence[float]], order: float, resolution: float) -> float:
    """Maximise a gain near `order`: by the vertex of a parabola through three orders, then through three close to it.

    The gain of a line falls off with the square of its distance from the best order, up to half a resolution.
    `gains` gives that of several orders.
    """
    best = order
    for reach in (0.5 * resolution, 0.1 * resolution):
        low = max(best - reach, 1e-6)
        at = gains([low, low + reach, low + 2.0 * reach])
        bend = at[0] - 2.0 * at[1] + at[2]
        shift = 0.5 * (at[0] - at[2]) / bend if bend < 0.0 else float(np.sign(at[2] - at[0]))
        best = low + reach * (1.0 + min(max(shift, -1.0), 1.0))
    return best

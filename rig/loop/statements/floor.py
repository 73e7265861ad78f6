"""The floor of an equation in a procedure: what noise alone leaves.

The rms of the difference of two replicates over sqrt(2), scaled to the runs in question by the ratio of their fast
noise; without replicates, quantisation and noise of the instruments, propagated through the model, as seen in the quiet
dwell before a run.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rig.config.dut import Dut
from rig.loop.fitting.normal import correlation_length
from rig.loop.model.equations import target_of
from rig.loop.model.prediction import Model
from rig.loop.statements.dwells import dwell_of, dwell_spread, instrument_square
from rig.loop.statements.residuals import Residual, aligned, pairs, rms

Floats = NDArray[np.float64]

BLOCK = 2.0
"""s over which squares are summed for the floor's interval."""

LEAST_SPREAD = 0.05
ONE_PAIR_SPREAD = 0.15
"""Relative half width of a floor from replicates at least, and from one pair: the noise of a few runs is not that of
all runs."""

ALL_NOISE = 1.1
"""Times the fast part of a residual up to which that of what was measured is noise, too."""

NONE_MISSING = 0.9
"""Share of the replicates' fast noise from which on none is missing;"""
UNSURE_MEDIAN = 4.0
"""by this over the root of the number of samples less: three standard deviations of the median of differences."""

COMPUTED_SPREAD = 0.25
"""Relative half width of a computed floor: quantisation is not quite uniform, a dwell is not quite a sweep."""

SAME_PERIOD = 1.2
"""Ratio up to which two logs are sampled alike."""

RECORDED_OTHERWISE = 2.0
"""By how much wider a floor's interval is if its replicates were recorded otherwise than the runs in question."""


@dataclass(frozen=True, slots=True)
class Floor:
    """rms that noise alone leaves, and its 95 % interval. `replicates`: measured, not computed."""

    rms: float
    low: float
    high: float
    replicates: bool


def floor_of(wanted: Sequence[Residual], known: Sequence[Residual], dut: Dut, model: Model) -> Floor | None:
    """Give the floor of the residuals `wanted` of one equation and procedure; `known`: all runs with replicates."""
    procedure = wanted[0].piece.track.procedure
    same = [residual for residual in known if residual.piece.track.procedure is procedure]
    found = pairs(same)
    measured, computed = _from_replicates(_alike(found, wanted), wanted), _computed(wanted, dut, model)
    if measured is None and computed is None:
        return _recorded_otherwise(found, wanted)
    if measured is None or computed is None or computed.rms <= measured.rms:
        return measured if measured is not None else computed
    # quantisation that repeats cancels between replicates: what is computed is the lower limit
    return Floor(computed.rms, min(measured.low, computed.low), max(measured.high, computed.high), True)


def pooled(floors: Iterable[tuple[Floor, int]]) -> Floor | None:
    """Join floors weighted by their numbers of samples."""
    known = list(floors)
    if not known:
        return None
    total = sum(count for _, count in known)

    def mean(values: Iterable[float]) -> float:
        return math.sqrt(sum(v**2 * count for v, (_, count) in zip(values, known, strict=True)) / total)

    return Floor(
        mean(f.rms for f, _ in known),
        mean(f.low for f, _ in known),
        mean(f.high for f, _ in known),
        all(f.replicates for f, _ in known),
    )


def _alike(found: Sequence[tuple[Residual, Residual]], wanted: Sequence[Residual]) -> list[tuple[Residual, Residual]]:
    """Keep the pairs whose noise is that of the runs in question: recorded as fast, and smoothed alike.

    A slower log holds more noise in every sample, and so does a torque in which no polyline was found.
    """
    periods = [residual.piece.track.period for residual in wanted]
    low, high = min(periods) / SAME_PERIOD, max(periods) * SAME_PERIOD
    smoothed = {_is_polyline(residual) for residual in wanted}
    return [
        pair
        for pair in found
        if all(low <= item.piece.track.period <= high and _is_polyline(item) in smoothed for item in pair)
    ]


def _recorded_otherwise(found: Sequence[tuple[Residual, Residual]], wanted: Sequence[Residual]) -> Floor | None:
    """Give the floor, within wide limits, from replicates whose noise is not that of the runs in question."""
    other = _from_replicates(found, wanted)
    if other is None:
        return None
    return replace(other, low=other.low / RECORDED_OTHERWISE, high=other.high * RECORDED_OTHERWISE)


def _is_polyline(residual: Residual) -> bool:
    return residual.piece.track.swept_torque is not None


def _from_replicates(found: Sequence[tuple[Residual, Residual]], wanted: Sequence[Residual]) -> Floor | None:
    blocks: list[Floats] = []
    replicates: list[Residual] = []
    for one, two in found:
        time, a, b = aligned(one, two)
        if time.size < 20:
            continue
        difference = (a - b) - (a - b).mean() if one.piece.demeaned else a - b
        starts = np.flatnonzero(np.diff(np.floor(time / BLOCK), prepend=-1.0))
        counts = np.diff(np.append(starts, time.size))
        # counts of two runs can be in antiphase: their difference then shows more noise than either run has
        excess = (
            max(float(np.mean(difference**2)) / float(np.mean(a**2 + b**2)), 1.0) if np.any(a) or np.any(b) else 1.0
        )
        blocks.append(np.add.reduceat(difference**2 / (2.0 * excess), starts) / counts)
        replicates += [one, two]
    if not blocks:
        return None
    squares = np.concatenate(blocks)
    mean_square = float(squares.mean())
    between = np.array([block.mean() for block in blocks])
    # a stretch in which one run goes another way counts once, however many blocks it has
    independent = squares.size / max(correlation_length(squares), 1.0) if squares.size > 1 else 1.0
    spread = 1.96 * float(squares.std(ddof=1)) / math.sqrt(independent) if squares.size > 1 else mean_square
    if between.size > 1:
        spread = max(spread, 1.96 * float(between.std(ddof=1)) / math.sqrt(between.size))
    # counts beat with the sampling, so that the fast part of an angle says nothing about its size
    scale = 1.0 if wanted[0].piece.demeaned else min(max(_noisier(wanted, replicates), 0.5), 2.0)
    seen = math.sqrt(mean_square)
    least = max(LEAST_SPREAD, ONE_PAIR_SPREAD / math.sqrt(between.size))
    relative = max(least, 0.5 * spread / mean_square if mean_square > 0 else 0.0)
    # the runs in question are a sample as well: by chance they may hold less noise than the replicates
    relative = math.hypot(relative, _own_spread(wanted))
    # that their noise is another is an estimate too, as unsure as it is far from one
    low, high = min(scale**2, 1.0) * max(1.0 - relative, 0.0), max(scale**2, 1.0) * (1.0 + relative)
    low, high = low * seen, high * seen
    if not wanted[0].piece.demeaned and _none_missing(_steps(wanted), _steps(replicates)):
        low = _as_small_as(low, wanted)
    return Floor(scale * seen, low, high, True)


def _noisier(wanted: Sequence[Residual], replicates: Sequence[Residual]) -> float:
    """Give how much more fast noise the residuals `wanted` have than the replicates.

    Where what was measured has no other fast part than noise it is asked, because a leak takes the noise from a
    residual and must not lower its own floor.
    """
    left, measured = _fast(replicates), _fast_of_target(replicates)
    if left == 0.0:
        return 1.0
    return _fast_of_target(wanted) / measured if 0.0 < measured < ALL_NOISE * left else _fast(wanted) / left


def _none_missing(own: Floats, noise: Floats) -> bool:
    """Whether neighbouring samples differ as those of noise do, single outliers of heavy tails apart."""
    if not own.size or not noise.size:
        return False
    size = np.median if np.median(noise) > 0.0 else rms  # a reading that is held steps in few samples
    unsure = UNSURE_MEDIAN / math.sqrt(min(own.size, noise.size))
    return bool(size(own) >= (NONE_MISSING - unsure) * size(noise))


def _steps(residuals: Sequence[Residual]) -> Floats:
    return np.concatenate([residual.step_sizes for residual in residuals])


def _as_small_as(low: float, wanted: Sequence[Residual]) -> float:
    """Give a floor's lower end, no higher than what is left: a leak takes fast noise as well.

    Where all of that is there, a smaller slow part, or fewer outliers, are the chance of a few swings.
    """
    return min(low, rms(np.concatenate([r.values for r in wanted])) * (1.0 - _own_spread(wanted)))


def _fast(residuals: Sequence[Residual]) -> float:
    return rms(np.array([residual.fast for residual in residuals]))


def _fast_of_target(residuals: Sequence[Residual]) -> float:
    return rms(np.array([residual.fast_of_target for residual in residuals]))


def _own_spread(wanted: Sequence[Residual]) -> float:
    """Give the relative 95 % half width of the rms of the residuals `wanted`, from blocks of time."""
    squares: list[float] = []
    for residual in wanted:
        starts = np.flatnonzero(np.diff(np.floor(residual.time / BLOCK), prepend=-1.0))
        counts = np.diff(np.append(starts, residual.time.size))
        squares += (np.add.reduceat(residual.values**2, starts) / counts).tolist() if starts.size else []
    mean = float(np.mean(squares)) if squares else 0.0
    if len(squares) < 2 or mean == 0.0:
        return 0.0
    return 0.5 * 1.96 * float(np.std(squares, ddof=1)) / math.sqrt(len(squares)) / mean


def _computed(wanted: Sequence[Residual], dut: Dut, model: Model) -> Floor | None:
    squares = []
    for residual in wanted:
        square = instrument_square(residual.piece, dut, model)
        if square is None:
            return None
        squares.append(square)
    size = math.sqrt(float(np.mean(squares)))
    spread = max(COMPUTED_SPREAD, *(dwell_spread(residual.piece) for residual in wanted))
    low = size * max(1.0 - spread, 0.0)
    if not wanted[0].piece.demeaned and _none_missing(_steps(wanted), _dwell_steps(wanted, model)):
        low = _as_small_as(low, wanted)
    return Floor(size, low, size * (1.0 + spread), False)


def _dwell_steps(wanted: Sequence[Residual], model: Model) -> Floats:
    """Give what `Residual.step_sizes` has of the dwells before the first motion, of what was measured."""
    quiet = [(target_of(x.piece, model.ratio), dwell_of(x.piece)) for x in wanted]
    known = [np.abs(np.diff(target[rows])) / math.sqrt(2.0) for target, rows in quiet if rows is not None]
    return np.concatenate(known) if known else np.zeros(0)

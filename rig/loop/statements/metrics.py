"""Errors of a model on runs at the full rate of their logs, per equation and procedure, and the floor below them.

The floor is what noise alone leaves: rms of the difference of two replicates over sqrt(2), scaled to the runs in
question by the ratio of their fast noise; without replicates, quantisation and noise of the instruments, propagated
through the model, as seen in the quiet dwell before a run.
"""

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rig.config.dut import Dut
from rig.loop.fitting.normal import correlation_length
from rig.loop.model.equations import Equation, Piece, target_of
from rig.loop.model.parameters import TYPICAL_RATIO
from rig.loop.model.prediction import Model, predict
from rig.loop.result import Errors
from rig.loop.signals.counts import count_of
from rig.loop.signals.tracks import SHARE_OF_A_TURN
from sim_backend.model.compliance import wave_generator_stiffness

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

MEDIAN_TO_SIGMA = 1.4826
"""Standard deviation of a normal variable over its median size."""

QUIET_TRAVEL = 2e-3
"""rad at the motor within which a run still dwells."""

RECORDED_OTHERWISE = 2.0
"""By how much wider a floor's interval is if its replicates were recorded otherwise than the runs in question."""

LOADED = 30.0
"""A torque that has left its first value by this many times its own noise is not a dwell."""

LEAST_DWELL = 2.0
"""s of dwell that tell something about noise."""


@dataclass(frozen=True, slots=True)
class Residual:
    """Residual (m,) of a piece at the samples that count, at `time` (m,)."""

    piece: Piece
    time: Floats
    values: Floats

    @property
    def fast(self) -> float:
        """Give the rms difference of neighbouring samples over sqrt(2): white noise without slow structure."""
        if self.values.size < 3:
            return 0.0
        step = np.diff(self.values)[np.diff(self.time) < 1.5 * self.piece.track.period]
        return float(np.sqrt(np.mean(step**2) / 2.0)) if step.size else 0.0

    @property
    def step_sizes(self) -> Floats:
        """Give the size of the differences of neighbouring samples over sqrt(2), (k,)."""
        step = np.diff(self.values)[np.diff(self.time) < 1.5 * self.piece.track.period]
        return np.abs(step) / math.sqrt(2.0)

    @property
    def fast_of_target(self) -> float:
        """Give the same of what was measured, whatever the model makes of it."""
        step = np.diff(self.piece.target)[np.diff(self.piece.index) == 1]
        return float(np.sqrt(np.mean(step**2) / 2.0)) if step.size else 0.0


@dataclass(frozen=True, slots=True)
class Floor:
    """rms that noise alone leaves, and its 95 % interval. `replicates`: measured, not computed."""

    rms: float
    low: float
    high: float
    replicates: bool


def residual_of(piece: Piece, model: Model, judge: Model | None = None) -> Residual:
    """Evaluate the piece where the law determines it; an angle's own constant is removed.

    `judge`: the model whose law decides which samples those are, so that two models are compared on the same ones.
    """
    evaluation = predict(piece, model)
    settled = (evaluation if judge is None else predict(piece, judge)).settled[piece.index]
    keep = settled if settled.any() else np.ones(piece.index.size, dtype=bool)
    rows = piece.index[keep]
    values = piece.target[keep] - evaluation.value[rows]
    if piece.demeaned:
        values = values - values.mean()
    return Residual(piece, piece.track.time[rows], values)


def errors(before: Sequence[Residual], after: Sequence[Residual], floor: Floor | None) -> Errors:
    """Pool the residuals of several pieces of one equation."""
    one, two = np.concatenate([r.values for r in before]), np.concatenate([r.values for r in after])
    return Errors(
        rms_before=_rms(one),
        rms_after=_rms(two),
        max_before=float(np.abs(one).max()),
        max_after=float(np.abs(two).max()),
        floor=None if floor is None else floor.rms,
        floor_ci95=None if floor is None else (floor.low, floor.high),
    )


def pairs(residuals: Sequence[Residual]) -> list[tuple[Residual, Residual]]:
    """Give the replicate pairs among residuals of one equation: neighbours within a group."""
    groups: dict[tuple[str, str], list[Residual]] = {}
    for residual in residuals:
        track = residual.piece.track
        if track.replicate is not None:
            groups.setdefault((track.replicate, track.procedure.value), []).append(residual)
    return [pair for members in groups.values() for pair in itertools.pairwise(members)]


def aligned(one: Residual, two: Residual) -> tuple[Floats, Floats, Floats]:
    """Give time, and both residuals at the samples that both have; runs of a pair are commanded alike in time."""
    period = one.piece.track.period
    a, b = np.round(one.time / period).astype(np.int64), np.round(two.time / period).astype(np.int64)
    common, at_a, at_b = np.intersect1d(a, b, return_indices=True)
    return np.asarray(common * period, dtype=float), one.values[at_a], two.values[at_b]


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


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0


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
    size = np.median if np.median(noise) > 0.0 else _rms  # a reading that is held steps in few samples
    unsure = UNSURE_MEDIAN / math.sqrt(min(own.size, noise.size))
    return bool(size(own) >= (NONE_MISSING - unsure) * size(noise))


def _steps(residuals: Sequence[Residual]) -> Floats:
    return np.concatenate([residual.step_sizes for residual in residuals])


def _as_small_as(low: float, wanted: Sequence[Residual]) -> float:
    """Give a floor's lower end, no higher than what is left: a leak takes fast noise as well.

    Where all of that is there, a smaller slow part, or fewer outliers, are the chance of a few swings.
    """
    return min(low, _rms(np.concatenate([r.values for r in wanted])) * (1.0 - _own_spread(wanted)))


def _fast(residuals: Sequence[Residual]) -> float:
    return _rms(np.array([residual.fast for residual in residuals]))


def _fast_of_target(residuals: Sequence[Residual]) -> float:
    return _rms(np.array([residual.fast_of_target for residual in residuals]))


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
        square = _instrument_square(residual, dut, model)
        if square is None:
            return None
        squares.append(square)
    rms = math.sqrt(float(np.mean(squares)))
    spread = max(COMPUTED_SPREAD, *(_dwell_spread(residual.piece) for residual in wanted))
    low = rms * max(1.0 - spread, 0.0)
    if not wanted[0].piece.demeaned and _none_missing(_steps(wanted), _dwell_steps(wanted, model)):
        low = _as_small_as(low, wanted)
    return Floor(rms, low, rms * (1.0 + spread), False)


def _dwell_steps(wanted: Sequence[Residual], model: Model) -> Floats:
    """Give what `Residual.step_sizes` has of the dwells before the first motion, of what was measured."""
    quiet = [(target_of(x.piece, model.ratio), dwell_of(x.piece)) for x in wanted]
    known = [np.abs(np.diff(target[rows])) / math.sqrt(2.0) for target, rows in quiet if rows is not None]
    return np.concatenate(known) if known else np.zeros(0)


def _dwell_spread(piece: Piece) -> float:
    """Give the relative 95 % half width of the rms of the torques in a dwell: of heavy tails it tells little."""
    quiet, track = dwell_of(piece), piece.track
    if quiet is None:
        return 0.0
    apart = [(values[quiet] - values[quiet].mean()) ** 2 for values in (track.T, track.M) if values is not None]
    known = [squares for squares in apart if squares.size > 1 and np.any(squares)]
    return max((0.5 * 1.96 * float(x.std(ddof=1) / x.mean()) / math.sqrt(x.size) for x in known), default=0.0)


def _instrument_square(residual: Residual, dut: Dut, model: Model) -> float | None:
    piece, track = residual.piece, residual.piece.track
    quiet = dwell_of(piece)
    if piece.equation is not Equation.TORSION:
        return None if quiet is None else float(np.var(target_of(piece, model.ratio)[quiet]))
    square = quantisation_square(piece, dut, model.ratio)
    if square is None or model.ratio is None:
        return None
    if quiet is None and (track.T is not None or track.M is not None):
        return None
    if track.T is not None and quiet is not None:
        noise = float(np.var(track.T[quiet])) * _averaged_away(piece)
        square += noise * float(np.mean((1.0 / model.flexspline_stiffness(track.T[piece.index])) ** 2))
    if track.M is not None and quiet is not None and not track.moves:
        softness = 1.0 / wave_generator_stiffness(track.M[piece.index], model.value("K_w0"), model.value("C_w"))
        square += float(np.var(track.M[quiet]) * np.mean((softness / model.ratio) ** 2))
    return square


def _averaged_away(piece: Piece) -> float:
    """Give the share of white noise that is left in the output torque of a turning run, averaged leg by leg."""
    track = piece.track
    if not track.moves:
        return 1.0
    width = SHARE_OF_A_TURN * 2.0 * math.pi / np.abs(track.speed[piece.index]) / track.period
    return float(np.mean(1.0 / np.maximum(np.round(width), 1.0)))


def quantisation_square(piece: Piece, dut: Dut, ratio: float | None) -> float | None:
    """Give the variance (rad**2) which the encoders' counts leave in the torsion, None where counts are unknown.

    Counts that the device file lacks are read off the steps of the angle.
    """
    motor, output, track = dut.motor.encoder_counts, dut.output.encoder_counts, piece.track
    if ratio is None:
        return None
    square = 0.0
    for position, count, gear in ((track.motor_position, motor, ratio), (track.output_position, output, 1.0)):
        step = 2.0 * math.pi / count if count is not None else _step_of(position)
        if step is None:
            return None
        if position is not None and np.ptp(position) > 3.0 * step:
            square += (step / gear) ** 2 / 12.0
    return square


def _step_of(position: Floats | None) -> float | None:
    return None if position is None else count_of([position])


def by_procedure(residuals: Sequence[Residual]) -> dict[tuple[str, str], list[Residual]]:
    """Group residuals by equation and procedure."""
    groups: dict[tuple[str, str], list[Residual]] = {}
    for residual in residuals:
        key = (residual.piece.equation.value, residual.piece.track.procedure.value)
        groups.setdefault(key, []).append(residual)
    return groups


def dwell_of(piece: Piece) -> slice | None:
    """Give the quiet samples before a run's first motion, None if there are too few."""
    track = piece.track
    angle = track.motor_position if track.motor_position is not None else track.output_position
    if angle is None:
        return None
    travel = QUIET_TRAVEL if track.motor_position is not None else QUIET_TRAVEL / TYPICAL_RATIO
    moved = np.abs(angle - angle[0]) > travel
    for torque in (track.output_torque, track.motor_torque):
        if torque is not None and torque.size > 3:
            # a sweep has slope in every sample, but no second difference
            noise = MEDIAN_TO_SIGMA * float(np.median(np.abs(np.diff(torque, 2)))) / math.sqrt(6.0)
            moved |= np.abs(torque - torque[0]) > LOADED * max(noise, 1e-3 * float(np.abs(torque).max()))
    places = np.flatnonzero(moved)
    end = int(places[0]) if places.size else angle.size
    end = round(0.8 * end)
    return slice(0, end) if end * track.period >= LEAST_DWELL else None

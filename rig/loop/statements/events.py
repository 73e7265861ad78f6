"""Single events in a torsion: steps that come at once and stay, found by a change-point search of the residual.

A counter that loses counts is off by whole counts from then on. A shape of the model that is missing also has
steps, but at the same place of the next run: what a replicate shows at the same time is no event.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from rig.config.dut import Dut
from rig.log.run import ProcedureName
from rig.loop.model.equations import Equation
from rig.loop.model.prediction import Model
from rig.loop.statements.colour import (
    STANDS,
    cleaned_away,
    encoder_counts,
    rows_of,
    slow_counts,
    slow_square,
    steeply_read,
)
from rig.loop.statements.dwells import MEDIAN_TO_SIGMA
from rig.loop.statements.residuals import Residual

Floats = NDArray[np.float64]

SIDE, LONG_SIDE = 1.0, 3.0
"""s on either side of a step over which its height is taken, and over which it must still be there."""

BEYOND = 1.1
"""Sides away at which it is looked whether a reading stands: nearer, what begins at the step is part of its speed."""

STANDS_OUT = 6.0
"""Times the typical difference of two such means that a step is high at least."""

LEAST_COUNTS = 0.7
OFF_WHOLE = 0.3
"""Counts that a step has at least, and by which it may miss a whole number of them."""

STAYS = 0.5
"""Share of a step's height that is left over the long sides."""

SUDDEN = 0.5
"""Share of what a clean step gains over a straight line that a step must gain: what rises slowly is no event."""

LONGEST_GAP = 0.1
"""s without samples across which nothing is a step."""

FEWEST = 10
"""Samples on either side of a step; a log with fewer in a second shows none."""

MOST_TRIED = 100
"""Steps of one run that are looked at; a residual with more of them is another kind of thing."""

AT_ONCE = 1.0
"""s within which steps of two replicates come at the same time."""

COARSE = 5.0
"""Counts of the motor's encoder, at the output, from which on one of the output's is coarse."""

WRONG_INPUT = 2.0
"""Times the step which the smoothing took from a torque that one of the torsion exceeds at least."""

EXPLAINED = 0.5
"""Share of the slow part's squares that is left at most when the events of a run are taken off."""


@dataclass(frozen=True, slots=True)
class Event:
    """A step of the torsion of one run: `time` s, `size` rad at the output, in `counts` of the motor's encoder."""

    run: str
    time: float
    size: float
    counts: int


def events_of(residuals: Sequence[Residual], dut: Dut, model: Model) -> list[tuple[Event, ...]]:
    """Give the events of every residual, in their order; none where the equation is no torsion.

    Of replicates only what no other of them has at the same time. Where most steps of a procedure's replicates come
    again, its steps are a shape that is missing, in the runs without a replicate too.
    """
    found = []
    for residual in residuals:
        counts = encoder_counts(residual.piece, dut, model.ratio)
        found.append(_steps(residual, model, counts) if counts is not None and counts[0] > 0.0 else ())
    kept = []
    groups = [(residual.piece.track.replicate, residual.piece.track.procedure) for residual in residuals]
    for number, events in enumerate(found):
        alone = groups[number][0] is None
        others = [other for k, other in enumerate(found) if k != number and not alone and groups[k] == groups[number]]
        kept.append(tuple(event for event in events if not any(_in(event, other) for other in others)))
    repeated = [k for k, (group, _) in enumerate(groups) if group is not None]
    shaped = set()
    for procedure in {groups[k][1] for k in repeated}:
        same = [k for k in repeated if groups[k][1] is procedure]
        steps, own = sum(len(found[k]) for k in same), sum(len(kept[k]) for k in same)
        if steps and 2 * own <= steps:
            shaped.add(procedure)
    return [() if groups[k][0] is None and groups[k][1] in shaped else some for k, some in enumerate(kept)]


def without_events(residual: Residual, events: Sequence[Event]) -> Residual:
    """Give the residual with the steps taken off and its mean removed again."""
    if not events:
        return residual
    values = residual.values.copy()
    for event in events:
        values[residual.time >= event.time] -= event.size
    return replace(residual, values=values - values.mean())


def _in(event: Event, others: Sequence[Event]) -> bool:
    return any(abs(event.time - other.time) < AT_ONCE and event.size * other.size > 0.0 for other in others)


def _steps(residual: Residual, model: Model, counts: tuple[float, float]) -> tuple[Event, ...]:
    """Take the highest step off, as long as one is left that stands out, comes at once and stays."""
    piece, values, count = residual.piece, residual.values.copy(), counts[0]
    period = piece.track.period
    side = round(SIDE / period)
    if piece.equation is not Equation.TORSION or side < FEWEST or values.size < 4 * FEWEST:
        return ()
    gaps = np.flatnonzero(np.diff(residual.time) > max(LONGEST_GAP, 1.5 * period)) + 1
    stretches = list(itertools.pairwise([0, *gaps.tolist(), values.size]))
    unsure = WRONG_INPUT * np.abs(_heights(cleaned_away(residual, model), stretches, side))
    unsure += WRONG_INPUT * maximum_filter1d(steeply_read(residual, model), 2 * side + 1)
    unsure += _readings(residual, counts, model)
    refused = np.zeros(values.size, dtype=bool)
    found: list[Event] = []
    for _ in range(MOST_TRIED):
        height = _heights(values, stretches, side)
        known = np.isfinite(height) & np.isfinite(unsure)
        typical = MEDIAN_TO_SIGMA * float(np.median(np.abs(height[known]))) if known.any() else 0.0
        candidates = np.where(known & ~refused, np.abs(height), 0.0)
        place = int(candidates.argmax())
        if candidates[place] < max(STANDS_OUT * typical, LEAST_COUNTS * count):
            break
        whole = round(float(height[place]) / count)
        first, last = next((a, b) for a, b in stretches if a <= place < b)
        clear = abs(whole) * count > unsure[place] + LEAST_COUNTS * count
        if clear and _is_step(values[first:last], place - first, whole * count, count, period):
            found.append(Event(piece.track.name, float(residual.time[place]), whole * count, whole))
            values[residual.time >= residual.time[place]] -= whole * count
        else:
            refused[max(place - side // 2, 0) : place + side // 2] = True
    events = tuple(sorted(found, key=lambda event: event.time))
    after = without_events(residual, events)
    return events if slow_square(after) < EXPLAINED * slow_square(residual) else ()


def _readings(residual: Residual, counts: tuple[float, float], model: Model) -> Floats:
    """Give by how much the rounding of the readings may shift the torsion at a sample, rad, (m,).

    A reading that stands, or whose counts beat with the samples, is off by up to half a count all the time; one that
    moves is right on average.
    """
    track, rows = residual.piece.track, rows_of(residual)
    half = max(round(BEYOND * SIDE / track.period), 1)
    low, high = np.maximum(rows - half, 0), np.minimum(rows + half - 1, track.size - 1)
    before = np.maximum(rows - 1, 0)
    found = np.zeros(rows.size)
    gears = (model.ratio or 1.0, 1.0)
    for position, count, gear in zip((track.motor_position, track.output_position), counts, gears, strict=True):
        if position is None or count == 0.0:
            continue
        angle = position / gear
        slow = slow_counts(angle, count, track.period)
        shift = count * np.sqrt(np.max([slow[low], slow[rows], slow[high]], axis=0))
        locked = track.procedure is ProcedureName.LOCKED_OUTPUT
        if gear == 1.0 and (locked or count < COARSE * counts[0]):
            # the motor's own step is what is looked for; an output that reads the same has none, unless it creeps
            # along within a coarse count
            stand = [np.abs(angle[a] - angle[b]) <= STANDS * count for a, b in ((before, low), (high, rows))]
            shift = np.where(stand[0] & stand[1], np.abs(angle[rows] - angle[before]), shift)
        found += shift
    return found


def _heights(values: Floats, stretches: Sequence[tuple[int, int]], side: int) -> Floats:
    """Give the mean after less the mean before every sample, over `side` samples, NaN at the ends of a stretch."""
    found = np.full(values.size, np.nan)
    for first, last in stretches:
        sums = np.concatenate([[0.0], np.cumsum(values[first:last])])
        here = np.arange(FEWEST, last - first - FEWEST + 1)
        low, high = np.maximum(here - side, 0), np.minimum(here + side, last - first)
        enough = (here - low >= side // 2) & (high - here >= side // 2)
        height = (sums[high] - sums[here]) / (high - here) - (sums[here] - sums[low]) / (here - low)
        found[first + here[here < last - first]] = np.where(enough, height, np.nan)[here < last - first]
    return found


def _is_step(values: Floats, place: int, size: float, count: float, period: float) -> bool:
    """Whether the step before the sample `place` is whole, sudden, and still there over the long sides."""
    side, long_side = round(SIDE / period), round(LONG_SIDE / period)
    left, right = values[max(place - side, 0) : place], values[place : place + side]
    height = float(right.mean() - left.mean())
    if abs(height - size) > OFF_WHOLE * count + 0.05 * abs(size):
        return False
    stays = float(values[place : place + long_side].mean() - values[max(place - long_side, 0) : place].mean())
    if stays / size < STAYS:
        return False
    both = np.concatenate([left, right])
    index = np.arange(both.size) - 0.5 * (both.size - 1)
    line = float(index @ both) ** 2 / float(index @ index)
    centred = both - both.mean()
    step = height**2 * left.size * right.size / both.size
    # what a straight line explains of a clean step of this height
    shape = np.where(np.arange(both.size) < left.size, 0.0, height)
    clean = step - float(index @ (shape - shape.mean())) ** 2 / float(index @ index)
    return bool(centred.any()) and step - line > SUDDEN * clean

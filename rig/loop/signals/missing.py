"""Rows and readings that a log lacks: rows are put back without values, slow channels are read between their readings.

All that follows counts samples, so that a log that lost every third row would be smoothed, and its plays followed, over
the wrong times.
"""

import zlib
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rig.log.run import Run
from rig.loop.signals.noise import MEDIAN_OF_SQUARE

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

ON_THE_GRID = 0.25
"""Periods by which a step of the time may miss a whole number of them."""

REGULAR = 0.95
"""Share of the steps that must do so: else the log was not sampled by the clock, and lacks no rows."""

TYPICAL = 10.0
"""Percentile of the steps that is the period: up to nine rows in ten may be missing."""

LONGEST = 60.0
"""s of a gap that is filled; what happened in a longer one nobody knows."""

TURNED = 0.3
"""s of a gap from which on the torque may have turned in it unseen."""

MOST = 4.0
"""Rows that are put back for each one that is there, at most."""

SLOW = 1.5
"""Samples between the readings of a channel, typically, from which on it is slower than the log."""

FEWEST_STEPS = 10
MOSTLY_HELD = 0.8
"""Changes that tell how a channel steps, and the share of them that must come after the same number of rows."""

LEAST_STEP = 1e-6
MANY_STEPS = 5.0
"""Least difference of steps, as a share of the largest step, that is no rounding; and how many of them a step of a
held channel is, typically."""

LOST = 2.5
"""Times that distance from which on a reading of a slow channel is missing."""


def filled(run: Run) -> Run:
    """Put rows of NaN where the log's own clock says that rows are missing; the rows that are there stay as they are.

    A log whose steps are no whole numbers of one period (sampled by an angle, or by a bad clock) is given back.
    """
    inserted = missing_times(run.time)
    if not inserted.size:
        return run
    time = np.concatenate([run.time, inserted])
    order = np.argsort(time)

    def longer(values: Floats) -> Floats:
        return np.concatenate([values, np.full(inserted.size, np.nan)])[order]

    return replace(
        run,
        time=time[order],
        signals={name: longer(values) for name, values in run.signals.items()},
        auxiliary={name: longer(values) for name, values in run.auxiliary.items()},
    )


def missing_times(time: Floats) -> Floats:
    """Give the times (s), shape (m,), at which rows are missing from `time` (n,)."""
    steps = np.diff(time)
    if steps.size < 3:
        return np.empty(0)
    period = float(np.percentile(steps, TYPICAL))
    short = steps <= LONGEST
    counts = np.where(short, np.round(steps / period), 1.0)
    on_the_grid = np.abs(steps - counts * period) <= ON_THE_GRID * period
    lacking = (counts - 1.0).clip(min=0.0).astype(np.intp)
    if not lacking.any() or on_the_grid[short].mean() < REGULAR or lacking.sum() > MOST * time.size:
        return np.empty(0)
    places = np.flatnonzero(lacking)
    parts = [time[k] + steps[k] * np.arange(1, lacking[k] + 1) / (lacking[k] + 1) for k in places.tolist()]
    return np.concatenate(parts)


def in_long_gaps(time: Floats, known: Flags) -> Flags:
    """Tell which rows (n,) of a filled run stand in a gap of a torque so long that its sweep may have turned in it.

    `known` (n,): the rows in which that torque is known; it may be missing alone, or with the whole row.
    """
    found = np.zeros(time.size, dtype=bool)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], (~known).astype(int), [0]])))
    for start, stop in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        found[start:stop] = time[stop - 1] - time[start] > TURNED
    return found


def unheld(values: Floats) -> Floats:
    """Give a channel (n,) that is read every few rows and held in between with its readings only, NaN between them.

    Held are steps of regular length, each of many of the channel's own least steps: a slow encoder steps by one count.
    """
    changes = np.flatnonzero(np.diff(values) != 0.0) + 1
    if changes.size < FEWEST_STEPS:
        return values
    apart = np.diff(changes)
    typical = float(np.median(apart))
    if typical < SLOW or float(np.mean(np.abs(apart - typical) < 1.0)) < MOSTLY_HELD:
        return values
    steps = np.unique(np.abs(np.diff(values)[changes - 1]))
    finest = np.diff(steps, prepend=0.0)
    finest = finest[finest > LEAST_STEP * steps[-1]]
    if float(np.median(steps)) < MANY_STEPS * float(finest.min()):
        return values
    found = np.full(values.size, np.nan)
    found[0] = values[0]
    found[changes] = values[changes]
    return found


def read_together(run: Run, names: Sequence[str]) -> Run:
    """Keep the rows of a sweep in which the slowest of its channels `names` was read.

    What stands between the readings of a slow torque is a line: it has less noise than a reading, and not its own.
    """
    signals = {name: unheld(run.signals[name]) if name in names else v for name, v in run.signals.items()}
    good = [np.isfinite(signals[name]) for name in names if name in signals]
    slow = [flags for flags in good if flags.sum() > 2 and float(np.median(np.diff(np.flatnonzero(flags)))) >= SLOW]
    if not slow:
        return run
    rows = min(slow, key=lambda flags: int(flags.sum()))
    return replace(
        run,
        time=run.time[rows],
        signals={name: values[rows] for name, values in signals.items()},
        auxiliary={name: values[rows] for name, values in run.auxiliary.items()},
    )


def known_between(good: Flags) -> Flags:
    """Tell at which samples (n,) a channel is known that has readings at `good` (n,).

    A channel that is read every few rows is known between its readings, by a straight line; of one that is read in
    every row a reading that lacks is missing.
    """
    places = np.flatnonzero(good)
    if places.size < 3:
        return good
    apart = np.diff(places)
    typical = float(np.median(apart))
    if typical < SLOW:
        return good
    known = np.zeros(good.size, dtype=bool)
    known[places] = True
    for start, width in zip(places[:-1].tolist(), apart.tolist(), strict=True):
        known[start : start + width] |= width < LOST * typical
    return known


def between(time: Floats, values: Floats, good: Flags, *, noisy: bool) -> Floats:
    """Give a channel (n,) with a straight line where it has no reading; `noisy`: with noise as large as its readings'.

    A torque is smoothed by what its noise is: a bare line would look like a noise that remembers, and the corners of
    the sweep would be cut. The noise is the same in every call with the same readings, and another one with others.
    """
    whole = np.interp(time, time[good], values[good])
    if not noisy or good.all():
        return np.asarray(whole)
    together = good[2:] & good[1:-1] & good[:-2]
    bends = (whole[2:] - 2.0 * whole[1:-1] + whole[:-2])[together]
    size = float(np.sqrt(np.median(bends**2) / MEDIAN_OF_SQUARE / 6.0)) if bends.size else 0.0
    noise = np.random.default_rng(zlib.crc32(values[good].tobytes())).standard_normal(time.size)
    return np.asarray(np.where(good, whole, whole + size * noise))

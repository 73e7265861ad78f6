"""Where a torque is not what the drive or the sensor shows: at a limit, cut off at the largest value it has, or stuck.

A drive at its torque limit says so in its status word. A sensor beyond its range, or one that has stuck, shows the same
value again and again, which a noisy channel otherwise never does.
"""

import itertools
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from rig.log.run import Run
from rig.loop.signals.living import TORQUES

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

LIMIT_ACTIVE = 1 << 11
"""Bit `internal limit active` of the CiA 402 status word."""

FEWEST_CUT, FEWEST_STUCK, STUCK = 5, 25, 1.0
"""Equal readings in a row that make a cut-off at the extreme, and a stuck channel anywhere, over s at least."""

TO_AND_FRO = 0.2
"""Share of successive changes of opposite sign from which on a channel has noise of its own: white noise gives 2/3."""

NOISY = 0.2
"""Share of neighbouring readings that are equal elsewhere, up to which a channel is noisy: a quantised one repeats
itself in every hold."""

FORGOTTEN = 0.25
"""Share of its range that a torque comes away from where it was cut off, until what it reached no longer matters:
twice the radius of the widest play behind it."""


def at_limit(run: Run) -> Flags:
    """Tell at which samples (n,) the drive says that its torque limit is active."""
    words = run.signals.get("status_word")
    if words is None:
        return np.zeros(run.time.size, dtype=bool)
    return np.asarray((np.nan_to_num(words).astype(np.int64) & LIMIT_ACTIVE) != 0)


def cut_off(run: Run) -> Mapping[str, Flags]:
    """Give, for each torque that is cut off or has stuck, the samples (n,) at which it is."""
    found = {}
    for name in TORQUES:
        values = run.signals.get(name)
        if values is not None:
            flags = _cut(values, run.period)
            if flags.any():
                found[name] = flags
    return found


def doubtful_after(values: Floats, cut: Flags) -> Flags:
    """Tell at which samples (n,) a torque is cut off, or has not yet come away from where it was.

    The play behind it remembers a peak that nobody saw.
    """
    found = cut.copy()
    reach = FORGOTTEN * float(np.nanmax(values) - np.nanmin(values))
    ends = np.flatnonzero(cut[:-1] & ~cut[1:]) + 1
    for end in ends.tolist():
        away = np.flatnonzero(np.abs(values[end:] - values[end - 1]) > reach)
        found[end : end + int(away[0]) if away.size else values.size] = True
    return found


def _cut(values: Floats, period: float) -> Flags:
    cut = np.zeros(values.size, dtype=bool)
    known = values[np.isfinite(values)]
    if known.size < 2 * FEWEST_CUT or float(np.ptp(known)) == 0.0:
        return cut
    top, bottom = float(known.max()), float(known.min())
    edges = np.flatnonzero(np.diff(values, prepend=np.nan, append=np.nan) != 0.0)
    fewest = max(FEWEST_STUCK, STUCK / period) if _noisy_between(values) else values.size + 1
    for start, stop in itertools.pairwise(edges.tolist()):
        if stop - start >= (FEWEST_CUT if values[start] in (top, bottom) else fewest):
            cut[start:stop] = True
    elsewhere = ~cut[1:] & ~cut[:-1]
    repeats = np.diff(values)[elsewhere] == 0.0
    return cut if repeats.size and float(repeats.mean()) <= NOISY else np.zeros(values.size, dtype=bool)


def _noisy_between(values: Floats) -> bool:
    """Whether the readings go to and fro where they change: a commanded torque does not, and its holds are real."""
    steps = np.diff(values)
    steps = steps[np.isfinite(steps) & (steps != 0.0)]
    return steps.size > 1 and float((steps[1:] * steps[:-1] < 0.0).mean()) >= TO_AND_FRO

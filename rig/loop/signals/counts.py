"""The count of an encoder, read off the steps between samples: a log need not say it."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

FINEST = 1e-7
"""rad below which differences are rounding; the finest encoders of a bench have some 1e-6."""

READ = 1e-9
"""Share of the largest angle to which it is known, at most: logs in text have ten digits."""

FEWEST_STEPS, FEWEST_SIZES = 200, 5
"""Steps between samples, and different sizes of them, from which a grid is read."""

FEWEST_LONE = 50
"""Steps between samples that stand still, from which a grid is read, too: they are of one count. At a constant speed
every step may be of several."""

OFF = 0.1
"""Counts by which angles may miss the grid, rms; 0.29 is none at all."""


def count_of(positions: Sequence[Floats]) -> float | None:
    """Give the count (rad) of the encoder that these angles (n,) rad come from; None where no steps are seen."""
    steps = np.sort(np.concatenate([np.abs(np.diff(position)) for position in positions] or [np.zeros(0)]))
    gaps = np.diff(steps, prepend=0.0)
    gaps = gaps[gaps > FINEST]
    return _fitted(steps, float(gaps.min())) if gaps.size else None


def grid_of(angles: Sequence[Floats]) -> float | None:
    """Give the step (rad) of the grid on which these angles (n,) rad lie, to ten digits; None where they lie on none.

    Unlike `count_of` it asks for so many steps that the device file can be held against it.
    """
    angles = [angle for angle in angles if angle.size > 1]
    if not angles:
        return None
    read = max(FINEST, READ * max(float(np.abs(angle).max()) for angle in angles))
    steps = np.sort(np.concatenate([np.abs(np.diff(angle)) for angle in angles]))
    sizes = steps[np.flatnonzero(np.diff(steps, prepend=-1.0) > 2.0 * read)]
    several = np.count_nonzero(steps > 2.0 * read) >= FEWEST_STEPS and sizes.size >= FEWEST_SIZES
    if not several and sum(lone_steps(angle, 2.0 * read).size for angle in angles) < FEWEST_LONE:
        return None
    step = _fitted(steps, float(np.diff(sizes).min()))
    ways = np.sort(np.concatenate([np.abs(angle - angle[0]) for angle in angles]))
    return None if step is None else _fitted(ways, step)


def lone_steps(angle: Floats, least: float) -> Floats:
    """Give the steps (k,) rad of an angle (n,) rad, above `least`, that stand between samples without one."""
    steps = np.abs(np.diff(angle))
    moved = steps > least
    return np.asarray(steps[1:-1][moved[1:-1] & ~moved[:-2] & ~moved[2:]])


def _fitted(ways: Floats, step: float) -> float | None:
    """Fit the step to ways (n,) rad in ascending order, the shortest first, so that no way is a count out."""
    reach = 8.0 * step
    while True:
        some = ways[: np.searchsorted(ways, reach)]
        times = np.round(some / step)
        power = float(times @ times)
        if power > 0.0:
            step = float((some @ times) / power)
            if float(np.sqrt(np.mean((some[times > 0.0] / step - times[times > 0.0]) ** 2))) > OFF:
                return None
        if reach > ways[-1]:
            return step
        reach *= 4.0

"""The grid on which an angle lies in the log, against the counts of its encoder in the device file.

An encoder's angle is a whole number of counts. Where a log shows another grid, the counts are wrong, or the unit.
Means, rounded numbers and angles that lie on no grid say nothing.
"""

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from drivers.errors import DataError
from rig.config.dut import Dut
from rig.log.run import Run

Floats = NDArray[np.float64]

READ = 1e-9
"""Share of the largest angle to which it is known, at most: logs in text have ten digits."""

FINEST = 1e-7
"""rad below which differences are rounding; the finest encoders of a bench have some 1e-6."""

FEWEST_STEPS, FEWEST_SIZES = 200, 5
"""Steps between samples, and different sizes of them, from which a grid is read."""

FEWEST_LONE = 50
"""Steps between samples that stand still, from which a grid is read, too: they are of one count. At a constant speed
every step may be of several."""

ENOUGH = 20_000
"""Samples of a run that are looked at."""

OFF = 0.1
"""Counts by which angles may miss the grid, rms; 0.29 is none at all."""

SAME = 1e-3
"""Relative difference of counts that is none."""

WHOLE = 1e-7
"""Relative error with which the counts are read off a log."""

MEANS = 64
"""Most counts of which a mean is taken, so that the grid is finer by that."""

ROUNDED = 1e-5
"""Relative difference from a power of ten (times 1, 2 or 5) or of two in rad or degrees: the number was rounded."""

ENCODERS = {"motor_position": "motor.encoder_counts", "output_position": "output.encoder_counts"}


def check_counts(runs: Sequence[Run], dut: Dut) -> None:
    """Raise DataError where an angle lies on the grid of other counts than the device file's, or of degrees."""
    for name, given, found in _grids(runs, dut):
        if abs(found / given - 1.0) < SAME or _times(found, given) is not None:
            continue
        degrees = abs(math.degrees(found) / given - 1.0) < SAME
        if not degrees and abs(found - round(found)) > max(0.02, WHOLE * found):
            continue
        told = (
            "which are those counts if the angle is in degrees"
            if degrees
            else f"which is an encoder of {round(found)} counts per revolution"
        )
        raise DataError(
            f"device '{dut.name}'",
            f"encoder_counts = {given}, but {name} goes in steps of {2.0 * math.pi / found:.6g} rad, {told}",
            column=ENCODERS[name],
            value=given,
            expected=f"steps of {2.0 * math.pi / given:.6g} rad, or a log without steps",
            hint="Check the unit and the scale of the angle in the header or mapping."
            if degrees
            else "Correct the counts in the device file (after evaluation of all edges), or the scale of the angle.",
        )


def finer_grids(runs: Sequence[Run], dut: Dut) -> list[str]:
    """Give a warning for every angle whose grid is finer by a whole number: means of counts, or lines for edges."""
    return [
        f"{name} goes in steps of {2.0 * math.pi / found:.6g} rad, {times} to a count of {ENCODERS[name]} = {given}: "
        f"means of {times} samples, or the counts are {round(found)} (lines given for edges)."
        for name, given, found in _grids(runs, dut)
        if abs(found / given - 1.0) >= SAME and (times := _times(found, given)) is not None
    ]


def _times(found: float, given: float) -> int | None:
    """Give by which whole number a grid is finer than the counts; None where it is not."""
    times = round(found / given)
    return times if 1 < times <= MEANS and abs(found / given / times - 1.0) < 10.0 * WHOLE else None


def _grids(runs: Sequence[Run], dut: Dut) -> Iterator[tuple[str, int, float]]:
    """Give the angle, the counts of the device file, and those of the log, where both are known."""
    for name, given in (("motor_position", dut.motor.encoder_counts), ("output_position", dut.output.encoder_counts)):
        angles = [run.signals[name][:ENOUGH] for run in runs if name in run.signals and run.averaged == 1]
        step = grid_of([angle[np.isfinite(angle)] for angle in angles]) if given is not None else None
        if given is not None and step is not None and not _rounded(step):
            yield name, given, 2.0 * math.pi / step


def _rounded(step: float) -> bool:
    for unit in (1.0, math.pi / 180.0, 2.0 * math.pi):
        size = math.log10(step / unit) % 1.0
        if any(abs(size - math.log10(digit)) < ROUNDED for digit in (1, 2, 5, 10)):
            return True
        twos = math.log2(step / unit)
        if unit < 2.0 * math.pi and abs(twos - round(twos)) < ROUNDED:
            return True
    return False


def grid_of(angles: Sequence[Floats]) -> float | None:
    """Give the step (rad) of the grid on which these angles (n,) rad lie; None where they lie on none."""
    angles = [angle for angle in angles if angle.size > 1]
    if not angles:
        return None
    read = max(FINEST, READ * max(float(np.abs(angle).max()) for angle in angles))
    steps = np.sort(np.concatenate([np.abs(np.diff(angle)) for angle in angles]))
    sizes = steps[np.flatnonzero(np.diff(steps, prepend=-1.0) > 2.0 * read)]
    several = np.count_nonzero(steps > 2.0 * read) >= FEWEST_STEPS and sizes.size >= FEWEST_SIZES
    if not several and sum(_lone_steps(angle, 2.0 * read) for angle in angles) < FEWEST_LONE:
        return None
    step = _fitted(steps, float(np.diff(sizes).min()))
    ways = np.sort(np.concatenate([np.abs(angle - angle[0]) for angle in angles]))
    return None if step is None else _fitted(ways, step)


def _lone_steps(angle: Floats, read: float) -> int:
    """Give how many steps of an angle (n,) rad stand between samples that do not differ by more than `read`."""
    moved = np.abs(np.diff(angle)) > read
    return int(np.count_nonzero(moved[1:-1] & ~moved[:-2] & ~moved[2:]))


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

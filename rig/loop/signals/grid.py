"""The grid on which an angle lies in the log, against the counts of its encoder in the device file.

An encoder's angle is a whole number of counts. Where a log shows another grid, the counts are wrong, or the unit.
Means, rounded numbers and angles that lie on no grid say nothing.
"""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from drivers.errors import DataError
from rig.config.dut import Dut
from rig.log.run import Run
from rig.loop.signals.counts import grid_of

ENOUGH = 20_000
"""Samples of a run that are looked at."""

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

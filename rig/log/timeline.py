"""From columns of a file to a run: order of time, merged duplicates, gaps, and the facts that metadata carries."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from drivers.errors import DataError
from drivers.signals import INTEGER_SIGNALS, TIME
from rig.log.run import Floats, ProcedureName, Run, RunEvent
from rig.terminal import counted

Indices = NDArray[np.intp]

MAX_SECONDS = 1e9
"""Longest recording: 31 years. A longer one has its time in another unit."""

LEAST_SHARE = 0.01
"""Share of the samples that must have a time stamp of their own; where fewer do, the time is not what it seems."""

GAP_PERIODS = 5
"""A gap is where more than this many nominal periods are missing."""

GAPS = f"of more than {GAP_PERIODS} nominal periods"
"""What the note on the gaps of a run holds."""


def make_run(
    file: Path,
    time: Floats,
    signals: Mapping[str, Floats],
    auxiliary: Mapping[str, Floats],
    auxiliary_units: Mapping[str, str],
    metadata: Mapping[str, str],
    *,
    events: Sequence[RunEvent] = (),
    dut_text: str = "",
    bench_text: str = "",
    complete: bool = True,
    warnings: Sequence[str] = (),
    row_of: Callable[[int], int] = lambda index: index + 1,
    averaged: int = 1,
) -> Run:
    """Give the run for columns of shape (n,) whose `time` (s) may start anywhere and may contain equal stamps.

    `metadata` keys `procedure`, `replicate` and `start_angle` fill the fields of that name. `row_of` maps a sample's
    index to the row that an error names. `averaged`: samples of the log of which each of these is the mean. Raises
    DataError where time decreases, repeats itself nearly throughout or is too long, and where a count or status word
    is no whole number of its range.
    """
    check_order(time, file, row_of)
    _check_length(time, file, row_of)
    for name, column in signals.items():
        _check_whole(name, column, file, row_of)
    notes = list(warnings)
    signals, auxiliary = dict(signals), dict(auxiliary)
    merged_time, groups = _group_equal(time)
    check_stamps(len(time), len(merged_time), file)
    if groups is not None:
        count = len(time) - len(merged_time)
        notes.append(f"{counted(count, 'sample')} with the time stamp of the one before merged by mean")
        signals = {name: means(name, column, groups) for name, column in signals.items()}
        auxiliary = {name: means(name, column, groups) for name, column in auxiliary.items()}
    if not len(time):
        notes.append("the log holds no sample")
    start = merged_time[0] if len(merged_time) else 0.0
    # subtracting exactly zero keeps the time of a log that starts at zero as it is, to the bit
    relative = merged_time - start
    gaps = find_gaps(relative)
    if gaps:
        found = counted(len(gaps), "gap")
        notes.append(f"{found} {GAPS}, the first after {gaps[0]:.6g} s")
    return Run(
        name=file.stem,
        file=file,
        procedure=_procedure(metadata, notes),
        time=relative,
        signals=MappingProxyType(signals),
        replicate=metadata.get("replicate") or None,
        start_angle=_start_angle(metadata, notes),
        auxiliary=MappingProxyType(auxiliary),
        auxiliary_units=MappingProxyType(dict(auxiliary_units)),
        gaps=gaps,
        events=tuple(events),
        metadata=MappingProxyType(dict(metadata)),
        dut_text=dut_text,
        bench_text=bench_text,
        complete=complete,
        warnings=tuple(notes),
        averaged=averaged,
    )


def averaged(run: Run) -> Run:
    """Replace every two samples in turn of a run by their mean."""
    starts = np.arange(0, len(run.time), 2)
    time = means(TIME.name, run.time, starts)
    return replace(
        run,
        time=time,
        signals=MappingProxyType({name: means(name, column, starts) for name, column in run.signals.items()}),
        auxiliary=MappingProxyType({name: means(name, column, starts) for name, column in run.auxiliary.items()}),
        gaps=find_gaps(time),
        averaged=2 * run.averaged,
    )


def check_order(time: Floats, file: Path, row_of: Callable[[int], int]) -> None:
    """Raise DataError, with the row, where `time` (s, shape (n,)) is not finite or decreases."""
    bad = np.flatnonzero(~np.isfinite(time))
    if len(bad):
        index = int(bad[0])
        raise DataError(
            str(file), "time is not a finite number", column="time", row=row_of(index), value=float(time[index])
        )
    with np.errstate(over="ignore"):
        bad = np.flatnonzero(np.diff(time) < 0)
    if len(bad):
        index = int(bad[0]) + 1
        raise DataError(
            str(file),
            f"time decreases from {time[index - 1]:.9g} s to {time[index]:.9g} s",
            column="time",
            row=row_of(index),
            value=float(time[index]),
            expected="time that never decreases",
            hint="Cut the recording where the clock was reset, or sort it by time.",
        )


def _check_length(time: Floats, file: Path, row_of: Callable[[int], int]) -> None:
    if not len(time) or float(time[-1]) - float(time[0]) <= MAX_SECONDS:
        return
    raise DataError(
        str(file),
        f"the recording would last {float(time[-1]) - float(time[0]):.3g} s",
        column="time",
        row=row_of(len(time) - 1),
        value=float(time[-1]),
        expected=f"at most {MAX_SECONDS:.0e} s",
        hint="Check the unit of time.",
    )


def check_stamps(samples: int, stamps: int, file: Path) -> None:
    """Raise DataError if merging samples with equal time stamps would leave next to nothing of them."""
    if samples > 1 and (stamps == 1 or stamps < LEAST_SHARE * samples):
        raise DataError(
            str(file),
            f"the {samples} samples have only {counted(stamps, 'different time stamp')}",
            column="time",
            expected="a stamp for each sample",
            hint="Check the column, unit, scale and offset of time.",
        )


def _check_whole(name: str, column: Floats, file: Path, row_of: Callable[[int], int]) -> None:
    if name not in INTEGER_SIGNALS:
        return
    low, above = (-(2.0**63), 2.0**63) if name == "cycle" else (0.0, 2.0**32)
    with np.errstate(invalid="ignore"):
        bad = np.flatnonzero(~np.isnan(column) & ((column != np.floor(column)) | (column < low) | (column >= above)))
    if len(bad):
        index = int(bad[0])
        raise DataError(
            str(file),
            f"{column[index]:.9g} is no whole number from {int(low)} to {int(above) - 1}",
            column=name,
            row=row_of(index),
            value=float(column[index]),
            hint="Correct the column, give it another name, or leave it out.",
        )


def find_gaps(time: Floats) -> tuple[float, ...]:
    """Give the times (s) after which more than GAP_PERIODS nominal periods are missing; period: median step."""
    if len(time) < 3:
        return ()
    steps = np.diff(time)
    period = float(np.median(steps))
    # half a period of slack: jitter is no missing sample
    return tuple(float(t) for t in time[:-1][steps > (GAP_PERIODS + 1.5) * period])


def constant_columns(columns: Mapping[str, Floats]) -> tuple[str, ...]:
    """Name the real-valued columns, shape (n,), that hold one and the same value at all of two or more samples."""
    return tuple(
        name
        for name, column in columns.items()
        if name not in INTEGER_SIGNALS and len(column) > 1 and bool(np.all(column == column[0]))
    )


def _group_equal(time: Floats) -> tuple[Floats, Indices | None]:
    """Give the distinct times and, if any were equal, the index at which each distinct time starts."""
    if len(time) < 2 or bool(np.all(np.diff(time) > 0)):
        return time, None
    starts = np.flatnonzero(np.concatenate(([True], np.diff(time) > 0)))
    return time[starts], starts


def means(name: str, column: Floats, starts: Indices) -> Floats:
    """Give the means of a signal (n,) over the samples from each of `starts` to the next; the last of what is counted.

    A missing value (NaN) is left out of its mean.
    """
    if name in INTEGER_SIGNALS:
        # the mean of two status words is no status word: the last one counts
        last: Floats = column[np.append(starts[1:], len(column)) - 1]
        return last
    known = ~np.isnan(column)
    total = np.add.reduceat(np.where(known, column, 0.0), starts)
    count = np.add.reduceat(known.astype(np.float64), starts)
    single = np.diff(np.append(starts, len(column))) == 1
    mean = np.divide(total, count, out=np.full(len(starts), np.nan), where=count > 0)
    merged: Floats = np.where(single, column[starts], mean)
    return merged


def _procedure(metadata: Mapping[str, str], notes: list[str]) -> ProcedureName:
    text = metadata.get("procedure", "")
    try:
        return ProcedureName(text)
    except ValueError:
        said = f"procedure '{text[:40]}' is not known" if text else "no procedure is stated"
        notes.append(f"{said}: taken as 'other'")
        return ProcedureName.OTHER


def _start_angle(metadata: Mapping[str, str], notes: list[str]) -> float | None:
    text = metadata.get("start_angle", "")
    if not text:
        return None
    try:
        angle = float(text)
    except ValueError:
        angle = math.nan
    if math.isfinite(angle):
        return angle
    notes.append(f"start angle '{text[:40]}' is not a number of rad and was left out")
    return None

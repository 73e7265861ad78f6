"""Is each run a recording of its own, long enough, with a plausible time? Looked at before anything is made of it."""

from collections.abc import Sequence
from hashlib import blake2b

import numpy as np

from drivers.errors import DataError
from rig.log.run import Run

FEWEST_SAMPLES = 20
"""Samples below which a run tells neither a sign nor a gain and enters no equation."""

FEWEST_VALUES = 100
"""Different values of a signal that no two recordings share by chance; a held encoder gives one count over and over."""

SHORTEST_INTERVAL = 1e-6
"""s between samples; no bench samples faster, so that below it the unit of the time is wrong."""


def check_recordings(runs: Sequence[Run]) -> None:
    """Raise DataError for a time in another unit, and for a recording that is there under two names."""
    for run in runs:
        _check_interval(run)
    _check_copies(runs)


def too_short(runs: Sequence[Run]) -> tuple[str, ...]:
    """Give one warning for all runs of which nothing can be told."""
    short = [f"{run.name} ({run.time.size} samples)" for run in runs if run.time.size < FEWEST_SAMPLES]
    return (f"Too short, at least {FEWEST_SAMPLES} samples are needed: {', '.join(short)}.",) if short else ()


def _check_interval(run: Run) -> None:
    interval = float(np.median(np.diff(run.time))) if run.time.size > 1 else np.inf
    if interval < SHORTEST_INTERVAL:
        raise DataError(
            str(run.file),
            f"the samples are {interval:.3g} s apart, {run.time.size} of them in {run.time[-1]:.3g} s",
            column="time",
            value=interval,
            expected=f"at least {SHORTEST_INTERVAL:g} s between samples",
            hint="Check the unit of time, in the mapping or in the header.",
        )


def _check_copies(runs: Sequence[Run]) -> None:
    """Raise DataError for the first two runs whose time and signals are equal, sample by sample."""
    seen: dict[bytes, Run] = {}
    for run in runs:
        if not any(np.unique(values).size >= FEWEST_VALUES for values in run.signals.values()):
            continue
        first = seen.setdefault(_content(run), run)
        if first is not run:
            raise DataError(
                f"{first.name}, {run.name}",
                f"the two runs are the same recording: time and all signals are equal in {run.time.size} samples",
                expected="every recording once: a copy is no replicate, and held out it tells nothing",
                hint=f"Remove {run.file.name}, or give the log that was meant.",
            )


def _content(run: Run) -> bytes:
    """Give a digest of time and signals."""
    digest = blake2b(np.ascontiguousarray(run.time).tobytes())
    for name in sorted(run.signals):
        digest.update(name.encode())
        digest.update(np.ascontiguousarray(run.signals[name]).tobytes())
    return digest.digest()

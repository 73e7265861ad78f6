"""Is each run a recording of its own, long enough, with a plausible time? Looked at before anything is made of it."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import blake2b
from typing import Self

import numpy as np
from numpy.typing import NDArray

from drivers.errors import DataError
from rig.log.run import Run

FEWEST_SAMPLES = 20
"""Samples below which a run tells neither a sign nor a gain and enters no equation."""

FEWEST_VALUES = 100
"""Different values of a signal that no two recordings share by chance; a held encoder gives one count over and over."""

PROBES, MOST, NEARLY_ALL = 300, 0.5, 0.999
"""Samples of the shorter of two runs that are looked up first in the longer one, the share of all of them, and of those
in its time, that it has if both are one recording: two runs of commanded torques and encoder counts may share many."""

SPREAD = np.uint64(0x9E3779B97F4A7C15)
"""2^64 over the golden ratio: multiplied by it, values that differ in few bits differ in many."""

SHORTEST_INTERVAL = 1e-6
"""s between samples; no bench samples faster, so that below it the unit of the time is wrong."""


def check_recordings(runs: Sequence[Run]) -> None:
    """Raise DataError for a time in another unit, and for a recording that is there twice, whole or in part."""
    for run in runs:
        _check_interval(run)
    _check_copies(runs)
    _check_parts(runs)


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


def _check_parts(runs: Sequence[Run]) -> None:
    """Raise DataError for two runs of which the longer has most samples of the shorter: nearly all, while both last."""
    known = sorted((_Distinct.of(run) for run in runs), key=lambda samples: samples.keys.size)
    for part, whole in itertools.combinations(known, 2):
        count = part.keys.size
        if count < FEWEST_VALUES or part.run.signals.keys() != whole.run.signals.keys():
            continue
        if not part.shared(whole, PROBES) or not (shared := part.shared(whole, count)):
            continue
        raise DataError(
            f"{part.run.name}, {whole.run.name}",
            f"the two runs are of one recording: {shared} of the {count} distinct samples of {part.run.name} are in "
            f"{whole.run.name} too, all signals equal and as far apart in time",
            expected="every recording once: a part of it is no replicate, and held out it tells nothing",
            hint=f"Remove {part.run.file.name}, or give the log that was meant.",
        )


@dataclass(frozen=True, slots=True)
class _Distinct:
    """The samples of a run whose signals are equal to no other's: `keys` (n,), sorted, and their `time` (n,) in s."""

    run: Run
    keys: NDArray[np.uint64]
    time: NDArray[np.float64]

    @classmethod
    def of(cls, run: Run) -> Self:
        """Give those of `run`; each key is a hash of all signals, so that they are in no order of time."""
        keys = np.zeros(run.time.size, dtype=np.uint64)
        for name in sorted(run.signals):
            keys = (keys ^ np.ascontiguousarray(run.signals[name], dtype=float).view(np.uint64)) * SPREAD
            keys ^= keys >> np.uint64(32)
        order = np.argsort(keys)
        changes = np.concatenate([[True], np.diff(keys[order]) != 0, [True]])
        alone = order[changes[1:] & changes[:-1]]
        return cls(run, keys[alone], run.time[alone])

    def shared(self, other: Self, count: int) -> int:
        """Give how many of the first `count` samples `other` has too, all as much earlier or later; 0 unless most."""
        keys, time = self.keys[:count], self.time[:count]
        at = np.searchsorted(other.keys, keys).clip(max=other.keys.size - 1)
        later = (time - other.time[at])[other.keys[at] == keys]
        if later.size < MOST * keys.size:
            return 0
        shift = float(np.median(later))
        shared = int(np.count_nonzero(np.abs(later - shift) < 0.5 * self.run.period))
        both_last = (time >= other.time.min() + shift) & (time <= other.time.max() + shift)
        return shared if shared >= max(MOST * keys.size, NEARLY_ALL * np.count_nonzero(both_last)) else 0

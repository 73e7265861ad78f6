"""One run as read from a file: time, signals as arrays, and the few facts that travel with them."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from rig.terminal import shortened

Floats = NDArray[np.float64]


class ProcedureName(StrEnum):
    """What was done on the bench, as written in logs and sidecar files."""

    STARTING_TORQUE = "starting-torque"
    LOCKED_OUTPUT = "locked-output"
    BACKDRIVE = "backdrive"
    FREE_RUN = "free-run"
    OTHER = "other"


SWEEPS = (ProcedureName.LOCKED_OUTPUT, ProcedureName.BACKDRIVE)
"""Procedures that sweep a torque while a shaft is held."""


@dataclass(frozen=True, slots=True)
class RunEvent:
    """Something that happened at `time` (s since the run's first sample): a phase, a limit, an operator's word."""

    time: float
    kind: str
    text: str


ENDINGS: Mapping[str, str] = MappingProxyType(
    {
        "done": "went as planned",
        "limit": "was ended by a limit",
        "fault": "was ended by a fault",
        "aborted": "was aborted",
        "error": "ended in an error",
    }
)
"""What each status of a log's outcome says of the run."""

LONGEST_REASON = 160
"""Letters of a reason that a warning repeats; `rig show` prints all."""


@dataclass(frozen=True, slots=True)
class Run:
    """One log.

    `time`: s since the first sample, shape (n,), strictly increasing. `signals`: contract name to SI values,
    shape (n,); a signal that was not recorded is absent; NaN marks samples at which it was missing.
    `auxiliary`: further columns under their own name, with `auxiliary_units` as written. `replicate`: name of the
    group of runs that repeat the same conditions, or None. `start_angle`: rad, or None. `gaps`: times (s) after
    which more than 5 nominal periods are missing. `metadata`: plain text facts (run id, operator, ...).
    `dut_text`, `bench_text`: the attached files as written, "" where there are none.
    `complete`: False if the log was cut off; an aborted run whose log was closed is complete, see `ending`.
    `averaged`: samples of the log of which each sample here is the mean; 1 unless the log was too large to be kept.
    """

    name: str
    file: Path
    procedure: ProcedureName
    time: Floats
    signals: Mapping[str, Floats]
    replicate: str | None = None
    start_angle: float | None = None
    auxiliary: Mapping[str, Floats] = field(default_factory=lambda: MappingProxyType({}))
    auxiliary_units: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    gaps: tuple[float, ...] = ()
    events: tuple[RunEvent, ...] = ()
    metadata: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    dut_text: str = ""
    bench_text: str = ""
    complete: bool = True
    warnings: tuple[str, ...] = ()
    averaged: int = 1

    @property
    def period(self) -> float:
        """Typical time between samples, s; 1 of a single sample."""
        return float(np.median(np.diff(self.time))) if self.time.size > 1 else 1.0

    @property
    def status(self) -> str | None:
        """How the run ended, as the log says it (`done`, `aborted`, ...); None where it does not tell."""
        return self.metadata.get("outcome.status") or None

    @property
    def reason(self) -> str | None:
        """Why the run did not go as planned, as the log says it."""
        return self.metadata.get("outcome.error") or None

    @property
    def ending(self) -> str | None:
        """Say that the run did not go as planned or that its log was cut off, with the reason; None where it did."""
        if not self.complete:
            return "the log was cut off: how the run ended is not known"
        if self.status is None or self.status == "done":
            return None
        how = ENDINGS.get(self.status, f"ended as '{self.status}'")
        if self.reason is None:
            return f"the run {how}"
        first = self.reason.split(". ")[0].rstrip(".")
        return f"the run {how} ({shortened(first, LONGEST_REASON)})"


def averagings(runs: Iterable[Run]) -> tuple[str, ...]:
    """Give one warning for every run of whose log means are used."""
    return tuple(
        f"{run.name}: the log is too large to be kept whole; every {run.averaged} samples in turn are replaced by "
        f"their mean, {len(run.time)} in all. What repeats within some {4 * run.averaged} samples shows weaker."
        for run in runs
        if run.averaged > 1
    )


def endings(runs: Iterable[Run]) -> tuple[str, ...]:
    """Give one warning for every run that did not go as planned."""
    return tuple(f"{run.name}: {run.ending}." for run in runs if run.ending is not None)

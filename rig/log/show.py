"""What a log holds, in numbers: the content of `rig show`."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from types import MappingProxyType

import numpy as np

from drivers.signals import BY_NAME
from rig.log.run import Floats, Run, RunEvent

Plain = str | float | int | bool | None | list["Plain"] | dict[str, "Plain"]


@dataclass(frozen=True, slots=True)
class SignalSummary:
    """One signal: range and root mean square in `unit`; None where no sample is finite. `missing` in samples."""

    name: str
    unit: str
    auxiliary: bool
    minimum: float | None
    maximum: float | None
    rms: float | None
    missing: int


@dataclass(frozen=True, slots=True)
class Summary:
    """One run. `duration` s, `rate` Hz (from the median step, None below two samples).

    `complete`: the file was closed, whatever became of the run; `status`, `reason`: how the run ended and why. `late`
    counts late cycles, `missing` the cycle numbers that never came. None where the log does not tell.
    """

    name: str
    file: str
    procedure: str
    replicate: str | None
    start_angle: float | None
    complete: bool
    status: str | None
    reason: str | None
    samples: int
    duration: float
    rate: float | None
    late: int | None
    missing: int | None
    gaps: tuple[float, ...]
    signals: tuple[SignalSummary, ...]
    events: tuple[RunEvent, ...]
    metadata: Mapping[str, str]
    warnings: tuple[str, ...]

    def as_dict(self) -> dict[str, Plain]:
        """Give plain values for JSON."""
        plain: dict[str, Plain] = {
            name: getattr(self, name)
            for name in (
                "name", "file", "procedure", "replicate", "start_angle", "complete", "status", "reason", "samples",
                "duration", "rate", "late", "missing",
            )
        }  # fmt: skip
        plain["gaps"] = list(self.gaps)
        plain["signals"] = [asdict(item) for item in self.signals]
        plain["events"] = [asdict(item) for item in self.events]
        plain["metadata"] = dict(self.metadata)
        plain["warnings"] = list(self.warnings)
        return plain


def describe(run: Run) -> Summary:
    """Give the summary of a run."""
    steps = np.diff(run.time)
    signals = [_signal(name, BY_NAME[name].unit, False, column) for name, column in run.signals.items()]
    signals += [
        _signal(name, run.auxiliary_units.get(name, ""), True, column) for name, column in run.auxiliary.items()
    ]
    return Summary(
        name=run.name,
        file=str(run.file),
        procedure=str(run.procedure),
        replicate=run.replicate,
        start_angle=run.start_angle,
        complete=run.complete,
        status=run.status,
        reason=run.reason,
        samples=len(run.time),
        duration=float(run.time[-1]) if len(run.time) else 0.0,
        rate=_rate(steps),
        late=_late(run),
        missing=_missing_cycles(run),
        gaps=run.gaps,
        signals=tuple(signals),
        events=run.events,
        metadata=MappingProxyType(dict(run.metadata)),
        warnings=run.warnings,
    )


def _signal(name: str, unit: str, auxiliary: bool, column: Floats) -> SignalSummary:
    finite = column[np.isfinite(column)]
    if not len(finite):
        return SignalSummary(name, unit, auxiliary, None, None, None, len(column))
    return SignalSummary(
        name,
        unit,
        auxiliary,
        float(finite.min()),
        float(finite.max()),
        _rms(finite),
        len(column) - len(finite),
    )


def _rms(values: Floats) -> float:
    largest = float(np.abs(values).max())
    # squared as shares of the largest, since the square of a large number may be no number any more
    return largest * math.sqrt(np.mean((values / largest) ** 2)) if largest else 0.0


def _rate(steps: Floats) -> float | None:
    median = float(np.median(steps)) if len(steps) else 0.0
    return 1.0 / median if median > 1e-300 else None


def _late(run: Run) -> int | None:
    late = run.signals.get("late")
    return None if late is None else int(np.nansum(late))


def _missing_cycles(run: Run) -> int | None:
    cycle = run.signals.get("cycle")
    if cycle is None:
        return None
    steps = np.diff(cycle[np.isfinite(cycle)])
    return int(np.sum(steps[steps > 1] - 1))

"""One tree of errors for everything above the wire.

    RigError
    +-- ConfigError        2   a file or an option is wrong; every mistake at once
    +-- NotConnectedError  3   devices that did not answer
    +-- DriveFaultError    3   a drive reported a fault, refused a state or a mode, or rebooted
    |   +-- ReadingError   3   a device answers, but what it says cannot be true
    +-- LimitError         3   a safety limit was reached in motion
    +-- CycleError         3   too many late or missing cycles
    +-- RigTimeoutError    3   something awaited did not come (also a TimeoutError)
    +-- AbortedError       4   a person or a signal stopped the run
    +-- DataError          5   data unreadable, insufficient or leaking (also a ValueError)

The number is the exit code of the command line. A message is one paragraph: what, where, value and unit, the
limit, what was done, what to do next. The same facts are attributes, so that tests and `--json` can read them.
A failed verdict is a result, not an exception.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar


class RigError(Exception):
    """Root of the tree. `hint` says what to do next; `facts` are the numbers behind the message."""

    exit_code: ClassVar[int] = 3

    def __init__(self, message: str, *, hint: str = "", **facts: object) -> None:
        super().__init__(f"{message} {hint}".strip())
        self.message = message
        self.hint = hint
        self.facts: dict[str, object] = facts

    def __reduce__(self) -> tuple[object, ...]:
        """Travel between processes as made, whatever the constructor of a subclass takes."""
        return _restored, (type(self), self.args, self.__dict__)


def _restored(kind: "type[RigError]", args: tuple[object, ...], state: dict[str, object]) -> "RigError":
    error = kind.__new__(kind, *args)
    error.__dict__.update(state)
    return error


@dataclass(frozen=True, slots=True)
class Mistake:
    """One wrong entry of a configuration: where it stands, what was found, which rule it breaks."""

    path: str
    value: object
    rule: str

    def __str__(self) -> str:
        return f"{self.path} = {self.value!r}: {self.rule}"


class ConfigError(RigError):
    """Wrong use or configuration. Carries `source` (file or option) and every `mistakes` entry at once."""

    exit_code = 2

    def __init__(self, source: str, mistakes: Sequence[Mistake], *, hint: str = "") -> None:
        self.source = source
        self.mistakes = tuple(mistakes)
        count = f"{len(self.mistakes)} mistake{'s' if len(self.mistakes) != 1 else ''}"
        lines = "; ".join(str(m) for m in self.mistakes)
        super().__init__(
            f"{source}: {count}: {lines}.",
            hint=hint,
            source=source,
            mistakes=[{"path": m.path, "value": repr(m.value), "rule": m.rule} for m in self.mistakes],
        )


class NotConnectedError(RigError):
    """Devices that did not answer: `missing` maps device name to address and what was tried."""

    def __init__(self, missing: dict[str, str], *, hint: str = "") -> None:
        self.missing = dict(missing)
        lines = "; ".join(f"{name}: {tried}" for name, tried in self.missing.items())
        super().__init__(
            f"No answer from {len(self.missing)} device(s): {lines}.",
            hint=hint or "Check power, wiring, termination, bit rate and node ids in the bench file.",
            missing=self.missing,
        )


class DriveFaultError(RigError):
    """A drive is in fault, refused a command, or restarted.

    Attributes: `device`, `state` (CiA 402 state name), `error_code` and `error_register` as numbers (0 when
    the drive named none), `last_setpoint` in SI or None. A subclass for other devices changes
    `noun`; an empty state is left out of the message.
    """

    noun: ClassVar[str] = "Drive"

    def __init__(
        self,
        device: str,
        what: str,
        *,
        state: str = "unknown",
        error_code: int = 0,
        error_register: int = 0,
        last_setpoint: float | None = None,
        hint: str = "",
    ) -> None:
        self.device = device
        self.state = state
        self.error_code = error_code
        self.error_register = error_register
        self.last_setpoint = last_setpoint
        code = f" Error code 0x{error_code:04X}, error register 0x{error_register:02X}." if error_code else ""
        condition = f" (state: {state})" if state else ""
        super().__init__(
            f"{self.noun} '{device}' {what}{condition}.{code}",
            hint=hint,
            device=device,
            state=state,
            error_code=error_code,
            error_register=error_register,
            last_setpoint=last_setpoint,
        )


class ReadingError(DriveFaultError):
    """A device, drive or sensor, answers, but what it says cannot be true: it is frozen, or it jumped."""

    noun = "Device"


class LimitError(RigError):
    """A limit was reached in motion. Attributes: `signal`, `value`, `limit`, `unit`, `cycle`, `reaction`.

    `reaction` names the safe-state reaction that was carried out; `confirmed` says whether the drive reported it.
    """

    def __init__(
        self,
        signal: str,
        value: float,
        limit: float,
        unit: str,
        *,
        cycle: int | None = None,
        reaction: str = "",
        confirmed: bool | None = None,
        what: str = "",
        hint: str = "",
    ) -> None:
        self.signal = signal
        self.value = value
        self.limit = limit
        self.unit = unit
        self.cycle = cycle
        self.reaction = reaction
        self.confirmed = confirmed
        where = f" in cycle {cycle}" if cycle is not None else ""
        message = what or f"{signal} reached {value:.6g} {unit}{where}; the limit is {limit:.6g} {unit}."
        super().__init__(
            message,
            hint=hint,
            signal=signal,
            value=value,
            limit=limit,
            unit=unit,
            cycle=cycle,
            margin=limit - abs(value),
            reaction=reaction,
            confirmed=confirmed,
        )


class CycleError(RigError):
    """Too many late or missing cycles. Attributes: `late`, `missing`, `worst_age` (s), `limit` (cycles)."""

    def __init__(self, what: str, *, late: int, missing: int, worst_age: float, limit: int, hint: str = "") -> None:
        self.late = late
        self.missing = missing
        self.worst_age = worst_age
        self.limit = limit
        super().__init__(
            f"{what}: {late} late and {missing} missing cycles, oldest reading {worst_age * 1e3:.3g} ms; "
            f"the limit is {limit} cycles.",
            hint=hint,
            late=late,
            missing=missing,
            worst_age=worst_age,
            limit=limit,
        )


class RigTimeoutError(RigError, TimeoutError):
    """Something awaited did not come. Attributes: `awaited`, `waited` (s), `last_seen`."""

    def __init__(self, awaited: str, waited: float, *, last_seen: str = "nothing", hint: str = "") -> None:
        self.awaited = awaited
        self.waited = waited
        self.last_seen = last_seen
        super().__init__(
            f"Waited {waited:.3g} s for {awaited}; last seen: {last_seen}.",
            hint=hint,
            awaited=awaited,
            waited=waited,
            last_seen=last_seen,
        )


class AbortedError(RigError):
    """A person or a signal stopped the run. Attributes: `by`, `phase`, `confirmed` (safe state read back)."""

    exit_code = 4

    def __init__(self, by: str, *, phase: str = "", confirmed: bool | None = None, hint: str = "") -> None:
        self.by = by
        self.phase = phase
        self.confirmed = confirmed
        where = f", in phase '{phase}'" if phase else ""
        super().__init__(f"Aborted by {by}{where}.", hint=hint, by=by, phase=phase, confirmed=confirmed)


class DataError(RigError, ValueError):
    """Data unreadable, insufficient or leaking. Attributes: `file`, `column`, `row`, `value`, `expected`."""

    exit_code = 5

    def __init__(
        self,
        file: str,
        what: str,
        *,
        column: str | None = None,
        row: int | None = None,
        value: object = None,
        expected: str = "",
        hint: str = "",
    ) -> None:
        self.file = file
        self.column = column
        self.row = row
        self.value = value
        self.expected = expected
        place = "".join(
            [f", column '{column}'" if column is not None else "", f", row {row}" if row is not None else ""]
        )
        tail = f" Expected {expected}." if expected else ""
        super().__init__(
            f"{file}{place}: {what}.{tail}",
            hint=hint,
            file=file,
            column=column,
            row=row,
            value=None if value is None else str(value),
            expected=expected,
        )

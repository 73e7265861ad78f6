"""Signals that stop the program: outside of a run they end what it is doing at once.

During a run `rig.stop` takes them as requests instead. Once the end is being told, no further signal may cut it short.
This module imports next to nothing, so that the signals are taken care of before anything that takes time to import.
"""

import signal
from collections.abc import Callable
from types import FrameType

STOP_SIGNALS: tuple[signal.Signals, ...] = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK") if hasattr(signal, name)
)


class Interrupted(BaseException):
    """A stop signal came; `by` is its name. Not an Exception: nothing on its way may take it for a failure."""

    def __init__(self, by: str) -> None:
        super().__init__(by)
        self.by = by


def handled_signals() -> tuple[signal.Signals, ...]:
    """Give the stop signals, without a hang-up that whoever started the program chose to ignore (nohup)."""
    return tuple(s for s in STOP_SIGNALS if s.name != "SIGHUP" or signal.getsignal(s) is not signal.SIG_IGN)


def interrupt_on_signals() -> None:
    """Let each stop signal raise Interrupted."""
    _handle(_interrupt)


def ignore_signals() -> None:
    """Let no further stop signal disturb the end, which is near."""
    for number in STOP_SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def raised_interrupt() -> str | None:
    """Give the name of the stop signal that was raised as Interrupted and for which nobody has called ignore_signals.

    What was raised may have got lost in code that catches everything (C code that asks whether something exists,
    destructors), or have become another exception (a library that wraps whatever happens in it).
    """
    handler = signal.getsignal(signal.SIGTERM)
    return handler.by if isinstance(handler, _Raised) else None


def interrupt_if_unheard() -> None:
    """Raise Interrupted again if it got lost; before motion and between long stages."""
    by = raised_interrupt()
    if by is not None:
        raise Interrupted(by)


class _Raised:
    """Handler once Interrupted was raised: one signal that follows closely must not interrupt what tells the end."""

    def __init__(self, by: str) -> None:
        self.by = by
        self._one_passed = False

    def __call__(self, number: int, frame: FrameType | None) -> None:
        if self._one_passed:
            _interrupt(number, frame)
        self._one_passed = True


def _handle(handler: Callable[[int, FrameType | None], None]) -> None:
    for number in handled_signals():
        signal.signal(number, handler)


def _interrupt(number: int, _frame: FrameType | None) -> None:
    by = signal.Signals(number).name
    _handle(_Raised(by))
    raise Interrupted(by)

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


def _handle(handler: Callable[[int, FrameType | None], None]) -> None:
    for number in handled_signals():
        signal.signal(number, handler)


def _interrupt(number: int, _frame: FrameType | None) -> None:
    _handle(_let_one_pass)  # one that follows closely must not interrupt what takes care of this one
    raise Interrupted(signal.Signals(number).name)


def _let_one_pass(_number: int, _frame: FrameType | None) -> None:
    _handle(_interrupt)  # should the first have got lost in code that catches everything, the next counts again

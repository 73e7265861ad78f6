"""Signals during a run: they only set a flag, which the runner looks at in every cycle."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from drivers.errors import AbortedError
from rig.interrupt import handled_signals, ignore_signals, interrupt_if_unheard


class Stop:
    """Whether somebody asked to stop, and who. A second signal changes nothing."""

    def __init__(self) -> None:
        self.by: str | None = None

    def request(self, by: str) -> None:
        """Ask the run to stop at its next cycle."""
        if self.by is None:
            self.by = by

    def check(self, phase: str) -> None:
        """Raise AbortedError if a stop was asked for."""
        if self.by is not None:
            raise AbortedError(self.by, phase=phase)

    @contextmanager
    def listening(self) -> Iterator["Stop"]:
        """Turn the process's stop signals into requests while the block runs; after one, ignore all further."""

        def on_signal(number: int, _frame: FrameType | None) -> None:
            self.request(signal.Signals(number).name)

        interrupt_if_unheard()
        before = {number: signal.signal(number, on_signal) for number in handled_signals()}
        try:
            yield self
            self.check("end")
        finally:
            if self.by is not None:
                ignore_signals()
            else:
                for number, handler in before.items():
                    signal.signal(number, handler)

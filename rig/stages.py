"""What a long command is doing: told when a stage begins, and again while it lasts, so that silence means a fault."""

import sys
import threading
from collections.abc import Callable
from types import TracebackType
from typing import Self

from drivers.clock import Clock, RealClock
from rig.terminal import tell

TERMINAL, ELSEWHERE = 5.0, 15.0
"""s after which the stage is told again: to a person at a terminal, and to a file or a pipe that keeps every line."""


class Stages:
    """Call it with what is being done now; within its `with` block it says every now and then that this goes on.

    `every`: s between these lines; None: as often as stderr, a `terminal` or not, calls for.
    """

    def __init__(
        self, say: Callable[[str], None] = tell, every: float | None = None, terminal: bool | None = None
    ) -> None:
        self._say = say
        terminal = sys.stderr.isatty() if terminal is None else terminal
        self.every = (TERMINAL if terminal else ELSEWHERE) if every is None else every
        self._clock: Clock = RealClock()
        self._stage = ("", 0.0)
        self._told = 0.0
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._remind, name="stages", daemon=True)

    def __call__(self, text: str) -> None:
        """Tell that another stage begins."""
        self._say(text)
        self._stage = (text.removesuffix(" ..."), self._clock.now())

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._over.set()
        self._thread.join()

    def _remind(self) -> None:
        pause = self.every
        while not self._over.wait(pause):
            text, since = self._stage
            now = self._clock.now()
            pause = max(self._told, since) + self.every - now
            if pause <= 0.0:
                if text:
                    self._say(f"  {text}: {now - since:.0f} s so far")
                self._told, pause = now, self.every

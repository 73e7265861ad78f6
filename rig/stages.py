"""What a long command is doing: told when a stage begins, and again while it lasts, so that silence means a fault."""

import sys
import threading
from collections.abc import Callable
from types import TracebackType
from typing import Self, final

from drivers.clock import Clock
from rig.interrupt import interrupt_if_unheard
from rig.terminal import tell

TERMINAL, ELSEWHERE = 5.0, 15.0
"""s after which the stage is told again: to a person at a terminal, and to a file or a pipe that keeps every line."""


@final
class Stages:
    """Call it with what is being done now; within its `with` block it says every now and then that this goes on.

    `every`: s between these lines; None: as often as stderr, a `terminal` or not, calls for.
    """

    def __init__(
        self,
        clock: Clock,
        say: Callable[[str], None] = tell,
        every: float | None = None,
        terminal: bool | None = None,
    ) -> None:
        self._clock = clock
        self._say = say
        terminal = sys.stderr.isatty() if terminal is None else terminal
        self.every = (TERMINAL if terminal else ELSEWHERE) if every is None else every
        self._stage = ("", 0.0)
        self._over = False
        self._changed = threading.Event()
        self._thread = threading.Thread(target=self._remind, name="stages", daemon=True)

    def __call__(self, text: str) -> None:
        """Tell that another stage begins. Raises Interrupted if a stop signal came before it that was lost."""
        interrupt_if_unheard()
        self._say(text)
        self._stage = (text, self._clock.now())
        self._changed.set()

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._over = True
        self._changed.set()
        self._thread.join()

    def _remind(self) -> None:
        while not self._over:
            text, since = self._stage
            if self._changed.wait(self.every):
                self._changed.clear()
            elif text:
                self._say(f"  {text}: {self._clock.now() - since:.0f} s so far")

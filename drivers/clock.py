"""The one place where time is read or waited for.

`RealClock` paces by absolute deadlines, so that late cycles do not add up. `VirtualClock` shows the time of a
simulated bench and advances it instead of waiting. Time starts near zero and never goes backwards.
"""

import time
from typing import Protocol


class Clock(Protocol):
    """Monotonic seconds, and the wall-clock epoch of its zero."""

    def now(self) -> float:
        """Give the time in s since the clock's zero."""

    def sleep_until(self, deadline: float) -> None:
        """Wait until `now() >= deadline` (s); return at once if that has passed."""

    def epoch_ns(self) -> int:
        """Give the Unix time in ns at the clock's zero."""


class RealClock:
    """Wall-clock time."""

    def __init__(self) -> None:
        self._zero = time.perf_counter()
        self._epoch_ns = time.time_ns()

    def now(self) -> float:
        """Give the time in s since the clock was made."""
        return time.perf_counter() - self._zero

    def sleep_until(self, deadline: float) -> None:
        """Sleep until the absolute `deadline` (s)."""
        remaining = deadline - self.now()
        if remaining > 0:
            time.sleep(remaining)

    def epoch_ns(self) -> int:
        """Give the Unix time in ns at which the clock was made."""
        return self._epoch_ns


class SteppedTime(Protocol):
    """A simulated world whose time moves when it is told to."""

    @property
    def time(self) -> float:
        """Simulated time in s."""

    def advance_to(self, time: float) -> None:
        """Run the world up to `time` (s)."""


class VirtualClock:
    """The time of a simulated world; waiting runs the world."""

    def __init__(self, world: SteppedTime, epoch_ns: int | None = None) -> None:
        self._world = world
        self._epoch_ns = time.time_ns() if epoch_ns is None else epoch_ns

    def now(self) -> float:
        """Give the simulated time in s."""
        return self._world.time

    def sleep_until(self, deadline: float) -> None:
        """Run the simulated world up to `deadline` (s)."""
        if deadline > self._world.time:
            self._world.advance_to(deadline)

    def epoch_ns(self) -> int:
        """Give the Unix time in ns that stands for simulated zero."""
        return self._epoch_ns

"""A scripted CAN bus: it expects frames in order, plays the answers, and nothing may be left over.

A script is a list of lines (direction, identifier, data in hex, comment). ">" is sent by the bench, "<" by a device;
a "<" line is played as soon as everything above it has been sent.
"""

from collections import deque
from typing import Protocol

import can

Line = tuple[str, int, str, str]


class ManualClock:
    """Simulated seconds that move only when someone waits."""

    def __init__(self) -> None:
        self.time = 0.0

    def now(self) -> float:
        return self.time

    def sleep_until(self, deadline: float) -> None:
        self.time = max(self.time, deadline)

    def epoch_ns(self) -> int:
        return 0


class Time(Protocol):
    time: float


class ScriptedBus:
    """Plays one script; `recv` waits by moving the clock."""

    def __init__(self, script: list[Line], clock: Time) -> None:
        self._lines = deque(script)
        self._queue: deque[can.Message] = deque()
        self._clock = clock
        self._play()

    def send(self, message: can.Message) -> None:
        assert not message.is_extended_id
        assert not message.is_remote_frame
        frame = f"{message.arbitration_id:03X} {bytes(message.data).hex(' ')}".strip()
        assert self._lines, f"sent {frame} after the end of the script"
        direction, can_id, data, comment = self._lines.popleft()
        assert direction == ">"
        assert frame == f"{can_id:03X} {data}".strip(), f"expected: {comment}"
        self._play()

    def recv(self, timeout: float) -> can.Message | None:
        if self._queue:
            return self._queue.popleft()
        self._clock.time += timeout
        return None

    def finish(self) -> None:
        assert not self._lines, f"never sent: {self._lines}"
        assert not self._queue, f"never received: {[str(m) for m in self._queue]}"

    def _play(self) -> None:
        while self._lines and self._lines[0][0] == "<":
            _, can_id, data, _ = self._lines.popleft()
            self._queue.append(frame(can_id, data))


def frame(can_id: int, data: str) -> can.Message:
    """Give a data frame from hex text."""
    return can.Message(arbitration_id=can_id, data=bytes.fromhex(data), is_extended_id=False)

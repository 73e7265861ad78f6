"""The bench's own heartbeat, on which the drives' watchdogs rely.

It is sent by `CanopenBus.exchange` and by nothing else: no thread, no cyclic sender of the adapter. If the control
loop stops for any reason, the heartbeat stops with it and the drives stop by themselves (CiA 301, 0x1016).
"""

import math

import can

from drivers.canopen.link import Link

_OPERATIONAL = b"\x05"


class BenchHeartbeat:
    """Heartbeat producer `master_id`; at least every `watchdog_time` / 4 (s) if `beat` is called that often."""

    def __init__(self, link: Link, master_id: int, watchdog_time: float) -> None:
        self.watchdog_time = watchdog_time
        self._link = link
        self._period = watchdog_time / 4
        self._message = can.Message(arbitration_id=0x700 + master_id, data=_OPERATIONAL, is_extended_id=False)
        self._last = -math.inf
        self._ceased = False

    def beat(self, now: float) -> None:
        """Send the heartbeat if it is due at `now` (s)."""
        if now - self._last >= self._period and not self._ceased:
            self._link.send_message(self._message)
            self._last = now

    def cease(self) -> None:
        """Send no heartbeat any more, so that every drive's watchdog takes its torque away."""
        self._ceased = True

    def silence(self, now: float) -> float:
        """Give how long ago (s) the last heartbeat was sent, infinity if there was none."""
        return now - self._last

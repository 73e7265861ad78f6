"""Frames in and out of one python-can bus, routed by identifier. One owner, one thread.

Whoever waits for something pumps the bus meanwhile, so no frame is missed and no second thread is needed. Every
time-out is taken from the injected clock and handed to `recv`; a simulated transport advances its time there.
Any failure of the transport becomes a NotConnectedError that says "communication lost".
"""

from collections.abc import Callable

import can

from drivers.clock import Clock
from drivers.errors import NotConnectedError

MOST_WAITING = 100_000
"""Frames; a bus at 1 Mbit/s takes over 5 s for as many, so whoever finds more does not keep up with it."""

Handler = Callable[[bytearray], bool]
"""Takes the data of one frame; True if it was a process-data frame of this cycle that was still awaited."""


class Link:
    """The one user of a transport. `where` names it in messages; `devices` are those who lose their connection."""

    def __init__(self, transport: can.BusABC, clock: Clock, where: str, devices: tuple[str, ...]) -> None:
        self._transport = transport
        self._clock = clock
        self._where = where
        self._devices = devices
        self._handlers: dict[int, Handler] = {}
        self.error_frames = 0
        """How many error frames the interface has reported."""

    def route(self, can_id: int, handler: Handler) -> None:
        """Give all data frames with the 11-bit identifier `can_id` to `handler`."""
        self._handlers[can_id] = handler

    def send(self, can_id: int, data: bytes) -> None:
        """Send one data frame. Raises NotConnectedError if the transport fails."""
        self.send_message(can.Message(arbitration_id=can_id, data=data, is_extended_id=False))

    def send_message(self, message: can.Message) -> None:
        """Send a frame that was made before. Raises NotConnectedError if the transport fails."""
        try:
            self._transport.send(message)
        except (can.CanError, OSError) as error:
            raise self._lost(f"sending frame 0x{message.arbitration_id:03X}", error) from error

    def pump(self, timeout: float) -> bool:
        """Route one frame, waiting for it up to `timeout` (s). False if none came. Raises NotConnectedError."""
        try:
            message = self._transport.recv(timeout)
        except (can.CanError, OSError) as error:
            raise self._lost("receiving", error) from error
        if message is None:
            return False
        if message.is_extended_id or message.is_remote_frame or message.is_error_frame:
            self.error_frames += message.is_error_frame
        elif (handler := self._handlers.get(message.arbitration_id)) is not None:
            handler(message.data)
        return True

    def drain(self) -> None:
        """Route everything that has already arrived. Raises NotConnectedError, also if that never ends."""
        for _ in range(MOST_WAITING):
            if not self.pump(0.0):
                return
        raise self._lost("receiving", OverflowError(f"more than {MOST_WAITING} frames were waiting"))

    def wait(self, duration: float) -> None:
        """Route what arrives during `duration` (s). Raises NotConnectedError."""
        deadline = self._clock.now() + duration
        while (remaining := deadline - self._clock.now()) > 0 and self.pump(remaining):
            pass

    def collect(self, count: int, window: float) -> None:
        """Route frames until `count` awaited ones have come or `window` (s) has passed. Raises NotConnectedError."""
        if count <= 0:
            return
        now, recv, handlers = self._clock.now, self._transport.recv, self._handlers
        deadline = now() + window
        remaining = window
        # this loop sees every frame of a run, so it does by itself what `pump` does by calls
        while True:
            try:
                message = recv(remaining if remaining > 0.0 else 0.0)
            except (can.CanError, OSError) as error:
                raise self._lost("receiving", error) from error
            if message is None:
                return
            if message.is_extended_id or message.is_remote_frame or message.is_error_frame:
                self.error_frames += message.is_error_frame
            else:
                handler = handlers.get(message.arbitration_id)
                if handler is not None and handler(message.data):
                    count -= 1
                    if not count:
                        return
            remaining = deadline - now()

    def _lost(self, doing: str, error: Exception) -> NotConnectedError:
        return NotConnectedError(
            dict.fromkeys(self._devices, f"communication lost on {self._where} while {doing}: {error}"),
            hint="The drives stop by their own heartbeat watchdog. Check the adapter and the bus before going on.",
        )

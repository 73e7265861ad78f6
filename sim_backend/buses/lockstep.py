"""Threadless bus in lock-step with simulated time, as a python-can bus.

`send` hands a frame to all devices at once; their answers wait in the receive queue, stamped with simulated time.
`recv` gives a waiting frame, or lets the world run until there is one or the time-out has passed in simulated
time. Nothing reads a wall clock, so a run is the same bit for bit each time. One thread owns the bus: a reader
thread (can.Notifier) would let simulated time run away from whoever sends.
"""

import heapq
from collections import deque
from collections.abc import Callable, Sequence
from typing import Protocol

import can

from sim_backend.buses.hooks import MASTER, Delivery, Hook
from sim_backend.nodes.frame import Frame, Node, new_frame

BITRATE = 1_000_000
"""bit/s."""

SILENCE_LIMIT = 60.0
"""s of simulated time after which `recv` without a time-out gives up: in lock-step it would never return."""

CASCADE_LIMIT = 10_000
"""Frames that may follow from one another at one instant: more is a loop between devices."""


def frame_bits(size: int) -> int:
    """Give the bits on the wire of a data frame with an 11-bit identifier and `size` bytes, worst-case stuffing.

    34 + 8 size stuffable bits, at most one stuff bit per four after the first, 13 bits more with the gap.
    """
    stuffable = 34 + 8 * size
    return stuffable + (stuffable - 1) // 4 + 13


Listener = tuple[int, Callable[[float, int, bytes], Sequence[Frame]]]
"""Node id and `on_frame` of a device."""

_BITS = tuple(frame_bits(size) for size in range(9))


def _message(time: float, can_id: int, data: bytes) -> can.Message:
    """Give `can.Message(time, can_id, is_extended_id=False, data=data)`, at half the price: this is every frame."""
    message = _new_message(can.Message)
    message.timestamp = time
    message.arbitration_id = can_id
    message.is_extended_id = message.is_remote_frame = message.is_error_frame = False
    message.is_fd = message.bitrate_switch = message.error_state_indicator = False
    message.is_rx = True
    message.channel = None
    message.dlc = len(data)
    message.data = bytearray(data)
    return message


_new_message = can.Message.__new__


class SteppedWorld(Protocol):
    """What owns simulated time."""

    time: float
    """Simulated time, s."""

    def step_towards(self, deadline: float) -> None:
        """Advance to the next tick, or to `deadline` (s) if that comes first."""


class LockstepBus(can.BusABC):
    """A classic CAN bus with 11-bit identifiers. Made by `World`; extended and remote frames reach no device."""

    def __init__(self, world: SteppedWorld, nodes: Sequence[Node], bitrate: int = BITRATE) -> None:
        self.bitrate = bitrate
        self.bits = 0
        self.channel_info = "simulated bench, lock-step"
        self._world = world
        self._nodes = tuple(nodes)
        self._routes: dict[int, tuple[Listener, ...]] = {}
        for node in self._nodes:
            node.accepts_changed = self._routes.clear
        self._received: deque[can.Message] = deque()
        self._hooks: tuple[Hook, ...] = ()
        self._delayed: list[tuple[float, int, int, Frame]] = []
        self._delay_count = 0
        super().__init__(channel="lock-step")

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Hand one frame to all devices. Raises CanOperationError after shutdown, or for a CAN FD frame."""
        if self._is_shutdown:
            raise can.CanOperationError("the simulated bus was shut down; nothing was sent")
        if msg.is_fd:
            raise can.CanOperationError(f"frame 0x{msg.arbitration_id:X}: the simulated bus has no CAN FD")
        if not (msg.is_extended_id or msg.is_remote_frame or msg.is_error_frame):
            self.transmit(MASTER, new_frame((msg.arbitration_id, bytes(msg.data))))

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Give the next frame, or None after `timeout` s of simulated time.

        Raises CanOperationError after shutdown, and without a time-out after 60 s of silence.
        """
        if self._is_shutdown:
            raise can.CanOperationError("the simulated bus was shut down; nothing can be received")
        if self._received and self._filters is None:
            return self._received.popleft()
        if timeout == 0.0 and not self._received:
            return None
        deadline = None
        while True:
            while self._received:
                message = self._received.popleft()
                if self._filters is None or self._matches_filters(message):
                    return message
            now = self._world.time
            if deadline is None:
                deadline = now + (SILENCE_LIMIT if timeout is None else timeout)
            if now >= deadline:
                break
            self._world.step_towards(deadline)
        if timeout is None:
            raise can.CanOperationError(f"no frame within {SILENCE_LIMIT:g} s of simulated time")
        return None

    def transmit(self, sender: int, frame: Frame, *, disturbed: bool = False) -> None:
        """Put one frame on the bus, and what devices answer; `sender` is a node id, or MASTER.

        Hooks do not see a frame that they have already `disturbed`.
        """
        time = self._world.time
        routes = self._routes
        work = [(sender, frame)]
        # the list grows while it is walked: answers to answers follow in the order in which they were given
        for origin, sent in work:
            for can_id, data in self._disturb(origin, sent) if self._hooks and not disturbed else (sent,):
                self.bits += _BITS[len(data)]
                if origin != MASTER:
                    self._received.append(_message(time, can_id, data))
                for node_id, on_frame in routes[can_id] if can_id in routes else self._route(can_id):
                    if node_id != origin:
                        for answer in on_frame(time, can_id, data):
                            work.append((node_id, answer))
            if len(work) > CASCADE_LIMIT:
                raise can.CanOperationError(f"bus overload: more than {CASCADE_LIMIT} frames at one instant")
            disturbed = False

    def release(self) -> None:
        """Deliver the delayed frames whose time has come."""
        while self._delayed and self._delayed[0][0] <= self._world.time:
            _, _, sender, frame = heapq.heappop(self._delayed)
            self.transmit(sender, frame, disturbed=True)

    def load(self, seconds: float) -> float:
        """Give the bus load, 0 to 1 and above, if all `bits` so far had been sent within `seconds`."""
        if not seconds > 0:
            raise ValueError(f"a bus load needs a positive time, not {seconds} s")
        return self.bits / (self.bitrate * seconds)

    def add_hook(self, hook: Hook) -> None:
        """Let `hook` disturb the frames from now on."""
        self._hooks = (*self._hooks, hook)

    def remove_hook(self, hook: Hook) -> None:
        """Take a disturbance away again."""
        self._hooks = tuple(other for other in self._hooks if other is not hook)

    def shutdown(self) -> None:
        """Close the bus for its user; the devices live on."""
        self._received = deque(maxlen=0)
        super().shutdown()

    def __del__(self) -> None:
        """Warn of nothing: unlike python-can's own buses this one holds no thread, socket or adapter."""

    def send_periodic(self, *_args: object, **_kwargs: object) -> can.CyclicSendTaskABC:
        """Refuse: a cyclic sender runs on wall-clock time, which this bus does not know."""
        raise can.CanInterfaceNotImplementedError("the simulated lock-step bus has no cyclic sender")

    def _disturb(self, sender: int, frame: Frame) -> list[Frame]:
        travelling = [Delivery(frame)]
        for hook in self._hooks:
            travelling = [
                Delivery(after.frame, before.delay + after.delay)
                for before in travelling
                for after in hook(sender, before.frame)
            ]
        for delivery in travelling:
            if delivery.delay > 0:
                self._delay_count += 1
                due = self._world.time + delivery.delay
                heapq.heappush(self._delayed, (due, self._delay_count, sender, delivery.frame))
        return [delivery.frame for delivery in travelling if not delivery.delay > 0]

    def _route(self, can_id: int) -> tuple[Listener, ...]:
        listeners = tuple((node.node_id, node.on_frame) for node in self._nodes if can_id in node.accepts)
        self._routes[can_id] = listeners
        return listeners

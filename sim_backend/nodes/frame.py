"""A CAN data frame with an 11-bit identifier, and what the bus asks of a device."""

from collections.abc import Callable, Container, Sequence
from functools import partial
from typing import NamedTuple, Protocol


class Frame(NamedTuple):
    """One data frame: identifier 0 to 0x7FF, 0 to 8 bytes."""

    can_id: int
    data: bytes


new_frame = partial(tuple.__new__, Frame)
"""Make a frame of an (identifier, data) pair in half the time of `Frame(...)`; for what is sent every cycle."""

NO_FRAMES: tuple[Frame, ...] = ()
"""The common answer of a device that has nothing to say; shared, so that silence costs nothing."""


class Node(Protocol):
    """A device on the bus. Time is simulated, in s, and never goes backwards."""

    @property
    def node_id(self) -> int:
        """CANopen node id, 1 to 127."""

    @property
    def accepts(self) -> Container[int]:
        """Identifiers the device listens to now; the bus keeps other frames from it."""

    time: float
    """Kept up to date by the world, also while the device sleeps."""

    due: float
    """Instant (s) before which `tick` has nothing to do; the world lets the device sleep until then."""

    accepts_changed: Callable[[], None]
    """Set by the bus; the device calls it after each change of `accepts`."""

    def on_frame(self, time: float, can_id: int, data: bytes) -> Sequence[Frame]:
        """Hear one frame of another participant; give the frames it makes the device send."""

    def tick(self, time: float) -> Sequence[Frame]:
        """Let time pass; give the frames that are due."""

"""Disturbances of frames on a simulated bus: drop, delay, duplicate, corrupt, refuse to send.

A hook sees each frame with its sender before anyone else does and gives what really travels. Hooks are added
with `LockstepBus.add_hook`, see each other's results in that order, and are removed with `remove_hook`.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import can

from sim_backend.nodes.frame import Frame

MASTER = 0
"""Sender of the frames that come from the application."""


class Delivery(NamedTuple):
    """A frame that travels, and how much later (s) it arrives."""

    frame: Frame
    delay: float = 0.0


Hook = Callable[[int, Frame], Sequence[Delivery]]
Match = Callable[[int, Frame], bool]


def from_node(node_id: int) -> Match:
    """Match every frame that a node sends."""
    return lambda sender, _frame: sender == node_id


def process_data_of(node_id: int) -> Match:
    """Match the TPDOs that a node sends: identifiers between SYNC/EMCY/TIME and SDO."""
    return lambda sender, frame: sender == node_id and 0x180 < frame.can_id < 0x580


def drop(match: Match) -> Hook:
    """Lose the matching frames."""
    return _on(match, lambda _frame: ())


def delay(match: Match, seconds: float) -> Hook:
    """Let the matching frames arrive later."""
    return _on(match, lambda frame: (Delivery(frame, seconds),))


def duplicate(match: Match) -> Hook:
    """Let the matching frames arrive twice."""
    return _on(match, lambda frame: (Delivery(frame), Delivery(frame)))


def corrupt(match: Match, change: Callable[[Frame], Frame]) -> Hook:
    """Change the matching frames."""
    return _on(match, lambda frame: (Delivery(change(frame)),))


def refuse(match: Match, message: str) -> Hook:
    """Fail as an adapter does that has gone: CanOperationError in whoever sends or receives."""

    def fail(_frame: Frame) -> Sequence[Delivery]:
        raise can.CanOperationError(message)

    return _on(match, fail)


def _on(match: Match, act: Callable[[Frame], Sequence[Delivery]]) -> Hook:
    def hook(sender: int, frame: Frame) -> Sequence[Delivery]:
        return act(frame) if match(sender, frame) else (Delivery(frame),)

    return hook

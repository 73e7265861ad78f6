"""Heartbeat producer 0x1017 and consumer 0x1016 (CiA 301).

The consumer watches a producer from its first heartbeat on; a loss is reported once and watching starts again
with the next heartbeat.
"""

import math
from collections.abc import Callable

from sim_backend.nodes.object_dictionary import (
    AbortCode,
    AbortError,
    Access,
    DataType,
    ObjectDictionary,
    ObjectSpec,
    array,
)

CONSUMERS = 4
"""How many producers a device can watch."""

_MS = 1e-3
_STATES = frozenset((0x04, 0x05, 0x7F))


def heartbeat_specs() -> list[ObjectSpec]:
    """List the entries that producer and consumer serve."""
    entries = [
        ObjectSpec(0x1016, n, f"Consumer heartbeat time {n}", DataType.U32, Access.RW, high=0x007FFFFF)
        for n in range(1, CONSUMERS + 1)
    ]
    return [
        *array(0x1016, "Consumer heartbeat time", entries),
        ObjectSpec(0x1017, 0, "Producer heartbeat time (ms)", DataType.U16, Access.RW),
    ]


class HeartbeatProducer:
    """Says when the next heartbeat is due."""

    def __init__(self, dictionary: ObjectDictionary) -> None:
        self.due = math.inf
        self._time = dictionary[0x1017, 0]

    def start(self, now: float) -> None:
        """Begin a new period at `now` (s), or stop where the time is 0."""
        self.due = now + self._time.value * _MS if self._time.value else math.inf

    def next_period(self) -> None:
        """Go on from the nominal instant, so that lateness does not add up."""
        self.due += self._time.value * _MS


class HeartbeatConsumer:
    """Watches other nodes. `watched` maps node id to the time (s) within which it must be heard again."""

    def __init__(self, dictionary: ObjectDictionary, changed: Callable[[], None]) -> None:
        self.watched: dict[int, float] = {}
        self._deadlines: dict[int, float] = {}
        self._entries = [dictionary[0x1016, n] for n in range(1, CONSUMERS + 1)]
        self._changed = changed
        for position, entry in enumerate(self._entries):
            entry.check = self._checker(position)
            entry.changed = lambda _: self.configure()

    def configure(self) -> None:
        """Take over what the entries say; watching starts anew."""
        values = [entry.value for entry in self._entries]
        self.watched = {v >> 16 & 0x7F: (v & 0xFFFF) * _MS for v in values if v >> 16 & 0x7F and v & 0xFFFF}
        self._deadlines.clear()
        self._changed()

    def hear(self, node_id: int, data: bytes, now: float) -> bool:
        """Note a heartbeat; tell whether it is the first since watching started."""
        if len(data) != 1 or data[0] not in _STATES:
            return False
        first = node_id not in self._deadlines
        self._deadlines[node_id] = now + self.watched[node_id]
        return first

    @property
    def due(self) -> float:
        """Instant (s) at which the next producer counts as lost; infinite if none is watched."""
        return min(self._deadlines.values(), default=math.inf)

    def lost(self, now: float) -> bool:
        """Tell whether a producer was not heard in time, once per loss."""
        gone = [node_id for node_id, deadline in self._deadlines.items() if deadline <= now]
        for node_id in gone:
            del self._deadlines[node_id]
        return bool(gone)

    def _checker(self, position: int) -> Callable[[int], None]:
        def check(value: int) -> None:
            node_id = value >> 16 & 0x7F
            others = [e.value for i, e in enumerate(self._entries) if i != position and e.value & 0xFFFF]
            if value & 0xFFFF and node_id and any(other >> 16 & 0x7F == node_id for other in others):
                raise AbortError(AbortCode.CLASH)

        return check

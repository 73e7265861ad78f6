"""The simulated bench as a whole: plant, devices and bus under one simulated clock.

Time moves when it is told to, in ticks that are counted as integers: a million ticks are exact.
"""

import heapq
import math
from collections.abc import Callable, Sequence
from typing import Protocol

from sim_backend.buses.lockstep import LockstepBus
from sim_backend.errors import ModelError
from sim_backend.nodes.frame import Node

TICK = 1e-3
"""s between the firmware cycles of the devices."""

_SNAP = 1e-6
"""Part of a tick by which a requested time may miss a tick and still mean it."""


class Mover(Protocol):
    """What the world asks of the plant; the devices ask for the rest of `PlantPort`."""

    def advance_to(self, time: float) -> None:
        """Integrate up to `time` (s)."""

    def set_lock(self, locked: bool) -> None:
        """Clamp the output to the fixture where it stands, or let it go."""


class World:
    """A bench that is not there, at simulated `time` (s, to be read only), with a python-can `bus`.

    The devices are found powered and pre-operational at time 0, their boot-up messages waiting on the bus.
    """

    def __init__(self, plant: Mover, nodes: Sequence[Node], tick: float = TICK) -> None:
        if not (math.isfinite(tick) and tick > 0):
            raise ModelError(f"tick = {tick} s of the simulated world must be a positive number")
        self._nodes = {node.node_id: node for node in nodes}
        if len(self._nodes) != len(nodes):
            raise ModelError(f"node ids {[node.node_id for node in nodes]} of the simulated devices must differ")
        self.plant = plant
        self.tick = tick
        self._snap = _SNAP * tick
        self.time = 0.0
        self._ticks = 0
        self._scheduled: list[tuple[float, int, Callable[[], None]]] = []
        self._schedule_count = 0
        self.bus = LockstepBus(self, nodes)
        self._tick_nodes()

    def node(self, node_id: int) -> Node:
        """Give a device by its node id. Raises ModelError if there is none."""
        try:
            return self._nodes[node_id]
        except KeyError:
            raise ModelError(f"the simulated bench has no node {node_id}, only {sorted(self._nodes)}") from None

    def advance_to(self, time: float) -> None:
        """Run plant and devices up to `time` (s); return at once if that has passed."""
        if not math.isfinite(time):
            raise ModelError(f"the simulated world cannot advance to time {time} s")
        while self.time < time:
            self.step_towards(time)

    def step_towards(self, deadline: float) -> None:
        """Advance to the next tick, or to `deadline` (s) if that comes first."""
        next_tick = (self._ticks + 1) * self.tick
        if deadline < next_tick - self._snap:
            if deadline > self.time:
                self.plant.advance_to(deadline)
                self.time = deadline
            return
        self.plant.advance_to(next_tick)
        self._ticks += 1
        # a deadline that misses the tick by rounding is reached with it
        self.time = deadline if next_tick < deadline < next_tick + self._snap else next_tick
        self._tick_nodes()

    def schedule(self, time: float, action: Callable[[], None]) -> None:
        """Do `action` at the first tick at or after `time` (s), before the devices act; at once if that has passed."""
        if not math.isfinite(time):
            raise ModelError(f"nothing can be scheduled for time {time} s")
        if time <= self.time:
            action()
            return
        heapq.heappush(self._scheduled, (time, self._schedule_count, action))
        self._schedule_count += 1

    def set_lock(self, locked: bool) -> None:
        """Clamp the output to the fixture where it stands, or let it go."""
        self.plant.set_lock(locked)

    def _tick_nodes(self) -> None:
        time = self.time
        while self._scheduled and self._scheduled[0][0] <= time + self._snap:
            heapq.heappop(self._scheduled)[2]()
        self.bus.release()
        for node_id, node in self._nodes.items():
            node.time = time
            if time >= node.due:
                for frame in node.tick(time):
                    self.bus.transmit(node_id, frame)

"""Our driver on a device that shares nothing with our simulated ones: an encoder built on the package `durand`.

Both run in one thread and in simulated time; frames travel through plain queues.
"""

import math
from collections import deque
from collections.abc import Callable, Iterator

import can
import pytest

from drivers.canopen.bus import CanopenBus, open_bus
from drivers.clock import VirtualClock
from drivers.errors import NotConnectedError
from tests.drivers.canopen.bench import CYCLE_TIME, HEARTBEAT_TIME, device_config

durand = pytest.importorskip("durand", reason="the package durand is not installed: make foreign")
scheduler = pytest.importorskip("durand.scheduler", reason="the package durand is not installed: make foreign")

NODE = 3
COUNTS = 4096
STEP = 1e-3
"""Time between two looks at durand's timers, s."""


class DurandWorld:
    """durand's network and scheduler on one side, a python-can bus in simulated time on the other."""

    def __init__(self) -> None:
        self.time = 0.0
        self.timers = scheduler.VirtualScheduler()
        self.silent = False
        self._subscribers: dict[int, Callable[[int, bytes], None]] = {}
        self._received: deque[can.Message] = deque()

    # what durand asks of a network
    def add_subscription(self, cob_id: int, callback: Callable[[int, bytes], None]) -> None:
        self._subscribers[cob_id] = callback

    def remove_subscription(self, cob_id: int) -> None:
        self._subscribers.pop(cob_id)

    # durand sends; our driver's transport sends messages
    def send(self, cob_id: int | can.Message, data: bytes = b"") -> None:
        if isinstance(cob_id, can.Message):
            callback = self._subscribers.get(cob_id.arbitration_id)
            if callback is not None and not self.silent:
                callback(cob_id.arbitration_id, bytes(cob_id.data))
        elif not self.silent:
            self._received.append(can.Message(arbitration_id=cob_id, data=data, is_extended_id=False))

    def recv(self, timeout: float) -> can.Message | None:
        deadline = self.time + timeout
        while not self._received and self.time < deadline:
            self.advance_to(min(deadline, self.time + STEP))
        return self._received.popleft() if self._received else None

    def advance_to(self, time: float) -> None:
        while self.time < time:
            step = min(STEP, time - self.time)
            self.timers.run(step)
            self.time += step


@pytest.fixture
def world() -> Iterator[DurandWorld]:
    before = scheduler.get_scheduler()
    world = DurandWorld()
    scheduler.set_scheduler(world.timers)
    yield world
    scheduler.set_scheduler(before)


@pytest.fixture
def device(world: DurandWorld) -> "durand.Node":
    node = durand.MinimalNode(world, NODE)
    objects = node.object_dictionary
    kind, variable = durand.DatatypeEnum, durand.Variable
    objects[0x6004] = variable(kind.UNSIGNED32, "ro", 1000, name="position value")
    objects[0x6501] = variable(kind.UNSIGNED32, "ro", COUNTS, name="single-turn resolution")
    objects[0x6502] = variable(kind.UNSIGNED16, "ro", 4096, name="number of turns")
    objects.write(0x1000, 0, 0x00020196)
    objects.write(0x1018, 4, 1234)
    return node


@pytest.fixture
def bus(world: DurandWorld) -> CanopenBus:
    config = device_config("output_encoder", "cia406", NODE)
    return open_bus([config], VirtualClock(world, epoch_ns=0), world)


def cycles(world: DurandWorld, bus: CanopenBus, count: int) -> None:
    for _ in range(count):
        world.advance_to(world.time + CYCLE_TIME)
        bus.exchange()


def test_the_driver_configures_starts_and_reads_it_and_puts_it_back(
    world: DurandWorld, device: "durand.Node", bus: CanopenBus
) -> None:
    before = {key: device.object_dictionary.read(*key) for key in ((0x1017, 0), (0x1800, 1), (0x1800, 2), (0x1A00, 0))}
    encoder = bus.attach(device_config("output_encoder", "cia406", NODE))
    told = encoder.connect()
    assert ("serial", "0x000004D2") in told.identity
    assert told.resolution == pytest.approx(math.tau / COUNTS)
    assert device.nmt.state.name == "OPERATIONAL"
    for counts in (1000, 1010, 990):
        device.object_dictionary.write(0x6004, 0, counts)
        cycles(world, bus, 1)
        reading = encoder.read()
        assert reading.age == 0
        assert reading.value == pytest.approx(counts * math.tau / COUNTS)
    bus.close()
    assert device.nmt.state.name == "PRE_OPERATIONAL"
    assert {key: device.object_dictionary.read(*key) for key in before} == before


def test_its_heartbeat_is_watched(world: DurandWorld, device: "durand.Node", bus: CanopenBus) -> None:
    bus.attach(device_config("output_encoder", "cia406", NODE)).connect()
    cycles(world, bus, 300)
    world.silent = True
    with pytest.raises(NotConnectedError, match="no heartbeat"):
        cycles(world, bus, round(HEARTBEAT_TIME / CYCLE_TIME))

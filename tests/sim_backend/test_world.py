"""Simulated time: exact, deterministic, never backwards; and the named faults."""

import math
from collections.abc import Callable

import can
import pytest

from sim_backend.errors import ModelError
from sim_backend.faults import FAULTS
from sim_backend.nodes.bench import bench_nodes
from sim_backend.nodes.communication import CanopenNode
from sim_backend.nodes.frame import Frame
from sim_backend.world import World
from tests.sim_backend.fake_plant import FakePlant
from tests.sim_backend.test_lockstep import capture_ready, drain, message, sync


class Ticking:
    """A device that notes when it is ticked."""

    node_id = 5
    accepts = ()
    time = due = 0.0

    def __init__(self) -> None:
        self.ticks: list[float] = []
        self.accepts_changed = lambda: None

    def on_frame(self, _time: float, _can_id: int, _data: bytes) -> list[Frame]:
        return []

    def tick(self, time: float) -> list[Frame]:
        self.ticks.append(time)
        return []


@pytest.fixture
def plant() -> FakePlant:
    return FakePlant()


@pytest.fixture
def world(plant: FakePlant) -> World:
    world = World(plant, bench_nodes(plant))
    capture_ready(world)
    drain(world)
    return world


def test_ticks_do_not_drift_over_a_million_of_them() -> None:
    device = Ticking()
    world = World(FakePlant(), [device])
    time = 0.0
    for _ in range(1000):
        time += 0.1  # accumulates rounding on purpose
        world.advance_to(time)
    assert len(device.ticks) == 1 + 100_000
    assert device.ticks[-1] == pytest.approx(100.0, abs=1e-9)
    assert device.ticks[12_345] == 12_345 * 1e-3


def test_the_time_reached_is_never_short_of_the_time_asked_for() -> None:
    world = World(FakePlant(), [Ticking()])
    for asked in (0.1 + 0.2, 0.3 + 1e-13, 0.9 - 1e-13, 1.0005, 1.00051):
        world.advance_to(asked)
        assert world.time >= asked
        assert world.time == pytest.approx(asked, abs=1e-12)


def test_the_plant_advances_in_slices_of_a_tick_before_the_devices_look(plant: FakePlant) -> None:
    device = Ticking()
    world = World(plant, [device])
    world.advance_to(0.0035)
    assert plant.advanced == pytest.approx([0.001, 0.002, 0.003, 0.0035])
    assert device.ticks == pytest.approx([0.0, 0.001, 0.002, 0.003])


def test_time_does_not_go_backwards(plant: FakePlant) -> None:
    world = World(plant, [Ticking()])
    world.advance_to(0.5)
    world.advance_to(0.2)
    assert world.time == 0.5


@pytest.mark.parametrize("time", [math.nan, math.inf])
def test_an_impossible_time_is_an_error(plant: FakePlant, time: float) -> None:
    world = World(plant, [])
    with pytest.raises(ModelError):
        world.advance_to(time)
    with pytest.raises(ModelError):
        world.schedule(time, list)


@pytest.mark.parametrize("tick", [0.0, -1.0, math.nan])
def test_an_impossible_tick_is_an_error(plant: FakePlant, tick: float) -> None:
    with pytest.raises(ModelError, match="tick"):
        World(plant, [], tick)


def test_two_devices_cannot_share_a_node_id(plant: FakePlant) -> None:
    with pytest.raises(ModelError, match="differ"):
        World(plant, [Ticking(), Ticking()])


def test_the_lock_is_the_plants(plant: FakePlant) -> None:
    world = World(plant, [])
    world.set_lock(True)
    world.set_lock(False)
    assert plant.locks == [True, False]


def test_actions_happen_in_order_at_the_first_tick_not_before_their_time(plant: FakePlant) -> None:
    world = World(plant, [])
    done: list[tuple[str, float]] = []

    def note(name: str) -> Callable[[], None]:
        return lambda: done.append((name, round(world.time, 6)))

    world.schedule(0.0, note("at once"))
    world.schedule(0.0042, note("second"))
    world.schedule(0.003, note("first"))
    world.schedule(0.0042, note("third"))
    world.advance_to(0.01)
    assert done == [("at once", 0.0), ("first", 0.003), ("second", 0.005), ("third", 0.005)]


def test_two_runs_of_the_same_world_are_the_same_bit_for_bit() -> None:
    def run() -> list[tuple[float, int, bytes]]:
        plant = FakePlant()
        world = World(plant, bench_nodes(plant))
        capture_ready(world)
        frames = []
        for cycle in range(50):
            plant.show(motor_position=0.01 * cycle, output_torque=math.sin(cycle))
            world.bus.send(message(0x080))
            world.advance_to((cycle + 1) * 1e-3)
            while (received := world.bus.recv(0)) is not None:
                frames.append((received.timestamp, received.arbitration_id, bytes(received.data)))
        return frames

    first, second = run(), run()
    assert len(first) == 4 * 50
    assert first == second


def enable_motor(world: World) -> None:
    for data in ("2F 60 60 00 0A 00 00 00", "2B 40 60 00 06 00 00 00"):
        world.bus.send(message(0x601, data))
    world.advance_to(world.time + 0.005)
    for word in ("07", "0F"):
        world.bus.send(message(0x601, f"2B 40 60 00 {word} 00 00 00"))
    drain(world)


def test_drive_fault_reports_over_current_and_ends_in_fault(world: World) -> None:
    enable_motor(world)
    FAULTS["drive-fault"].inject(world, 1, world.time + 0.01)
    world.advance_to(world.time + 0.009)
    assert not [frame for frame in drain(world) if frame[0] == 0x081]
    world.advance_to(world.time + 0.2)
    assert (0x081, "10 23 03 00 00 00 00 00") in drain(world)
    status = int.from_bytes(bytes.fromhex(sync(world)[0][1])[:2], "little")
    assert status & 0x4F == 0x08


def test_refuse_mode_aborts_the_next_mode_change(world: World) -> None:
    FAULTS["refuse-mode"].inject(world, 1, 0.0)
    world.bus.send(message(0x601, "2F 60 60 00 09 00 00 00"))
    assert drain(world) == [(0x581, "80 60 60 00 30 00 09 06")]


def test_a_mute_device_sends_nothing_any_more_but_still_listens(world: World, plant: FakePlant) -> None:
    FAULTS["mute"].inject(world, 1, 0.0)
    enable_motor(world)
    assert [can_id for can_id, _ in sync(world)] == [0x182, 0x183, 0x184]
    assert plant.commands["motor"][0].name == "TORQUE"


def test_a_rebooted_drive_drops_the_torque_and_says_boot_up_once(world: World, plant: FakePlant) -> None:
    enable_motor(world)
    FAULTS["reboot"].inject(world, 1, 0.0)
    assert plant.commands["motor"][0].name == "OFF"
    assert [can_id for can_id, _ in sync(world)] == [0x182, 0x183, 0x184]
    world.advance_to(world.time + 0.1)
    assert drain(world) == [(0x701, "00")]
    assert [can_id for can_id, _ in sync(world)] == [0x182, 0x183, 0x184]  # pre-operational


def test_short_pdos_have_3_bytes(world: World) -> None:
    FAULTS["short-pdo"].inject(world, 1, 0.0)
    lengths = {can_id: len(bytes.fromhex(data)) for can_id, data in sync(world)}
    assert lengths == {0x181: 3, 0x182: 8, 0x183: 4, 0x184: 4}


def test_frozen_pdos_repeat_the_first_value_after_the_fault(world: World, plant: FakePlant) -> None:
    FAULTS["freeze-pdo"].inject(world, 3, 0.0)
    first = sync(world)
    plant.show(output_position=1.0, output_torque=1.0)
    second = sync(world)
    assert second[2] == first[2]  # the encoder
    assert second[3] != first[3]  # the transducer is alive


@pytest.mark.parametrize("name", FAULTS)
def test_every_fault_says_what_it_does_and_refuses_a_node_that_is_not_there(world: World, name: str) -> None:
    assert FAULTS[name].name == name
    assert len(FAULTS[name].summary.split()) > 3
    with pytest.raises(ModelError, match="no node 9"):
        FAULTS[name].inject(world, 9, 0.0)


@pytest.mark.parametrize("name", ["refuse-mode", "drive-fault"])
def test_faults_of_drives_do_not_apply_to_sensors(world: World, name: str) -> None:
    with pytest.raises(ModelError, match="no drive"):
        FAULTS[name].inject(world, 3, 0.0)


def test_faults_leave_the_bus_usable_for_everyone_else(world: World) -> None:
    for name in FAULTS:
        FAULTS[name].inject(world, 1, 0.0)
    world.bus.send(message(0x602, "40 00 10 00 00 00 00 00"))
    assert (0x582, "43 00 10 00 92 01 02 00") in drain(world)
    assert isinstance(world.bus, can.BusABC)


def test_a_device_sleeps_until_it_is_due_and_still_knows_the_time() -> None:
    device = Ticking()
    world = World(FakePlant(), [device])
    device.due = 0.0049
    world.advance_to(0.004)
    assert (device.ticks, device.time) == ([0.0], 0.004)
    world.advance_to(0.006)
    assert device.ticks == pytest.approx([0.0, 0.005, 0.006], abs=1e-9)


def test_what_a_sleeping_sensor_has_to_say_by_itself_leaves_with_the_next_tick(world: World) -> None:
    sensor = world.node(4)
    assert isinstance(sensor, CanopenNode)
    world.advance_to(world.time + 0.01)
    assert sensor.due == math.inf  # no heartbeat, no event timer, nothing that moves
    sensor.emergency.raise_error(0x5000)
    assert drain(world) == []
    world.advance_to(world.time + 0.001)
    ((can_id, data),) = drain(world)
    assert (can_id, data[:5]) == (0x084, "00 50")
    assert sensor.due == math.inf

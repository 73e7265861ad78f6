"""What every registered driver must do, shown on the simulated bench; a new entry is covered without being named."""

import contextlib
import inspect
from typing import Any

import pytest

from drivers.clock import VirtualClock
from drivers.devices import DeviceConfig, Drive, Sensor, TorqueSensor
from drivers.errors import ConfigError, DriveFaultError, NotConnectedError, RigError
from drivers.registry import DriverEntry, Kind, all_drivers
from drivers.types import DriveState, Mode
from sim_backend.buses.hooks import MASTER, Delivery
from sim_backend.nodes.bench import bench_nodes
from sim_backend.nodes.communication import CanopenNode
from sim_backend.nodes.frame import Frame
from sim_backend.nodes.object_dictionary import Access
from sim_backend.world import World
from tests.drivers.canopen.bench import StillPlant, Tap

DRIVERS = pytest.mark.parametrize("entry", all_drivers().values(), ids=lambda entry: entry.name)
ROLES = {Kind.DRIVE: ("motor", 1), Kind.ENCODER: ("output_encoder", 3), Kind.TORQUE_SENSOR: ("torque_sensor", 4)}
PROTOCOLS = {Kind.DRIVE: Drive, Kind.ENCODER: Sensor, Kind.TORQUE_SENSOR: TorqueSensor}
MOST_METHODS = 10
"""Methods that a driver may show to the application."""
CYCLE_TIME = 1e-3


class Bench:
    """One device of one kind on the simulated bus."""

    def __init__(self, entry: DriverEntry, **changes: Any) -> None:
        name, address = ROLES[entry.kind]
        self.plant = StillPlant()
        self.world = World(self.plant, bench_nodes(self.plant))
        self.clock = VirtualClock(self.world, epoch_ns=0)
        settings: dict[str, Any] = {
            "name": name,
            "driver": entry.name,
            "interface": "simulated",
            "channel": "bench",
            "address": address,
            "profile": "generic",
            "cycle_time": CYCLE_TIME,
            "heartbeat_time": 0.1,
        }
        self.config = DeviceConfig(**settings | changes)
        self.tap = Tap(self.world.bus)
        self.bus = entry.load()((self.config,), self.clock, self.tap)
        self.device = self.bus.attach(self.config)

    def cycles(self, count: int) -> None:
        for _ in range(count):
            self.clock.sleep_until(self.clock.now() + CYCLE_TIME)
            self.bus.exchange()

    def memory(self) -> dict[tuple[int, int], int]:
        """Everything that the device lets be written, as it stands; not what lies beyond the end of a PDO mapping."""
        node = self.world.node(self.config.address)
        assert isinstance(node, CanopenNode)
        keys = [(spec.index, spec.sub) for spec in node.dictionary if spec.access is Access.RW]
        values = {key: node.dictionary[key].value for key in keys}
        return {(index, sub): v for (index, sub), v in values.items() if not _beyond_mapping(values, index, sub)}


@DRIVERS
def test_the_factory_takes_configurations_clock_and_transport(entry: DriverEntry) -> None:
    parameters = list(inspect.signature(entry.load()).parameters)
    assert parameters == ["configs", "clock", "transport"]


@DRIVERS
def test_the_device_keeps_to_the_protocol_of_its_kind_and_has_few_methods(entry: DriverEntry) -> None:
    device = Bench(entry).device
    protocol = PROTOCOLS[entry.kind]
    assert isinstance(device, protocol)
    for name, function in inspect.getmembers(protocol, inspect.isfunction):
        if not name.startswith("_"):
            assert inspect.signature(getattr(type(device), name)).parameters.keys() == (
                inspect.signature(function).parameters.keys()
            ), name
    shown = [name for name, _ in inspect.getmembers(protocol, inspect.isfunction) if not name.startswith("_")]
    assert len(shown) <= MOST_METHODS


@DRIVERS
def test_every_public_method_is_documented(entry: DriverEntry) -> None:
    device = Bench(entry).device
    for name, function in inspect.getmembers(type(device), inspect.isfunction):
        if not name.startswith("_"):
            assert inspect.getdoc(function), name


@DRIVERS
def test_attaching_sends_nothing(entry: DriverEntry) -> None:
    bench = Bench(entry)
    assert bench.tap.sent == []


@DRIVERS
def test_an_unknown_option_is_a_configuration_error_that_names_it(entry: DriverEntry) -> None:
    with pytest.raises(ConfigError, match="no_such_option"):
        Bench(entry, options={"no_such_option": 1})


@DRIVERS
def test_an_unknown_profile_is_a_configuration_error(entry: DriverEntry) -> None:
    with pytest.raises(ConfigError, match="no-such-profile"):
        Bench(entry, profile="no-such-profile")


@DRIVERS
def test_connecting_tells_who_the_device_is(entry: DriverEntry) -> None:
    bench = Bench(entry)
    info = bench.device.connect()
    assert (info.name, info.driver) == (bench.config.name, entry.name)
    assert info.address
    assert info.identity
    assert info.resolution is not None
    assert info.resolution > 0
    bench.bus.close()


@DRIVERS
def test_a_device_that_does_not_answer_is_named(entry: DriverEntry) -> None:
    bench = Bench(entry, address=99)
    with pytest.raises(NotConnectedError) as got:
        bench.device.connect()
    assert list(got.value.missing) == [bench.config.name]
    assert "99" in got.value.missing[bench.config.name]


@DRIVERS
def test_a_fresh_reading_has_age_zero(entry: DriverEntry) -> None:
    bench = Bench(entry)
    bench.device.connect()
    bench.cycles(3)
    assert bench.device.read().age == 0
    bench.bus.close()


@DRIVERS
def test_closing_leaves_the_device_as_it_was_found(entry: DriverEntry) -> None:
    bench = Bench(entry)
    before = bench.memory()
    info = bench.device.connect()
    assert info.changed
    assert bench.memory() != before
    bench.cycles(1)
    bench.device.close()
    assert bench.memory() == before


@DRIVERS
def test_closing_is_allowed_at_any_moment_and_twice(entry: DriverEntry) -> None:
    bench = Bench(entry)
    bench.device.close()
    bench.device.connect()
    bench.device.close()
    bench.device.close()
    bench.bus.close()
    bench.bus.close()


@DRIVERS
@pytest.mark.parametrize("answers", [0, 1, 5, 12, 20])
def test_a_device_that_falls_silent_while_connecting_can_be_closed_and_connected_later(
    entry: DriverEntry, answers: int
) -> None:
    bench = Bench(entry)
    left = answers

    def falls_silent(sender: int, frame: Frame) -> tuple[Delivery, ...]:
        nonlocal left
        if sender == MASTER:
            return (Delivery(frame),)
        left -= 1
        return (Delivery(frame),) if left >= 0 else ()

    bench.world.bus.add_hook(falls_silent)
    with pytest.raises(RigError):
        bench.device.connect()
    with contextlib.suppress(RigError):
        bench.device.close()
    bench.world.bus.remove_hook(falls_silent)
    assert bench.device.connect().name == bench.config.name


@DRIVERS
def test_a_drive_is_without_torque_until_it_is_enabled_and_after_it_is_disabled(entry: DriverEntry) -> None:
    bench = Bench(entry)
    device = bench.device
    if not isinstance(device, Drive):
        assert entry.kind is not Kind.DRIVE
        return
    device.connect()
    bench.cycles(2)
    assert not device.read().state.energised
    for mode in Mode:
        device.enable(mode)
        bench.cycles(1)
        assert device.read().state is DriveState.ENABLED
        assert not device.disable().energised
        with pytest.raises(DriveFaultError):
            device.write(0.0)
    bench.bus.close()


def _beyond_mapping(values: dict[tuple[int, int], int], index: int, sub: int) -> bool:
    return (0x1600 <= index < 0x1800 or 0x1A00 <= index < 0x1C00) and sub > values[index, 0]

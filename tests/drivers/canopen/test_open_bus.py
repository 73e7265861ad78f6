"""Opening and closing a bus: configuration, adapter, ownership."""

from dataclasses import replace
from typing import Any

import can
import pytest

from drivers.canopen.bus import open_bus
from drivers.errors import ConfigError, NotConnectedError
from tests.drivers.canopen.bench import ENCODER, LOAD, MOTOR, TORQUE, device_config, simulated_bench
from tests.drivers.canopen.wire import ManualClock


class FakeAdapter:
    def __init__(self) -> None:
        self.closed = 0

    def send(self, message: can.Message) -> None:
        raise AssertionError("nothing is sent before connect")

    def recv(self, timeout: float) -> None:
        return None

    def shutdown(self) -> None:
        self.closed += 1


def test_every_mistake_is_reported_at_once_with_its_path() -> None:
    configs = [
        replace(MOTOR, interface="udp_multicast", options={"max_tork": 1.0, "max_velocity": -3.0}),
        replace(LOAD, address=1, profile="unheard-of", interface="udp_multicast"),
        replace(ENCODER, options={"bitrate": True}, sign={"output_position": 2}),
        device_config("torque_sensor", "cia999", 4),
    ]
    with pytest.raises(ConfigError) as got:
        open_bus(configs, ManualClock(), FakeAdapter())
    paths = {mistake.path for mistake in got.value.mistakes}
    assert paths >= {
        "devices.motor.interface",
        "devices.motor.options.max_tork",
        "devices.motor.options.max_velocity",
        "devices.load.address",
        "devices.load.profile",
        "devices.load.interface",
        "devices.output_encoder.interface",
        "devices.output_encoder.options.bitrate",
        "devices.output_encoder.sign.output_position",
        "devices.torque_sensor.driver",
    }
    assert got.value.exit_code == 2


@pytest.mark.parametrize(
    ("changes", "path"),
    [
        ({"address": 0}, "devices.motor.address"),
        ({"address": 128}, "devices.motor.address"),
        ({"address": 127}, "devices.motor.address"),
        ({"heartbeat_time": 0.002}, "devices.motor.heartbeat_time"),
        ({"heartbeat_time": 70.0}, "devices.motor.heartbeat_time"),
        ({"options": {"max_torque": float("inf")}}, "devices.motor.options.max_torque"),
        ({"options": {"max_torque": "much"}}, "devices.motor.options.max_torque"),
        ({"options": {"quick_stop_option": 1.5}}, "devices.motor.options.quick_stop_option"),
        ({"options": {"external_watchdog": 1}}, "devices.motor.options.external_watchdog"),
        ({"options": {"unit": "N*m"}}, "devices.motor.options.unit"),
    ],
)
def test_one_mistake_is_one_entry(changes: dict[str, Any], path: str) -> None:
    with pytest.raises(ConfigError) as got:
        open_bus([replace(MOTOR, **changes)], ManualClock(), FakeAdapter())
    assert [mistake.path for mistake in got.value.mistakes] == [path]


def test_udp_multicast_is_refused_by_name_even_with_an_open_transport() -> None:
    with pytest.raises(ConfigError, match=r"udp_multicast.*hears its own frames"):
        open_bus([replace(MOTOR, interface="udp_multicast")], ManualClock(), FakeAdapter())


def test_a_torque_unit_must_be_known() -> None:
    with pytest.raises(ConfigError, match=r"options.unit = 'furlong'.*N\*m"):
        open_bus([replace(TORQUE, options={"unit": "furlong"})], ManualClock(), FakeAdapter())


def test_no_devices_and_equal_names_are_refused() -> None:
    with pytest.raises(ConfigError, match="at least one device"):
        open_bus([], ManualClock(), FakeAdapter())
    with pytest.raises(ConfigError, match="same name"):
        open_bus([MOTOR, replace(MOTOR, address=2)], ManualClock(), FakeAdapter())


def test_only_the_devices_of_the_bus_can_be_attached_and_only_once() -> None:
    bus = open_bus([MOTOR], ManualClock(), FakeAdapter())
    bus.attach(MOTOR)
    for config in (MOTOR, LOAD):
        with pytest.raises(ConfigError, match="not one of the devices"):
            bus.attach(config)


def test_the_adapter_is_opened_as_the_bench_file_says_and_closed_with_the_bus(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[dict[str, Any]] = []
    adapter = FakeAdapter()

    def opened(**arguments: Any) -> FakeAdapter:
        calls.append(arguments)
        return adapter

    monkeypatch.setattr(can, "Bus", opened)
    options = {"bitrate": 500_000, "can_tcp_tune": True}
    bus = open_bus([replace(MOTOR, interface="socketcand", channel="can0", options=options)], ManualClock())
    assert calls == [
        {
            "interface": "socketcand",
            "channel": "can0",
            "bitrate": 500_000,
            "ignore_config": True,  # nothing is merged in from the user's home directory
            "tcp_tune": True,
        }
    ]
    bus.close()
    bus.close()
    assert adapter.closed == 1


def test_a_transport_that_was_handed_in_is_left_open() -> None:
    adapter = FakeAdapter()
    open_bus([MOTOR], ManualClock(), adapter).close()
    assert adapter.closed == 0


def test_an_interface_that_nobody_knows_is_a_configuration_error() -> None:
    with pytest.raises(ConfigError, match=r"devices.motor.interface = 'no-such-interface'"):
        open_bus([replace(MOTOR, interface="no-such-interface")], ManualClock())


@pytest.mark.parametrize(
    "error", [can.CanInitializationError("no driver"), OSError("no device"), ImportError("no module")]
)
def test_an_adapter_that_cannot_be_opened_is_not_connected(monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    def fail(**_arguments: Any) -> None:
        raise error

    monkeypatch.setattr(can, "Bus", fail)
    with pytest.raises(NotConnectedError, match=rf"opening socketcan 'can0' at 1000000 bit/s: {error}"):
        open_bus([replace(MOTOR, interface="socketcan", channel="can0")], ManualClock())


def test_closing_the_bus_closes_every_device() -> None:
    bench = simulated_bench().connect()
    bench.bus.close()
    assert [bench.value(node, 0x1017) for node in (1, 2, 3, 4)] == [0, 0, 0, 0]

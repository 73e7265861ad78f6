"""The open bench: what each device reads lands in the fields that bear its name."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import SimpleNamespace

import pytest

from drivers.devices import DeviceConfig
from drivers.types import Axis, DeviceInfo, DriveReading, DriveState, Mode, Sample, SensorReading, Setpoint
from rig.bench import Bench
from rig.config.bench import load_bench

READINGS: Mapping[str, DriveReading | SensorReading] = {
    "motor": DriveReading(1.0, 2.0, DriveState.ENABLED, 3, False, 0, 4.0, 5.0, 6.0, 7.0),
    "load": DriveReading(11.0, 12.0, DriveState.ENABLED, 13, False, 0, 14.0, 15.0, 16.0, 17.0),
    "output_encoder": SensorReading(21.0, 0),
    "torque_sensor": SensorReading(31.0, 0),
}
MEASURED = {
    "time": 0.5,
    "cycle": 500,
    "late": 1,
    "motor_position": 1.0,
    "motor_torque": 2.0,
    "status_word": 3,
    "motor_velocity": 4.0,
    "motor_current": 5.0,
    "motor_temperature": 6.0,
    "bus_voltage": 7.0,
    "load_position": 11.0,
    "load_torque": 12.0,
    "load_status_word": 13,
    "output_position": 21.0,
    "output_torque": 31.0,
}
OF_ROLE = {
    "motor": [n for n in MEASURED if n.startswith("motor_")] + ["status_word", "bus_voltage"],
    "load": ["load_position", "load_torque", "load_status_word"],
    "output_encoder": ["output_position"],
    "torque_sensor": ["output_torque"],
}


@dataclass
class FakeDevice:
    """Gives one reading and takes everything."""

    name: str
    reading: DriveReading | SensorReading

    def connect(self) -> DeviceInfo:
        return DeviceInfo(self.name, "fake", "")

    def read(self) -> DriveReading | SensorReading:
        return self.reading

    def enable(self, mode: Mode) -> None: ...

    def write(self, value: float) -> None: ...

    def close(self) -> None: ...


class FakeBus:
    def __init__(self, *_: object) -> None:
        self.devices: dict[str, FakeDevice] = {}

    def attach(self, config: DeviceConfig) -> FakeDevice:
        return self.devices.setdefault(config.name, FakeDevice(config.name, READINGS[config.name]))

    def exchange(self) -> None: ...

    def close(self) -> None: ...


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> tuple[Bench, FakeBus]:
    bus = FakeBus()
    entry = SimpleNamespace(bus="fake", load=lambda: lambda *_: bus)
    monkeypatch.setattr("rig.bench.all_drivers", lambda: dict.fromkeys(("cia402", "cia406", "cia404"), entry))
    bench = Bench(load_bench("sim")[0], SimpleNamespace(), None)
    bench.open()
    return bench, bus


@pytest.mark.parametrize(
    ("motor", "load", "commands"),
    [
        (None, None, {}),
        (Setpoint(Mode.POSITION, 41.0), None, {"motor_position_command": 41.0}),
        (Setpoint(Mode.VELOCITY, 42.0), None, {"motor_velocity_command": 42.0}),
        (Setpoint(Mode.TORQUE, 43.0), None, {"motor_torque_command": 43.0}),
        (None, Setpoint(Mode.TORQUE, 44.0), {"load_torque_command": 44.0}),
        (None, Setpoint(Mode.POSITION, 45.0), {}),
    ],
)
def test_every_reading_and_command_lands_in_the_field_of_its_name(
    fake: tuple[Bench, FakeBus], motor: Setpoint | None, load: Setpoint | None, commands: dict[str, float]
) -> None:
    bench, _ = fake
    for axis, setpoint in ((Axis.MOTOR, motor), (Axis.LOAD, load)):
        bench.apply(axis, setpoint)
    report = bench.cycle(0.5, 500, late=True)
    assert report.sample == Sample(**MEASURED, **commands)
    assert report.missing == ()


@pytest.mark.parametrize("role", list(READINGS))
def test_the_fields_of_a_device_that_did_not_answer_are_absent_and_no_others(
    fake: tuple[Bench, FakeBus], role: str
) -> None:
    bench, bus = fake
    bus.devices[role].reading = READINGS[role]._replace(age=1)
    report = bench.cycle(0.5, 500, late=True)
    assert report.missing == (role,)
    assert report.filled == Sample(**MEASURED)
    assert report.sample == Sample(**{n: v for n, v in MEASURED.items() if n not in OF_ROLE[role]})

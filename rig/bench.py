"""The open bench: all devices of a bench file, one control cycle at a time.

`Bench.cycle` exchanges one cycle with every device and gives the sample as the log wants it; a value that did not
arrive is absent from it. No policy lives here: limits and the safe state belong to the runner.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, NamedTuple, Protocol, TypeVar, cast

from drivers.clock import Clock
from drivers.devices import DeviceBus, DeviceConfig, Drive, Sensor, TorqueSensor
from drivers.errors import (
    ConfigError,
    CycleError,
    DriveFaultError,
    LimitError,
    Mistake,
    NotConnectedError,
    ReadingError,
    RigError,
)
from drivers.registry import all_drivers
from drivers.types import Axis, DeviceEvent, DeviceInfo, DriveReading, DriveState, Mode, Sample, Setpoint
from rig.config.bench import BenchFile
from rig.operator import Answered

if TYPE_CHECKING:
    import can

STALE_CYCLES = 5
"""A device that has not answered for this many cycles makes the bench stop."""

NO_ANSWER_HINT = "Check the device's power and wiring and its node id in the bench file."

Reading = TypeVar("Reading", covariant=True)
Absent = TypeVar("Absent")

Transports = Mapping[tuple[str, str], "can.BusABC"]
"""Open python-can buses by (interface, channel), for benches whose bus is not opened by name."""


class FixtureLock(Protocol):
    """What locks the output to the frame."""

    def set_lock(self, locked: bool) -> Answered:
        """Begin to lock or release the output; look at what it returns until it is true."""


class CycleReport(NamedTuple):
    """One cycle: the `sample` to log, the same with the last known values filled in, and which devices were missing."""

    sample: Sample
    filled: Sample
    missing: tuple[str, ...] = ()


class SafeReport(NamedTuple):
    """One cycle on the way to the safe state, and what is wrong, by the role it concerns ("bus": no role is named)."""

    cycle: CycleReport
    troubles: Mapping[str, RigError]


@dataclass(frozen=True, slots=True)
class Stopped:
    """What came of stopping all drives: the states read back, and the `failure` of those that gave none."""

    states: Mapping[Axis, DriveState]
    failure: RigError | None = None


class Bench:
    """Devices of one bench, opened together and closed together."""

    def __init__(
        self, config: BenchFile, clock: Clock, fixture: FixtureLock | None, transports: Transports | None = None
    ) -> None:
        self.config = config
        self.clock = clock
        self.fixture = fixture
        self._transports = transports or {}
        self._buses: list[DeviceBus] = []
        self._devices: dict[str, Drive | Sensor] = {}
        self._drives: dict[Axis, Drive] = {}
        self.torque_resolutions: Mapping[Axis, float] = {}
        """N*m, one step of each drive's torque, as far as it said so."""
        self._setpoints: dict[Axis, Setpoint | None] = {Axis.MOTOR: None, Axis.LOAD: None}

    def open(self) -> tuple[DeviceInfo, ...]:
        """Connect every device; give what each said of itself. Names all that do not answer in one error."""
        configs = self.config.device_configs()
        for group in _by_bus(configs).values():
            bus = self._open_bus(group)
            self._buses.append(bus)
            for config in group:
                self._devices[config.name] = bus.attach(config)
        self._name_parts()
        infos: list[DeviceInfo] = []
        missing: dict[str, str] = {}
        for device in self._devices.values():
            try:
                infos.append(device.connect())
            except NotConnectedError as error:
                missing |= error.missing
        if missing:
            raise NotConnectedError(missing)
        self._refuse_faults(infos)
        self.torque_resolutions = {Axis(i.name): i.resolution for i in infos if i.name in self._drives and i.resolution}
        return tuple(infos)

    def _refuse_faults(self, infos: Sequence[DeviceInfo] = ()) -> None:
        """Raise DriveFaultError, with what it said when connected, for a drive in fault, even if it is not needed."""
        for axis, drive in self._drives.items():
            if drive.read().state not in _FAULTS:
                continue
            told = "; ".join(text for info in infos if info.name == axis for text in info.warnings)
            raise DriveFaultError(
                axis.value,
                f"is in fault, so nothing is moved{f' ({told})' if told else ''}",
                state=str(DriveState.FAULT),
                hint="Remove the cause and reset it: switch its supply off and on, or use the maker's tool. "
                "The bench resets no fault by itself.",
            )

    def _name_parts(self) -> None:
        """Keep each role's device at hand for the cycle."""
        self._drives = {axis: cast(Drive, self._devices[axis.value]) for axis in Axis if self.has(axis.value)}
        self._motor = cast(Drive, self._devices["motor"])
        self._load = cast(Drive | None, self._devices.get("load"))
        self._encoder = cast(Sensor | None, self._devices.get("output_encoder"))
        self._torque = cast(Sensor | None, self._devices.get("torque_sensor"))

    def _open_bus(self, group: tuple[DeviceConfig, ...]) -> DeviceBus:
        first = group[0]
        factory = all_drivers()[first.driver].load()
        return factory(group, self.clock, self._transports.get((first.interface, first.channel)))

    def has(self, role: str) -> bool:
        """Tell whether the bench file names this role."""
        return role in self.config.devices

    def setpoint(self, axis: Axis) -> Setpoint | None:
        """Give what the axis was last told and took, None while it is released."""
        return self._setpoints[axis]

    def apply(self, axis: Axis, setpoint: Setpoint | None) -> bool:
        """Queue a setpoint, or release the axis with None. Gives True if the drive changed its state for it.

        What the drive refuses leaves the axis with the setpoint it has. No axis is enabled while a drive is in fault.
        """
        drive = self._drive(axis)
        present = self._setpoints[axis]
        if setpoint is None:
            if present is not None:
                drive.disable()
                self._setpoints[axis] = None
            return present is not None
        mode, value = setpoint
        changed = present is None or present.mode is not mode
        if changed:
            self._refuse_faults()
            drive.enable(mode)
            self._setpoints[axis] = Setpoint(mode, drive.read().position if mode is Mode.POSITION else 0.0)
        drive.write(value)
        self._setpoints[axis] = setpoint
        return changed

    def cycle(self, time: float, index: int, late: bool) -> CycleReport:
        """Exchange one cycle. `time` s since the run began, `index` the cycle's number."""
        for bus in self._buses:
            bus.exchange()
        motor = self._motor.read()
        load = self._load.read() if self._load is not None else _ABSENT_DRIVE
        encoder = self._encoder.read() if self._encoder is not None else _ABSENT_SENSOR
        torque = self._torque.read() if self._torque is not None else _ABSENT_SENSOR
        if not torque.valid:
            raise _saturated(torque.value, index)
        if not encoder.valid:
            raise _jumped(encoder.value, index)
        filled = self._sample(time, index, late, motor, load, encoder.value, torque.value)
        if not (motor.age or load.age or encoder.age or torque.age):
            return CycleReport(filled, filled)
        stale = _stale(motor.age, load.age, encoder.age, torque.age)
        oldest = max(stale.values())
        if oldest > STALE_CYCLES:
            raise self._silent(stale, time, late)
        return CycleReport(_without(filled, stale), filled, tuple(stale))

    def safe_cycle(self, time: float, index: int) -> SafeReport:
        """Exchange one cycle on the way to the safe state, where only the drives matter. Raises no RigError.

        What is wrong with a device is told instead: a sensor that stays bad must not keep the drives from stopping.
        A value that cannot be true is absent from the sample, as one that did not come.
        """
        troubles: dict[str, RigError] = {}

        def note(name: str, caught: Exception) -> None:
            error = _driver_error(name, caught)
            for role in _concerned(error) or (name,):
                troubles.setdefault(role, error)

        for bus in self._buses:
            try:
                bus.exchange()
            except Exception as caught:  # as above
                note("bus", caught)
        motor = _read("motor", self._motor, _ABSENT_DRIVE, note)
        load = _read("load", self._load, _ABSENT_DRIVE, note)
        encoder = _read("output_encoder", self._encoder, _ABSENT_SENSOR, note)
        torque = _read("torque_sensor", self._torque, _ABSENT_SENSOR, note)
        if not torque.valid:
            note("torque_sensor", _saturated(torque.value, index))
        if not encoder.valid:
            note("output_encoder", _jumped(encoder.value, index))
        filled = self._sample(
            time,
            index,
            False,
            motor,
            load,
            encoder.value if encoder.valid else None,
            torque.value if torque.valid else None,
        )
        stale = _stale(motor.age, load.age, encoder.age, torque.age)
        for role, age in stale.items():
            if age > STALE_CYCLES:
                note(role, self._silent({role: age}, time, late=False))
        return SafeReport(CycleReport(_without(filled, stale) if stale else filled, filled, tuple(stale)), troubles)

    def _sample(
        self,
        time: float,
        index: int,
        late: bool,
        motor: "DriveReading | _AbsentDrive",
        load: "DriveReading | _AbsentDrive",
        output_position: float | None,
        output_torque: float | None,
    ) -> Sample:
        position, velocity, motor_torque = _by_mode(self._setpoints[Axis.MOTOR])
        _, _, load_torque = _by_mode(self._setpoints[Axis.LOAD])
        return _new_sample(
            (
                time,
                index,
                int(late),
                motor.position,
                motor.velocity,
                position,
                velocity,
                motor.torque,
                motor_torque,
                motor.current,
                output_position,
                None,  # output_velocity: no device measures it
                output_torque,
                load.torque,
                load_torque,
                load.position,
                None,  # temperature of the gear: no device measures it
                motor.temperature,
                motor.voltage,
                None,  # supply_voltage: no device measures it
                motor.status_word,
                load.status_word,
                (),
            )
        )

    def _silent(self, stale: Mapping[str, int], time: float, late: bool) -> CycleError:
        oldest = max(stale.values())
        return CycleError(
            f"No answer from {self.located(stale)} for {oldest} cycles at {time:.3f} s",
            late=int(late),
            missing=oldest,
            worst_age=oldest * self.config.cycle_time,
            limit=STALE_CYCLES,
            hint=NO_ANSWER_HINT,
        )

    def located(self, roles: Iterable[str]) -> str:
        """Name devices with where they are, for messages."""
        devices = self.config.devices
        return " and ".join(f"'{role}' (node {devices[role].node} on {devices[role].channel})" for role in roles)

    @property
    def axes(self) -> tuple[Axis, ...]:
        """Give the axes that have a drive."""
        return tuple(self._drives)

    @property
    def energised(self) -> bool:
        """Tell whether a drive may carry torque by its latest reading; one that cannot be read may."""
        for drive in self._drives.values():
            try:
                if drive.read().state.energised:
                    return True
            except Exception:  # a drive whose state is unknown is not known to be without torque
                return True
        return False

    def readings(self) -> Mapping[Axis, DriveReading]:
        """Give the latest reading of each drive."""
        return {axis: drive.read() for axis, drive in self._drives.items()}

    def events(self) -> list[DeviceEvent]:
        """Give what the devices reported by themselves since the last call."""
        found: list[DeviceEvent] = []
        for bus in self._buses:
            found += bus.events()
        return found

    def listen(self) -> list[DeviceEvent]:
        """Give what the devices reported by themselves, without sending anything: after a failure nothing is fed."""
        for bus in self._buses:
            with suppress(RigError):  # the run has failed already; what its devices say may tell why
                bus.listen()
        return self.events()

    def disable(self) -> Stopped:
        """Take the torque from every drive. A drive that fails does not keep the next from being stopped."""
        return self._each_drive(lambda drive: drive.disable())

    def quick_stop(self) -> Stopped:
        """Stop every drive by its own quick-stop ramp, which goes on when this returns."""
        return self._each_drive(lambda drive: drive.quick_stop())

    def _each_drive(self, action: Callable[[Drive], DriveState]) -> Stopped:
        states: dict[Axis, DriveState] = {}
        failure: RigError | None = None
        for axis in Axis:
            if axis not in self._drives:
                continue
            self._setpoints[axis] = None
            try:
                states[axis] = action(self._drive(axis))
            except Exception as caught:  # whatever fails on one drive, the next must still be stopped
                error = _driver_error(axis.value, caught)
                if failure is None:
                    failure = error
                else:
                    failure.add_note(str(error))
        return Stopped(states, failure)

    def tare(self) -> float:
        """Zero the torque sensor; give the offset it removed, N*m."""
        sensor = self._devices.get("torque_sensor")
        if not isinstance(sensor, TorqueSensor):
            raise ConfigError(
                self.config.name,
                [Mistake("devices.torque_sensor", "missing", "an unloaded zero needs a torque sensor")],
            )
        return sensor.tare()

    def set_lock(self, locked: bool) -> Answered:
        """Begin to lock or release the output through the bench's fixture; it is done when the answer is true."""
        if self.fixture is None:
            raise ConfigError(
                self.config.name, [Mistake("fixture.lock", "none", "this procedure locks and releases the output")]
            )
        return self.fixture.set_lock(locked)

    def close(self) -> None:
        """Close every device and bus; the first failure is raised when all have been tried."""
        failures: list[RigError] = []
        for part in (*self._devices.values(), *self._buses):
            try:
                part.close()
            except Exception as caught:  # whatever fails on one part, the next must still be closed
                failures.append(_driver_error(getattr(part, "name", "bus"), caught))
        self._devices.clear()
        self._drives.clear()
        self._buses.clear()
        if failures:
            for other in failures[1:]:
                failures[0].add_note(" ".join((str(other), *getattr(other, "__notes__", ()))))
            raise failures[0]

    def _drive(self, axis: Axis) -> Drive:
        drive = self._drives.get(axis)
        if drive is None:
            raise DriveFaultError(axis.value, "is not part of this bench", hint="Name it in the bench file.")
        return drive


def _by_bus(configs: tuple[DeviceConfig, ...]) -> dict[tuple[str, str, str], tuple[DeviceConfig, ...]]:
    drivers = all_drivers()
    groups: dict[tuple[str, str, str], tuple[DeviceConfig, ...]] = {}
    for config in configs:
        key = (drivers[config.driver].bus, config.interface, config.channel)
        groups[key] = (*groups.get(key, ()), config)
    return groups


def _driver_error(device: str, error: Exception) -> RigError:
    if isinstance(error, RigError):
        return error
    wrapped = DriveFaultError(device, f"failed in its driver: {type(error).__name__}: {error}")
    wrapped.__cause__ = error
    return wrapped


def _concerned(error: RigError) -> tuple[str, ...]:
    """Give the devices that an error names."""
    if isinstance(error, NotConnectedError):
        return tuple(error.missing)
    return (error.device,) if isinstance(error, DriveFaultError) else ()


def _saturated(value: float | None, index: int) -> LimitError:
    return LimitError(
        "output_torque",
        value or 0.0,
        abs(value or 0.0),
        "N*m",
        cycle=index,
        what=f"The torque sensor is at the end of its range ({value} N*m) in cycle {index}.",
        hint="What it shows there is no torque: lower the load or use a larger sensor.",
    )


def _jumped(value: float | None, index: int) -> ReadingError:
    return ReadingError(
        "output_encoder",
        f"jumped to {value:.6g} rad in cycle {index}, further than the shaft can turn in one cycle",
        state="",
        hint="Check the encoder and its wiring, and whether its preset was changed.",
    )


def _stale(motor: int, load: int, encoder: int, torque: int) -> Mapping[str, int]:
    """Give the ages (cycles) above zero by role."""
    ages = {"motor": motor, "load": load, "output_encoder": encoder, "torque_sensor": torque}
    return {name: age for name, age in ages.items() if age > 0}


class _Readable(Protocol[Reading]):
    """A drive or a sensor, by what it gives."""

    def read(self) -> Reading: ...


def _read(
    role: str, device: _Readable[Reading] | None, absent: Absent, note: Callable[[str, Exception], None]
) -> Reading | Absent:
    """Give what a device reads, or what stands for one that is absent; a device that fails is noted."""
    if device is None:
        return absent
    try:
        return device.read()
    except Exception as caught:  # whatever fails in one device, the drives must still be stopped
        note(role, caught)
        return absent


class _AbsentDrive(NamedTuple):
    """Stands for a drive that the bench has not, or that gives no reading."""

    position: None = None
    velocity: None = None
    torque: None = None
    current: None = None
    temperature: None = None
    voltage: None = None
    status_word: None = None
    age: int = 0


class _AbsentSensor(NamedTuple):
    """Stands for a sensor that the bench has not."""

    value: None = None
    age: int = 0
    valid: bool = True


_ABSENT_DRIVE = _AbsentDrive()
_ABSENT_SENSOR = _AbsentSensor()
_NO_COMMAND = (None, None, None)


_FAULTS = (DriveState.FAULT, DriveState.FAULT_REACTION)

_new_sample = partial(tuple.__new__, Sample)
"""Make a sample of all its fields in their order: a third of what `Sample(...)` by keywords takes, once per cycle."""


def _by_mode(setpoint: Setpoint | None) -> tuple[float | None, float | None, float | None]:
    """Give the commanded position, velocity and torque; only the one of the setpoint's mode is not None."""
    if setpoint is None:
        return _NO_COMMAND
    if setpoint.mode is Mode.TORQUE:
        return None, None, setpoint.value
    if setpoint.mode is Mode.VELOCITY:
        return None, setpoint.value, None
    return setpoint.value, None, None


_FIELDS_OF_ROLE: Mapping[str, tuple[str, ...]] = {
    "motor": (
        "motor_position",
        "motor_velocity",
        "motor_torque",
        "motor_current",
        "motor_temperature",
        "bus_voltage",
        "status_word",
    ),
    "load": ("load_position", "load_torque", "load_status_word"),
    "output_encoder": ("output_position",),
    "torque_sensor": ("output_torque",),
}


def _without(sample: Sample, roles: Mapping[str, int]) -> Sample:
    absent = {name for role in roles for name in _FIELDS_OF_ROLE[role]}
    return Sample._make(None if name in absent else value for name, value in zip(Sample._fields, sample, strict=True))

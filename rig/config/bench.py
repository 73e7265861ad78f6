"""The bench file, `bench.toml`: devices, rates, limits, safety reaction. Every mistake is reported at once.

The load of each CAN bus is computed (worst-case bit stuffing, 11-bit identifiers) and refused above its limit.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from enum import StrEnum
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from drivers.devices import DeviceConfig
from drivers.errors import ConfigError, Mistake
from drivers.registry import Kind, all_drivers
from drivers.spelling import did_you_mean
from drivers.types import Limits
from rig.config.dut import Positive
from rig.config.toml_file import Conflict, FileModel, PlainValue, Quantity, Table, parse_toml, read_text

SIMULATED = "simulated"
"""Interface name of a device that the simulated bench provides."""

SYNC_BITS = 55
"""An empty CAN frame, 11-bit identifier, worst-case stuffing, with inter-frame space."""

ROLES: Mapping[str, Kind] = {
    "motor": Kind.DRIVE,
    "load": Kind.DRIVE,
    "output_encoder": Kind.ENCODER,
    "torque_sensor": Kind.TORQUE_SENSOR,
}
"""What a bench may have, and what kind of driver each role takes."""

SIGNED_SIGNALS: Mapping[str, frozenset[str]] = {
    "motor": frozenset({"motor_position", "motor_torque"}),
    "load": frozenset({"load_position", "load_torque"}),
    "output_encoder": frozenset({"output_position"}),
    "torque_sensor": frozenset({"output_torque"}),
}
"""Which channels of a role carry a sign."""

BENCH_NODE = 127
"""Node id of the bench's own heartbeat on a CANopen bus, unless a device's option `master_id` names another."""

UNBOUNDED = math.inf

EVERY_CYCLE = "the check in every cycle"

_DEVICE_SOURCE = re.compile(r"device '(.+)'")
_NODE_PATH = re.compile(r"(devices\.[^.]+)\.address")
_HEARTBEAT_PATH = re.compile(r"devices\.[^.]+\.heartbeat_time")
"""Where drivers have another word for a key of the file."""


class Reaction(StrEnum):
    """How the bench becomes safe: torque ramped to zero then disabled, or the drive's own quick stop."""

    RAMP = "ramp"
    QUICK_STOP = "quick-stop"


class Lock(StrEnum):
    """Who locks the output to the frame."""

    NONE = "none"
    OPERATOR = "operator"
    SIMULATED = "simulated"


class Device(FileModel):
    """One device: driver, transport, address, profile, and the sign of each of its channels."""

    driver: str
    interface: str
    channel: str
    node: Annotated[int, Field(ge=1, le=127)]
    bitrate: Annotated[int, Field(ge=10_000, le=1_000_000)] = 1_000_000
    profile: str = "generic"
    sign: dict[str, Literal[1, -1]] = Field(default_factory=dict)
    options: dict[str, PlainValue] = Field(default_factory=dict)


class BenchLimits(FileModel):
    """Torques N*m, speed rad/s, travel rad from where a run began, temperature degC, cycles per run."""

    motor_torque: Annotated[Positive, Quantity("N*m", EVERY_CYCLE)]
    motor_velocity: Annotated[Positive, Quantity("rad/s", EVERY_CYCLE)]
    output_torque: Annotated[Positive, Quantity("N*m", EVERY_CYCLE)]
    motor_travel: Annotated[Positive | None, Quantity("rad", EVERY_CYCLE)] = None
    output_travel: Annotated[Positive | None, Quantity("rad", EVERY_CYCLE)] = None
    load_torque: Annotated[Positive | None, Quantity("N*m", EVERY_CYCLE)] = None
    load_velocity: Annotated[Positive | None, Quantity("rad/s", EVERY_CYCLE)] = None
    load_travel: Annotated[Positive | None, Quantity("rad", EVERY_CYCLE)] = None
    temperature: Annotated[Positive | None, Quantity("degC", EVERY_CYCLE)] = None
    late_cycles: Annotated[int, Field(ge=0)] = 0
    missing_cycles: Annotated[int, Field(ge=0)] = 0

    def frozen(self) -> Limits:
        """Give the limits as the bench uses them; an undeclared bound is infinite."""
        return Limits(
            motor_torque=self.motor_torque,
            motor_velocity=self.motor_velocity,
            output_torque=self.output_torque,
            motor_travel=self.motor_travel or UNBOUNDED,
            output_travel=self.output_travel or UNBOUNDED,
            load_torque=self.load_torque or UNBOUNDED,
            load_velocity=self.load_velocity or UNBOUNDED,
            load_travel=self.load_travel or UNBOUNDED,
            temperature=self.temperature or UNBOUNDED,
            late_cycles=self.late_cycles,
            missing_cycles=self.missing_cycles,
        )


class Safety(FileModel):
    """Safe-state reaction; `ramp_time` s; `heartbeat_time` s after which a drive stops by itself."""

    reaction: Annotated[Reaction, Field(strict=False)] = Reaction.RAMP
    ramp_time: Annotated[Positive, Field(le=5.0), Quantity("s", "the ramp to the safe state")] = 0.2
    heartbeat_time: Annotated[Positive, Field(ge=0.02, le=2.0), Quantity("s", "the drive's own stop")] = 0.2


class Fixture(FileModel):
    """Whether the output can be locked, and by whom."""

    lock: Annotated[Lock, Field(strict=False)] = Lock.NONE


class BenchFile(FileModel):
    """The whole bench."""

    name: Annotated[str, Field(min_length=1, max_length=100)]
    cycle_rate: Annotated[int, Field(ge=10, le=2000), Quantity("Hz", "the control cycle")] = 1000
    bus_load_limit: Annotated[Positive, Field(le=0.95), Quantity("", "the share of its bits that a bus carries")] = 0.8
    devices: dict[str, Device]
    limits: BenchLimits
    safety: Safety = Safety()
    fixture: Fixture = Fixture()

    @classmethod
    def conflicts(cls, table: Table) -> Iterator[Conflict]:
        """Check roles, drivers, buses and what one table asks of another, on everything that can be read."""
        devices = {role: device for role, device in (table.get("devices") or {}).items() if device is not None}
        for role, device in devices.items():
            yield from _device_conflicts(role, device)
        if "motor" not in devices and table.get("devices", {}) is not None and "motor" not in table.get("devices", {}):
            yield Conflict(("devices", "motor"), None, "missing; a bench has at least the motor drive")
        yield from _bus_conflicts(devices, _value(cls, table, "cycle_rate"), _value(cls, table, "bus_load_limit"))
        yield from cls._safety_conflicts(table, devices)

    @classmethod
    def _safety_conflicts(cls, table: Table, devices: Mapping[str, Table]) -> Iterator[Conflict]:
        safety, limits, fixture = (table.get(name, {}) or {} for name in ("safety", "limits", "fixture"))
        rate, time = _value(cls, table, "cycle_rate"), _value(Safety, safety, "heartbeat_time")
        if rate is not None and time is not None and time < 10 / rate:
            rule = f"at least 10 cycles ({10 / rate:g} s at {rate} Hz)"
            yield Conflict(("safety", "heartbeat_time"), time, rule)
        for key, what in (("load_torque", "torque"), ("load_velocity", "speed and its position steps")):
            if "load" in devices and key not in limits:
                yield Conflict(("limits", key), None, f"missing; a bench with a load drive bounds its {what}")
        if fixture.get("lock") == Lock.SIMULATED and any(d.get("interface") != SIMULATED for d in devices.values()):
            yield Conflict(("fixture", "lock"), str(Lock.SIMULATED), "only where every device is simulated")

    def bus_loads(self) -> dict[tuple[str, str], float]:
        """Give the share of its bit rate that each bus carries in the worst case, by (interface, channel)."""
        return _bus_loads([device.model_dump() for device in self.devices.values()], self.cycle_rate)

    @property
    def simulated(self) -> bool:
        """True if no real device is named."""
        return all(device.interface == SIMULATED for device in self.devices.values())

    @property
    def cycle_time(self) -> float:
        """Length of one control cycle, s."""
        return 1.0 / self.cycle_rate

    def _most(self, role: str) -> tuple[float | None, float | None]:
        """Give torque (N*m) and speed (rad/s) that the limits allow a role's shaft.

        The output turns with the load drive; without one all that is known is that it does not outrun its motor.
        """
        limits = self.limits
        output = limits.load_velocity if "load" in self.devices else limits.motor_velocity
        return {
            "motor": (limits.motor_torque, limits.motor_velocity),
            "load": (limits.load_torque, limits.load_velocity),
            "output_encoder": (None, output),
        }.get(role, (None, None))

    def device_configs(self) -> tuple[DeviceConfig, ...]:
        """Give what each driver is told, role by role."""
        return tuple(
            DeviceConfig(
                name=role,
                driver=device.driver,
                interface=device.interface,
                channel=device.channel,
                address=device.node,
                profile=device.profile,
                cycle_time=self.cycle_time,
                heartbeat_time=self.safety.heartbeat_time,
                max_torque=self._most(role)[0],
                max_velocity=self._most(role)[1],
                sign={name: int(sign) for name, sign in device.sign.items()},
                options={"bitrate": device.bitrate, **device.options},
            )
            for role, device in self.devices.items()
        )


def _value(model: type[FileModel], table: Table, name: str) -> Any:
    """Give what the table says, the default where it says nothing, None where what it says is wrong."""
    return table.get(name, model.model_fields[name].default)


def _device_conflicts(role: str, device: Table) -> Iterator[Conflict]:
    path = ("devices", role)
    kind = ROLES.get(role)
    if kind is None:
        yield Conflict(path, dict(device), f"unknown role{did_you_mean(role, ROLES)}; there are {', '.join(ROLES)}")
    name, interface = device.get("driver"), device.get("interface")
    drivers = all_drivers()
    entry = drivers.get(name) if name is not None else None
    if entry is None and name is not None:
        yield Conflict((*path, "driver"), name, f"unknown{did_you_mean(name, drivers)}; there are {', '.join(drivers)}")
    elif entry is not None and kind is not None and entry.kind is not kind:
        yield Conflict((*path, "driver"), name, f"is a {entry.kind}, not a {kind}")
    allowed = SIGNED_SIGNALS.get(role)
    for signal, sign in (device.get("sign") or {}).items():
        if allowed is not None and signal not in allowed:
            rule = f"no such channel{did_you_mean(signal, allowed)}; there are {', '.join(sorted(allowed))}"
            yield Conflict((*path, "sign", signal), sign, rule)
    if interface == "udp_multicast":
        yield Conflict((*path, "interface"), interface, "refused, it hears its own frames and loses others")
    elif interface is not None and _frames(name) and interface not in (SIMULATED, *_can_interfaces()):
        rule = f"no python-can interface of that name{did_you_mean(interface, _can_interfaces())}"
        yield Conflict((*path, "interface"), interface, rule)
    own = (device.get("options") or {}).get("master_id", BENCH_NODE)
    if _frames(name) and device.get("node") is not None and device["node"] == own:
        yield Conflict((*path, "node"), own, "is the bench's own node id (options.master_id)")


def _bus_conflicts(devices: Mapping[str, Table], cycle_rate: int | None, limit: float | None) -> Iterator[Conflict]:
    if len({device["interface"] == SIMULATED for device in devices.values() if device.get("interface")}) > 1:
        shown = ", ".join(f"{role}: {device['interface']}" for role, device in devices.items() if "interface" in device)
        yield Conflict(("devices",), shown, "simulated and real devices are mixed, which this version cannot join")
    buses: dict[tuple[str, str], dict[str, Table]] = {}
    for role, device in devices.items():
        if device.get("interface") is not None and device.get("channel") is not None:
            buses.setdefault((device["interface"], device["channel"]), {})[role] = device
    for (interface, channel), members in buses.items():
        place = f"{interface} '{channel}'"
        nodes: dict[int, str] = {}
        for role, device in members.items():
            first = nodes.setdefault(device["node"], role) if device.get("node") is not None else role
            if first != role:
                rule = f"devices.{first} and devices.{role} share a node id on {place}"
                yield Conflict(("devices", role, "node"), device["node"], rule)
        rates = {rate for device in members.values() if (rate := _value(Device, device, "bitrate")) is not None}
        if len(rates) > 1:
            yield Conflict(("devices",), sorted(rates), f"different bit rates on {place}")
    if cycle_rate is None or limit is None:
        return
    for (interface, channel), load in _bus_loads(list(devices.values()), cycle_rate).items():
        if load > limit:
            rule = (
                f"load {load:.0%} of bus {interface} '{channel}' is above the limit {limit:.0%}; lower cycle_rate, "
                "raise the bit rate, or use two buses"
            )
            yield Conflict(("cycle_rate",), cycle_rate, rule)


def _bus_loads(devices: Sequence[Table], cycle_rate: int) -> dict[tuple[str, str], float]:
    """Give the load of each bus by (interface, channel); a device of which too little is known adds nothing."""
    loads: dict[tuple[str, str], float] = {}
    for device in devices:
        interface, channel, bitrate = device.get("interface"), device.get("channel"), _value(Device, device, "bitrate")
        if interface is None or channel is None or bitrate is None:
            continue
        share = cycle_rate / bitrate
        loads.setdefault((interface, channel), SYNC_BITS * share)
        loads[interface, channel] += sum(frame_bits(size) for size in _frames(device.get("driver"))) * share
    return loads


def _can_interfaces() -> frozenset[str]:
    from can.interfaces import VALID_INTERFACES  # heavy, and only a bench file needs it

    return frozenset(VALID_INTERFACES)


def _frames(driver: str | None) -> tuple[int, ...]:
    """Give the data bytes of each frame that a device of this driver puts on a CAN bus in every cycle."""
    entry = all_drivers().get(driver) if driver is not None else None
    return entry.cycle_frames if entry is not None else ()


def frame_bits(size: int) -> int:
    """Give the longest CAN frame, in bits, with `size` data bytes and an 11-bit identifier, inter-frame space in."""
    return 47 + 8 * size + (34 + 8 * size - 1) // 4


def bench_source(name: str) -> str:
    """Give how an error calls the bench that `--bench` names."""
    return "shipped bench 'sim'" if name == "sim" else name


@contextmanager
def naming_the_bench(name: str) -> Iterator[None]:
    """Let mistakes that a driver or procedure finds in the bench name the file and its keys."""
    try:
        yield
    except ConfigError as error:
        device = _DEVICE_SOURCE.fullmatch(error.source)
        if error.source != "bench" and device is None:
            raise
        prefix = f"devices.{device[1]}." if device is not None else ""
        named = ConfigError(
            bench_source(name),
            [Mistake(_key_in_file(prefix + m.path), m.value, m.rule) for m in error.mistakes],
            hint=error.hint,
        )
        for note in getattr(error, "__notes__", []):
            named.add_note(note)
        raise named from error


def _key_in_file(path: str) -> str:
    return _HEARTBEAT_PATH.sub("safety.heartbeat_time", _NODE_PATH.sub(r"\1.node", path))


def load_bench(name: str) -> tuple[BenchFile, str]:
    """Read a bench file, or the shipped one for "sim"; give the model and the text. Raises ConfigError.

    Files that it names (`options.eds`) lie beside it.
    """
    if name == "sim":
        text = files("rig.config").joinpath("sim_bench.toml").read_text(encoding="utf-8")
        return parse_toml(text, BenchFile, bench_source(name)), text
    if not name:
        raise ConfigError("--bench", [Mistake("--bench", name, "expected a bench file, or sim")])
    text = read_text(Path(name))
    return _beside(parse_toml(text, BenchFile, name), Path(name).parent), text


def _beside(bench: BenchFile, folder: Path) -> BenchFile:
    """Take the files that devices name from beside the bench file."""
    devices = {
        role: device.model_copy(update={"options": {**device.options, "eds": str(folder / str(device.options["eds"]))}})
        if device.options.get("eds")
        else device
        for role, device in bench.devices.items()
    }
    return bench.model_copy(update={"devices": devices})

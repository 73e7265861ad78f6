"""The bench file, `bench.toml`: devices, rates, limits, safety reaction. Every mistake is reported at once.

The load of each CAN bus is computed (worst-case bit stuffing, 11-bit identifiers) and refused above its limit.
"""

import math
from collections.abc import Mapping
from enum import StrEnum
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, field_validator, model_validator

from drivers.devices import DeviceConfig
from drivers.registry import DriverEntry, Kind, all_drivers
from drivers.types import Limits
from rig.config.dut import Positive
from rig.config.toml_file import FileModel, parse_toml, read_text

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

UNBOUNDED = math.inf


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
    options: dict[str, bool | int | float | str] = Field(default_factory=dict)


class BenchLimits(FileModel):
    """Torques N*m, speed rad/s, travel rad from where a run began, temperature degC, cycles per run."""

    motor_torque: Positive
    motor_velocity: Positive
    output_torque: Positive
    motor_travel: Positive | None = None
    output_travel: Positive | None = None
    load_torque: Positive | None = None
    load_velocity: Positive | None = None
    load_travel: Positive | None = None
    temperature: Positive | None = None
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
    ramp_time: Annotated[Positive, Field(le=5.0)] = 0.2
    heartbeat_time: Annotated[Positive, Field(ge=0.02, le=2.0)] = 0.2


class Fixture(FileModel):
    """Whether the output can be locked, and by whom."""

    lock: Annotated[Lock, Field(strict=False)] = Lock.NONE


class BenchFile(FileModel):
    """The whole bench."""

    name: Annotated[str, Field(min_length=1, max_length=100)]
    cycle_rate: Annotated[int, Field(ge=10, le=2000)] = 1000
    bus_load_limit: Annotated[Positive, Field(le=0.95)] = 0.8
    devices: dict[str, Device]
    limits: BenchLimits
    safety: Safety = Safety()
    fixture: Fixture = Fixture()

    @field_validator("devices")
    @classmethod
    def _known_devices(cls, devices: dict[str, Device]) -> dict[str, Device]:
        mistakes = [text for role, device in devices.items() for text in _device_mistakes(role, device)]
        if "motor" not in devices:
            mistakes.append("motor: missing; a bench has at least the motor drive")
        if len({device.interface == SIMULATED for device in devices.values()}) > 1:
            mistakes.append("simulated and real devices are mixed, which this version cannot join")
        if mistakes:
            raise ValueError("; ".join(mistakes))
        return devices

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        mistakes = self._bus_mistakes()
        if self.safety.heartbeat_time < 10 / self.cycle_rate:
            mistakes.append(
                f"safety.heartbeat_time = {self.safety.heartbeat_time:g} s: at least 10 cycles "
                f"({10 / self.cycle_rate:g} s at {self.cycle_rate} Hz)"
            )
        if "load" in self.devices and self.limits.load_torque is None:
            mistakes.append("limits.load_torque: missing; a bench with a load drive bounds its torque")
        if self.fixture.lock is Lock.SIMULATED and not self.simulated:
            mistakes.append("fixture.lock = 'simulated': only where every device is simulated")
        if mistakes:
            raise ValueError("; ".join(mistakes))
        return self

    def _bus_mistakes(self) -> list[str]:
        mistakes = []
        for (interface, channel), load in self.bus_loads().items():
            nodes = [d.node for d in self.devices.values() if (d.interface, d.channel) == (interface, channel)]
            rates = {d.bitrate for d in self.devices.values() if (d.interface, d.channel) == (interface, channel)}
            if len(set(nodes)) != len(nodes):
                mistakes.append(f"devices on {interface} '{channel}': two devices share a node id ({sorted(nodes)})")
            if len(rates) > 1:
                mistakes.append(f"devices on {interface} '{channel}': different bit rates ({sorted(rates)})")
            if load > self.bus_load_limit:
                mistakes.append(
                    f"bus {interface} '{channel}': load {load:.0%} at {self.cycle_rate} Hz is above the limit "
                    f"{self.bus_load_limit:.0%}; lower cycle_rate, raise the bit rate, or use two buses"
                )
        return mistakes

    def bus_loads(self) -> dict[tuple[str, str], float]:
        """Give the share of its bit rate that each bus carries in the worst case, by (interface, channel)."""
        drivers = all_drivers()
        loads: dict[tuple[str, str], float] = {}
        for device in self.devices.values():
            key = (device.interface, device.channel)
            entry = drivers.get(device.driver)
            share = self.cycle_rate / device.bitrate
            if key not in loads:
                loads[key] = SYNC_BITS * share
            loads[key] += sum(frame_bits(size) for size in _cycle_frames(entry)) * share
        return loads

    @property
    def simulated(self) -> bool:
        """True if no real device is named."""
        return all(device.interface == SIMULATED for device in self.devices.values())

    @property
    def cycle_time(self) -> float:
        """Length of one control cycle, s."""
        return 1.0 / self.cycle_rate

    def _most(self, role: str) -> tuple[float | None, float | None]:
        """Give torque (N*m) and speed (rad/s) that the limits allow a role's shaft. No output outruns its motor."""
        limits = self.limits
        return {
            "motor": (limits.motor_torque, limits.motor_velocity),
            "load": (limits.load_torque, limits.load_velocity),
            "output_encoder": (None, limits.motor_velocity),
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


def _device_mistakes(role: str, device: Device) -> list[str]:
    drivers = all_drivers()
    kind = ROLES.get(role)
    if kind is None:
        return [f"{role}: unknown role; there are {', '.join(ROLES)}"]
    mistakes = []
    entry = drivers.get(device.driver)
    if entry is None:
        mistakes.append(f"{role}.driver = '{device.driver}': unknown; there are {', '.join(drivers)}")
    elif entry.kind is not kind:
        mistakes.append(f"{role}.driver = '{device.driver}': is a {entry.kind}, not a {kind}")
    allowed = SIGNED_SIGNALS[role]
    mistakes += [
        f"{role}.sign.{name}: no such channel; there are {', '.join(sorted(allowed))}"
        for name in device.sign
        if name not in allowed
    ]
    if device.interface == "udp_multicast":
        mistakes.append(f"{role}.interface = 'udp_multicast': refused, it hears its own frames and loses others")
    elif entry is not None and entry.cycle_frames and device.interface not in (SIMULATED, *_can_interfaces()):
        mistakes.append(f"{role}.interface = '{device.interface}': no python-can interface of that name")
    return mistakes


def _can_interfaces() -> frozenset[str]:
    from can.interfaces import VALID_INTERFACES  # heavy, and only a bench file needs it

    return frozenset(VALID_INTERFACES)


def _cycle_frames(entry: DriverEntry | None) -> tuple[int, ...]:
    return entry.cycle_frames if entry is not None else ()


def frame_bits(size: int) -> int:
    """Give the longest CAN frame, in bits, with `size` data bytes and an 11-bit identifier, inter-frame space in."""
    return 47 + 8 * size + (34 + 8 * size - 1) // 4


def load_bench(name: str) -> tuple[BenchFile, str]:
    """Read a bench file, or the shipped one for "sim"; give the model and the text. Raises ConfigError."""
    if name == "sim":
        text = files("rig.config").joinpath("sim_bench.toml").read_text(encoding="utf-8")
        return parse_toml(text, BenchFile, "shipped bench 'sim'"), text
    text = read_text(Path(name))
    return parse_toml(text, BenchFile, name), text

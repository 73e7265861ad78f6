"""What a driver is: three small protocols, one per kind of device, and the bus they may share.

A driver turns SI intents into frames and frames into typed readings. It holds no policy, opens no file, prints
nothing and never hides a fault behind a retry. Every state change is read back; `close` works on a half-open device.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol, runtime_checkable

from drivers.clock import Clock
from drivers.types import DeviceEvent, DeviceInfo, DriveReading, DriveState, Mode, SensorReading

if TYPE_CHECKING:
    import can

OptionValue = bool | int | float | str
"""What an option of a device may be in the bench file."""


@dataclass(frozen=True, slots=True)
class DeviceConfig:
    """What the bench file says of one device, after validation.

    `interface` and `channel` name the transport (a python-can interface, or a serial port), `address` the node
    id or port; `sign` maps a signal name to +1 or -1; `options` are the driver's own keys, checked by the driver.
    `cycle_time` in s; `heartbeat_time` in s is how long the device may go without the bench's heartbeat before
    it stops the motor by itself. `max_torque` N*m and `max_velocity` rad/s are what the bench's limits allow the
    device's shaft, None where they say nothing.
    """

    name: str
    driver: str
    interface: str
    channel: str
    address: int
    profile: str
    cycle_time: float
    heartbeat_time: float
    max_torque: float | None = None
    max_velocity: float | None = None
    sign: Mapping[str, int] = field(default_factory=dict)
    options: Mapping[str, OptionValue] = field(default_factory=dict)


@runtime_checkable
class Drive(Protocol):
    """A motor drive. Position rad, speed rad/s, torque N*m at its own shaft."""

    name: str

    def connect(self) -> DeviceInfo:
        """Identify, configure and read back; leave the drive disabled. Raises NotConnectedError, DriveFaultError."""

    def enable(self, mode: Mode) -> None:
        """Clear the targets, switch the mode, verify it, energise. Raises DriveFaultError if refused."""

    def write(self, value: float) -> None:
        """Queue the setpoint of the active mode for this cycle."""

    def read(self) -> DriveReading:
        """Give the reading latched at the last SYNC."""

    def disable(self) -> DriveState:
        """Take the torque away and give the state read back."""

    def quick_stop(self) -> DriveState:
        """Stop by the drive's own quick-stop ramp and give the state read back."""

    def fault_reset(self) -> DriveState:
        """Reset a fault whose cause is gone; never re-enables. Gives the state read back."""

    def close(self) -> None:
        """Restore what was changed and let go; allowed in any condition."""


@runtime_checkable
class Sensor(Protocol):
    """An encoder (rad) or a torque transducer (N*m)."""

    name: str

    def connect(self) -> DeviceInfo:
        """Identify, configure and read back. Raises NotConnectedError."""

    def read(self) -> SensorReading:
        """Give the value latched at the last SYNC."""

    def close(self) -> None:
        """Restore what was changed and let go; allowed in any condition."""


@runtime_checkable
class TorqueSensor(Sensor, Protocol):
    """A torque transducer that can be zeroed."""

    def tare(self) -> float:
        """Zero the sensor at the present load; give the offset (N*m) it removed. Raises RigTimeoutError if refused."""


class DeviceBus(Protocol):
    """What several devices share: one owner, one exchange per control cycle."""

    def attach(self, config: DeviceConfig) -> Drive | Sensor:
        """Make the driver for one device of this bus; nothing is sent yet."""

    def exchange(self) -> None:
        """Run one cycle: send the queued setpoints, SYNC, and collect every device's reading."""

    def listen(self) -> None:
        """Take in what has arrived and send nothing, so that no watchdog is fed."""

    def events(self) -> Sequence[DeviceEvent]:
        """Give what the devices reported by themselves since the last call."""

    def close(self) -> None:
        """Let go of the transport; allowed in any condition."""


class BusFactory(Protocol):
    """Opens the transport that `configs` share; one per driver family, found in `drivers.registry`."""

    def __call__(
        self, configs: Sequence[DeviceConfig], clock: Clock, transport: "can.BusABC | None" = None
    ) -> DeviceBus:
        """Open the bus. `transport`: an open python-can bus to use instead of opening `interface`/`channel`."""

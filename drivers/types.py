"""Values that travel between drivers, procedures and the application. All SI; None means "not measured".

What is made anew in every control cycle is a NamedTuple: as immutable as a frozen dataclass and three times cheaper.
"""

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple


class Mode(StrEnum):
    """What a drive regulates, cyclically and synchronously (CiA 402 modes 10, 9, 8)."""

    TORQUE = "torque"
    VELOCITY = "velocity"
    POSITION = "position"


class DriveState(StrEnum):
    """States of the CiA 402 power state machine (statusword 0x6041)."""

    NOT_READY = "not ready to switch on"
    SWITCH_ON_DISABLED = "switch-on disabled"
    READY = "ready to switch on"
    SWITCHED_ON = "switched on"
    ENABLED = "operation enabled"
    QUICK_STOP = "quick stop active"
    FAULT_REACTION = "fault reaction active"
    FAULT = "fault"

    @property
    def energised(self) -> bool:
        """True if the motor may carry torque in this state."""
        return self in (DriveState.ENABLED, DriveState.QUICK_STOP, DriveState.FAULT_REACTION)


class Axis(StrEnum):
    """The two drives of a bench: the motor under test and the load drive at the output."""

    MOTOR = "motor"
    LOAD = "load"


class Setpoint(NamedTuple):
    """What one axis is asked for: N*m, rad/s or rad at its own shaft, according to `mode`.

    Whoever hands it on refuses a value that is not a finite number: the limit check and the drive, by a LimitError.
    """

    mode: Mode
    value: float


class DriveReading(NamedTuple):
    """One drive at one SYNC. Position rad, torque N*m, velocity rad/s, current A; `age` in cycles (0: fresh)."""

    position: float
    torque: float
    state: DriveState
    status_word: int
    limit_active: bool
    age: int
    velocity: float | None = None
    current: float | None = None
    temperature: float | None = None
    voltage: float | None = None


class SensorReading(NamedTuple):
    """One sensor value at one SYNC, in the sensor's SI unit; `age` in cycles (0: fresh)."""

    value: float
    age: int
    valid: bool = True


@dataclass(frozen=True, slots=True)
class DeviceInfo:
    """What a device said of itself when it was connected.

    `identity`: vendor, product, revision, serial as reported. `resolution` and `full_scale` in the SI unit of the
    main quantity (N*m for a torque sensor, rad for an encoder, N*m of torque for a drive), None where unknown.
    `changed`: every device parameter the driver altered, as (object, old value, new value).
    `warnings`: what the operator should know.
    """

    name: str
    driver: str
    address: str
    identity: tuple[tuple[str, str], ...] = ()
    resolution: float | None = None
    full_scale: float | None = None
    changed: tuple[tuple[str, str, str], ...] = ()
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class DeviceEvent:
    """Something a device reported by itself: an emergency message, a boot-up, a lost heartbeat.

    `code` and `register` are the CiA 301 error code and error register, 0 where they do not apply; `data` the
    five vendor bytes of an emergency message.
    """

    device: str
    time: float
    text: str
    code: int = 0
    register: int = 0
    data: bytes = b""


class Sample(NamedTuple):
    """Everything the bench measured in one control cycle; names and signs as in `drivers.signals`."""

    time: float
    cycle: int
    late: int = 0
    motor_position: float | None = None
    motor_velocity: float | None = None
    motor_position_command: float | None = None
    motor_velocity_command: float | None = None
    motor_torque: float | None = None
    motor_torque_command: float | None = None
    motor_current: float | None = None
    output_position: float | None = None
    output_velocity: float | None = None
    output_torque: float | None = None
    load_torque: float | None = None
    load_torque_command: float | None = None
    load_position: float | None = None
    temperature: float | None = None
    motor_temperature: float | None = None
    bus_voltage: float | None = None
    supply_voltage: float | None = None
    status_word: int | None = None
    load_status_word: int | None = None
    auxiliary: tuple[tuple[str, float], ...] = ()


@dataclass(frozen=True, slots=True)
class Limits:
    """What the bench never exceeds, checked every cycle. Torques N*m, speeds rad/s, travel rad, temperature degC.

    `motor_travel`, `output_travel` and `load_travel` bound the distance from where a run began; infinity: no bound
    declared.
    `late_cycles` and `missing_cycles` are counts per run.
    """

    motor_torque: float
    motor_velocity: float
    output_torque: float
    motor_travel: float = math.inf
    output_travel: float = math.inf
    load_torque: float = math.inf
    load_velocity: float = math.inf
    load_travel: float = math.inf
    temperature: float = math.inf
    late_cycles: int = 0
    missing_cycles: int = 0

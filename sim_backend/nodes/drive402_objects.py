"""Settings of a simulated CiA 402 drive and the table of objects that follows from them."""

import math
from dataclasses import dataclass
from enum import StrEnum

from sim_backend.errors import ModelError
from sim_backend.nodes.communication import DeviceType
from sim_backend.nodes.object_dictionary import Access, DataType, ObjectSpec, array
from sim_backend.nodes.pdo import PdoDefault

CSP, CSV, CST = 8, 9, 10
"""Modes of operation: cyclic synchronous position, velocity, torque."""

NO_WINDOW = 0xFFFFFFFF
"""0x6065: the following error is not watched."""

I32_MIN, I32_MAX = -(2**31), 2**31 - 1


class TorqueUnit(StrEnum):
    """Unit of the rated torque 0x6076."""

    MILLI = "mN*m"
    MICRO = "uN*m"


class VelocityUnit(StrEnum):
    """Unit of 0x606C, 0x60FF; stated in 0x60A9."""

    COUNTS_PER_SECOND = "counts/s"
    RPM = "rpm"


@dataclass(frozen=True, slots=True)
class DriveConfig:
    """One drive on one shaft. SI: N*m, N*m/A, rad/s, rad/s^2, rad, s.

    `axis` is the plant's name of the shaft, `encoder_counts` (1/rev) are those of a turn of it. `max_torque` is what
    0x6072 says at power-on, `max_speed` 0x6080. `following_window` and `following_time` start 0x6065 and 0x6066. A mode
    in `refuse_modes` is refused although 0x6502 may list it: by an abort, or silently where `refuse_by_silence`.
    """

    node_id: int = 1
    axis: str = "motor"
    encoder_counts: int = 16384
    rated_torque: float = 0.188
    torque_constant: float = 0.321
    max_torque: float = 0.564
    max_speed: float = 800.0
    deceleration: float = 1000.0
    quick_stop_deceleration: float = 4000.0
    standstill_speed: float = 0.5
    following_window: float = math.pi
    following_time: float = 0.1
    modes: tuple[int, ...] = (CSP, CSV, CST)
    mode_switch_time: float = 0.002
    refuse_modes: tuple[int, ...] = ()
    refuse_by_silence: bool = False
    torque_unit: TorqueUnit = TorqueUnit.MILLI
    velocity_unit: VelocityUnit = VelocityUnit.COUNTS_PER_SECOND
    supply_voltage: float = 48.0

    def __post_init__(self) -> None:
        positive = {
            "encoder_counts": self.encoder_counts,
            "rated_torque": self.rated_torque,
            "torque_constant": self.torque_constant,
            "max_torque": self.max_torque,
            "max_speed": self.max_speed,
            "deceleration": self.deceleration,
            "quick_stop_deceleration": self.quick_stop_deceleration,
        }
        for name, value in positive.items():
            if not (math.isfinite(value) and value > 0):
                raise ModelError(f"drive of axis '{self.axis}': {name} = {value} must be a positive number")

    @property
    def counts_per_radian(self) -> float:
        """Encoder counts per rad of the shaft."""
        return self.encoder_counts / math.tau

    @property
    def velocity_scale(self) -> float:
        """Velocity units per rad/s."""
        return self.counts_per_radian if self.velocity_unit is VelocityUnit.COUNTS_PER_SECOND else 60.0 / math.tau


def drive_type(config: DriveConfig) -> DeviceType:
    """Give the drive's table of objects. Shipped PDOs: status and control on events, the rest unused."""
    return DeviceType(
        profile=0x00020192,
        name="simulated CiA 402 drive",
        product_code=0x402,
        objects=tuple(_objects(config)),
        receive=(
            PdoDefault(((0x6040, 0),), valid=True),
            PdoDefault(((0x6040, 0), (0x6071, 0))),
            PdoDefault(((0x6040, 0), (0x607A, 0))),
            PdoDefault(((0x6040, 0), (0x60FF, 0))),
        ),
        transmit=(
            PdoDefault(((0x6041, 0),), valid=True),
            PdoDefault(((0x6041, 0), (0x6064, 0))),
            PdoDefault(((0x6041, 0), (0x606C, 0))),
            PdoDefault(((0x6041, 0), (0x6077, 0))),
        ),
    )


def _objects(c: DriveConfig) -> list[ObjectSpec]:
    per_mille = 1000.0 / c.rated_torque
    torque_scale = 1e3 if c.torque_unit is TorqueUnit.MILLI else 1e6
    max_torque = round(c.max_torque * per_mille)
    window = min(round(c.following_window * c.counts_per_radian), NO_WINDOW - 1)
    supported = sum(1 << mode - 1 for mode in c.modes)
    rpm = c.velocity_unit is VelocityUnit.RPM
    i8, i16, i32, u8, u16, u32 = (
        DataType.I8,
        DataType.I16,
        DataType.I32,
        DataType.U8,
        DataType.U16,
        DataType.U32,
    )
    return [
        ObjectSpec(0x6007, 0, "Abort connection option code", i16, Access.RW, 1, 0, 3),
        ObjectSpec(0x603F, 0, "Error code", u16, mappable=True),
        ObjectSpec(0x6040, 0, "Control word", u16, Access.RW, mappable=True),
        ObjectSpec(0x6041, 0, "Status word", u16, mappable=True),
        ObjectSpec(0x605A, 0, "Quick stop option code", i16, Access.RW, 2, 0, 8),
        ObjectSpec(0x605B, 0, "Shutdown option code", i16, Access.RW, 0, 0, 1),
        ObjectSpec(0x605C, 0, "Disable operation option code", i16, Access.RW, 1, 0, 1),
        ObjectSpec(0x605D, 0, "Halt option code", i16, Access.RW, 1, 1, 4),
        ObjectSpec(0x605E, 0, "Fault reaction option code", i16, Access.RW, 2, 0, 4),
        ObjectSpec(0x6060, 0, "Mode of operation", i8, Access.RW, mappable=True),
        ObjectSpec(0x6061, 0, "Mode of operation display", i8, mappable=True),
        ObjectSpec(0x6064, 0, "Position actual value", i32, mappable=True),
        ObjectSpec(0x6065, 0, "Following error window", u32, Access.RW, window),
        ObjectSpec(0x6066, 0, "Following error time out (ms)", u16, Access.RW, round(c.following_time * 1e3)),
        ObjectSpec(0x606C, 0, "Velocity actual value", i32, mappable=True),
        ObjectSpec(0x6071, 0, "Target torque (per mille)", i16, Access.RW, mappable=True),
        ObjectSpec(0x6072, 0, "Max torque (per mille)", u16, Access.RW, max_torque, mappable=True),
        ObjectSpec(0x6073, 0, "Max current (per mille)", u16, Access.RW, max_torque, mappable=True),
        ObjectSpec(0x6074, 0, "Torque demand (per mille)", i16, mappable=True),
        ObjectSpec(0x6075, 0, "Motor rated current (mA)", u32, default=round(c.rated_torque / c.torque_constant * 1e3)),
        ObjectSpec(
            0x6076, 0, f"Motor rated torque ({c.torque_unit})", u32, default=round(c.rated_torque * torque_scale)
        ),
        ObjectSpec(0x6077, 0, "Torque actual value (per mille)", i16, mappable=True),
        ObjectSpec(0x6078, 0, "Current actual value (per mille)", i16, mappable=True),
        ObjectSpec(0x6079, 0, "DC link voltage (mV)", u32, default=round(c.supply_voltage * 1e3), mappable=True),
        ObjectSpec(0x607A, 0, "Target position", i32, Access.RW, mappable=True),
        *array(
            0x607D,
            "Software position limit",
            [
                ObjectSpec(0x607D, 1, "Minimum position limit", i32, Access.RW, I32_MIN),
                ObjectSpec(0x607D, 2, "Maximum position limit", i32, Access.RW, I32_MAX),
            ],
        ),
        ObjectSpec(0x6080, 0, "Max motor speed (rpm)", u32, Access.RW, round(c.max_speed * 60.0 / math.tau)),
        ObjectSpec(0x6084, 0, "Profile deceleration", u32, Access.RW, _unsigned(c.deceleration * c.velocity_scale)),
        ObjectSpec(
            0x6085,
            0,
            "Quick stop deceleration",
            u32,
            Access.RW,
            _unsigned(c.quick_stop_deceleration * c.velocity_scale),
        ),
        *_ratio(0x608F, "Position encoder resolution", c.encoder_counts),
        *_ratio(0x6091, "Gear ratio", 1),
        ObjectSpec(0x60A8, 0, "SI unit position", u32, default=0x00B50000),
        ObjectSpec(0x60A9, 0, "SI unit velocity", u32, default=0x00B44700 if rpm else 0x00B50300),
        ObjectSpec(0x60B2, 0, "Torque offset (per mille)", i16, Access.RW, mappable=True),
        *array(
            0x60C2,
            "Interpolation time period",
            [
                ObjectSpec(0x60C2, 1, "Interpolation time: value", u8, Access.RW, 1, 1, 255),
                ObjectSpec(0x60C2, 2, "Interpolation time: exponent of 10", i8, Access.RW, -3, -6, 0),
            ],
        ),
        ObjectSpec(0x60E0, 0, "Positive torque limit (per mille)", u16, Access.RW, max_torque, mappable=True),
        ObjectSpec(0x60E1, 0, "Negative torque limit (per mille)", u16, Access.RW, max_torque, mappable=True),
        ObjectSpec(0x60F4, 0, "Following error actual value", i32, mappable=True),
        ObjectSpec(0x60FF, 0, "Target velocity", i32, Access.RW, mappable=True),
        ObjectSpec(0x6502, 0, "Supported drive modes", u32, default=supported),
    ]


def _ratio(index: int, name: str, numerator: int) -> list[ObjectSpec]:
    entries = [
        ObjectSpec(index, 1, f"{name}: numerator", DataType.U32, default=numerator),
        ObjectSpec(index, 2, f"{name}: motor revolutions", DataType.U32, default=1),
    ]
    return array(index, name, entries)


def _unsigned(value: float) -> int:
    return min(round(value), 0xFFFFFFFF)

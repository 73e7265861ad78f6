"""A simulated torque transducer amplifier after CiA 404, one channel.

    process value = round(torque * 10^digits), clipped at full scale; N*m

An autozero (0x6125, signature "zero") moves the offset 0x9124 so that the process value becomes 0. Outside the
tare range a public manual only says "time out": this device aborts with 0x05040000 or stays silent, by switch.
"""

import math
import struct
from dataclasses import dataclass

from sim_backend.errors import ModelError
from sim_backend.nodes.communication import CanopenNode, DeviceType, NodeOptions
from sim_backend.nodes.object_dictionary import (
    AbortCode,
    AbortError,
    Access,
    DataType,
    NoAnswerError,
    ObjectSpec,
    array,
)
from sim_backend.nodes.pdo import PdoDefault
from sim_backend.nodes.units import to_i16, to_i32
from sim_backend.ports import PlantPort

ZERO = 0x6F72657A
"""The autozero signature: "zero" as little-endian text."""

MAX_DIGITS = 6
_OVER_RANGE, _UNDER_RANGE = 0x02, 0x04


@dataclass(frozen=True, slots=True)
class TorqueConfig:
    """`full_scale` N*m, `digits` decimals of the integer process value, `tare_range` N*m.

    `unit_word` is 0x6131 as the device gives it: no code for N*m is verified, so 0 claims none.
    """

    node_id: int = 4
    full_scale: float = 40.0
    digits: int = 4
    tare_range: float = 8.0
    refuse_tare_by_silence: bool = False
    unit_word: int = 0

    def __post_init__(self) -> None:
        if not 0 <= self.digits <= MAX_DIGITS:
            raise ModelError(f"torque transducer: digits = {self.digits} must be 0 to {MAX_DIGITS}")
        if not 0 < self.full_scale * 10**self.digits < 2**31:
            raise ModelError(
                f"torque transducer: full scale {self.full_scale} N*m with {self.digits} digits must fit 32 bits"
            )


class Torque404:
    """The application half of a transducer."""

    moves = False

    def __init__(self, config: TorqueConfig, plant: PlantPort) -> None:
        self.config = config
        self.device_type = _torque_type(config)
        self._read = plant.read
        self._offset = 0.0
        self._scale = 1.0

    def attach(self, node: CanopenNode) -> None:
        """Bind the objects to their behaviour."""
        objects = node.dictionary
        self._digits = objects[0x6132, 1]
        objects[0x9130, 1].read = self._integer
        objects[0x7130, 1].read = lambda: to_i16(self._integer())
        objects[0x6130, 1].read = self._float32
        objects[0x6150, 1].read = self._status
        objects[0x9124, 1].read = lambda: to_i32(self._offset * self._scale)
        self._digits.changed = lambda _: self._configure()
        objects[0x6125, 1].check = self._check_zero
        objects[0x6125, 1].changed = self._zero

    def start(self) -> None:
        """Power on: the tare is forgotten."""
        self._offset = 0.0
        self._configure()

    def tick(self, time: float) -> None:
        """Do nothing: the amplifier has no state that moves by itself."""

    def connection_lost(self) -> None:
        """Do nothing: a transducer moves nothing."""

    def _configure(self) -> None:
        self._scale = 10.0**self._digits.value

    def _clipped(self) -> float:
        torque = self._read().output_torque
        limit = self.config.full_scale
        return torque if -limit <= torque <= limit else math.copysign(limit, torque)

    def _integer(self) -> int:
        return to_i32((self._clipped() + self._offset) * self._scale)

    def _float32(self) -> float:
        return float(struct.unpack("<f", struct.pack("<f", self._clipped() + self._offset))[0])

    def _status(self) -> int:
        torque = self._read().output_torque
        if torque >= self.config.full_scale:
            return _OVER_RANGE
        return _UNDER_RANGE if torque <= -self.config.full_scale else 0

    def _check_zero(self, value: int) -> None:
        if value != ZERO:
            raise AbortError(AbortCode.CANNOT_STORE)
        if abs(self._read().output_torque) > self.config.tare_range:
            if self.config.refuse_tare_by_silence:
                raise NoAnswerError("tare outside its range")
            raise AbortError(AbortCode.TIME_OUT)

    def _zero(self, _value: int) -> None:
        self._offset = -self._clipped()


def torque_node(config: TorqueConfig, plant: PlantPort, options: NodeOptions | None = None) -> CanopenNode:
    """Give a torque transducer on the bus."""
    return CanopenNode(config.node_id, Torque404(config, plant), options)


def _torque_type(c: TorqueConfig) -> DeviceType:
    def channel(
        index: int, name: str, kind: DataType, access: Access = Access.RO, default: int = 0, **limits: int
    ) -> list[ObjectSpec]:
        mappable = index in (0x6130, 0x6150, 0x7130, 0x9130)
        entry = ObjectSpec(index, 1, name, kind, access, default, high=limits.get("high"), mappable=mappable)
        return array(index, name, [entry])

    return DeviceType(
        profile=0x00020194,
        name="simulated CiA 404 torque transducer",
        product_code=0x404,
        objects=(
            *channel(0x6125, "Autozero", DataType.U32, Access.WO),
            *channel(0x6130, "Process value, floating point", DataType.REAL32),
            *channel(0x6131, "Unit", DataType.U32, default=c.unit_word),
            *channel(0x6132, "Decimal digits", DataType.U8, Access.RW, c.digits, high=MAX_DIGITS),
            *channel(0x6150, "Status", DataType.U8),
            *channel(0x7130, "Process value, 16 bits", DataType.I16),
            *channel(0x9124, "Offset, 32 bits", DataType.I32),
            *channel(0x9130, "Process value, 32 bits", DataType.I32),
        ),
        transmit=(PdoDefault(((0x9130, 1),), transmission=254, valid=True), PdoDefault(((0x9130, 1),), transmission=1)),
    )

"""A simulated absolute encoder after CiA 406 on the output shaft.

The position is floor(angle * counts / 2 pi) within the measuring range and wraps there. With scaling on
(0x6000 bit 2) units per revolution 0x6001 and range 0x6002 apply; a preset makes the position jump.
"""

import math
from dataclasses import dataclass

from sim_backend.errors import ModelError
from sim_backend.nodes.communication import CanopenNode, DeviceType, NodeOptions
from sim_backend.nodes.object_dictionary import AbortCode, AbortError, Access, DataType, ObjectSpec
from sim_backend.nodes.pdo import PdoDefault
from sim_backend.ports import PlantPort

_COUNTER_CLOCKWISE, _SCALING = 0x0001, 0x0004
_SUPPORTED_PARAMETERS = _COUNTER_CLOCKWISE | _SCALING


@dataclass(frozen=True, slots=True)
class EncoderConfig:
    """`encoder_counts` per turn, `turns` until it wraps; the product is the measuring range (at most 2^32)."""

    node_id: int = 3
    encoder_counts: int = 524288
    turns: int = 4096

    def __post_init__(self) -> None:
        if self.encoder_counts < 1 or self.turns < 1 or self.encoder_counts * self.turns > 2**32:
            raise ModelError(
                f"encoder with {self.encoder_counts} counts x {self.turns} turns: "
                "both must be positive and the product at most 2^32"
            )

    @property
    def measuring_range(self) -> int:
        """Counts until the position wraps."""
        return self.encoder_counts * self.turns


class Encoder406:
    """The application half of an encoder."""

    moves = False

    def __init__(self, config: EncoderConfig, plant: PlantPort) -> None:
        self.config = config
        self.device_type = _encoder_type(config)
        self._read = plant.read
        self._scale = 0.0
        self._range = 1
        self._offset = 0

    def attach(self, node: CanopenNode) -> None:
        """Bind the objects to their behaviour."""
        objects = node.dictionary
        self._parameters = objects[0x6000, 0]
        self._units = objects[0x6001, 0]
        self._total = objects[0x6002, 0]
        self._parameters.check = self._check_parameters
        for variable in (self._parameters, self._units, self._total):
            variable.changed = lambda _: self._configure()
        objects[0x6003, 0].check = self._check_preset
        objects[0x6003, 0].changed = self._preset
        objects[0x6004, 0].read = self._position
        objects[0x6500, 0].read = lambda: self._parameters.value
        objects[0x6509, 0].read = lambda: self._offset
        event_timer = objects[0x1800, 5]
        # one cell under two names, as encoders in the field have it
        objects[0x6200, 0].read = lambda: event_timer.value
        objects[0x6200, 0].changed = event_timer.put

    def start(self) -> None:
        """Power on: the preset is forgotten."""
        self._offset = 0
        self._configure()

    def tick(self, time: float) -> None:
        """Do nothing: an encoder has no state that moves by itself."""

    def connection_lost(self) -> None:
        """Do nothing: an encoder moves nothing."""

    def _configure(self) -> None:
        scaled = self._parameters.value & _SCALING
        sign = -1.0 if self._parameters.value & _COUNTER_CLOCKWISE else 1.0
        self._scale = sign * (self._units.value if scaled else self.config.encoder_counts) / math.tau
        self._range = self._total.value if scaled else self.config.measuring_range

    def _position(self) -> int:
        return (math.floor(self._read().output_position * self._scale) + self._offset) % self._range

    def _check_parameters(self, value: int) -> None:
        if value & ~_SUPPORTED_PARAMETERS:
            raise AbortError(AbortCode.VALUE)

    def _check_preset(self, value: int) -> None:
        if value >= self._range:
            raise AbortError(AbortCode.TOO_HIGH)

    def _preset(self, value: int) -> None:
        offset = (self._offset + value - self._position()) % self._range
        self._offset = offset - self._range if offset > self._range // 2 else offset


def encoder_node(config: EncoderConfig, plant: PlantPort, options: NodeOptions | None = None) -> CanopenNode:
    """Give an encoder on the bus."""
    return CanopenNode(config.node_id, Encoder406(config, plant), options)


def _encoder_type(c: EncoderConfig) -> DeviceType:
    u16, u32 = DataType.U16, DataType.U32
    total = min(c.measuring_range, 0xFFFFFFFF)
    return DeviceType(
        profile=0x00020196,
        name="simulated CiA 406 encoder",
        product_code=0x406,
        objects=(
            ObjectSpec(0x6000, 0, "Operating parameters", u16, Access.RW),
            ObjectSpec(
                0x6001, 0, "Measuring units per revolution", u32, Access.RW, c.encoder_counts, 1, c.encoder_counts
            ),
            ObjectSpec(0x6002, 0, "Total measuring range", u32, Access.RW, total, 1, total),
            ObjectSpec(0x6003, 0, "Preset value", u32, Access.RW),
            ObjectSpec(0x6004, 0, "Position value", u32, mappable=True),
            ObjectSpec(0x6200, 0, "Cyclic timer (ms)", u16, Access.RW),
            ObjectSpec(0x6500, 0, "Operating status", u16),
            ObjectSpec(0x6501, 0, "Single-turn resolution", u32, default=c.encoder_counts),
            ObjectSpec(0x6502, 0, "Number of turns", u16, default=min(c.turns, 0xFFFF)),
            ObjectSpec(0x6503, 0, "Alarms", u16, mappable=True),
            ObjectSpec(0x6504, 0, "Supported alarms", u16),
            ObjectSpec(0x6505, 0, "Warnings", u16, mappable=True),
            ObjectSpec(0x6506, 0, "Supported warnings", u16),
            ObjectSpec(0x6507, 0, "Profile and software version", u32, default=0x01000302),
            ObjectSpec(0x6509, 0, "Offset value", DataType.I32),
            ObjectSpec(0x650B, 0, "Serial number", u32, default=c.node_id),
        ),
        transmit=(PdoDefault(((0x6004, 0),), transmission=254, valid=True), PdoDefault(((0x6004, 0),), transmission=1)),
    )

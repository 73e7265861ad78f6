"""A CANopen encoder: CiA 406, position value 0x6004 at every SYNC, unwrapped.

Source: CiA 406 objects 0x6000 to 0x6503, as vendor manuals show them.
"""

import math

from drivers.canopen.errors import DeviceFaultError
from drivers.canopen.node import START_TIMEOUT, CanopenNode
from drivers.canopen.objects import (
    ALARMS,
    CYCLIC_TIMER,
    ENCODER_POSITION,
    MEASURING_RANGE,
    NUMBER_OF_TURNS,
    OPERATING_PARAMETERS,
    SINGLE_TURN_RESOLUTION,
    UNITS_PER_REVOLUTION,
)
from drivers.canopen.options import EncoderOptions
from drivers.canopen.pdo import Direction, Pdo, layout
from drivers.canopen.unwrap import Unwrapper
from drivers.devices import DeviceConfig
from drivers.errors import ConfigError, Mistake
from drivers.types import DeviceInfo, SensorReading

PROFILE = 406
FEEDBACK = Pdo(Direction.TPDO, 1, (ENCODER_POSITION,))

JUMP_CYCLES = 10
"""Cycles of travel at the highest speed beyond which two values in a row are a jump: some may have been missed."""

_SCALING_ON = 0x0004
"""Bit 2 of 0x6000: 0x6001 and 0x6002 act."""
_VALUE_RANGE = 1 << 32
"""0x6004 has 32 bits, whatever the product of resolution and turns."""


class Cia406Encoder:
    """One encoder on a CANopen bus; made by `CanopenBus.attach`."""

    def __init__(self, config: DeviceConfig, options: EncoderOptions, node: CanopenNode) -> None:
        self.name = config.name
        self.node = node
        self.age = 1
        self._config = config
        self._options = options
        self._sign = next(iter(config.sign.values()), 1)
        self._open = False
        self._scale = 0.0
        self._unwrapper = Unwrapper(_VALUE_RANGE)
        self._unpack = layout(FEEDBACK.objects).unpack
        self._size = layout(FEEDBACK.objects).size
        node.receive(FEEDBACK, self.on_feedback)

    def connect(self) -> DeviceInfo:
        """Identify the encoder, read its range, put its position on SYNC and read that back.

        Raises NotConnectedError if it does not answer, ConfigError if it is another device or turns too fast to
        be unwrapped, DriveFaultError if it refuses.
        """
        identity = self.node.identify(PROFILE)
        self._open = True
        objects = self.node.objects
        if (objects.find(OPERATING_PARAMETERS) or 0) & _SCALING_ON:
            counts, span = objects.read(UNITS_PER_REVOLUTION), objects.read(MEASURING_RANGE)
        else:
            counts = objects.read(SINGLE_TURN_RESOLUTION)
            turns = objects.find(NUMBER_OF_TURNS)
            span = counts * (turns if turns else 1)
        if counts < 1 or span < 1:
            raise DeviceFaultError(self.name, f"has no usable range: {counts} counts per turn, {span} in all", state="")
        self._scale = self._sign * 2.0 * math.pi / counts
        self._unwrapper = Unwrapper(min(span, _VALUE_RANGE), self._most_counts())
        self._refuse_too_fast()
        if objects.find(CYCLIC_TIMER) is not None:
            self.node.change(CYCLIC_TIMER, 0)
        self.node.map_pdos(Direction.TPDO, (FEEDBACK,))
        self.node.start_heartbeat()
        self.node.start(START_TIMEOUT)
        self._unwrapper.start(objects.read(ENCODER_POSITION))
        alarms = objects.find(ALARMS)
        return DeviceInfo(
            name=self.name,
            driver=self._config.driver,
            address=self.node.where,
            identity=identity,
            resolution=abs(self._scale),
            full_scale=abs(self._scale) * self._unwrapper.span,
            changed=self.node.changed,
            warnings=(f"alarms 0x{alarms:04X} (0x6503)",) if alarms else (),
        )

    def read(self) -> SensorReading:
        """Give the angle (rad, unwrapped) of the last SYNC; not valid if it jumped further than the shaft can turn."""
        return SensorReading(self._unwrapper.counts * self._scale, self.age, self._unwrapper.plausible)

    def close(self) -> None:
        """Restore what was changed and leave the node pre-operational; allowed in any condition."""
        if self._open:
            self._open = False
            self.node.shut_down()

    def on_feedback(self, data: bytearray) -> bool:
        """Take one TPDO; True if it is the first of its cycle. A wrong length is noted as a failure."""
        if len(data) != self._size:
            self.node.wrong_length(FEEDBACK, self._size, bytes(data))
            return False
        self._unwrapper.step(self._unpack(data)[0])
        first = self.age > 0
        self.age = 0
        return first

    def _most_counts(self) -> int | None:
        """Give the counts of `JUMP_CYCLES` at the highest speed, None if nothing bounds it."""
        fastest = self._options.max_velocity if self._options.max_velocity is not None else self._config.max_velocity
        if fastest is None:
            return None
        return math.ceil(JUMP_CYCLES * fastest * self._config.cycle_time / abs(self._scale))

    def _refuse_too_fast(self) -> None:
        fastest = self._options.max_velocity
        if fastest is None:
            return
        step, quarter = fastest * self._config.cycle_time, abs(self._scale) * self._unwrapper.span / 4
        if step > quarter:
            rule = f"{step:.4g} rad per cycle; at most a quarter of the range, {quarter:.4g} rad, can be unwrapped"
            raise ConfigError(f"device '{self.name}'", [Mistake("options.max_velocity", fastest, rule)])

"""The objects of the CANopen dictionary that the drivers use, with their types.

Sources: CiA 301 (0x1000-0x1FFF), CiA 402 (drives), CiA 404 (measuring devices), CiA 406 (encoders), as far as vendor
manuals and public object dictionaries show them. All values on the wire are little-endian integers.
"""

import struct
from dataclasses import dataclass

_SIZES = {"b": 1, "B": 1, "h": 2, "H": 2, "i": 4, "I": 4}


@dataclass(frozen=True, slots=True)
class ObjectRef:
    """One object: `index`, `sub`, integer type `code` as in `struct`, and its `name` for messages."""

    index: int
    sub: int
    code: str
    name: str

    @property
    def size(self) -> int:
        """Give the length in bytes."""
        return _SIZES[self.code]

    @property
    def mapping(self) -> int:
        """Give the PDO mapping entry: index, sub-index, bits (CiA 301, 0x1600 and 0x1A00)."""
        return self.index << 16 | self.sub << 8 | self.size * 8

    def encode(self, value: int) -> bytes:
        """Give the bytes of `value`. Raises ValueError if it does not fit the object's type."""
        try:
            return struct.pack(f"<{self.code}", value)
        except struct.error as error:
            raise ValueError(f"{value} does not fit {self}, an integer of {self.size} bytes: {error}") from error

    def decode(self, data: bytes) -> int:
        """Give the value of `data`. Raises ValueError unless the length is exactly the object's."""
        if len(data) != self.size:
            raise ValueError(f"{self} has {self.size} bytes, the device gave {len(data)}")
        return int(struct.unpack(f"<{self.code}", data)[0])

    def __str__(self) -> str:
        return f"0x{self.index:04X}:{self.sub:02X} ({self.name})"


# CiA 301
DEVICE_TYPE = ObjectRef(0x1000, 0, "I", "device type")
HEARTBEAT_CONSUMER = ObjectRef(0x1016, 1, "I", "heartbeat consumer")
HEARTBEAT_PRODUCER = ObjectRef(0x1017, 0, "H", "heartbeat producer time")
ERROR_BEHAVIOUR = ObjectRef(0x1029, 1, "B", "behaviour on communication error")
IDENTITY_COUNT = ObjectRef(0x1018, 0, "B", "identity entries")
IDENTITY = (
    ObjectRef(0x1018, 1, "I", "vendor"),
    ObjectRef(0x1018, 2, "I", "product"),
    ObjectRef(0x1018, 3, "I", "revision"),
    ObjectRef(0x1018, 4, "I", "serial"),
)

# CiA 402
ABORT_CONNECTION_OPTION = ObjectRef(0x6007, 0, "h", "abort connection option")
ERROR_CODE = ObjectRef(0x603F, 0, "H", "error code")
CONTROL_WORD = ObjectRef(0x6040, 0, "H", "control word")
STATUS_WORD = ObjectRef(0x6041, 0, "H", "status word")
QUICK_STOP_OPTION = ObjectRef(0x605A, 0, "h", "quick stop option")
MODE = ObjectRef(0x6060, 0, "b", "mode of operation")
MODE_DISPLAY = ObjectRef(0x6061, 0, "b", "mode of operation display")
POSITION = ObjectRef(0x6064, 0, "i", "position actual value")
VELOCITY = ObjectRef(0x606C, 0, "i", "velocity actual value")
TARGET_TORQUE = ObjectRef(0x6071, 0, "h", "target torque")
MAX_TORQUE = ObjectRef(0x6072, 0, "H", "max torque")
RATED_TORQUE = ObjectRef(0x6076, 0, "I", "motor rated torque")
TORQUE = ObjectRef(0x6077, 0, "h", "torque actual value")
TARGET_POSITION = ObjectRef(0x607A, 0, "i", "target position")
MAX_MOTOR_SPEED = ObjectRef(0x6080, 0, "I", "max motor speed")
ENCODER_INCREMENTS = ObjectRef(0x608F, 1, "I", "encoder increments")
MOTOR_REVOLUTIONS = ObjectRef(0x608F, 2, "I", "motor revolutions")
VELOCITY_UNIT = ObjectRef(0x60A9, 0, "I", "velocity unit")
TARGET_VELOCITY = ObjectRef(0x60FF, 0, "i", "target velocity")
SUPPORTED_MODES = ObjectRef(0x6502, 0, "I", "supported drive modes")

# CiA 406
OPERATING_PARAMETERS = ObjectRef(0x6000, 0, "H", "operating parameters")
UNITS_PER_REVOLUTION = ObjectRef(0x6001, 0, "I", "measuring units per revolution")
MEASURING_RANGE = ObjectRef(0x6002, 0, "I", "total measuring range")
ENCODER_POSITION = ObjectRef(0x6004, 0, "I", "position value")
CYCLIC_TIMER = ObjectRef(0x6200, 0, "H", "cyclic timer")
SINGLE_TURN_RESOLUTION = ObjectRef(0x6501, 0, "I", "single-turn resolution")
NUMBER_OF_TURNS = ObjectRef(0x6502, 0, "H", "number of turns")
ALARMS = ObjectRef(0x6503, 0, "H", "alarms")

# CiA 404
AUTOZERO = ObjectRef(0x6125, 1, "I", "autozero")
PHYSICAL_UNIT = ObjectRef(0x6131, 1, "I", "physical unit")
DECIMAL_DIGITS = ObjectRef(0x6132, 1, "B", "decimal digits")
OFFSET = ObjectRef(0x9124, 1, "i", "input offset")
PROCESS_VALUE = ObjectRef(0x9130, 1, "i", "process value")

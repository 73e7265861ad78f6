"""Process data: the layout of a PDO, and the procedure that gives a device that layout.

A frame whose length differs from the layout is an error, never a value. The mapping is written in the order that
CiA 301 asks for (disable, clear, fill, count, type, enable) and read back entry by entry.
Source: CiA 301, objects 0x1400, 0x1600 (received by the device), 0x1800, 0x1A00 (sent by it).
"""

import struct
from dataclasses import dataclass
from enum import StrEnum

from drivers.canopen.errors import DeviceFaultError
from drivers.canopen.objects import ObjectRef
from drivers.canopen.sdo import ObjectAccess

NOT_VALID = 0x80000000
"""Bit 31 of a PDO's identifier entry: the PDO does not exist."""
NO_RTR = 0x40000000
"""Bit 30: no remote request. Devices set it as they please, so it is kept and never compared."""
EVERY_SYNC = 1
"""Transmission type: sent at, or taken over at, every SYNC."""
MOST_BYTES = 8
MOST_ENTRIES = 64


class Direction(StrEnum):
    """Seen from the device, as in CiA 301: TPDO is what it transmits."""

    TPDO = "TPDO"
    RPDO = "RPDO"


_COMMUNICATION = {Direction.TPDO: 0x1800, Direction.RPDO: 0x1400}
_MAPPING = {Direction.TPDO: 0x1A00, Direction.RPDO: 0x1600}
_FIRST_ID = {Direction.TPDO: 0x180, Direction.RPDO: 0x200}


@dataclass(frozen=True, slots=True)
class PdoSetting:
    """How one PDO of a device is set: identifier entry, transmission type, mapping entries as 32-bit words."""

    cob_id: int
    transmission_type: int
    mapping: tuple[int, ...]

    def matches(self, other: "PdoSetting") -> bool:
        """Tell whether both mean the same, remote requests apart."""
        if self.cob_id & NOT_VALID and other.cob_id & NOT_VALID:
            return True
        same_id = self.cob_id & ~NO_RTR == other.cob_id & ~NO_RTR
        return same_id and self.transmission_type == other.transmission_type and self.mapping == other.mapping

    def __str__(self) -> str:
        if self.cob_id & NOT_VALID:
            return f"off (0x{self.cob_id:08X})"
        entries = " ".join(f"{entry:08X}" for entry in self.mapping)
        return f"id 0x{self.cob_id:08X}, type {self.transmission_type}, mapping {entries or 'empty'}"


@dataclass(frozen=True, slots=True)
class Pdo:
    """PDO `number` (1 to 4) with the objects it carries, in order."""

    direction: Direction
    number: int
    objects: tuple[ObjectRef, ...]

    def can_id(self, node_id: int) -> int:
        """Give the identifier of the predefined connection set."""
        return _FIRST_ID[self.direction] + 0x100 * (self.number - 1) + node_id

    def setting(self, node_id: int) -> PdoSetting:
        """Give the setting that the device must have: this mapping, at every SYNC."""
        return PdoSetting(self.can_id(node_id), EVERY_SYNC, tuple(ref.mapping for ref in self.objects))


def layout(objects: tuple[ObjectRef, ...]) -> struct.Struct:
    """Give the byte layout of a frame that carries `objects`, without gaps.

    Raises ValueError if there is none or more than 8 bytes.
    """
    made = struct.Struct("<" + "".join(ref.code for ref in objects))
    if not 0 < made.size <= MOST_BYTES:
        raise ValueError(f"a PDO carries 1 to {MOST_BYTES} bytes, {len(objects)} objects take {made.size}")
    return made


def cob_id_object(direction: Direction, number: int) -> ObjectRef:
    """Give the object that holds a PDO's identifier and its validity bit."""
    return ObjectRef(_COMMUNICATION[direction] + number - 1, 1, "I", f"{direction}{number} identifier")


def read_setting(objects: ObjectAccess, direction: Direction, number: int) -> PdoSetting | None:
    """Read how PDO `number` is set, None if the device has no such PDO."""
    cob_id = objects.find(cob_id_object(direction, number))
    if cob_id is None:
        return None
    count = min(objects.read(_count(direction, number)), MOST_ENTRIES)
    entries = tuple(objects.read(_entry(direction, number, k)) for k in range(1, count + 1))
    return PdoSetting(cob_id, objects.read(_type(direction, number)), entries)


def write_setting(objects: ObjectAccess, direction: Direction, number: int, wanted: PdoSetting) -> None:
    """Set PDO `number` by the remapping procedure of CiA 301; any refusal is raised."""
    cob_id = cob_id_object(direction, number)
    objects.write(cob_id, wanted.cob_id | NOT_VALID)
    objects.write(_count(direction, number), 0)
    for k, entry in enumerate(wanted.mapping, 1):
        objects.write(_entry(direction, number, k), entry)
    objects.write(_count(direction, number), len(wanted.mapping))
    objects.write(_type(direction, number), wanted.transmission_type)
    if not wanted.cob_id & NOT_VALID:
        objects.write(cob_id, wanted.cob_id)


def verify_setting(device: str, objects: ObjectAccess, direction: Direction, number: int, wanted: PdoSetting) -> None:
    """Read PDO `number` back. Raises DeviceFaultError naming wanted and found setting if they differ."""
    found = read_setting(objects, direction, number)
    if found is None or not found.matches(wanted):
        raise DeviceFaultError(
            device,
            f"did not keep {direction}{number}: wanted {wanted}; got {found}",
            state="",
            hint="Its process data would be misread, so it is not used.",
        )


def _type(direction: Direction, number: int) -> ObjectRef:
    return ObjectRef(_COMMUNICATION[direction] + number - 1, 2, "B", f"{direction}{number} transmission type")


def _count(direction: Direction, number: int) -> ObjectRef:
    return ObjectRef(_MAPPING[direction] + number - 1, 0, "B", f"{direction}{number} mapped objects")


def _entry(direction: Direction, number: int, k: int) -> ObjectRef:
    return ObjectRef(_MAPPING[direction] + number - 1, k, "I", f"{direction}{number} mapping entry {k}")

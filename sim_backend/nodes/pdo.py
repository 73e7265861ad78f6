"""Process data objects of a simulated device (CiA 301): parameters, mapping procedure, packing.

A master must disable a PDO (bit 31 of its COB-ID) and set the number of mapped objects to 0 before it writes
the mapping; everything else is refused. The layout is compiled when the PDO becomes valid.
"""

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from sim_backend.nodes.frame import Frame, new_frame
from sim_backend.nodes.object_dictionary import (
    AbortCode,
    AbortError,
    Access,
    DataType,
    ObjectDictionary,
    ObjectSpec,
    Variable,
    array,
)

PDO_COUNT = 4
"""PDOs in each direction: those with predefined identifiers."""

MAX_MAPPED = 8
NOT_VALID = 0x80000000
NO_RTR = 0x40000000
_EXTENDED = 0x20000000
_RESERVED_ID_BITS = 0x1FFFF800
_MAX_BITS = 64
_RESTRICTED = ((0x000, 0x07F), (0x101, 0x180), (0x581, 0x5FF), (0x601, 0x67F), (0x6E0, 0x6FF), (0x701, 0x7FF))
_TYPES = frozenset((*range(241), 254, 255))


@dataclass(frozen=True, slots=True)
class PdoDefault:
    """How a device ships one PDO: mapped (index, sub) pairs, transmission type, event timer in ms, in use or not."""

    mapping: tuple[tuple[int, int], ...] = ()
    transmission: int = 255
    event_time: int = 0
    valid: bool = False


def pdo_specs(
    node_id: int, receive: Sequence[PdoDefault], transmit: Sequence[PdoDefault], specs: Sequence[ObjectSpec]
) -> list[ObjectSpec]:
    """List the entries of all PDOs; `specs` are the device's objects, which the default mappings refer to."""
    bits = {(s.index, s.sub): 8 * s.type.size for s in specs}
    found: list[ObjectSpec] = []
    for number in range(PDO_COUNT):
        for base, can_id, flags, kind, defaults in (
            (0x1400, 0x200, 0, "RPDO", receive),
            (0x1800, 0x180, NO_RTR, "TPDO", transmit),
        ):
            default = defaults[number] if number < len(defaults) else PdoDefault()
            cob_id = can_id + 0x100 * number + node_id | flags | (0 if default.valid else NOT_VALID)
            found += _parameters(base + number, f"{kind} {number + 1}", cob_id, default, transmit=kind == "TPDO")
            entries = [index << 16 | sub << 8 | bits[index, sub] for index, sub in default.mapping]
            found += _mapping(base + 0x200 + number, f"{kind} {number + 1} mapping", entries)
    return found


def _parameters(index: int, name: str, cob_id: int, default: PdoDefault, *, transmit: bool) -> list[ObjectSpec]:
    entries = [
        ObjectSpec(index, 1, f"{name}: COB-ID", DataType.U32, Access.RW, cob_id),
        ObjectSpec(index, 2, f"{name}: transmission type", DataType.U8, Access.RW, default.transmission),
    ]
    if transmit:
        entries += [
            ObjectSpec(index, 3, f"{name}: inhibit time (100 us)", DataType.U16, Access.RW),
            ObjectSpec(index, 5, f"{name}: event timer (ms)", DataType.U16, Access.RW, default.event_time),
        ]
    return array(index, name, entries)


def _mapping(index: int, name: str, entries: Sequence[int]) -> list[ObjectSpec]:
    padded = [*entries, *[0] * (MAX_MAPPED - len(entries))]
    slots = [ObjectSpec(index, n, f"{name} {n}", DataType.U32, Access.RW, v) for n, v in enumerate(padded, 1)]
    count = ObjectSpec(index, 0, f"{name}: number of objects", DataType.U8, Access.RW, len(entries), high=MAX_MAPPED)
    return [count, *slots]


class Pdo:
    """Parameters and mapping of one PDO. `on_change` is called after each accepted write."""

    def __init__(
        self,
        dictionary: ObjectDictionary,
        parameters: int,
        *,
        refused: Access,
        while_valid: AbortCode,
        on_change: Callable[[], None],
    ) -> None:
        self._dictionary = dictionary
        self._refused = refused
        self._while_valid = while_valid
        self._cob_id = dictionary[parameters, 1]
        self._type = dictionary[parameters, 2]
        self._count = dictionary[parameters + 0x200, 0]
        self._entries = [dictionary[parameters + 0x200, n] for n in range(1, MAX_MAPPED + 1)]
        self._cob_id.check = self._check_cob_id
        self._type.check = self._check_type
        self._count.check = self._check_count
        for entry in self._entries:
            entry.check = self._check_entry
        for variable in (self._cob_id, self._type, self._count, *self._entries):
            variable.changed = lambda _: on_change()
        self.can_id = 0
        self.size = 0
        self.transmission = 255
        self._variables: tuple[Variable[Any], ...] = ()
        self._layout = struct.Struct("<")

    @property
    def valid(self) -> bool:
        """Whether the PDO exists on the bus."""
        return not self._cob_id.value & NOT_VALID

    @property
    def synchronous(self) -> bool:
        """Whether SYNC moves it."""
        return self.transmission <= 240

    def compile(self) -> None:
        """Prepare identifier and layout from the entries."""
        self.can_id = self._cob_id.value & 0x7FF
        self.transmission = self._type.value
        self._variables = tuple(self._resolve(e.value) for e in self._entries[: self._count.value])
        self._layout = struct.Struct("<" + "".join(v.spec.type.layout for v in self._variables))
        self.size = self._layout.size

    def _resolve(self, entry: int) -> Variable[Any]:
        try:
            variable = self._dictionary.find(entry >> 16, entry >> 8 & 0xFF)
        except AbortError as error:
            raise AbortError(AbortCode.NO_OBJECT) from error
        spec = variable.spec
        if not spec.mappable or spec.access is self._refused or entry & 0xFF != 8 * spec.type.size:
            raise AbortError(AbortCode.NOT_MAPPABLE)
        return variable

    def _check_cob_id(self, value: int) -> None:
        can_id = value & 0x7FF
        if value & (_EXTENDED | _RESERVED_ID_BITS) or any(low <= can_id <= high for low, high in _RESTRICTED):
            raise AbortError(AbortCode.VALUE)
        if self.valid and not value & NOT_VALID and can_id != self._cob_id.value & 0x7FF:
            raise AbortError(self._while_valid)

    def _check_type(self, value: int) -> None:
        if value not in _TYPES:
            raise AbortError(AbortCode.VALUE)

    def _check_count(self, value: int) -> None:
        if self.valid:
            raise AbortError(self._while_valid)
        variables = [self._resolve(entry.value) for entry in self._entries[:value]]
        if sum(8 * v.spec.type.size for v in variables) > _MAX_BITS:
            raise AbortError(AbortCode.PDO_TOO_LONG)

    def _check_entry(self, value: int) -> None:
        if self.valid:
            raise AbortError(self._while_valid)
        if self._count.value != 0:
            raise AbortError(AbortCode.SUB_0_FIRST)
        if value:
            self._resolve(value)


class ReceivePdo(Pdo):
    """Setpoints from the bus; a synchronous one waits in `pending` for the next SYNC."""

    def __init__(
        self, dictionary: ObjectDictionary, number: int, while_valid: AbortCode, on_change: Callable[[], None]
    ) -> None:
        super().__init__(dictionary, 0x1400 + number, refused=Access.RO, while_valid=while_valid, on_change=on_change)
        self.pending: bytes | None = None
        self._setters: tuple[Callable[[Any], None], ...] = ()

    def compile(self) -> None:
        """Prepare identifier and layout from the entries."""
        super().compile()
        self._setters = tuple(variable.put for variable in self._variables)

    def apply(self, data: bytes) -> None:
        """Write the mapped objects; a value that an object refuses leaves that object as it was."""
        # as many values as setters: both come from one mapping
        for put, value in zip(self._setters, self._layout.unpack_from(data), strict=False):
            try:
                put(value)
            except AbortError:
                continue


class TransmitPdo(Pdo):
    """Values to the bus."""

    def __init__(
        self, dictionary: ObjectDictionary, number: int, while_valid: AbortCode, on_change: Callable[[], None]
    ) -> None:
        super().__init__(dictionary, 0x1800 + number, refused=Access.WO, while_valid=while_valid, on_change=on_change)
        self._inhibit = dictionary[0x1800 + number, 3]
        self._event_time = dictionary[0x1800 + number, 5]
        self._inhibit.check = self._check_inhibit
        self._event_time.changed = lambda _: on_change()
        self._data: Callable[[], bytes] = bytes
        self.at_sync: Callable[[], Frame | None] = self._at_nth_sync
        """Counts a SYNC; gives the frame if it is this one's turn. Another function after each `compile`."""
        self._syncs = 0
        self._sent = b""
        self._earliest = 0.0
        self._timer_due = 0.0

    def compile(self) -> None:
        """Prepare identifier and layout from the entries."""
        super().compile()
        getters = [variable.read or variable.get for variable in self._variables]
        mapped = tuple((variable.spec.index, variable.spec.sub) for variable in self._variables)
        self._data = _sampler(self._layout.pack, getters, self._dictionary.together.get(mapped))
        if self.transmission == 1:
            can_id, data = self.can_id, self._data
            self.at_sync = lambda: new_frame((can_id, data()))
        else:
            self.at_sync = self._if_changed if self.transmission == 0 else self._at_nth_sync

    def start(self, now: float) -> None:
        """Begin anew, as on entering OPERATIONAL: the first event is the present value."""
        self._syncs = 0
        self._sent = b""
        self._earliest = now
        self._timer_due = now + self._event_time.value * 1e-3

    def _at_nth_sync(self) -> Frame | None:
        self._syncs += 1
        if self._syncs < self.transmission:
            return None
        self._syncs = 0
        return Frame(self.can_id, self._data())

    def at_tick(self, now: float) -> Frame | None:
        """Give the frame if the event timer is due or a mapped value has changed, not before the inhibit time."""
        if now < self._earliest:
            return None
        period = self._event_time.value * 1e-3
        if period and now >= self._timer_due:
            self._timer_due += period
            self._sent = self._data()
            frame: Frame | None = Frame(self.can_id, self._sent)
        else:
            frame = self._if_changed()
        if frame is not None:
            self._earliest = now + self._inhibit.value * 1e-4
        return frame

    def _if_changed(self) -> Frame | None:
        data = self._data()
        if data == self._sent:
            return None
        self._sent = data
        return Frame(self.can_id, data)

    def _check_inhibit(self, _value: int) -> None:
        if self.valid:
            raise AbortError(self._while_valid)


def _sampler(
    pack: Callable[..., bytes],
    getters: Sequence[Callable[[], Any]],
    together: Callable[[], tuple[Any, ...]] | None,
) -> Callable[[], bytes]:
    """Give a function that reads and packs the mapped values, all at once or by their `getters`."""
    if together is not None:
        return lambda: pack(*together())
    if len(getters) == 1:
        (only,) = getters
        return lambda: pack(only())
    return lambda: pack(*[get() for get in getters])

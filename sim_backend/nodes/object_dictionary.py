"""Object dictionary of a simulated device: typed entries, encoded and decoded little-endian.

What an entry is (`ObjectSpec`) is data, so that a device's whole table can be listed. What an entry does is in
the three hooks of its `Variable`: `read` computes a value, `check` may refuse one, `changed` acts on one.

Source: CiA 301 data types and SDO abort codes, as listed by public device manuals.
"""

import struct
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from enum import Enum, IntEnum, StrEnum
from typing import Any, Generic, TypeVar

from sim_backend.errors import ModelError

Value = TypeVar("Value", int, float, bytes)


class AbortCode(IntEnum):
    """Why an SDO transfer ends: CiA 301 abort codes."""

    TOGGLE = 0x05030000
    TIME_OUT = 0x05040000
    COMMAND = 0x05040001
    MEMORY = 0x05040005
    ACCESS = 0x06010000
    WRITE_ONLY = 0x06010001
    READ_ONLY = 0x06010002
    SUB_0_FIRST = 0x06010003
    NO_OBJECT = 0x06020000
    NOT_MAPPABLE = 0x06040041
    PDO_TOO_LONG = 0x06040042
    CLASH = 0x06040043
    INTERNAL = 0x06040047
    HARDWARE = 0x06060000
    LENGTH = 0x06070010
    TOO_LONG = 0x06070012
    TOO_SHORT = 0x06070013
    NO_SUB_INDEX = 0x06090011
    VALUE = 0x06090030
    TOO_HIGH = 0x06090031
    TOO_LOW = 0x06090032
    MAXIMUM_BELOW_MINIMUM = 0x06090036
    GENERAL = 0x08000000
    CANNOT_STORE = 0x08000020
    LOCAL_CONTROL = 0x08000021
    DEVICE_STATE = 0x08000022
    NO_DATA = 0x08000024


class AbortError(ValueError):
    """The device refuses an access; `code` is what the SDO server answers."""

    def __init__(self, code: AbortCode) -> None:
        super().__init__(f"0x{code:08X} {code.name}")
        self.code = code


class NoAnswerError(ValueError):
    """The device stays silent on an access, as some do instead of an abort."""


class DataType(Enum):
    """CiA 301 data types: code of the standard, layout for `struct` (empty: bytes of any length)."""

    I8 = (0x02, "b")
    I16 = (0x03, "h")
    I32 = (0x04, "i")
    U8 = (0x05, "B")
    U16 = (0x06, "H")
    U32 = (0x07, "I")
    REAL32 = (0x08, "f")
    VISIBLE_STRING = (0x09, "")

    def __init__(self, code: int, layout: str) -> None:
        self.code = code
        self.layout = layout
        self.size = struct.calcsize("<" + layout)


class Access(StrEnum):
    """Who may do what by SDO; CONST never changes."""

    RO = "ro"
    RW = "rw"
    WO = "wo"
    CONST = "const"


@dataclass(frozen=True, slots=True)
class ObjectSpec:
    """One entry as a table of objects prints it. `low` and `high` are inclusive; bytes only for strings."""

    index: int
    sub: int
    name: str
    type: DataType
    access: Access = Access.RO
    default: int | float | bytes = 0
    low: float | None = None
    high: float | None = None
    mappable: bool = False


class Variable(Generic[Value]):
    """The living value of one entry."""

    __slots__ = ("_bounded", "_default", "changed", "check", "read", "spec", "value")

    def __init__(self, spec: ObjectSpec, default: Value) -> None:
        self.spec = spec
        self.value: Value = default
        self._default: Value = default
        self._bounded = spec.high is not None or spec.low is not None
        self.read: Callable[[], Value] | None = None
        self.check: Callable[[Value], None] | None = None
        self.changed: Callable[[Value], None] | None = None

    def get(self) -> Value:
        """Give the value as it is now."""
        return self.value if self.read is None else self.read()

    def put(self, value: Value) -> None:
        """Take a value from the wire and act on it. Raises AbortError and leaves everything as it was if refused."""
        if self._bounded:
            self._check_range(value)
        if self.check is not None:
            self.check(value)
        self.value = value
        if self.changed is not None:
            self.changed(value)

    def reset(self) -> None:
        """Go back to the default without acting on it."""
        self.value = self._default

    def _check_range(self, value: Any) -> None:
        low, high = self.spec.low, self.spec.high
        if value != value:
            raise AbortError(AbortCode.VALUE)
        if high is not None and value > high:
            raise AbortError(AbortCode.TOO_HIGH)
        if low is not None and value < low:
            raise AbortError(AbortCode.TOO_LOW)


def array(index: int, name: str, entries: Iterable[ObjectSpec]) -> list[ObjectSpec]:
    """Put sub-index 0 (highest sub-index, constant) before the `entries` of one index."""
    members = list(entries)
    count = ObjectSpec(index, 0, f"{name}: highest sub-index", DataType.U8, Access.CONST, members[-1].sub)
    return [count, *members]


class ObjectDictionary:
    """All entries of a device. Hidden indices answer as if they did not exist; the device still uses them."""

    def __init__(self, specs: Iterable[ObjectSpec], hidden: Iterable[int] = ()) -> None:
        self.together: dict[tuple[tuple[int, int], ...], Callable[[], tuple[Any, ...]]] = {}
        """What a device reads in one go, by (index, sub) pairs: a PDO that maps just these asks once per SYNC."""
        self._variables: dict[tuple[int, int], Variable[Any]] = {}
        self._hidden = frozenset(hidden)
        for spec in specs:
            key = (spec.index, spec.sub)
            if key in self._variables:
                raise ModelError(f"object 0x{spec.index:04X}:{spec.sub} ('{spec.name}') is defined twice")
            _refuse_unfit_default(spec)
            self._variables[key] = Variable(spec, spec.default)
        self._indices = {index for index, _ in self._variables} - self._hidden

    def __getitem__(self, key: tuple[int, int]) -> Variable[Any]:
        """Give the variable at (index, sub), hidden or not."""
        return self._variables[key]

    def __iter__(self) -> Iterator[ObjectSpec]:
        """List what a master can find."""
        return (v.spec for v in self._variables.values() if v.spec.index not in self._hidden)

    def find(self, index: int, sub: int) -> Variable[Any]:
        """Give a variable that a master asks for. Raises AbortError if there is none."""
        if index not in self._indices:
            raise AbortError(AbortCode.NO_OBJECT)
        variable = self._variables.get((index, sub))
        if variable is None:
            raise AbortError(AbortCode.NO_SUB_INDEX)
        return variable

    def writable(self, index: int, sub: int) -> Variable[Any]:
        """Give a variable that a master wants to write. Raises AbortError if it may not."""
        variable = self.find(index, sub)
        if variable.spec.access in (Access.RO, Access.CONST):
            raise AbortError(AbortCode.READ_ONLY)
        return variable

    def upload(self, index: int, sub: int) -> bytes:
        """Give the encoded value. Raises AbortError."""
        variable = self.find(index, sub)
        spec = variable.spec
        if spec.access is Access.WO:
            raise AbortError(AbortCode.WRITE_ONLY)
        value = variable.get()
        return struct.pack("<" + spec.type.layout, value) if spec.type.layout else bytes(value)

    def download(self, index: int, sub: int, data: bytes) -> None:
        """Decode and store a value. Raises AbortError, or NoAnswerError where the device stays silent."""
        variable = self.writable(index, sub)
        kind = variable.spec.type
        if not kind.layout:
            variable.put(data)
            return
        check_length(kind, len(data))
        variable.put(struct.unpack("<" + kind.layout, data)[0])

    def reset(self, first: int, last: int) -> None:
        """Give every entry with an index of `first` to `last` its default again."""
        for (index, _), variable in self._variables.items():
            if first <= index <= last:
                variable.reset()


def _refuse_unfit_default(spec: ObjectSpec) -> None:
    """Raise ModelError for a default that the entry's type cannot carry; bytes have any length."""
    if not spec.type.layout:
        return
    try:
        struct.pack("<" + spec.type.layout, spec.default)
    except (struct.error, OverflowError) as error:
        raise ModelError(
            f"object 0x{spec.index:04X}:{spec.sub} ('{spec.name}') = {spec.default!r} does not fit its type "
            f"{spec.type.name} of {spec.type.size} bytes"
        ) from error


def check_length(kind: DataType, size: int) -> None:
    """Compare a size in bytes with that of a fixed type. Raises AbortError."""
    if kind.layout and size > kind.size:
        raise AbortError(AbortCode.TOO_LONG)
    if kind.layout and size < kind.size:
        raise AbortError(AbortCode.TOO_SHORT)

"""Protobuf messages of one type into columns, many at once where they share one layout.

Messages whose fields all have a fixed size and the same tags are a table in memory; numpy reads it in one step.
Anything else goes message by message through the protobuf library. Encoding: protobuf language guide, "Encoding".
"""

from dataclasses import dataclass

import numpy as np
from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.message import DecodeError, Message
from numpy.typing import NDArray

from rig.log.rows import Rows
from rig.log.run import Floats
from rig.log.schema import message_class

MESSAGE_HEAD = 9 + 2 + 4 + 8 + 8
"""Bytes before the payload of an MCAP message record: opcode, length, channel, sequence, log and publish time."""

BATCH_BYTES = 8 * 1024 * 1024

_FIXED = {
    FieldDescriptor.TYPE_DOUBLE: (1, "<f8"),
    FieldDescriptor.TYPE_FIXED64: (1, "<u8"),
    FieldDescriptor.TYPE_SFIXED64: (1, "<i8"),
    FieldDescriptor.TYPE_FLOAT: (5, "<f4"),
    FieldDescriptor.TYPE_FIXED32: (5, "<u4"),
    FieldDescriptor.TYPE_SFIXED32: (5, "<i4"),
}
_NUMERIC = frozenset(
    {
        FieldDescriptor.CPPTYPE_DOUBLE,
        FieldDescriptor.CPPTYPE_FLOAT,
        FieldDescriptor.CPPTYPE_INT32,
        FieldDescriptor.CPPTYPE_INT64,
        FieldDescriptor.CPPTYPE_UINT32,
        FieldDescriptor.CPPTYPE_UINT64,
        FieldDescriptor.CPPTYPE_BOOL,
        FieldDescriptor.CPPTYPE_ENUM,
    }
)


@dataclass(frozen=True, slots=True)
class _Layout:
    """Records of `record.itemsize` bytes: a numpy type over the whole record, and where the tag bytes stand."""

    record: np.dtype[np.void]
    tags: NDArray[np.intp]
    names: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _Pending:
    """Records of one size that wait to be decoded: pieces of them, the place of each piece's first, their number."""

    records: list[bytes]
    starts: list[int]
    counts: list[int]


@dataclass(frozen=True, slots=True)
class _Block:
    """Decoded records: their places among those that waited, their log times (ns) and columns, all of shape (n,)."""

    places: NDArray[np.intp]
    times: NDArray[np.int64]
    columns: dict[str, Floats]


class Columns:
    """Collects message records of one channel and gives its fields as columns."""

    def __init__(self, schema: bytes, type_name: str, rows: Rows) -> None:
        """Take the channel's schema and where the rows go; raises ValueError if the schema lacks the type."""
        try:
            self._message: type[Message] = message_class(schema, type_name)
        except (KeyError, TypeError, DecodeError, ValueError) as error:
            raise ValueError(f"schema of '{type_name}' is unreadable: {error}") from error
        numeric = [
            item for item in self._message.DESCRIPTOR.fields if item.cpp_type in _NUMERIC and not item.is_repeated
        ]
        self._fields = {item.number: item for item in numeric}
        self._names = frozenset(item.name for item in numeric)
        self._rows = rows
        self._pending: dict[int, _Pending] = {}
        self._pending_bytes = 0
        self._count = 0
        self.unreadable = 0
        """Messages that could not be decoded."""

    def add(self, records: bytes, stride: int) -> None:
        """Append message records of `stride` bytes each."""
        # signals that come in some cycles only give records of several sizes in turn: one table for each size
        pending = self._pending.get(stride)
        if pending is None:
            pending = self._pending[stride] = _Pending([], [], [])
        count = len(records) // stride
        pending.records.append(records)
        pending.starts.append(self._count)
        pending.counts.append(count)
        self._count += count
        self._pending_bytes += len(records)
        if self._pending_bytes > BATCH_BYTES:
            self._decode_pending()

    def finish(self) -> tuple[NDArray[np.int64], dict[str, Floats]]:
        """Give log times (ns, shape (n,)) and each field that occurred, shape (n,), NaN where it was absent."""
        self._decode_pending()
        times, columns = self._rows.finish()
        order = [item.name for item in sorted(self._fields.values(), key=lambda item: item.number)]
        return times.astype(np.int64), {name: columns[name] for name in order if name in columns}

    def _decode_pending(self) -> None:
        """Hand all records that wait on as rows, in the order in which they came."""
        blocks = []
        for stride, pending in self._pending.items():
            data = b"".join(pending.records)
            counts = np.array(pending.counts)
            before = np.cumsum(counts) - counts
            places = np.repeat(np.array(pending.starts) - before, counts) + np.arange(len(data) // stride)
            blocks.append(self._decode(data, stride, places))
        self._pending, self._pending_bytes = {}, 0
        times = np.zeros(self._count, dtype=np.int64)
        decoded = np.zeros(self._count, dtype=np.bool_)
        columns: dict[str, Floats] = {}
        for block in blocks:
            times[block.places] = block.times
            decoded[block.places] = True
            for name, values in block.columns.items():
                columns.setdefault(name, np.full(self._count, np.nan))[block.places] = values
        self._count = 0
        if decoded.all():
            self._rows.add(times, columns)
        else:
            self._rows.add(times[decoded], {name: column[decoded] for name, column in columns.items()})

    def _decode(self, data: bytes, stride: int, places: NDArray[np.intp]) -> _Block:
        layout = self._layout(data[:stride])
        if layout is not None:
            rows = np.frombuffer(data, dtype=np.uint8).reshape(-1, stride)
            tags = rows[:, layout.tags]
            if bool(np.all(tags == tags[0])):
                table = np.frombuffer(data, dtype=layout.record)
                columns = {name: table[name].astype(np.float64) for name in layout.names}
                return _Block(places, table["log_time"].astype(np.int64), columns)
        return self._decode_one_by_one(data, stride, places)

    def _layout(self, record: bytes) -> _Layout | None:
        """Give the layout of a record, None if it has a field of variable size, an unknown one, or one twice."""
        position = MESSAGE_HEAD
        tags: list[int] = []
        names, formats, offsets = ["log_time"], ["<u8"], [15]
        while position < len(record):
            first = position
            key, position = _varint(record, position)
            field = self._fields.get(key >> 3)
            if field is None or field.type not in _FIXED or field.name in names:
                return None
            wire_type, code = _FIXED[field.type]
            if key & 7 != wire_type:
                return None
            tags.extend(range(first, position))
            names.append(field.name)
            formats.append(code)
            offsets.append(position)
            position += 8 if wire_type == 1 else 4
        if position != len(record) or not tags:
            return None
        kind = np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": len(record)})
        return _Layout(kind, np.array(tags), tuple(names[1:]))

    def _decode_one_by_one(self, data: bytes, stride: int, places: NDArray[np.intp]) -> _Block:
        kept: list[int] = []
        times: list[int] = []
        rows: list[dict[str, float]] = []
        for index, start in enumerate(range(0, len(data), stride)):
            try:
                message = self._message.FromString(data[start + MESSAGE_HEAD : start + stride])
            except DecodeError:
                self.unreadable += 1
                continue
            kept.append(index)
            times.append(int.from_bytes(data[start + 15 : start + 23], "little"))
            rows.append({item.name: float(value) for item, value in message.ListFields() if item.name in self._names})
        columns = {name: np.full(len(rows), np.nan) for name in {name for row in rows for name in row}}
        for index, row in enumerate(rows):
            for name, value in row.items():
                columns[name][index] = value
        return _Block(places[kept], np.array(times, dtype=np.uint64).astype(np.int64), columns)


def _varint(data: bytes, position: int) -> tuple[int, int]:
    """Give the varint at `position` and the position after it; key 0, which no field has, if it is cut off."""
    value = shift = 0
    while position < len(data) and shift < 64:
        byte = data[position]
        position += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, position
        shift += 7
    return 0, position

"""An MCAP file whose chunks are closed when the caller says so, with one `struct` call per message.

The `mcap` package's own writer costs three times as much per message and, in older releases, cannot close a chunk
on demand; its record classes are used for everything but messages. File format: MCAP specification,
https://mcap.dev/spec.
"""

import struct
import zlib
from collections.abc import Callable, Mapping, Sequence
from typing import BinaryIO, Protocol

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

MAGIC = b"\x89MCAP0\r\n"
MESSAGE_HEAD = "<BQHIQQ"
"""`struct` format before a message's payload: opcode, length, channel, sequence, log time, publish time."""
MESSAGE_OVERHEAD = 2 + 4 + 8 + 8
"""What the length of a message record counts besides the payload."""

_CHUNK_HEAD = struct.Struct("<BQQQQII4sQ")
_MESSAGE_INDEX_HEAD = struct.Struct("<BQHI")
_FOOTER_WITHOUT_CRC = struct.Struct("<BQQQ")
_plain_head = struct.Struct(MESSAGE_HEAD)


class _Record(Protocol):
    def write(self, stream: RecordBuilder) -> None:
        """Append the record to `stream`."""


class McapFile:
    """Writes to `handle`, which stays the caller's to flush and close."""

    def __init__(self, handle: BinaryIO, *, profile: str, library: str) -> None:
        """Write the magic and the header."""
        self._handle = handle
        self._position = 0
        self._compress: Callable[[bytes], bytes] = zstandard.ZstdCompressor().compress
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._chunks: list[ChunkIndex] = []
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._counts: dict[int, int] = {}
        self._first_time: int | None = None
        self._last_time = 0
        self._parts: list[bytes] = []
        self._offset = 0
        self._index: dict[int, list[int]] = {}
        self._put(MAGIC)
        self._put(_record(Header(profile, library)))

    def add_metadata(self, name: str, data: Mapping[str, str]) -> None:
        """Write a metadata record now, before the messages of an open chunk."""
        record = _record(Metadata(name=name, metadata=dict(data)))
        self._metadata.append(MetadataIndex(offset=self._position, length=len(record), name=name))
        self._put(record)

    def add_attachment(self, time_ns: int, name: str, media_type: str, data: bytes) -> None:
        """Write an attachment now, before the messages of an open chunk."""
        attachment = Attachment(create_time=time_ns, log_time=time_ns, name=name, media_type=media_type, data=data)
        record = _record(attachment)
        self._attachments.append(
            AttachmentIndex(
                offset=self._position,
                length=len(record),
                create_time=time_ns,
                log_time=time_ns,
                data_size=len(data),
                name=name,
                media_type=media_type,
            )
        )
        self._put(record)

    def add_channel(self, topic: str, type_name: str, schema: bytes, metadata: Mapping[str, str]) -> int:
        """Declare a protobuf channel in the open chunk; give its id."""
        return self.copy_channel(
            Channel(id=0, topic=topic, message_encoding="protobuf", metadata=dict(metadata), schema_id=0),
            Schema(id=0, data=schema, encoding="protobuf", name=type_name),
        )

    def copy_channel(self, channel: Channel, schema: Schema | None) -> int:
        """Declare a channel like one of another file, with its schema, in the open chunk; give its id here."""
        number = len(self._channels) + 1
        if schema is not None:
            self._schemas.append(Schema(id=number, data=schema.data, encoding=schema.encoding, name=schema.name))
            self._append(_record(self._schemas[-1]))
        self._channels.append(
            Channel(
                id=number,
                topic=channel.topic,
                message_encoding=channel.message_encoding,
                metadata=channel.metadata,
                schema_id=number if schema is not None else 0,
            )
        )
        self._counts[number] = 0
        self._append(_record(self._channels[-1]))
        return number

    def add_message(self, channel: int, log_time: int, payload: bytes) -> None:
        """Append a message (log time in ns) to the open chunk."""
        self.add_record(
            channel,
            log_time,
            _plain_head.pack(
                Opcode.MESSAGE,
                MESSAGE_OVERHEAD + len(payload),
                channel,
                self._counts[channel] & 0xFFFFFFFF,
                log_time,
                log_time,
            )
            + payload,
        )

    def add_record(self, channel: int, log_time: int, record: bytes) -> None:
        """Append a complete message record, head included, to the open chunk."""
        index = self._index.get(channel)
        if index is None:
            index = self._index[channel] = []
        index.append(log_time)
        index.append(self._offset)
        self._parts.append(record)
        self._offset += len(record)
        self._counts[channel] += 1

    @property
    def open_bytes(self) -> int:
        """Size of the open chunk before compression."""
        return self._offset

    def close_chunk(self) -> None:
        """Compress the open chunk and write it to the handle; one without a message stays open."""
        if not self._index:
            return
        data = b"".join(self._parts)
        compressed = self._compress(data)
        times = [time for pairs in self._index.values() for time in pairs[::2]]
        first, last = min(times), max(times)
        start = self._position
        self._put(
            _CHUNK_HEAD.pack(
                Opcode.CHUNK,
                _CHUNK_HEAD.size - 9 + len(compressed),
                first,
                last,
                len(data),
                zlib.crc32(data),
                4,
                b"zstd",
                len(compressed),
            )
        )
        self._put(compressed)
        length, offsets = self._position - start, {}
        for channel, pairs in self._index.items():
            offsets[channel] = self._position
            size = 8 * len(pairs)
            self._put(_MESSAGE_INDEX_HEAD.pack(Opcode.MESSAGE_INDEX, 6 + size, channel, size))
            self._put(struct.pack(f"<{len(pairs)}Q", *pairs))
        self._chunks.append(
            ChunkIndex(
                message_start_time=first,
                message_end_time=last,
                chunk_start_offset=start,
                chunk_length=length,
                message_index_offsets=offsets,
                message_index_length=self._position - start - length,
                compression="zstd",
                compressed_size=len(compressed),
                uncompressed_size=len(data),
            )
        )
        self._first_time = first if self._first_time is None else min(first, self._first_time)
        self._last_time = max(last, self._last_time)
        self._parts, self._offset, self._index = [], 0, {}

    def finish(self) -> None:
        """Write the summary and the footer."""
        self._put(_record(DataEnd(0)))
        start = self._position
        statistics = Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts={channel: count for channel, count in self._counts.items() if count},
            chunk_count=len(self._chunks),
            message_count=sum(self._counts.values()),
            metadata_count=len(self._metadata),
            message_start_time=self._first_time or 0,
            message_end_time=self._last_time,
            schema_count=len(self._schemas),
        )
        groups: tuple[tuple[Opcode, Sequence[_Record]], ...] = (
            (Opcode.SCHEMA, self._schemas),
            (Opcode.CHANNEL, self._channels),
            (Opcode.STATISTICS, [statistics]),
            (Opcode.CHUNK_INDEX, self._chunks),
            (Opcode.ATTACHMENT_INDEX, self._attachments),
            (Opcode.METADATA_INDEX, self._metadata),
        )
        summary = b""
        offsets: list[SummaryOffset] = []
        for opcode, records in groups:
            group = b"".join(_record(item) for item in records)
            if group:
                offsets.append(
                    SummaryOffset(group_opcode=opcode, group_start=start + len(summary), group_length=len(group))
                )
            summary += group
        offset_start = start + len(summary)
        summary += b"".join(_record(item) for item in offsets)
        # the checksum covers the summary and the footer up to the checksum itself
        crc = zlib.crc32(_FOOTER_WITHOUT_CRC.pack(Opcode.FOOTER, 20, start, offset_start), zlib.crc32(summary))
        self._put(summary)
        self._put(_record(Footer(summary_start=start, summary_offset_start=offset_start, summary_crc=crc)))
        self._put(MAGIC)

    def _append(self, record: bytes) -> None:
        self._parts.append(record)
        self._offset += len(record)

    def _put(self, data: bytes) -> None:
        self._handle.write(data)
        self._position += len(data)


def _record(record: _Record) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())

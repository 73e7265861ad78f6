"""Top-level records of an MCAP file that may be cut off, damaged or hostile: bounded memory, nothing lost in silence.

Readers of the `mcap` package need an intact footer or stop at the first bad record. File format: MCAP
specification, https://mcap.dev/spec.
"""

import mmap
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Metadata, Schema

from drivers.errors import DataError

MAGIC = b"\x89MCAP0\r\n"
RECORD_HEAD = struct.Struct("<BQ")
"""Opcode and length of the content that follows."""

BROKEN = (McapError, struct.error, UnicodeDecodeError, OverflowError)
"""What parsing a damaged record raises."""

MAX_CHUNK_BYTES = 64 * 1024 * 1024
"""Largest decompressed chunk: a hundred times what common writers make."""

MAX_TOTAL_BYTES = 4 * 1024**3
"""Largest sum of decompressed chunks of a log that is kept whole: about 7 hours of 13 signals at 1 kHz."""

MAX_STREAMED_BYTES = 256 * 1024**3
"""The same of a log of which means are kept; it bounds the time that a small file can take."""


@dataclass(frozen=True, slots=True)
class RawChunk:
    """Decompressed records of one chunk."""

    data: bytes


@dataclass(frozen=True, slots=True)
class RawMessage:
    """A message record outside a chunk: its whole bytes, with opcode and length."""

    data: bytes


@dataclass(frozen=True, slots=True)
class Damage:
    """Something that could not be read: what, and how many seconds of the log it held (None: unknown)."""

    what: str
    seconds: float | None = None


Piece = RawChunk | RawMessage | Schema | Channel | Metadata | Attachment | Damage


@contextmanager
def open_mapped(path: Path) -> Iterator[mmap.mmap]:
    """Give the bytes of `path` without reading them into memory. Raises DataError if it is no MCAP file."""
    try:
        with path.open("rb") as handle:
            if handle.read(len(MAGIC)) != MAGIC:
                raise DataError(str(path), "this is no MCAP file", expected="the MCAP magic in the first 8 bytes")
            with mmap.mmap(handle.fileno(), 0, access=mmap.ACCESS_READ) as mapped:
                yield mapped
    except OSError as error:
        raise DataError(str(path), f"the log cannot be read: {error.strerror or error}") from error


def read_pieces(file: mmap.mmap, path: Path, most_bytes: int) -> Iterator[Piece]:
    """Give every readable record of the data section in file order, and Damage where one is not readable.

    Raises DataError where a chunk asks for more memory than MAX_CHUNK_BYTES, all together for more than `most_bytes`.
    """
    position, total, ended = len(MAGIC), 0, False
    zstd = zstandard.ZstdDecompressor()
    while position + RECORD_HEAD.size <= len(file):
        opcode, length = RECORD_HEAD.unpack_from(file, position)
        start = position + RECORD_HEAD.size
        position = start + length
        if position > len(file):
            break
        if opcode == Opcode.DATA_END:
            ended = True
            break
        if opcode == Opcode.MESSAGE:
            yield RawMessage(file[start - RECORD_HEAD.size : position])
        elif opcode == Opcode.CHUNK:
            piece = _chunk(file[start:position], path, zstd)
            if isinstance(piece, RawChunk):
                total += len(piece.data)
                if total > most_bytes:
                    raise DataError(str(path), f"the log is larger than {most_bytes} bytes when decompressed")
            yield piece
        else:
            try:
                record = parse_record(opcode, file[start:position])
            except ValueError as error:
                yield Damage(str(error), 0.0)
                continue
            if record is not None:
                yield record
    if not ended:
        yield Damage("the file ends in the middle of the data")
    elif file[-len(MAGIC) :] != MAGIC:
        yield Damage("the index at the end of the file is cut off; no sample is missing", 0.0)


def parse_record(opcode: int, content: bytes) -> Schema | Channel | Metadata | Attachment | None:
    """Give the record, or None for a kind that carries nothing of the log; raises ValueError if it is broken."""
    stream = ReadDataStream(BytesIO(content))
    record: Schema | Channel | Metadata | Attachment | None = None
    try:
        match opcode:
            case Opcode.SCHEMA:
                record = Schema.read(stream)
            case Opcode.CHANNEL:
                record = Channel.read(stream)
            case Opcode.METADATA:
                record = Metadata.read(stream)
            case Opcode.ATTACHMENT:
                record = Attachment.read(stream)
    except BROKEN as error:
        raise ValueError(f"unreadable record of kind {opcode}: {error}") from error
    return record


def _chunk(content: bytes, path: Path, zstd: zstandard.ZstdDecompressor) -> RawChunk | Damage:
    try:
        chunk = Chunk.read(ReadDataStream(BytesIO(content)))
    except BROKEN as error:
        return Damage(f"a chunk has a broken head ({error})")
    if chunk.uncompressed_size > MAX_CHUNK_BYTES:
        raise DataError(
            str(path),
            f"a chunk claims {chunk.uncompressed_size} bytes when decompressed",
            expected=f"at most {MAX_CHUNK_BYTES} bytes",
        )
    seconds = max(0, chunk.message_end_time - chunk.message_start_time) / 1e9
    try:
        data = _decompress(chunk, zstd)
    except (zstandard.ZstdError, RuntimeError, ValueError) as error:
        return Damage(f"a chunk cannot be decompressed ({error})", seconds)
    if len(data) != chunk.uncompressed_size:
        return Damage("a chunk decompresses to another size than it states", seconds)
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        return Damage("a chunk fails its checksum", seconds)
    return RawChunk(data)


def _decompress(chunk: Chunk, zstd: zstandard.ZstdDecompressor) -> bytes:
    """Give the chunk's content, never more than one byte above the size it states."""
    limit = chunk.uncompressed_size + 1
    if chunk.compression == "zstd":
        stated = zstandard.get_frame_parameters(chunk.data).content_size
        if stated <= limit:
            return zstd.decompress(chunk.data)
        with zstd.stream_reader(chunk.data) as reader:
            return reader.read(limit)
    if chunk.compression == "lz4":
        return bytes(lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=limit))
    if chunk.compression == "":
        return chunk.data
    raise ValueError(f"compression '{chunk.compression[:20]}' is not known")

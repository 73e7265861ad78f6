"""Read an MCAP log into arrays, also one that was cut off by a crash."""

import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from google.protobuf.message import DecodeError, Message
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Metadata, Schema

from drivers.errors import DataError
from drivers.signals import AUXILIARY_PREFIX, BY_FIELD, BY_NAME
from rig.log.mcap_records import (
    MAX_STREAMED_BYTES,
    MAX_TOTAL_BYTES,
    RECORD_HEAD,
    Damage,
    RawChunk,
    RawMessage,
    open_mapped,
    parse_record,
    read_pieces,
)
from rig.log.names import plain_name
from rig.log.rows import Rows
from rig.log.run import Floats, Run, RunEvent
from rig.log.schema import (
    EMERGENCY_TYPE,
    EVENT_TOPIC,
    EVENT_TYPE,
    SAMPLE_TOPIC,
    emergency_schema,
    event_schema,
    message_class,
)
from rig.log.timeline import make_run
from rig.log.wire import MESSAGE_HEAD, Columns

IMPORT_WARNINGS = "import_warnings"
"""Key of metadata `run` under which an import tells what it noticed."""

AT_IMPORT = "at import: "
"""What a warning begins with that an import gave."""

EVENT_KIND_DEVICE = "device"
"""Kind of the run events that stand for messages of a device."""

_MESSAGE_START = struct.Struct("<BQHIQ")
"""Opcode, length, channel, sequence, log time."""

_RUN_LENGTH = 256
"""Messages looked ahead for equal size; bounds the work on a chunk in which sizes alternate."""


@dataclass(slots=True)
class LogContent:
    """Everything found in a log: the raw material of `Run` and of a recovered file."""

    path: Path
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    attachments: dict[str, bytes] = field(default_factory=dict)
    damages: list[Damage] = field(default_factory=list)


def read_mcap(path: Path, most_samples: int | None = None) -> Run:
    """Give the run in an MCAP log; one that was cut off is read as far as it goes, with `complete` False.

    `most_samples`: of a log with more samples means over samples are kept, see `Run.averaged`; None: all is kept.
    Raises DataError if the file is no MCAP, has no `/rig/sample`, or would need too much memory.
    """
    samples: dict[int, Columns] = {}
    rows = Rows(path, most_samples)
    others: list[tuple[Channel, int, bytes]] = []

    def take(channel: Channel, records: bytes, stride: int) -> None:
        if channel.topic != SAMPLE_TOPIC:
            for start in range(0, len(records), stride):
                log_time = _MESSAGE_START.unpack_from(records, start)[4]
                others.append((channel, log_time, records[start + MESSAGE_HEAD : start + stride]))
            return
        if channel.id not in samples:
            samples[channel.id] = _columns(content, channel, rows)
        samples[channel.id].add(records, stride)

    content = LogContent(path)
    read_content(content, take, MAX_TOTAL_BYTES if most_samples is None else MAX_STREAMED_BYTES)
    if "run" not in content.metadata and not any(
        channel.topic == SAMPLE_TOPIC for channel in content.channels.values()
    ):
        topics = sorted(channel.topic for channel in content.channels.values())
        raise DataError(
            str(path),
            f"this MCAP file is no log of a bench; its topics are {topics[:5] or 'none'}",
            expected=f"the topic {SAMPLE_TOPIC}",
            hint="Convert foreign recordings to CSV and use rig import.",
        )
    if len(samples) > 1:
        raise DataError(str(path), f"the log has {len(samples)} channels {SAMPLE_TOPIC}", expected="one run per file")
    return _run(content, next(iter(samples.values()), None), rows, others)


def read_content(
    content: LogContent, take: Callable[[Channel, bytes, int], None], most_bytes: int = MAX_TOTAL_BYTES
) -> None:
    """Fill `content` from its file; hand message records to `take` as (channel, records, bytes per record)."""
    with open_mapped(content.path) as file:
        for piece in read_pieces(file, content.path, most_bytes):
            match piece:
                case RawChunk():
                    _read_chunk(content, piece.data, take)
                case RawMessage():
                    _read_chunk(content, piece.data, take)
                case Damage():
                    content.damages.append(piece)
                case _:
                    _keep(content, piece)


def _read_chunk(content: LogContent, data: bytes, take: Callable[[Channel, bytes, int], None]) -> None:
    position = 0
    while position + RECORD_HEAD.size <= len(data):
        opcode, length = RECORD_HEAD.unpack_from(data, position)
        stride = RECORD_HEAD.size + length
        if position + stride > len(data):
            content.damages.append(Damage("a record reaches over the end of its chunk"))
            return
        if opcode != Opcode.MESSAGE or stride < MESSAGE_HEAD:
            _keep_parsed(content, opcode, data[position + RECORD_HEAD.size : position + stride])
            position += stride
            continue
        count = _equal_heads(data, position, stride)
        channel = content.channels.get(_MESSAGE_START.unpack_from(data, position)[2])
        if channel is None:
            content.damages.append(Damage("messages of an undeclared channel were left out"))
        else:
            take(channel, data[position : position + count * stride], stride)
        position += count * stride


def _equal_heads(data: bytes, position: int, stride: int) -> int:
    """Count the records from `position` on that have the same opcode, length and channel as the first."""
    if data[position : position + 11] != data[position + stride : position + stride + 11]:
        return 1
    count = min((len(data) - position) // stride, _RUN_LENGTH)
    rows = np.frombuffer(data, dtype=np.uint8, count=count * stride, offset=position).reshape(count, stride)
    same = (rows[:, :11] == rows[0, :11]).all(axis=1)
    return count if bool(same.all()) else int(np.argmin(same))


def _keep_parsed(content: LogContent, opcode: int, data: bytes) -> None:
    try:
        record = parse_record(opcode, data)
    except ValueError as error:
        content.damages.append(Damage(str(error)))
        return
    if record is not None:
        _keep(content, record)


def _keep(content: LogContent, record: Schema | Channel | Metadata | Attachment) -> None:
    match record:
        case Schema():
            content.schemas[record.id] = record
        case Channel():
            content.channels[record.id] = record
        case Metadata():
            content.metadata.setdefault(record.name, dict(record.metadata))
        case Attachment():
            content.attachments[record.name] = record.data


def _columns(content: LogContent, channel: Channel, rows: Rows) -> Columns:
    schema = content.schemas.get(channel.schema_id)
    if schema is None or channel.message_encoding != "protobuf":
        raise DataError(
            str(content.path),
            f"{SAMPLE_TOPIC} is encoded as '{channel.message_encoding[:40]}'"
            + ("" if schema else " and its schema is missing"),
            expected="protobuf with a schema",
        )
    try:
        return Columns(schema.data, schema.name, rows)
    except ValueError as error:
        raise DataError(str(content.path), str(error)) from error


def _run(content: LogContent, samples: Columns | None, rows: Rows, others: list[tuple[Channel, int, bytes]]) -> Run:
    log_times, fields = samples.finish() if samples else (np.empty(0, dtype=np.int64), {})
    metadata = dict(content.metadata.get("run", {}))
    first = int(log_times[0]) if len(log_times) else _epoch(metadata)
    # the clock epoch of the run's own time, which begins at its first sample
    metadata["epoch_ns"] = str(first)
    metadata.update({f"outcome.{key}": value for key, value in content.metadata.get("outcome", {}).items()})
    stated = {
        key.removeprefix("unit."): unit
        for channel in content.channels.values()
        if channel.topic == SAMPLE_TOPIC
        for key, unit in channel.metadata.items()
    }
    signals: dict[str, Floats] = {}
    auxiliary: dict[str, Floats] = {}
    units: dict[str, str] = {}
    for name, column in fields.items():
        if name in BY_FIELD:
            signals[BY_FIELD[name].name] = column
        else:
            plain = plain_name(name.removeprefix(AUXILIARY_PREFIX), {*BY_NAME, *auxiliary})
            auxiliary[plain], units[plain] = column, stated.get(name, "1")
    return make_run(
        content.path,
        (log_times - first) / 1e9,
        signals,
        auxiliary,
        units,
        metadata,
        events=_events(others, first),
        dut_text=_text(content.attachments, "dut.toml"),
        bench_text=_text(content.attachments, "bench.toml"),
        complete=not content.damages and content.metadata.get("recovered", {}).get("complete", "true") == "true",
        warnings=_warnings(content, samples.unreadable if samples else 0),
        averaged=rows.averaged,
    )


def _warnings(content: LogContent, unreadable: int) -> list[str]:
    notes = []
    kinds: dict[str, list[float | None]] = {}
    for damage in content.damages:
        kinds.setdefault(damage.what, []).append(damage.seconds)
    for what, seconds in kinds.items():
        times = f" ({len(seconds)} times)" if len(seconds) > 1 else ""
        known = [value for value in seconds if value is not None]
        missing = f"; about {sum(known):.3g} s are missing" if len(known) == len(seconds) and sum(known) > 0 else ""
        notes.append(f"incomplete log: {what}{times}{missing}")
    recovered = content.metadata.get("recovered", {})
    if recovered:
        notes.append(f"recovered from {recovered.get('source', 'a damaged log')[:80]}: {recovered.get('damage', '')}")
    imported = content.metadata.get("run", {}).get(IMPORT_WARNINGS, "")
    if imported:
        notes.append(AT_IMPORT + imported)
    if unreadable:
        notes.append(f"{unreadable} samples could not be decoded and were left out")
    return notes


def _events(others: list[tuple[Channel, int, bytes]], first: int) -> tuple[RunEvent, ...]:
    event_class = message_class(event_schema(), EVENT_TYPE)
    emergency_class = message_class(emergency_schema(), EMERGENCY_TYPE)
    events = []
    for channel, log_time, data in others:
        time = (log_time - first) / 1e9
        try:
            if channel.topic == EVENT_TOPIC:
                event = _values(event_class.FromString(data))
                events.append(RunEvent(time, event.get("kind", ""), event.get("text", "")))
            elif channel.topic.startswith("/drive/") and channel.topic.endswith("/emcy"):
                emergency = _values(emergency_class.FromString(data))
                device = channel.metadata.get("device", channel.topic.split("/")[2])
                events.append(RunEvent(time, EVENT_KIND_DEVICE, _emergency_text(device, emergency)))
        except DecodeError:
            events.append(RunEvent(time, "unreadable", f"a message on {channel.topic[:40]} could not be decoded"))
    return tuple(sorted(events, key=lambda event: event.time))


def _values(message: Message) -> dict[str, str]:
    return {
        item.name: value.hex(" ") if isinstance(value, bytes) else str(value) for item, value in message.ListFields()
    }


def _emergency_text(device: str, emergency: Mapping[str, str]) -> str:
    code, register = int(emergency.get("code", "0")), int(emergency.get("register", "0"))
    text = f"{device}: {emergency.get('text', '')}"
    if code or register:
        text += f" (error code 0x{code:04X}, error register 0x{register:02X}, data {emergency.get('data', '')})"
    return text


def _text(attachments: Mapping[str, bytes], name: str) -> str:
    return attachments.get(name, b"").decode("utf-8", errors="replace")


def _epoch(metadata: Mapping[str, str]) -> int:
    try:
        return int(metadata.get("epoch_ns", "0"))
    except ValueError:
        return 0

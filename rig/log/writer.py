"""Write a run to an MCAP file while it happens, so that a killed process loses at most the last 100 ms.

A chunk is closed and handed to the operating system every 50 ms of sample time; before that a chunk is lost with
the process. Metadata `run` and the attached files are on disk before the first sample. One sample is one protobuf
message, packed by `struct` in one call. File format: MCAP specification, https://mcap.dev/spec.
"""

import errno
import struct
from collections.abc import Collection, Mapping, Sequence
from operator import itemgetter
from pathlib import Path
from typing import BinaryIO, Final

from google.protobuf.message import Message
from mcap.opcode import Opcode

from drivers.errors import ConfigError, DataError, Mistake
from drivers.signals import BY_NAME
from drivers.types import DeviceEvent, Sample
from rig.log.mcap_file import MESSAGE_HEAD, MESSAGE_OVERHEAD, McapFile
from rig.log.names import plain_name, writable_folder
from rig.log.run import RunEvent
from rig.log.schema import (
    EMERGENCY_TYPE,
    EVENT_TOPIC,
    EVENT_TYPE,
    SAMPLE_TOPIC,
    SAMPLE_TYPE,
    LogField,
    emergency_schema,
    emergency_topic,
    event_schema,
    message_class,
    sample_fields,
    sample_schema,
)

CHUNK_TIME = 0.05
"""s of samples in one chunk: half of the 100 ms that a killed process may lose."""

MAX_CHUNK_BYTES = 256 * 1024
"""Upper bound of a chunk, for cycles so fast that 50 ms would be long to read back."""

_AUXILIARY, _TIME = Sample._fields.index("auxiliary"), Sample._fields.index("time")

PROFILE = "rig"
LIBRARY = "harmonic-rig"


class LogWriter:
    """An open log. Every method raises DataError, with the file's name, if the disk refuses."""

    def __init__(
        self,
        path: Path,
        info: Mapping[str, str],
        *,
        attachments: Mapping[str, bytes],
        cycle_rate: float,
        epoch_ns: int,
        auxiliary: Sequence[str] = (),
        auxiliary_units: Mapping[str, str] | None = None,
        without: Collection[str] = (),
    ) -> None:
        """Create `path` and write what is known before the first sample.

        `info`: text facts of the run (metadata `run`). `attachments`: file name to content. `cycle_rate`: Hz.
        `epoch_ns`: Unix time in ns at sample time zero. `auxiliary`: names that samples may carry beyond the
        signal table, each with its unit in `auxiliary_units` (default "1"). `without`: signals that are never
        written (an imported recording has no control cycle).
        Raises ConfigError if the file exists or cannot be created.
        """
        units = auxiliary_units or {}
        self._path = path
        self._epoch_ns = epoch_ns
        self._auxiliary: Final = {name: units.get(name, "1") for name in auxiliary}
        _refuse_bad_names(path, auxiliary)
        fields = sample_fields(self._auxiliary)
        self._fields: Final = tuple(item for item in fields if item.auxiliary or item.signal not in without)
        self._samples = 0
        self._end_of_chunk = -1.0
        self._emergency_channels: dict[str, int] = {}
        self._event_class: Final = message_class(event_schema(), EVENT_TYPE)
        self._emergency_class: Final = message_class(emergency_schema(), EMERGENCY_TYPE)
        self._closed = True
        self._handle = _create(path)
        try:
            self._begin(info, attachments, cycle_rate)
        except OSError as error:
            _close_quietly(self._handle)
            raise self._refused(error) from error
        self._layouts: dict[tuple[str, ...], _Layout] = {}
        self._layout = self._layout_for(())
        self._closed = False

    @property
    def path(self) -> Path:
        """The file that is written."""
        return self._path

    @property
    def samples(self) -> int:
        """Number of samples written so far."""
        return self._samples

    def write(self, sample: Sample) -> None:
        """Append one sample. Raises DataError for an auxiliary signal that was not declared."""
        log_time = self._log_time(sample.time)
        record = self._layout.pack(sample, self._samples & 0xFFFFFFFF, log_time)
        if record is None:
            self._layout = self._layout_for(self._present(sample))
            record = self._layout.pack(sample, self._samples & 0xFFFFFFFF, log_time)
            if record is None:
                raise DataError(
                    str(self._path), f"sample at {sample.time!r} s holds a value that does not fit its field"
                )
        if sample.time >= self._end_of_chunk or self._file.open_bytes > MAX_CHUNK_BYTES:
            self.flush()
            self._end_of_chunk = sample.time + CHUNK_TIME
        self._file.add_record(self._sample_channel, log_time, record)
        self._samples += 1

    def event(self, event: RunEvent) -> None:
        """Append something that happened in the run."""
        message = self._event_class(time_s=event.time, kind=event.kind, text=event.text)
        self._message(self._event_channel, event.time, message)

    def device_event(self, event: DeviceEvent) -> None:
        """Append something a device reported by itself, on the device's own topic."""
        message = self._emergency_class(
            time_s=event.time, text=event.text, code=event.code, register=event.register, data=event.data
        )
        device = plain_name(event.device)
        if device not in self._emergency_channels:
            self._emergency_channels[device] = self._file.add_channel(
                emergency_topic(device), EMERGENCY_TYPE, emergency_schema(), {"device": event.device}
            )
        self._message(self._emergency_channels[device], event.time, message)

    def flush(self) -> None:
        """Hand everything written so far to the operating system."""
        if self._closed:
            raise DataError(str(self._path), "the log is closed already; nothing more can be written to it")
        try:
            self._file.close_chunk()
            self._handle.flush()
        except OSError as error:
            raise self._refused(error) from error

    def close(self, outcome: Mapping[str, str]) -> None:
        """Write metadata `outcome`, the index and the footer; close the file. A second call does nothing."""
        if self._closed:
            return
        self._closed = True
        try:
            # metadata lands before a chunk that is still open, and `outcome` is to be the last record
            self._file.close_chunk()
            self._file.add_metadata("outcome", outcome)
            self._file.finish()
            self._handle.flush()
        except OSError as error:
            raise self._refused(error) from error
        finally:
            _close_quietly(self._handle)

    def _begin(self, info: Mapping[str, str], attachments: Mapping[str, bytes], cycle_rate: float) -> None:
        self._file = McapFile(self._handle, profile=PROFILE, library=LIBRARY)
        self._file.add_metadata("run", {"cycle_rate": repr(cycle_rate), **info, "epoch_ns": str(self._epoch_ns)})
        for name, data in attachments.items():
            kind = "application/toml" if name.endswith(".toml") else "application/octet-stream"
            self._file.add_attachment(self._epoch_ns, name, kind, data)
        units = {f"unit.{item.name}": item.unit for item in self._fields}
        self._sample_channel = self._file.add_channel(SAMPLE_TOPIC, SAMPLE_TYPE, sample_schema(self._fields), units)
        self._event_channel = self._file.add_channel(EVENT_TOPIC, EVENT_TYPE, event_schema(), {})
        self._handle.flush()

    def _message(self, channel: int, time: float, message: Message) -> None:
        self._file.add_message(channel, self._log_time(time), message.SerializeToString(deterministic=True))

    def _log_time(self, time: float) -> int:
        return self._epoch_ns + round(time * 1e9)

    def _present(self, sample: Sample) -> tuple[str, ...]:
        undeclared = [name for name, _ in sample.auxiliary if name not in self._auxiliary]
        if undeclared:
            raise DataError(
                str(self._path),
                f"auxiliary signals {undeclared} were not declared when the log was opened",
                expected=f"one of {list(self._auxiliary)}",
            )
        table = [item.signal for item in self._fields if not item.auxiliary]
        names = [name for name in table if getattr(sample, name) is not None]
        return (*names, *(name for name, _ in sample.auxiliary))

    def _layout_for(self, present: tuple[str, ...]) -> "_Layout":
        if present not in self._layouts:
            self._layouts[present] = _Layout(present, self._fields, self._sample_channel)
        return self._layouts[present]

    def _refused(self, error: OSError) -> DataError:
        full = error.errno in (errno.ENOSPC, errno.EDQUOT)
        return DataError(
            str(self._path),
            f"the log could not be written after {self._samples} samples: {error.strerror or error}",
            hint="Free some space or choose another folder with -o." if full else "Choose another folder with -o.",
        )


class _Layout:
    """Packs samples that carry exactly the signals `present` into message records; another sample gives None."""

    def __init__(self, present: Sequence[str], fields: Sequence[LogField], channel: int) -> None:
        chosen = {item.signal: item for item in fields}
        table = [name for name in present if not chosen[name].auxiliary]
        absent = [item.signal for item in fields if not item.auxiliary and item.signal not in present]
        self._auxiliary = tuple(name for name in present if chosen[name].auxiliary)
        # by place in the tuple, which is faster than by name; two leading places, since of one name or none an
        # itemgetter would not give a tuple
        self._values = itemgetter(_AUXILIARY, _TIME, *map(Sample._fields.index, table))
        self._others = itemgetter(_TIME, _TIME, *map(Sample._fields.index, absent))
        self._none = [None] * len(absent)
        tags = [_tag(chosen[name]) for name in present]
        body = "".join(f"{len(tag)}s{chosen[name].code}" for name, tag in zip(present, tags, strict=True))
        self._struct = struct.Struct(MESSAGE_HEAD + body)
        length = MESSAGE_OVERHEAD + struct.calcsize("<" + body)
        head: list[object] = [Opcode.MESSAGE, length, channel, 0, 0, 0]
        self._first = len(head) + 1
        self._arguments = head + [part for tag in tags for part in (tag, None)]

    def pack(self, sample: Sample, sequence: int, log_time: int) -> bytes | None:
        """Give the message record (log time in ns), or None if the sample carries other signals."""
        _, _, *others = self._others(sample)
        if others != self._none:
            return None
        auxiliary, _, *values = self._values(sample)
        if auxiliary or self._auxiliary:
            if tuple(name for name, _ in auxiliary) != self._auxiliary:
                return None
            values.extend(value for _, value in auxiliary)
        arguments = self._arguments
        arguments[3:6] = sequence, log_time, log_time
        arguments[self._first :: 2] = values
        try:
            return self._struct.pack(*arguments)
        except struct.error:
            return None


def _tag(item: LogField) -> bytes:
    """Give the protobuf tag: number and wire type (1: 64 bit, 5: 32 bit) as a varint."""
    key = item.number << 3 | (5 if item.code == "I" else 1)
    tag = bytearray()
    while key > 0x7F:
        tag.append(key & 0x7F | 0x80)
        key >>= 7
    tag.append(key)
    return bytes(tag)


def _refuse_bad_names(path: Path, auxiliary: Sequence[str]) -> None:
    mistakes = [
        Mistake(f"auxiliary[{index}]", name, "letters, digits and underscores, no contract signal, each name once")
        for index, name in enumerate(auxiliary)
        if name != plain_name(name, BY_NAME) or name in auxiliary[:index]
    ]
    if mistakes:
        raise ConfigError(str(path), mistakes)


def _create(path: Path) -> BinaryIO:
    writable_folder(path.parent)
    try:
        return path.open("xb")
    except FileExistsError as error:
        raise ConfigError(
            str(path),
            [Mistake("file", path.name, "exists already and a log is never overwritten")],
            hint="Choose another folder with -o or move the old log away.",
        ) from error
    except OSError as error:
        raise ConfigError(
            str(path),
            [Mistake("file", path.name, f"cannot be created: {error.strerror or error}")],
            hint="Choose a folder you may write to with -o.",
        ) from error


def _close_quietly(handle: BinaryIO) -> None:
    """Close a file whose last flush may already have failed; that failure is the one that is reported."""
    try:
        handle.close()
    except OSError:
        return

"""Save what a cut or damaged log still holds into a new, indexed file, and check that file before saying yes."""

import struct
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Channel

from drivers.errors import ConfigError, DataError, Mistake
from rig.log.load import one_log
from rig.log.mcap_file import McapFile
from rig.log.mcap_reader import LogContent, read_content
from rig.log.schema import SAMPLE_TOPIC

MAX_CHUNK_BYTES = 256 * 1024
_CHANNEL_POSITION = 9
_LOG_TIME_POSITION = 15


@dataclass(frozen=True, slots=True)
class RecoverReport:
    """What was saved: `samples` and other `messages` in `file`, the time they span, and each `damage` of `source`.

    `intact` says that the source had no damage and the copy was not needed.
    """

    source: Path
    file: Path
    samples: int
    messages: int
    seconds: float
    damage: tuple[str, ...]

    @property
    def intact(self) -> bool:
        """True if nothing was wrong with the source."""
        return not self.damage


def recover(path: Path, out: Path | None = None) -> RecoverReport:
    """Copy every readable record of `path` to `out` (default `<name>-recovered.mcap` beside it).

    Raises DataError if `path` is a folder or no MCAP file, or the copy does not hold what was read; ConfigError if
    `out` exists or cannot be written.
    """
    target = out if out is not None else path.with_name(f"{path.stem}-recovered.mcap")
    content = LogContent(one_log(path))
    messages: list[tuple[Channel, bytes, int]] = []
    read_content(content, lambda channel, records, stride: messages.append((channel, records, stride)))
    if not messages:
        raise DataError(str(path), "nothing is readable: no message was found", expected="at least one whole chunk")
    try:
        with target.open("xb") as handle:
            file = McapFile(handle, profile="rig", library="harmonic-rig recover")
            counts, first, last = _write(file, content, messages)
    except OSError as error:
        raise ConfigError(
            str(target),
            [Mistake("file", target.name, f"cannot be created: {error.strerror or error}")],
            hint="Choose another file with -o.",
        ) from error
    _verify(target, counts)
    samples = counts.get(SAMPLE_TOPIC, 0)
    return RecoverReport(
        source=path,
        file=target,
        samples=samples,
        messages=counts.total() - samples,
        seconds=(last - first) / 1e9,
        damage=tuple(damage.what for damage in content.damages),
    )


def _write(
    file: McapFile, content: LogContent, messages: list[tuple[Channel, bytes, int]]
) -> tuple[Counter[str], int, int]:
    """Write everything; give the messages per topic and the first and last log time (ns) of the samples."""
    for name, data in content.metadata.items():
        if name != "outcome":
            file.add_metadata(name, data)
    for name, text in content.attachments.items():
        kind = "application/toml" if name.endswith(".toml") else "application/octet-stream"
        file.add_attachment(0, name, kind, text)
    channels: dict[int, int] = {}
    counts: Counter[str] = Counter()
    first = last = 0
    for channel, records, stride in messages:
        if channel.id not in channels:
            channels[channel.id] = file.copy_channel(channel, content.schemas.get(channel.schema_id))
        number = struct.pack("<H", channels[channel.id])
        for start in range(0, len(records), stride):
            record = records[start : start + stride]
            (log_time,) = struct.unpack_from("<Q", record, _LOG_TIME_POSITION)
            file.add_record(
                channels[channel.id], log_time, record[:_CHANNEL_POSITION] + number + record[_CHANNEL_POSITION + 2 :]
            )
            if channel.topic == SAMPLE_TOPIC:
                first = first if counts[SAMPLE_TOPIC] else log_time
                last = log_time
            counts[channel.topic] += 1
        if file.open_bytes > MAX_CHUNK_BYTES:
            file.close_chunk()
    file.close_chunk()
    if content.damages and "recovered" not in content.metadata:
        damage = "; ".join(dict.fromkeys(item.what for item in content.damages))
        complete = "true" if all(item.seconds == 0.0 for item in content.damages) else "false"
        file.add_metadata("recovered", {"source": content.path.name, "damage": damage, "complete": complete})
    if "outcome" in content.metadata:
        file.add_metadata("outcome", content.metadata["outcome"])
    file.finish()
    return counts, first, last


def _verify(target: Path, counts: Counter[str]) -> None:
    """Read the new file back with the mcap package's indexed reader and compare the number of messages."""
    try:
        with target.open("rb") as handle:
            found = Counter(channel.topic for _, channel, _ in make_reader(handle, validate_crcs=True).iter_messages())
    except (McapError, ValueError, struct.error) as error:
        raise DataError(str(target), f"the recovered file does not open: {error}") from error
    if found != counts:
        raise DataError(
            str(target),
            f"the recovered file holds {dict(found)} messages, but {dict(counts)} were read",
            hint="The original is unchanged; keep it.",
        )

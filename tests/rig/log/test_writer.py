"""The log writer: what is in the file, and what happens when it cannot be written."""

import subprocess
import sys
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from drivers.errors import ConfigError, DataError
from drivers.signals import BY_NAME, SIGNALS
from drivers.types import Sample
from rig.log.schema import FIELD_NUMBERS, sample_fields
from rig.log.writer import LogWriter
from tests.rig.log.samples import DUT, EPOCH_NS, samples, write_log


def open_writer(path: Path, auxiliary: tuple[str, ...] = ()) -> LogWriter:
    return LogWriter(path, {}, attachments={}, cycle_rate=1000.0, epoch_ns=EPOCH_NS, auxiliary=auxiliary)


def test_every_signal_of_the_table_has_its_own_field_number() -> None:
    assert {signal.name for signal in SIGNALS} == set(FIELD_NUMBERS)
    numbers = [item.number for item in sample_fields({"a": "1", "b": "1"})]
    assert len(set(numbers)) == len(numbers)


def test_an_independent_reader_with_a_protobuf_decoder_finds_every_sample(tmp_path: Path) -> None:
    write_log(tmp_path / "a.mcap", 200)
    with (tmp_path / "a.mcap").open("rb") as handle:
        reader = make_reader(handle, validate_crcs=True, decoder_factories=[DecoderFactory()])
        decoded = list(reader.iter_decoded_messages(topics=["/rig/sample"]))
    assert len(decoded) == 200
    for expected, (schema, _, message, found) in zip(samples(200), decoded, strict=True):
        assert schema is not None
        assert schema.name == "rig.Sample"
        assert message.log_time == message.publish_time == EPOCH_NS + expected.cycle * 1_000_000
        assert message.sequence == expected.cycle
        for name, signal in BY_NAME.items():
            value = getattr(expected, name)
            assert found.HasField(signal.field) == (value is not None), name
            if value is not None:
                assert getattr(found, signal.field) == value
        assert found.HasField("aux_strain") == (expected.cycle >= 10)
        if expected.auxiliary:
            assert found.aux_strain == expected.auxiliary[0][1]


def test_events_emergencies_metadata_units_and_attachments_are_in_the_file(tmp_path: Path) -> None:
    write_log(tmp_path / "a.mcap", 100)
    with (tmp_path / "a.mcap").open("rb") as handle:
        reader = make_reader(handle, validate_crcs=True, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert summary.statistics.message_count == 103
        assert summary.statistics.chunk_count == len(summary.chunk_indexes)
        topics = {channel.topic: channel for channel in summary.channels.values()}
        assert set(topics) == {"/rig/sample", "/rig/event", "/drive/motor/emcy"}
        assert topics["/rig/sample"].metadata["unit.output_torque_nm"] == "N*m"
        assert topics["/rig/sample"].metadata["unit.aux_strain"] == "mV/V"
        assert [record.name for record in reader.iter_metadata()] == ["run", "outcome"]
        attachments = {item.name: item.data for item in reader.iter_attachments()}
        assert attachments["dut.toml"] == DUT
        events = [found.text for _, _, _, found in reader.iter_decoded_messages(topics=["/rig/event"])]
        assert events == ["dwell", "sweep"]
        ((_, _, _, emergency),) = reader.iter_decoded_messages(topics=["/drive/motor/emcy"])
        assert (emergency.code, emergency.register, emergency.data) == (0x2310, 3, b"\x01\x02\x03\x04\x05")


def test_metadata_run_and_the_attachments_are_on_disk_before_the_first_sample(tmp_path: Path) -> None:
    open_writer(tmp_path / "a.mcap")
    assert b"cycle_rate" in (tmp_path / "a.mcap").read_bytes()


def test_the_outcome_is_the_last_record_of_the_data(tmp_path: Path) -> None:
    write_log(tmp_path / "a.mcap", 100)
    with (tmp_path / "a.mcap").open("rb") as handle:
        summary = make_reader(handle).get_summary()
    assert summary is not None
    (outcome,) = [item for item in summary.metadata_indexes if item.name == "outcome"]
    last = max(item.chunk_start_offset + item.chunk_length for item in summary.chunk_indexes)
    assert outcome.offset > last


def test_an_existing_file_is_never_overwritten(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(b"precious")
    with pytest.raises(ConfigError, match=r"a\.mcap.*never overwritten"):
        open_writer(tmp_path / "a.mcap")
    assert (tmp_path / "a.mcap").read_bytes() == b"precious"


def test_a_folder_that_is_a_file_is_named(tmp_path: Path) -> None:
    (tmp_path / "runs").write_text("not a folder")
    with pytest.raises(ConfigError, match="runs"):
        open_writer(tmp_path / "runs" / "a.mcap")


def test_missing_folders_are_made(tmp_path: Path) -> None:
    write_log(tmp_path / "new" / "folder" / "a.mcap", 3)
    assert (tmp_path / "new" / "folder" / "a.mcap").is_file()


def test_an_undeclared_auxiliary_signal_is_refused(tmp_path: Path) -> None:
    writer = open_writer(tmp_path / "a.mcap", ("strain",))
    with pytest.raises(DataError, match=r"surprise.*not declared"):
        writer.write(Sample(time=0.0, cycle=0, auxiliary=(("surprise", 1.0),)))


@pytest.mark.parametrize("names", [("a/b",), ("",), ("motor_torque",), ("strain", "strain")])
def test_an_auxiliary_name_that_no_field_takes_is_refused(tmp_path: Path, names: tuple[str, ...]) -> None:
    with pytest.raises(ConfigError, match="letters, digits"):
        open_writer(tmp_path / "a.mcap", names)
    assert not (tmp_path / "a.mcap").exists()


def test_a_value_that_does_not_fit_its_field_is_refused(tmp_path: Path) -> None:
    writer = open_writer(tmp_path / "a.mcap")
    with pytest.raises(DataError, match="does not fit"):
        writer.write(Sample(time=0.0, cycle=0, status_word=-1))


def test_a_second_close_does_nothing_and_a_flush_after_it_is_refused(tmp_path: Path) -> None:
    writer = write_log(tmp_path / "a.mcap", 5)
    size = (tmp_path / "a.mcap").stat().st_size
    writer.close({"result": "again"})
    assert (tmp_path / "a.mcap").stat().st_size == size
    with pytest.raises(DataError, match="closed"):
        writer.flush()


def test_a_disk_that_refuses_gives_one_error_that_names_the_file_and_keeps_what_was_written(tmp_path: Path) -> None:
    # a limit on the file size stands for a full disk
    limit = 60_000
    code = f"""
import resource, signal, sys
from pathlib import Path
from drivers.errors import DataError
from tests.rig.log.samples import write_log
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit}))
try:
    write_log(Path(sys.argv[1]), 5000)
except DataError as error:
    print(error)
    raise SystemExit(error.exit_code)
"""
    file = tmp_path / "a.mcap"
    command = [sys.executable, "-c", code, str(file)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=Path(__file__).parents[3])
    assert done.returncode == 5, done.stderr
    assert str(file) in done.stdout
    assert "could not be written" in done.stdout
    assert file.stat().st_size == limit

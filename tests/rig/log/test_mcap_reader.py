"""Reading MCAP logs: whole ones to the bit, cut, damaged, foreign and hostile ones without harm."""

import json
import re
import struct
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from google.protobuf import descriptor_pb2
from mcap.writer import CompressionType, Writer

from drivers.errors import DataError
from drivers.types import Sample
from rig.log.mcap_reader import read_mcap
from rig.log.run import ProcedureName
from rig.log.schema import message_class, sample_fields, sample_schema
from rig.log.writer import LogWriter
from tests.rig.log.samples import EPOCH_NS, samples, write_log


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Give the bytes of a closed log of 300 samples."""
    path = tmp_path_factory.mktemp("log") / "a.mcap"
    write_log(path, 300)
    return path.read_bytes()


def test_signals_read_back_to_the_bit_and_missing_samples_are_nan(tmp_path: Path) -> None:
    write_log(tmp_path / "a.mcap", 300)
    run = read_mcap(tmp_path / "a.mcap")
    expected = list(samples(300))
    assert np.array_equal(run.time, [sample.time for sample in expected])
    for name, column in run.signals.items():
        wanted = np.array([getattr(sample, name) for sample in expected], dtype=np.float64)
        assert np.array_equal(column, wanted, equal_nan=True), name
    assert np.isnan(run.signals["load_torque"]).sum() == 200
    assert "supply_voltage" not in run.signals
    assert np.isnan(run.auxiliary["strain"]).sum() == 10
    assert run.auxiliary_units["strain"] == "mV/V"


def test_facts_events_and_attachments_come_back(tmp_path: Path) -> None:
    write_log(tmp_path / "first.mcap", 100)
    run = read_mcap(tmp_path / "first.mcap")
    assert run.name == "first"
    assert run.procedure is ProcedureName.LOCKED_OUTPUT
    assert (run.replicate, run.start_angle) == ("A", 0.25)
    assert run.metadata["operator"] == "Ada"
    assert run.metadata["epoch_ns"] == str(EPOCH_NS)
    assert run.metadata["outcome.result"] == "done"
    assert run.dut_text == 'name = "µ-drive"\n'
    assert run.bench_text == "# bench\n"
    assert run.complete
    assert run.warnings == ()
    assert [(event.kind, event.text) for event in run.events][:2] == [("phase", "dwell"), ("phase", "sweep")]
    assert run.events[2].text == "motor: overcurrent (error code 0x2310, error register 0x03, data 01 02 03 04 05)"
    assert run.events[1].time == pytest.approx(0.020, abs=1e-9)


def test_a_log_cut_anywhere_is_read_as_far_as_it_goes(tmp_path: Path, whole: bytes) -> None:
    file = tmp_path / "cut.mcap"
    full = list(samples(300))
    lengths = []
    tail = len(whole) - 6000
    for end in [
        *range(8, tail, 1997),
        *range(tail, len(whole), 97),
        *range(len(whole) - 60, len(whole), 5),
        len(whole) - 1,
    ]:
        file.write_bytes(whole[:end])
        if end < whole.index(b"cycle_rate") + 200:
            continue
        run = read_mcap(file)
        assert not run.complete, end
        assert any("incomplete log" in note for note in run.warnings), end
        count = len(run.time)
        lengths.append(count)
        assert np.array_equal(run.time, [sample.time for sample in full[:count]])
        if count:
            assert np.array_equal(run.signals["output_torque"], [sample.output_torque for sample in full[:count]])
    assert lengths == sorted(lengths)
    assert lengths[-1] == 300


def test_a_cut_before_the_run_record_is_an_error_and_not_a_crash(tmp_path: Path, whole: bytes) -> None:
    file = tmp_path / "cut.mcap"
    for end in range(0, 60):
        file.write_bytes(whole[:end])
        with pytest.raises(DataError, match=r"cut\.mcap"):
            read_mcap(file)


def test_a_flipped_bit_in_a_chunk_costs_that_chunk_only_and_its_seconds_are_told(tmp_path: Path, whole: bytes) -> None:
    file = tmp_path / "bit.mcap"
    damaged = bytearray(whole)
    # the first chunk holds the schemas and the first event, the second one samples 0 to 49
    third = [match.start() for match in re.finditer(re.escape(b"\x28\xb5\x2f\xfd"), whole)][2]
    damaged[third + 500] ^= 0x10
    file.write_bytes(damaged)
    run = read_mcap(file)
    assert not run.complete
    assert len(run.time) == 250
    assert len(run.gaps) == 1
    (note,) = [note for note in run.warnings if "incomplete" in note]
    assert "0.049 s are missing" in note


def test_random_bytes_after_the_magic_never_crash_the_reader(tmp_path: Path, whole: bytes) -> None:
    file = tmp_path / "noise.mcap"
    dice = np.random.default_rng(5)
    for _ in range(150):
        noisy = bytearray(whole)
        for place in dice.integers(8, len(whole), size=4):
            noisy[place] = dice.integers(0, 256)
        file.write_bytes(noisy)
        with suppress(DataError):
            assert len(read_mcap(file).time) <= 300


@pytest.mark.parametrize("content", [b"", b"x", b"time[s]\n", b"\x89MCAP0\r\n"])
def test_a_file_that_is_no_log_is_refused(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "foreign.mcap"
    file.write_bytes(content)
    with pytest.raises(DataError, match=r"foreign\.mcap") as caught:
        read_mcap(file)
    assert caught.value.exit_code == 5


def test_a_foreign_mcap_is_refused_with_its_topics(tmp_path: Path) -> None:
    file = tmp_path / "robot.mcap"
    with file.open("wb") as handle:
        writer = Writer(handle)
        writer.start()
        schema = writer.register_schema("Pose", "jsonschema", b"{}")
        channel = writer.register_channel("/tf", "json", schema)
        writer.add_message(channel, 1, json.dumps({"x": 1}).encode(), 1)
        writer.finish()
    with pytest.raises(DataError, match=r"robot\.mcap.*/tf.*/rig/sample"):
        read_mcap(file)


def test_a_sample_topic_in_another_encoding_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "json.mcap"
    with file.open("wb") as handle:
        writer = Writer(handle)
        writer.start()
        channel = writer.register_channel("/rig/sample", "json", writer.register_schema("S", "jsonschema", b"{}"))
        writer.add_message(channel, 1, b"{}", 1)
        writer.finish()
    with pytest.raises(DataError, match="'json'"):
        read_mcap(file)


@pytest.mark.parametrize("compression", list(CompressionType))
def test_samples_of_another_writer_with_other_wire_types_read_the_same(
    tmp_path: Path, compression: CompressionType
) -> None:
    # floats and varints, in another order, some fields absent, a text field that no signal needs
    file_descriptor = descriptor_pb2.FileDescriptorProto(name="o.proto", package="other", syntax="proto3")
    message = file_descriptor.message_type.add(name="Row")
    kinds = descriptor_pb2.FieldDescriptorProto
    for number, (name, kind) in enumerate(
        [
            ("output_torque_nm", kinds.TYPE_FLOAT),
            ("cycle", kinds.TYPE_INT64),
            ("note", kinds.TYPE_STRING),
            ("motor_position_rad", kinds.TYPE_DOUBLE),
            ("late", kinds.TYPE_BOOL),
        ],
        start=3,
    ):
        message.field.add(name=name, number=number, type=kind, label=kinds.LABEL_OPTIONAL)
    schema = descriptor_pb2.FileDescriptorSet(file=[file_descriptor]).SerializeToString()
    row = message_class(schema, "other.Row")
    file = tmp_path / "other.mcap"
    with file.open("wb") as handle:
        writer = Writer(handle, compression=compression)
        writer.start()
        channel = writer.register_channel(
            "/rig/sample", "protobuf", writer.register_schema("other.Row", "protobuf", schema)
        )
        for index in range(400):
            data = row(output_torque_nm=index / 4, cycle=index, note="x" * (index % 3), motor_position_rad=1.0 + index)
            writer.add_message(channel, 1000 + index * 2_000_000, data.SerializeToString(), 0)
        writer.finish()
    run = read_mcap(file)
    assert np.array_equal(run.time, np.arange(400) / 500)
    assert np.array_equal(run.signals["motor_position"], 1.0 + np.arange(400))
    # proto3 without presence does not write a zero
    assert np.array_equal(run.signals["output_torque"][1:], np.arange(1, 400) / 4)
    assert np.array_equal(run.signals["cycle"][1:], np.arange(1, 400))


def _chunk(compression: bytes, data: bytes, uncompressed: int) -> bytes:
    body = struct.pack("<QQQI", 0, 0, uncompressed, 0) + struct.pack("<I", len(compression)) + compression
    body += struct.pack("<Q", len(data)) + data
    return b"\x89MCAP0\r\n" + struct.pack("<BQ", 6, len(body)) + body


def test_a_chunk_that_claims_too_much_memory_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "bomb.mcap"
    file.write_bytes(_chunk(b"zstd", b"\x28\xb5\x2f\xfd", 1 << 40))
    with pytest.raises(DataError, match="claims 1099511627776 bytes"):
        read_mcap(file)


def test_a_chunk_that_expands_beyond_its_stated_size_is_left_out(tmp_path: Path) -> None:
    import zstandard

    bomb = zstandard.ZstdCompressor().compress(bytes(300_000_000))
    file = tmp_path / "bomb.mcap"
    file.write_bytes(_chunk(b"zstd", bomb, 100))
    with pytest.raises(DataError, match="no log of a bench"):
        read_mcap(file)


def test_time_that_runs_backwards_is_refused_with_its_row(tmp_path: Path) -> None:
    file = tmp_path / "back.mcap"
    writer = LogWriter(file, {}, attachments={}, cycle_rate=1000.0, epoch_ns=EPOCH_NS)
    for index, time in enumerate((0.0, 0.001, 0.0005)):
        writer.write(Sample(time=time, cycle=index))
    writer.close({})
    with pytest.raises(DataError, match="row 3: time decreases"):
        read_mcap(file)


def test_equal_time_stamps_are_merged_and_counted(tmp_path: Path) -> None:
    file = tmp_path / "equal.mcap"
    writer = LogWriter(file, {}, attachments={}, cycle_rate=1000.0, epoch_ns=EPOCH_NS)
    for index, time in enumerate((0.0, 0.001, 0.001, 0.002)):
        writer.write(Sample(time=time, cycle=index, motor_torque=float(index), load_torque=5.0 if index == 1 else None))
    writer.close({})
    run = read_mcap(file)
    assert list(run.time) == [0.0, 0.001, 0.002]
    assert list(run.signals["motor_torque"]) == [0.0, 1.5, 3.0]
    assert run.signals["load_torque"][1] == 5.0
    assert list(run.signals["cycle"]) == [0, 2, 3]
    assert any("1 sample with the time stamp" in note for note in run.warnings)


def test_a_run_that_ended_before_its_first_sample_still_opens(tmp_path: Path) -> None:
    file = tmp_path / "empty.mcap"
    writer = LogWriter(file, {"procedure": "free-run"}, attachments={}, cycle_rate=1000.0, epoch_ns=EPOCH_NS)
    writer.close({"result": "aborted"})
    run = read_mcap(file)
    assert len(run.time) == 0
    assert run.metadata["outcome.result"] == "aborted"
    assert "the log holds no sample" in run.warnings


def test_the_fast_path_and_the_protobuf_library_agree(tmp_path: Path) -> None:
    fields = sample_fields({})
    row = message_class(sample_schema(fields), "rig.Sample")
    file = tmp_path / "a.mcap"
    write_log(file, 40)
    run = read_mcap(file)
    for index, sample in enumerate(samples(40)):
        names = {item.name: getattr(sample, item.signal) for item in fields}
        message = row(**{name: value for name, value in names.items() if value is not None})
        for item in fields:
            if message.HasField(item.name):
                assert run.signals[item.signal][index] == getattr(message, item.name)

"""Logs that are larger than what may be kept: means over samples, in memory that does not grow with the log."""

import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer
from numpy.typing import NDArray

from drivers.errors import DataError
from rig.log.csv_file import read_csv
from rig.log.load import load_run, load_runs
from rig.log.mcap_reader import read_mcap
from rig.log.rows import MOST_AVERAGED, USUAL_COLUMNS, Rows
from rig.log.run import Floats, averagings
from rig.log.schema import SAMPLE_TYPE, message_class, sample_fields, sample_schema
from rig.log.text_table import read_text_table, text_tables

MEGA = 2**20


def written(file: Path, columns: dict[str, Floats], samples: int) -> Path:
    """Write an MCAP log at 1 kHz with these fields, shape (samples,)."""
    schema = sample_schema(sample_fields({}))
    row = message_class(schema, SAMPLE_TYPE)
    with file.open("wb") as handle:
        writer = Writer(handle, compression=CompressionType.ZSTD)
        writer.start()
        known = writer.register_schema(SAMPLE_TYPE, "protobuf", schema)
        channel = writer.register_channel("/rig/sample", "protobuf", known)
        writer.add_metadata("run", {"procedure": "locked-output"})
        for index in range(samples):
            fields = {name: float(column[index]) for name, column in columns.items()}
            writer.add_message(channel, 10**18 + index * 10**6, row(**fields).SerializeToString(), 0)
        writer.finish()
    return file


def means_of(values: Floats, over: int) -> Floats:
    """Give the means by a plain loop, as a second way to compute them."""
    return np.array([np.mean(values[start : start + over]) for start in range(0, len(values), over)])


def noise(count: int, seed: int) -> Floats:
    return np.random.default_rng(seed).normal(size=count)


def test_rows_are_kept_as_they_came_where_they_fit(tmp_path: Path) -> None:
    rows = Rows(tmp_path, 5_000)
    time = np.arange(3000) * 1e-3
    for part in np.array_split(np.arange(3000), 7):
        rows.add(time[part], {"motor_torque": time[part] ** 2})
    kept, columns = rows.finish()
    assert rows.averaged == 1
    assert np.array_equal(kept, time)
    assert np.array_equal(columns["motor_torque"], time**2)


@pytest.mark.parametrize("pieces", [1, 3, 50])
def test_rows_beyond_the_limit_become_means_of_a_power_of_two(tmp_path: Path, pieces: int) -> None:
    count = 10 * MOST_AVERAGED + 123
    time, torque = np.arange(count) * 1e-3, noise(count, 1)
    rows = Rows(tmp_path, 6_000)
    for part in np.array_split(np.arange(count), pieces):
        rows.add(time[part], {"motor_torque": torque[part]})
    kept, columns = rows.finish()
    assert rows.averaged == 8
    assert rows.count == count
    assert kept == pytest.approx(means_of(time, 8), rel=1e-12)
    assert columns["motor_torque"] == pytest.approx(means_of(torque, 8), abs=1e-12)


def test_times_in_whole_nanoseconds_stay_so(tmp_path: Path) -> None:
    time = 10**18 + np.arange(2 * MOST_AVERAGED, dtype=np.int64) * 10**6
    rows = Rows(tmp_path, MOST_AVERAGED)
    rows.add(time, {"motor_torque": np.ones(len(time))})
    kept, _ = rows.finish()
    assert kept.dtype == np.int64
    assert list(kept[:2] - 10**18) == [500_000, 2_500_000]


def test_a_missing_value_is_left_out_of_its_mean_and_a_status_word_is_never_averaged(tmp_path: Path) -> None:
    count = 2 * MOST_AVERAGED
    torque: Floats = np.tile([1.0, np.nan, np.nan, np.nan], count // 4)
    rows = Rows(tmp_path, MOST_AVERAGED)
    rows.add(np.arange(count) * 1e-3, {"motor_torque": torque, "status_word": np.tile([7.0, 39.0], count // 2)})
    _, columns = rows.finish()
    assert rows.averaged == 2
    assert np.array_equal(columns["motor_torque"], np.tile([1.0, np.nan], count // 4), equal_nan=True)
    assert set(columns["status_word"]) == {39.0}


def test_rows_of_very_many_columns_count_in_proportion(tmp_path: Path) -> None:
    count = 2 * MOST_AVERAGED
    rows = Rows(tmp_path, count)
    rows.add(np.arange(count) * 1e-3, {f"c{k}": np.zeros(count) for k in range(4 * USUAL_COLUMNS)})
    assert rows.averaged == 4


def test_a_signal_that_comes_late_is_missing_before(tmp_path: Path) -> None:
    rows = Rows(tmp_path)
    rows.add(np.arange(2.0), {"motor_torque": np.ones(2)})
    rows.add(np.arange(2.0, 4.0), {"motor_torque": np.ones(2), "temperature": np.array([20.0, 21.0])})
    _, columns = rows.finish()
    assert np.array_equal(columns["temperature"], [np.nan, np.nan, 20.0, 21.0], equal_nan=True)


def test_time_that_decreases_inside_a_mean_is_refused_with_its_row(tmp_path: Path) -> None:
    rows = Rows(tmp_path / "a.mcap", MOST_AVERAGED)
    time = np.arange(2 * MOST_AVERAGED) * 1e-3
    rows.add(time, {"motor_torque": time})
    later = time + time[-1] + 1e-3
    later[5] = later[3]
    with pytest.raises(DataError, match=f"row {2 * MOST_AVERAGED + 6}: time decreases"):
        rows.add(later, {"motor_torque": time})


def test_a_log_in_mcap_and_the_same_in_csv_give_the_same_means(tmp_path: Path) -> None:
    count = 5 * MOST_AVERAGED + 17
    torque = np.round(noise(count, 2), 6)
    whole = read_mcap(written(tmp_path / "a.mcap", {"output_torque_nm": torque}, count))
    rows = "".join(f"{k / 1000:.3f},{value!r}\n" for k, value in enumerate(torque.tolist()))
    (tmp_path / "b.csv").write_text("time[s],output_torque[N*m]\n" + rows)
    runs = [load_run(tmp_path / name, 5_000) for name in ("a.mcap", "b.csv")]
    assert [run.averaged for run in runs] == [8, 8]
    expected = means_of(whole.signals["output_torque"], 8)
    for run in runs:
        assert run.signals["output_torque"] == pytest.approx(expected, abs=1e-9)
        assert np.diff(run.time)[:-1] == pytest.approx(0.008, abs=1e-9)
    (note,) = averagings(runs[:1])
    assert "every 8 samples" in note
    assert averagings([whole]) == ()


def test_the_largest_runs_of_a_campaign_are_averaged_until_all_fit(tmp_path: Path) -> None:
    for name, count in (("a", 4000), ("b", 1000), ("c", 1000)):
        written(tmp_path / f"{name}.mcap", {"output_torque_nm": noise(count, 3)}, count)
    found = {run.name: (run.averaged, len(run.time)) for run in load_runs([tmp_path], 4000)}
    assert found == {"a": (2, 2000), "b": (1, 1000), "c": (1, 1000)}
    assert sum(run.averaged for run in load_runs([tmp_path])) == 3


def peak(file: Path, most_samples: int | None) -> int:
    """Give the most bytes that reading the file holds at once."""
    tracemalloc.start()
    try:
        load_run(file, most_samples)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_memory_does_not_grow_with_a_log_that_is_streamed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rig.log.wire.BATCH_BYTES", MEGA)
    torque = {"output_torque_nm": noise(400_000, 4)}
    short, long = (written(tmp_path / f"{n}.mcap", torque, n) for n in (100_000, 400_000))
    assert peak(long, 10_000) < 1.2 * peak(short, 10_000)
    assert peak(long, None) > 2.0 * peak(long, 10_000)


def test_a_table_in_parts_is_the_table(tmp_path: Path) -> None:
    file = tmp_path / "a.csv"
    values: NDArray[np.float64] = noise(3000, 6).reshape(1000, 3)
    lines = [",".join(map(repr, row)) for row in values.tolist()]
    lines[500] = '"0.5",NA,1'
    file.write_text("\ufefftime[s],b[],c[]\r\n" + "\r\n".join([*lines[:700], "", *lines[700:]]), encoding="utf-8")
    whole = read_text_table(file)
    parts = list(text_tables(file, block_bytes=700))
    assert len(parts) > 20
    assert all(part.names == whole.names for part in parts)
    assert np.array_equal(np.concatenate([part.values for part in parts]), whole.values, equal_nan=True)
    places = [part.row_of(k) for part in parts for k in range(len(part.values))]
    assert places == [whole.row_of(k) for k in range(1000)]
    assert places[0] == 2
    assert places[-1] == 1002


def test_a_part_never_ends_inside_a_quoted_cell(tmp_path: Path) -> None:
    file = tmp_path / "a.csv"
    file.write_text("time[s],note\n" + "".join(f'{k},"two\nlines"\n' for k in range(40)))
    parts = list(text_tables(file, lambda name: name != "note", 50))
    assert len(parts) > 5
    assert [value for part in parts for value in part.values[:, 0]] == list(range(40))


def test_a_wrong_cell_far_down_is_named_by_its_row(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rig.log.text_table.text_tables.__defaults__", (lambda name: True, 500))
    file = tmp_path / "a.csv"
    file.write_text("time[s],motor_torque[N*m]\n" + "".join(f"{k},{'x' if k == 777 else k}\n" for k in range(1000)))
    with pytest.raises(DataError, match="row 779: 'x' is not a number"):
        read_csv(file, 500)

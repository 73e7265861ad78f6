"""Contract CSV in: units, sidecar, and one clear error with file, column and row for whatever is wrong."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.errors import ConfigError, DataError
from drivers.signals import SIGNALS
from rig.log.csv_file import read_csv, write_csv
from rig.log.run import ProcedureName, Run
from rig.log.timeline import make_run
from rig.log.units import ALIASES, UNITS, find_unit, to_si

finite = st.floats(allow_nan=False, allow_infinity=False)


def write(folder: Path, text: str | bytes, sidecar: str | None = None) -> Path:
    file = folder / "x.csv"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    if sidecar is not None:
        (folder / "x.toml").write_text(sidecar)
    return file


def test_contract_columns_become_si_and_others_stay_as_written(tmp_path: Path) -> None:
    file = write(
        tmp_path,
        "time[ms],motor_position[deg],output_torque[mN*m],motor_velocity[rpm],temperature[K],status_word,oil film[um]\n"
        "10,180,1500,60,300,39,4.5\n"
        "12.5,90,-500,30,301,40,4.25\n",
    )
    run = read_csv(file)
    # relative to the first sample: a difference of two rounded numbers
    assert run.time == pytest.approx([0.0, 0.0025], abs=1e-17)
    assert run.signals["motor_position"] == pytest.approx([math.pi, math.pi / 2], rel=1e-15)
    assert list(run.signals["output_torque"]) == [1.5, -0.5]
    assert run.signals["motor_velocity"] == pytest.approx([2 * math.pi, math.pi], rel=1e-15)
    assert run.signals["temperature"] == pytest.approx([26.85, 27.85], abs=1e-9)
    assert list(run.signals["status_word"]) == [39, 40]
    assert list(run.auxiliary["oil_film"]) == [4.5, 4.25]
    assert run.auxiliary_units["oil_film"] == "um"


def test_the_sidecar_gives_procedure_replicate_start_angle_and_metadata(tmp_path: Path) -> None:
    file = write(
        tmp_path,
        "time[s],motor_torque[Nm]\n0,1\n1,2\n",
        'procedure = "backdrive"\nreplicate = "A"\nstart_angle = 1\noperator = "Ada"\nday = 2026-01-31\nn = 3\n',
    )
    run = read_csv(file)
    assert run.procedure is ProcedureName.BACKDRIVE
    assert (run.replicate, run.start_angle) == ("A", 1.0)
    assert run.metadata["operator"] == "Ada"
    assert run.metadata["day"] == "2026-01-31"
    assert run.metadata["n"] == "3"


def test_without_a_sidecar_the_procedure_is_other_and_that_is_said(tmp_path: Path) -> None:
    run = read_csv(write(tmp_path, "time[s],motor_torque[N*m]\n0,1\n1,2\n"))
    assert run.procedure is ProcedureName.OTHER
    assert any("no procedure" in note for note in run.warnings)


def test_a_column_of_words_is_said_to_be_none_and_what_to_do_with_it(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="column 'state', row 2: 'running' is not a number") as caught:
        read_csv(write(tmp_path, "time[s],motor_torque[N*m],state\n0,1,running\n"))
    assert "a mapping that does not name it" in str(caught.value)


def test_every_mistake_of_a_sidecar_is_reported_at_once(tmp_path: Path) -> None:
    file = write(
        tmp_path,
        "time[s],motor_torque[N*m]\n0,1\n",
        'procedure = "baking"\nstart_angle = "north"\nreplicate = 3\n',
    )
    with pytest.raises(ConfigError) as caught:
        read_csv(file)
    assert {mistake.path for mistake in caught.value.mistakes} == {"procedure", "start_angle", "replicate"}
    assert caught.value.exit_code == 2


def test_a_misspelt_key_or_column_is_pointed_out(tmp_path: Path) -> None:
    file = write(tmp_path, "time[s],motor_torqe[N*m]\n0,1\n1,2\n", 'procedur = "backdrive"\n')
    notes = " ".join(read_csv(file).warnings)
    assert "'motor_torque' was meant" in notes
    assert "'procedure' was meant" in notes


@pytest.mark.parametrize(
    ("text", "column", "row", "words"),
    [
        ("time[s],motor_torque[N*m]\n0,1\n1,nan\n", "motor_torque[N*m]", 3, "not a finite number"),
        ("time[s],motor_torque[N*m]\n0,1\n1,\n", "motor_torque[N*m]", 3, "empty"),
        ("time[s],motor_torque[N*m]\n0,-inf\n", "motor_torque[N*m]", 2, "not a finite number"),
        ("time[s],motor_torque[N*m]\n0,1e999\n", "motor_torque[N*m]", 2, "not a finite number"),
        ("time[s],motor_torque[N*m]\n0,1\n1,two\n", "motor_torque[N*m]", 3, "'two' is not a number"),
        ("time[s],motor_torque[N*m]\n0,1_0\n", "motor_torque[N*m]", 2, "'1_0' is not a number"),
        ("time[s];motor_torque[N*m]\n0;1,5\n", "motor_torque[N*m]", 2, "'1,5' is not a number"),
        ("time[s],motor_torque[N*m]\n0,1\n1\n", None, 3, "1 fields"),
        ("time[s],motor_torque[N*m]\n0,1,2\n", None, 2, "3 fields"),
        ("time[s],motor_torque[N*m]\n0,1\n\n2,1\n1,1\n", "time", 5, "decreases from 2 s to 1 s"),
        ("time[s],motor_torque[N*m]\nNA,1\n", "time[s]", 2, "time is NA"),
        ("t,motor_torque[N*m]\n0,1\n", "time", None, "no time column"),
        ("time[s],motor_torque[furlong]\n0,1\n", "motor_torque", 1, "'furlong' is not known"),
        ("time[s],motor_torque[rad]\n0,1\n", "motor_torque", 1, "does not fit"),
        ("time[s],motor_torque\n0,1\n", "motor_torque", 1, "has no unit"),
        ("time,motor_torque[N*m]\n0,1\n", "time", 1, "has no unit"),
        ("time[s],motor_torque[N*m],motor_torque[mN*m]\n0,1,1\n", "motor_torque[mN*m]", 1, "twice"),
        ("time[s],a,a\n0,1,1\n", "a", 1, "twice"),
        ("time[s],motor_torque[N*m]\n", None, 2, "no sample"),
        ("time[s],motor_torque[N*m]", None, 2, "no sample"),
        ("", None, None, "empty"),
        (" \n \n", None, None, "empty"),
        (",\n1,2\n", None, 1, "no header"),
        (b"time[s],motor_torque[N*m]\n0,1\n1,\xff\n", None, 3, "no UTF-8"),
        (b"\x00\x01\x02\x03\n1\n", "time", None, "no time column"),
        ("time[s],a\n0,1\n" + "9" * 200_000 + "\n", None, 3, "200000 bytes"),
        ('time[s],a\n0,"1\n', None, 2, "no CSV"),
    ],
)
def test_what_is_wrong_is_named_with_file_column_and_row(
    tmp_path: Path, text: str | bytes, column: str | None, row: int | None, words: str
) -> None:
    with pytest.raises(DataError) as caught:
        read_csv(write(tmp_path, text))
    assert words in str(caught.value)
    assert "x.csv" in str(caught.value)
    assert (caught.value.column, caught.value.row) == (column, row)
    assert caught.value.exit_code == 5


def test_a_folder_or_a_missing_file_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="cannot be read"):
        read_csv(tmp_path / "absent.csv")
    with pytest.raises(DataError, match="cannot be read"):
        read_csv(tmp_path)


def test_equal_time_stamps_are_merged_by_mean_and_counted(tmp_path: Path) -> None:
    run = read_csv(write(tmp_path, "time[s],motor_torque[N*m]\n0,1\n1,2\n1,4\n1,6\n2,0\n"))
    assert list(run.time) == [0, 1, 2]
    assert list(run.signals["motor_torque"]) == [1, 4, 0]
    assert any(note.startswith("2 samples with the time stamp") for note in run.warnings)


def test_a_constant_channel_is_kept_with_a_warning(tmp_path: Path) -> None:
    run = read_csv(write(tmp_path, "time[s],motor_torque[N*m],bus_voltage[V]\n0,1,48\n1,2,48\n"))
    assert list(run.signals["bus_voltage"]) == [48, 48]
    assert any("constant over the whole log: bus_voltage" in note for note in run.warnings)


def test_a_gap_is_marked_where_more_than_five_periods_are_missing(tmp_path: Path) -> None:
    times = [0, 1, 2, 3, 9, 10, 11, 18, 19]  # 5 samples missing after 3, 6 after 11
    text = "time[ms],motor_torque[N*m]\n" + "".join(f"{time},{index}\n" for index, time in enumerate(times))
    assert read_csv(write(tmp_path, text)).gaps == (0.011,)


def test_a_byte_order_mark_and_windows_line_ends_are_taken(tmp_path: Path) -> None:
    run = read_csv(write(tmp_path, b"\xef\xbb\xbftime[s],motor_torque[N*m]\r\n0,1\r\n1,2\r\n"))
    assert list(run.signals["motor_torque"]) == [1, 2]


def test_a_cell_na_is_a_missing_sample(tmp_path: Path) -> None:
    run = read_csv(write(tmp_path, "time[s],motor_torque[N*m]\n0,1\n1,NA\n2,3\n"))
    assert np.array_equal(run.signals["motor_torque"], [1, np.nan, 3], equal_nan=True)
    assert any("missing in 1 of 3" in note for note in run.warnings)


@pytest.mark.parametrize("spelling", sorted([*UNITS, *ALIASES, "µs", "μs", "µrad"]))
def test_every_spelling_leads_to_a_unit_of_the_signal_table_or_of_time(spelling: str) -> None:
    unit = find_unit(spelling)
    assert unit is not None
    assert unit.si in {signal.unit for signal in SIGNALS} | {"s"}


@pytest.mark.parametrize(
    ("value", "unit", "expected"),
    [
        (1.0, "rev", 6.283185307179586),
        (1.0, "rpm", 0.10471975511965977),
        (3600.0, "arcsec", 0.017453292519943295),
        (2.5, "kN*m", 2500.0),
        (1.0, "ms", 0.001),
        (3.0, "us", 3e-6),
        (212.0, "degF", 100.0),
        (0.0, "K", -273.15),
        (50.0, "%", 0.5),
        (7.0, "N*cm", 0.07),
    ],
)
def test_units_convert_by_their_definition(value: float, unit: str, expected: float) -> None:
    found = find_unit(unit)
    assert found is not None
    assert to_si(np.array([value]), found)[0] == pytest.approx(expected, rel=1e-15)


@settings(max_examples=60, deadline=None)
@given(
    rows=st.lists(st.tuples(finite, finite, st.one_of(finite, st.just(math.nan))), min_size=1, max_size=20),
    start=st.floats(0, 1e6),
    texts=st.dictionaries(st.text(max_size=8), st.text(max_size=12), max_size=4),
)
def test_any_run_survives_csv_to_the_bit(
    tmp_path_factory: pytest.TempPathFactory,
    rows: list[tuple[float, float, float]],
    start: float,
    texts: dict[str, str],
) -> None:
    folder = tmp_path_factory.mktemp("csv")
    table = np.array(rows)
    facts = {key: value for key, value in texts.items() if key not in ("procedure", "replicate", "start_angle")}
    run = make_run(
        folder / "made.csv",
        np.arange(len(rows)) / 7.0 + start,
        {"motor_torque": table[:, 0], "output_torque": table[:, 1]},
        {"extra": table[:, 2]},
        {"extra": "m/s^2"},
        facts | {"procedure": "free-run", "replicate": "G", "start_angle": "0.1"},
    )
    write_csv(run, folder / "made.csv")
    again = read_csv(folder / "made.csv")
    assert_same(run, again)
    assert {key: again.metadata[key] for key in facts} == facts


def assert_same(run: Run, again: Run) -> None:
    assert np.array_equal(again.time, run.time)
    for name, column in run.signals.items():
        assert np.array_equal(again.signals[name], column, equal_nan=True)
        # the sign of a zero is part of the value
        assert np.array_equal(np.signbit(again.signals[name]), np.signbit(column))
    for name, column in run.auxiliary.items():
        assert np.array_equal(again.auxiliary[name], column, equal_nan=True)
        assert again.auxiliary_units[name] == run.auxiliary_units[name]
    assert (again.procedure, again.replicate, again.start_angle) == (run.procedure, run.replicate, run.start_angle)


@settings(max_examples=200, deadline=None)
@given(text=st.one_of(st.binary(max_size=80), st.text(alphabet='time[s],-0.e1\n\r"NA; ', max_size=60).map(str.encode)))
def test_any_bytes_give_a_run_or_a_data_error(tmp_path_factory: pytest.TempPathFactory, text: bytes) -> None:
    file = write(tmp_path_factory.mktemp("csv"), b"time[s],motor_torque[N*m]\n0,1\n" + text)
    try:
        run = read_csv(file)
    except DataError:
        return
    assert len(run.time) >= 1
    assert np.all(np.diff(run.time) > 0)


@pytest.mark.parametrize("cell", ["1e30", "-1", "1.0000001", "4294967296"])
def test_a_status_word_that_is_no_whole_number_of_its_size_is_refused_by_its_row(tmp_path: Path, cell: str) -> None:
    with pytest.raises(DataError, match="no whole number from 0 to 4294967295") as caught:
        read_csv(write(tmp_path, f"time[s],motor_torque[N*m],status_word\n0,1,7\n1,1,NA\n2,1,{cell}\n"))
    assert (caught.value.column, caught.value.row) == ("status_word", 4)


def test_a_recording_of_a_century_has_its_time_in_the_wrong_unit(tmp_path: Path) -> None:
    for last in ("4e9", "1e300"):
        with pytest.raises(DataError, match="unit of time") as caught:
            read_csv(write(tmp_path, f"time[s],motor_torque[N*m]\n0,1\n1,1\n{last},1\n"))
        assert caught.value.row == 4
    with pytest.raises(DataError, match="unit of time"):
        read_csv(write(tmp_path, "time[s],motor_torque[N*m]\n-1e308,1\n1e308,1\n"))


@pytest.mark.parametrize("stamps", [["5"] * 4, ["0"] * 500 + ["1"] * 500])
def test_a_time_that_nearly_always_stands_still_is_refused(tmp_path: Path, stamps: list[str]) -> None:
    rows = "".join(f"{stamp},1\n" for stamp in stamps)
    with pytest.raises(DataError, match=rf"the {len(stamps)} samples have only {len(set(stamps))} different") as caught:
        read_csv(write(tmp_path, f"time[s],motor_torque[N*m]\n{rows}"))
    assert caught.value.column == "time"


def test_a_value_that_is_too_large_in_si_is_refused_by_its_row(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="too large in SI") as caught:
        read_csv(write(tmp_path, "time[s],motor_torque[kN*m]\n0,1\n1,1e308\n"))
    assert (caught.value.column, caught.value.row) == ("motor_torque", 3)

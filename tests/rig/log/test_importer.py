"""Foreign logs in: mapping, formats, splits, and errors that name file, column and row."""

import errno
import tomllib
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from drivers.errors import ConfigError, DataError
from rig.log.importer import import_files
from rig.log.load import load_runs
from rig.log.mcap_file import McapFile
from rig.log.run import ProcedureName, Run

MAP = """
[signals.time]
column = "t"
unit = "ms"
[signals.output_torque]
column = "tau"
unit = "mN*m"
scale = 2.0
offset = 1.0
sign = -1
[run]
procedure = "free-run"
start_angle = 1
day = 2026-01-31
"""


def write(folder: Path, name: str, text: str) -> Path:
    (folder / name).write_text(text)
    return folder / name


def bring_in(folder: Path, table: str, rules: str, name: str = "x.csv") -> tuple[Run, ...]:
    import_files([write(folder, name, table)], write(folder, "map.toml", rules), folder / "out")
    return load_runs([folder / "out"])


def test_a_value_is_sign_times_scale_times_raw_plus_offset_in_its_unit(tmp_path: Path) -> None:
    (run,) = bring_in(tmp_path, "t,tau\n0,10\n5,20\n", MAP)
    assert run.time == pytest.approx([0, 0.005])
    assert run.signals["output_torque"] == pytest.approx([-0.021, -0.041], rel=1e-15)
    assert run.procedure is ProcedureName.FREE_RUN
    assert run.start_angle == 1.0
    assert run.metadata["day"] == "2026-01-31"
    assert run.metadata["backend"] == "import"
    assert run.metadata["source"] == "x.csv"


def test_an_import_has_no_control_cycle(tmp_path: Path) -> None:
    (run,) = bring_in(tmp_path, "t,tau\n0,10\n5,20\n", MAP)
    assert set(run.signals) == {"output_torque"}


@settings(max_examples=40, deadline=None)
@given(
    raw=st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=8),
    scale=st.floats(-1e3, 1e3).filter(lambda value: value != 0.0),
    offset=st.floats(-1e3, 1e3),
    sign=st.sampled_from([1, -1]),
)
def test_any_mapping_follows_the_formula(
    tmp_path_factory: pytest.TempPathFactory, raw: list[float], scale: float, offset: float, sign: int
) -> None:
    folder = tmp_path_factory.mktemp("map")
    rules = (
        '[signals.time]\ncolumn = "t"\n[signals.motor_current]\ncolumn = "i"\nunit = "mA"\n'
        f"scale = {scale!r}\noffset = {offset!r}\nsign = {sign}\n"
    )
    table = "t,i\n" + "".join(f"{index},{value!r}\n" for index, value in enumerate(raw))
    (run,) = bring_in(folder, table, rules)
    expected = [sign * (scale * value + offset) / 1000 for value in raw]
    # two roundings against three: a few units in the last place of the larger term
    bound = 1e-15 * (1e6 * abs(scale) + abs(offset))
    assert np.max(np.abs(run.signals["motor_current"] - expected)) <= bound


def test_columns_with_contract_names_need_no_mapping(tmp_path: Path) -> None:
    file = write(tmp_path, "y.csv", "time[ms],motor_position[deg],extra[bar],remark\n0,0,1,a\n1,180,2,b\n")
    (path,) = import_files([file], None, tmp_path / "out")
    (run,) = load_runs([path])
    assert run.signals["motor_position"] == pytest.approx([0, np.pi])
    assert list(run.auxiliary["extra"]) == [1, 2]
    assert run.auxiliary_units["extra"] == "bar"
    assert any("'remark' left out" in note for note in run.warnings)


def test_the_unit_in_a_columns_name_counts_where_the_mapping_gives_none(tmp_path: Path) -> None:
    rules = '[signals.time]\ncolumn = "t [ms]"\n[signals.output_torque]\ncolumn = "tau [mNm]"\n'
    (run,) = bring_in(tmp_path, "t [ms],tau [mNm]\n0,1000\n1,2000\n", rules)
    assert list(run.signals["output_torque"]) == [1.0, 2.0]
    assert run.time[-1] == 0.001


def test_an_auxiliary_signal_can_be_named_and_a_column_ignored(tmp_path: Path) -> None:
    rules = MAP.replace("[run]", '[signals.aux_pressure]\ncolumn = "p"\nunit = "bar"\nscale = 10\n[run]')
    (run,) = bring_in(tmp_path, "t,tau,p,q\n0,1,2,3\n1,2,3,4\n", 'ignore = ["q"]\n' + rules)
    assert list(run.auxiliary["pressure"]) == [20, 30]
    assert run.auxiliary_units == {"pressure": "bar"}


@pytest.mark.parametrize(
    ("table", "column", "row", "words"),
    [
        ("t,tau\n0,1\n1,nan\n", "tau", 3, "not a finite number"),
        ("t,tau\n0,1\n1,\n", "tau", 3, "empty"),
        ("t,tau\n0,1\n1,x\n", "tau", 3, "'x' is not a number"),
        ("t,tau\n0,1\n2,1\n1,1\n", "time", 4, "decreases"),
        ("t,torque\n0,1\n", "tau", 1, "not in the file"),
        ("t,tau,tau\n0,1,1\n", "tau", 1, "twice"),
        ("t,tau\n0,1,2\n", None, 2, "3 fields"),
        ("", None, None, "empty"),
    ],
)
def test_what_is_wrong_in_the_data_is_named_and_nothing_is_written(
    tmp_path: Path, table: str, column: str | None, row: int | None, words: str
) -> None:
    with pytest.raises(DataError) as caught:
        bring_in(tmp_path, table, MAP)
    assert words in str(caught.value)
    assert (caught.value.column, caught.value.row) == (column, row)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("cell", ["nan", "", "inf", "1e999", "x"])
def test_a_column_with_a_contract_name_is_as_strict_as_a_mapped_one(tmp_path: Path, cell: str) -> None:
    file = write(tmp_path, "x.csv", f"time[s],motor_position[rad],remark\n0,1,a\n1,{cell},b\n")
    with pytest.raises(DataError) as caught:
        import_files([file], None, tmp_path / "out")
    assert (caught.value.file, caught.value.column, caught.value.row) == (str(file), "motor_position[rad]", 3)
    assert not (tmp_path / "out").exists()


def test_only_the_cell_that_says_so_is_a_missing_sample(tmp_path: Path) -> None:
    file = write(tmp_path, "x.csv", "time[s],motor_position[rad]\n0,1\n1,NA\n")
    (run,) = load_runs(import_files([file], None, tmp_path / "out"))
    assert list(np.isnan(run.signals["motor_position"])) == [False, True]


def test_a_contract_column_that_is_mapped_elsewhere_or_ignored_may_hold_anything(tmp_path: Path) -> None:
    rules = 'ignore = ["motor_torque[N*m]"]\n[signals.motor_position]\ncolumn = "p"\nunit = "rad"\n'
    table = "time[s],p,motor_position[rad],motor_torque[N*m]\n0,1,nan,nan\n1,2,nan,nan\n"
    (run,) = bring_in(tmp_path, table, rules)
    assert set(run.signals) == {"motor_position"}
    assert any("'motor_position[rad]' left out: 2 of 2" in note for note in run.warnings)


def test_a_contract_dataset_of_a_binary_file_is_strict_too(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "b.h5", "w") as file:
        file["time[s]"], file["motor_position[rad]"] = np.arange(3.0), np.array([0.0, np.nan, 1.0])
    with pytest.raises(DataError, match="not a finite number") as caught:
        import_files([tmp_path / "b.h5"], None, tmp_path / "out")
    assert (caught.value.column, caught.value.row) == ("motor_position[rad]", 2)


def test_a_contract_column_that_is_there_twice_is_refused(tmp_path: Path) -> None:
    file = write(tmp_path, "x.csv", "time[s],motor_position[rad],motor_position[rad]\n0,1,2\n")
    with pytest.raises(DataError, match="twice"):
        import_files([file], None, tmp_path / "out")


def test_one_bad_file_of_several_keeps_all_from_being_written(tmp_path: Path) -> None:
    good, bad = write(tmp_path, "a.csv", "t,tau\n0,1\n"), write(tmp_path, "b.csv", "t,tau\n0,nan\n")
    with pytest.raises(DataError, match=r"b\.csv"):
        import_files([good, bad], write(tmp_path, "map.toml", MAP), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_every_mistake_of_a_mapping_is_reported_at_once(tmp_path: Path) -> None:
    rules = (
        '[signals.output_torque]\ncolum = "a"\n[signals.motor_current]\ncolumn = "b"\nsign = 2\nscale = "x"\n'
        '[run]\nprocedure = "dance"\n[run.split]\nby = "time"\n'
    )
    with pytest.raises(ConfigError) as caught:
        bring_in(tmp_path, "a,b\n0,1\n", rules)
    paths = {mistake.path for mistake in caught.value.mistakes}
    assert paths == {
        "signals.output_torque.column",
        "signals.output_torque.colum",
        "signals.motor_current.sign",
        "signals.motor_current.scale",
        "run.procedure",
        "run.split",
    }


def test_rules_between_values_are_checked_where_a_value_is_wrong(tmp_path: Path) -> None:
    rules = (
        '[signals.output_torque]\ncolumn = 3\nunit = "parsec"\nscale = 0\n[signals.motor_curent]\ncolumn = "b"\n'
        '[run]\noperator = [1]\n[run.split]\nby = "tme"\n'
    )
    with pytest.raises(ConfigError) as caught:
        bring_in(tmp_path, "a,b\n0,1\n", rules)
    assert sorted(mistake.path for mistake in caught.value.mistakes) == [
        "run.operator",
        "run.split",
        "run.split.by",
        "signals.motor_curent",
        "signals.output_torque.column",
        "signals.output_torque.scale",
        "signals.output_torque.unit",
    ]


@pytest.mark.parametrize(
    ("rules", "words"),
    [
        ('[signals.output_torqe]\ncolumn = "a"\n', "did you mean output_torque"),
        ('[signals.output_torque]\ncolumn = "a"\nunit = "parsec"\n', "should be one of N"),
        ('[signals.output_torque]\ncolumn = "a"\nunit = "A"\n', "should be one of N"),
        ('[signals.output_torque]\ncolumn = "a"\nscale = 0\n', "erase"),
        ('[signals.output_torque]\ncolumn = "a"\noffset = inf\n', "finite"),
        ('[signals.time]\ncolumn = "a"\n[signals.output_torque]\ncolumn = "a"\n', "is taken for time already"),
        ('[signals.motor_torque]\ncolumn = "a"\n[signals.aux_iq]\ncolumn = "a"\n', "taken for motor_torque already"),
        ('[run.split]\nby = "motor_positon"\nblocks = 3\n', "did you mean motor_position"),
        ("[run.split]\nblocks = 3\nperiod = 2\n", "either blocks or period"),
        ("[run.split]\nblocks = 1\n", "greater than or equal to 2"),
        ("[run.split]\nperiod = 0\n", "greater than 0"),
        ("[signals\n", "TOML"),
    ],
)
def test_a_wrong_mapping_is_a_configuration_error(tmp_path: Path, rules: str, words: str) -> None:
    with pytest.raises(ConfigError, match=r"map\.toml") as caught:
        bring_in(tmp_path, "a,b\n0,1\n", rules)
    assert words in str(caught.value)
    assert caught.value.exit_code == 2


def test_a_split_by_time_cuts_equal_blocks_and_says_what_they_are(tmp_path: Path) -> None:
    table = "t,tau\n" + "".join(f"{index},{index}\n" for index in range(10))
    runs = bring_in(tmp_path, table, MAP + '[run.split]\nby = "time"\nblocks = 3\n')
    assert [run.name for run in runs] == ["x-01", "x-02", "x-03"]
    assert [len(run.time) for run in runs] == [3, 3, 4]
    assert runs[1].metadata["split"] == "2 of 3 by time"
    assert runs[1].metadata["recording"] == "x"
    assert runs[1].time[0] == 0.0
    raw = np.concatenate([run.signals["output_torque"] for run in runs])
    assert raw == pytest.approx([-(2 * index + 1) / 1000 for index in range(10)])


def test_a_split_by_a_signal_collects_every_pass_over_each_part(tmp_path: Path) -> None:
    angles = [0, 1, 2, 3, 3, 2, 1, 0]
    table = "time[s],motor_position[rad]\n" + "".join(f"{time},{angle}\n" for time, angle in enumerate(angles))
    runs = bring_in(tmp_path, table, '[run.split]\nby = "motor_position"\nblocks = 2\n')
    assert [list(run.signals["motor_position"]) for run in runs] == [[0, 1, 1, 0], [2, 3, 3, 2]]
    assert list(runs[0].time) == [0, 1, 6, 7]


def test_a_split_by_period_gives_a_run_per_turn(tmp_path: Path) -> None:
    table = "time[s],motor_position[rev]\n" + "".join(f"{time},{time / 4}\n" for time in range(12))
    runs = bring_in(tmp_path, table, f'[run.split]\nby = "motor_position"\nperiod = {2 * np.pi!r}\n')
    assert [len(run.time) for run in runs] == [4, 4, 4]


@pytest.mark.parametrize("period", [1e-9, 1e-3])
def test_a_split_into_too_many_runs_is_refused(tmp_path: Path, period: float) -> None:
    table = "time[s],motor_position[rad]\n0,0\n1,5\n"
    with pytest.raises(DataError, match="between 2 and 1000 blocks"):
        bring_in(tmp_path, table, f'[run.split]\nby = "motor_position"\nperiod = {period}\n')


def test_a_split_by_a_constant_or_absent_signal_is_refused(tmp_path: Path) -> None:
    table = "time[s],motor_position[rad]\n0,2\n1,2\n"
    with pytest.raises(DataError, match="do not cut"):
        bring_in(tmp_path, table, '[run.split]\nby = "motor_position"\nblocks = 2\n')
    with pytest.raises(DataError, match="lacks"):
        bring_in(tmp_path, table, '[run.split]\nby = "motor_current"\nblocks = 2\n')


def test_what_the_import_noticed_is_told_by_the_log(tmp_path: Path) -> None:
    (run,) = bring_in(tmp_path, "t,tau\n0,1\n0,3\n1,2\n", MAP)
    assert list(run.signals["output_torque"]) == pytest.approx([-0.005, -0.005])
    assert any("at import" in note and "1 sample with the time stamp" in note for note in run.warnings)


def test_names_from_files_stay_inside_the_chosen_folder(tmp_path: Path) -> None:
    table = "time[s],motor_torque[N*m],../../evil<script>[x]\n0,1,2\n1,2,3\n"
    file = write(tmp_path, "..;rm -rf & x.csv", table)
    (path,) = import_files([file], None, tmp_path / "out")
    assert path.parent == tmp_path / "out"
    assert path.name == "rm_-rf_x.mcap"
    (run,) = load_runs([path])
    assert list(run.auxiliary) == ["evil_script"]


def test_a_recording_of_a_century_has_its_time_in_the_wrong_unit(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="unit of time"):
        bring_in(tmp_path, "time[s],motor_torque[N*m]\n0,1\n4e9,1\n", "")


def test_an_offset_that_swallows_the_time_is_refused(tmp_path: Path) -> None:
    table = "t,tau\n" + "".join(f"{index},1\n" for index in range(50))
    with pytest.raises(DataError, match="50 samples have only 1 different"):
        bring_in(tmp_path, table, MAP.replace('unit = "ms"', 'unit = "s"\noffset = 1e18'))
    with pytest.raises(DataError, match="50 samples have only 1 different"):
        bring_in(tmp_path, table, MAP.replace('unit = "ms"', 'unit = "ns"\nscale = 0.001'))
    assert not (tmp_path / "out").exists()


def test_a_scale_beyond_all_numbers_is_refused_by_its_row(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="too large in SI") as caught:
        bring_in(tmp_path, "t,tau\n0,0\n1,1e10\n", MAP.replace("scale = 2.0", "scale = 1e300"))
    assert (caught.value.column, caught.value.row) == ("output_torque", 3)


def test_a_status_word_needs_no_unit_and_takes_whole_numbers_only(tmp_path: Path) -> None:
    table = "time[s],motor_torque[N*m],status_word,motor_position\n0,1,39,0\n1,2,{},1\n"
    (run,) = load_runs(import_files([write(tmp_path, "a.csv", table.format(55))], None, tmp_path / "out"))
    assert list(run.signals["status_word"]) == [39, 55]
    assert any("'motor_position' is kept as auxiliary, since it states no unit" in note for note in run.warnings)
    with pytest.raises(DataError, match="no whole number") as caught:
        import_files([write(tmp_path, "b.csv", table.format(39.0001))], None, tmp_path / "out")
    assert (caught.value.column, caught.value.row) == ("status_word", 3)


def test_an_existing_log_is_not_overwritten(tmp_path: Path) -> None:
    bring_in(tmp_path, "t,tau\n0,1\n", MAP)
    with pytest.raises(ConfigError, match="never overwritten"):
        bring_in(tmp_path, "t,tau\n0,1\n", MAP)


@pytest.mark.parametrize("at", ["close_chunk", "finish"])
def test_a_log_that_the_disk_refuses_does_not_stay_in_part(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, at: str
) -> None:
    def refuse(_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(McapFile, at, refuse)
    with pytest.raises(DataError, match="No space left"):
        bring_in(tmp_path, "t,tau\n0,1\n", MAP)
    assert not list((tmp_path / "out").iterdir())


def test_structs_matrices_and_tables_give_their_columns(tmp_path: Path) -> None:
    time = np.arange(5.0)
    savemat(tmp_path / "a.mat", {"log": {"t": time, "m": np.column_stack([time * 2, time * 3])}, "note": "text"})
    with h5py.File(tmp_path / "b.h5", "w") as file:
        file["log.t"] = time
        table = np.zeros(5, dtype=[("0", "f8"), ("1", "f4")])
        table["0"], table["1"] = time * 2, time * 3
        file["m"] = table
    for name, columns in (("a.mat", ("log.m:0", "log.m:1")), ("b.h5", ("m.0", "m.1"))):
        rules = f'[signals.time]\ncolumn = "log.t"\n[signals.motor_torque]\ncolumn = "{columns[0]}"\n'
        rules += f'[signals.output_torque]\ncolumn = "{columns[1]}"\n'
        paths = import_files([tmp_path / name], write(tmp_path, "map.toml", rules), tmp_path / name.replace(".", "_"))
        (run,) = load_runs(paths)
        assert np.array_equal(run.signals["motor_torque"], time * 2)
        assert np.array_equal(run.signals["output_torque"], time * 3)


def test_a_dataset_that_points_to_another_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "secret").write_bytes(np.arange(4.0).tobytes())
    with h5py.File(tmp_path / "b.h5", "w") as file:
        file.create_dataset("t", (4,), dtype="f8", external=[(str(tmp_path / "secret"), 0, 32)])
    with pytest.raises(DataError, match="another file"):
        import_files([tmp_path / "b.h5"], None, tmp_path / "out")


def test_columns_of_another_length_than_time_are_refused_or_left_out(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "b.h5", "w") as file:
        file["t"], file["tau"], file["slow"] = np.arange(4.0), np.arange(4.0), np.arange(2.0)
    (path,) = import_files([tmp_path / "b.h5"], write(tmp_path, "map.toml", MAP), tmp_path / "out")
    (run,) = load_runs([path])
    assert any("'slow' left out: 2 values, time has 4" in note for note in run.warnings)
    wrong = MAP.replace('"tau"', '"slow"')
    with pytest.raises(DataError, match="output_torque has 2 values, but time has 4"):
        import_files([tmp_path / "b.h5"], write(tmp_path, "map.toml", wrong), tmp_path / "out2")


@pytest.mark.parametrize("suffix", [".h5", ".mat", ".parquet"])
def test_a_file_of_noise_is_a_data_error(tmp_path: Path, suffix: str) -> None:
    pytest.importorskip("pyarrow", reason="Parquet needs the extra")
    file = tmp_path / f"noise{suffix}"
    file.write_bytes(bytes(range(256)) * 20)
    with pytest.raises(DataError, match="noise"):
        import_files([file], None, tmp_path / "out")


def test_an_unknown_kind_of_file_is_a_data_error(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"'\.xls' is no known kind"):
        import_files([write(tmp_path, "a.xls", "x")], None, tmp_path / "out")


@pytest.mark.parametrize("name", ["iiwa_joint4.toml", "cogging_map.toml"])
def test_the_example_mappings_are_toml_with_comments_for_a_reader(name: str) -> None:
    text = (Path(__file__).parents[3] / "docs" / "examples" / name).read_text(encoding="utf-8")
    assert "time" in tomllib.loads(text)["signals"]
    assert text.startswith("#")


CONTRACT = "time[s],output_torque[N*m]\n0,1\n0.005,2\n0.01,3\n"
SIDECAR = 'procedure = "locked-output"\nreplicate = "a"\nstart_angle = 0.7\noperator = "Ada"\n'


def test_the_sidecar_of_a_contract_csv_is_read_and_the_mapping_wins(tmp_path: Path) -> None:
    table = write(tmp_path, "x.csv", CONTRACT)
    write(tmp_path, "x.toml", SIDECAR)
    import_files([table], None, tmp_path / "plain")
    (run,) = load_runs([tmp_path / "plain"])
    (shown,) = load_runs([table])
    assert (run.procedure, run.replicate, run.start_angle) == (ProcedureName.LOCKED_OUTPUT, "a", 0.7)
    assert (run.procedure, run.replicate, run.start_angle) == (shown.procedure, shown.replicate, shown.start_angle)
    assert run.metadata["operator"] == "Ada"
    rules = write(tmp_path, "map.toml", '[run]\nprocedure = "backdrive"\n')
    import_files([table], rules, tmp_path / "mapped")
    (run,) = load_runs([tmp_path / "mapped"])
    assert (run.procedure, run.replicate) == (ProcedureName.BACKDRIVE, "a")


def test_parts_of_a_recording_are_no_replicates_whatever_its_sidecar_says(tmp_path: Path) -> None:
    table = write(tmp_path, "x.csv", CONTRACT)
    write(tmp_path, "x.toml", SIDECAR)
    import_files([table], write(tmp_path, "map.toml", '[run.split]\nby = "time"\nblocks = 2\n'), tmp_path / "out")
    runs = load_runs([tmp_path / "out"])
    assert {(run.procedure, run.replicate, run.start_angle) for run in runs} == {("locked-output", None, None)}


def test_a_mapping_beside_its_recording_is_no_sidecar(tmp_path: Path) -> None:
    table = write(tmp_path, "x.csv", "t,tau\n0,10\n5,20\n")
    import_files([table], write(tmp_path, "x.toml", MAP), tmp_path / "one")
    (run,) = load_runs([tmp_path / "one"])
    assert run.procedure is ProcedureName.FREE_RUN
    import_files([table], write(tmp_path, "map.toml", MAP), tmp_path / "two")
    (run,) = load_runs([tmp_path / "two"])
    assert any("x.toml beside it is no sidecar and was not read" in note for note in run.warnings)


def test_a_wrong_sidecar_of_a_contract_csv_is_refused_as_rig_show_does(tmp_path: Path) -> None:
    table = write(tmp_path, "x.csv", CONTRACT)
    write(tmp_path, "x.toml", "procedure = 'lock'\n")
    with pytest.raises(ConfigError, match="procedure"):
        import_files([table], None, tmp_path / "out")

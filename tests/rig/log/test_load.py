"""Which files a command line's RUN arguments stand for."""

from pathlib import Path

import pytest

from drivers.errors import DataError
from rig.log.load import load_runs
from tests.rig.log.samples import write_log

CSV = "time[s],motor_torque[N*m]\n0,1\n1,2\n"


def test_a_folder_stands_for_its_runs_in_order_of_their_names(tmp_path: Path) -> None:
    write_log(tmp_path / "b.mcap", 20)
    (tmp_path / "a.csv").write_text(CSV)
    (tmp_path / "notes.txt").write_text("no run")
    (tmp_path / "deeper").mkdir()
    write_log(tmp_path / "deeper" / "c.mcap", 20)
    assert [run.name for run in load_runs([tmp_path])] == ["a", "b"]


def test_hidden_files_of_a_folder_are_no_runs_unless_they_are_named(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(CSV)
    (tmp_path / "._a.csv").write_bytes(b"\0\5\x16\7 Mac OS X")
    (tmp_path / ".b.csv").write_text(CSV)
    assert [run.name for run in load_runs([tmp_path])] == ["a"]
    assert [run.name for run in load_runs([tmp_path / ".b.csv"])] == [".b"]


def test_a_file_named_twice_is_read_once(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(CSV)
    assert len(load_runs([tmp_path, tmp_path / "a.csv", tmp_path / "." / "a.csv"])) == 1


def test_two_runs_of_one_name_are_refused(tmp_path: Path) -> None:
    write_log(tmp_path / "a.mcap", 20)
    (tmp_path / "a.csv").write_text(CSV)
    with pytest.raises(DataError, match=r"two runs are called '.*-a'"):
        load_runs([tmp_path])


def test_a_csv_in_a_folder_that_is_no_contract_log_is_named(tmp_path: Path) -> None:
    write_log(tmp_path / "a.mcap", 20)
    (tmp_path / "foreign.csv").write_text("t,tau\n0,1\n")
    with pytest.raises(DataError, match=r"foreign\.csv.*rig import"):
        load_runs([tmp_path])


@pytest.mark.parametrize("name", ["absent", "absent.mcap", "absent.csv"])
def test_a_path_that_does_not_exist_is_named(tmp_path: Path, name: str) -> None:
    with pytest.raises(DataError, match=f"{name}: there is no such file"):
        load_runs([tmp_path / name])


def test_an_empty_folder_an_empty_list_and_another_kind_of_file_are_errors(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="holds no run"):
        load_runs([tmp_path])
    with pytest.raises(DataError, match="no run was given"):
        load_runs([])
    (tmp_path / "a.h5").write_bytes(b"x")
    with pytest.raises(DataError, match="rig import"):
        load_runs([tmp_path / "a.h5"])


def test_runs_of_two_days_are_told_apart_by_their_folders(tmp_path: Path) -> None:
    for day in ("monday", "tuesday"):
        (tmp_path / day).mkdir()
        (tmp_path / day / "a.csv").write_text(CSV)
        (tmp_path / day / "a.toml").write_text('procedure = "free-run"\nreplicate = "pair"\n')
    runs = load_runs([tmp_path / "monday", tmp_path / "tuesday"])
    assert [run.name for run in runs] == ["monday-a", "tuesday-a"]
    assert [run.replicate for run in runs] == ["monday-pair", "tuesday-pair"]

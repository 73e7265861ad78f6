"""The two measured data sets come in through the mapping files of the documentation."""

import os
from pathlib import Path

import numpy as np
import pytest

from rig.log.importer import import_files
from rig.log.load import load_runs

ROOT = Path(__file__).parents[3]
DATA = Path(os.environ.get("HARMONIC_RIG_DATA") or ROOT.parent / "shared" / "data")
"""The measured logs: where the environment says, else beside the checkout."""

EXAMPLES = ROOT / "docs" / "examples"

pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="the measured logs are not part of the repository")


def test_the_robot_joint_comes_in_one_run_per_speed_with_its_values_unchanged(tmp_path: Path) -> None:
    files = sorted((DATA / "kuka_iiwa_joint4").glob("*.csv"))
    runs = load_runs(import_files(files, EXAMPLES / "iiwa_joint4.toml", tmp_path))
    assert [run.name for run in runs] == [file.stem for file in files]
    for run, file in zip(runs, files, strict=True):
        raw = np.loadtxt(file, delimiter=",", skiprows=1)
        assert set(run.signals) == {"output_position", "output_velocity", "output_torque"}
        # the log keeps whole nanoseconds
        assert run.time == pytest.approx(raw[:, 0] - raw[0, 0], abs=1e-9)
        assert np.array_equal(run.signals["output_position"], raw[:, 1])
        assert np.array_equal(run.signals["output_velocity"], raw[:, 2])
        assert np.array_equal(run.signals["output_torque"], raw[:, 3])
        assert run.gaps == ()


def test_the_cogging_map_comes_in_sectors_of_the_turn_with_equal_times_merged(tmp_path: Path) -> None:
    file = DATA / "motor_cogging_map" / "hold_sweep.csv"
    raw = np.loadtxt(file, delimiter=",", skiprows=1)
    runs = load_runs(import_files([file], EXAMPLES / "cogging_map.toml", tmp_path))
    assert len(runs) == 16
    assert sum(len(run.time) for run in runs) == len(np.unique(raw[:, 0]))
    lows = [run.signals["motor_position"].min() for run in runs]
    highs = [run.signals["motor_position"].max() for run in runs]
    assert all(high <= low for high, low in zip(highs[:-1], lows[1:], strict=True))
    for run in runs:
        assert set(run.signals) == {"motor_position", "motor_current"}
        assert not run.auxiliary
        assert run.metadata["split"].endswith("of 16 by motor_position")
        assert run.gaps
        assert any("1029 samples with the time stamp" in note for note in run.warnings)

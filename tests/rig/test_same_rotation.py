"""A drive whose output turns with the wave generator: the same results, whatever the sense of the motor's signals."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from rig.cli import app
from rig.log.load import load_runs

SETTINGS = (
    "locked-output.start_angles=1",
    "locked-output.replicate_pairs=0",
    "locked-output.rates=0.12",
    "locked-output.amplitudes=1",
    "locked-output.dwell=1",
    "backdrive.start_angles=1",
    "backdrive.repeats=1",
    "backdrive.amplitudes=1",
    "backdrive.dwell=1",
)
DUT = """\
name = "same"
[gear]
ratio = 100
rotation = "same"
rated_torque = 16.0
K1 = 8.4e3
K2 = 9.4e3
T1 = 3.9
T2 = 12.0
hysteresis_loss = 1.8e-4
starting_torque = 0.012
backdriving_torque = 2.0
"""


def test_sweeps_give_positive_stiffness_loss_and_friction(tmp_path: Path) -> None:
    (tmp_path / "dut.toml").write_text(DUT)
    words = ["run", "locked-output", "backdrive", "--dut", str(tmp_path / "dut.toml"), "--json", "-o", str(tmp_path)]
    answer = CliRunner().invoke(app, [*words, *(word for text in SETTINGS for word in ("--set", text))])
    assert answer.exit_code == 0, answer.stderr
    locked, driven = json.loads(answer.stdout)["procedures"]
    found = {m["name"]: m["value"] for m in locked["measurements"]}
    assert found["stiffness"] == pytest.approx(9000, rel=0.02)
    assert found["friction_torque"] == pytest.approx(0.012, rel=0.02)
    assert found["hysteresis_loss"] == pytest.approx(1.137e-4, rel=0.03)
    found = {m["name"]: m["value"] for m in driven["measurements"]}
    assert found["stiffness"] == pytest.approx(9000, rel=0.02)
    assert found["friction_level"] == pytest.approx(1.2, rel=0.03)
    (run,) = load_runs([tmp_path / "locked-output-angle-1.mcap"])
    # positive torque turns the motor forward, and the torsion is output_position - motor_position / ratio
    twist = run.signals["output_position"] - run.signals["motor_position"] / 100
    assert run.signals["motor_torque"] @ (twist - twist.mean()) < 0

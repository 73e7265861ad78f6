"""What the procedures take for granted where the dut file is silent: told before the first run, kept in every log."""

import json
from pathlib import Path

from typer.testing import CliRunner, Result

from rig.cli import app
from rig.log.load import load_runs

THIN = 'name = "thin"\n[gear]\nratio = 100\nrated_torque = 16.0\n'

SHORT = [
    "free-run", "--set", "free-run.dwell=0.5", "--set", "free-run.repeats=1",
    "--set", "free-run.turns=1", "--set", "free-run.speeds=200",
]  # fmt: skip

GUESSED = (
    "gear.starting_torque = 0.016 N*m",  # 10 % of 16 N*m / 100
    "gear.hysteresis_loss = 0.00018 rad",
    "gear.backdriving_torque = 2.72 N*m",  # 1.7 times 0.016 N*m times 100
    "motor.inertia = 2.2e-05 kg*m^2",
    "motor.encoder_counts = 16384 per revolution",
)


def run(folder: Path, *options: object) -> Result:
    return CliRunner().invoke(app, ["run", *SHORT, *map(str, options), "-o", str(folder)])


def test_every_guess_about_a_thin_dut_is_told_and_recorded(tmp_path: Path) -> None:
    dut = tmp_path / "thin.toml"
    dut.write_text(THIN, encoding="utf-8")
    answer = run(tmp_path / "runs", "--dut", dut)
    assert answer.exit_code == 0, answer.stderr
    (log,) = load_runs([tmp_path / "runs"])
    recorded = json.loads(log.metadata["assumed"])
    assert len(recorded) == len(GUESSED)
    for guess, line in zip(GUESSED, recorded, strict=True):
        assert line.startswith(guess)
        assert f"assumed: {guess}" in answer.stderr


def test_nothing_is_guessed_about_a_complete_dut(tmp_path: Path) -> None:
    answer = run(tmp_path)
    assert "for the procedures" not in answer.stderr
    (log,) = load_runs([tmp_path])
    assert "assumed" not in log.metadata


def test_a_dut_without_ratio_is_refused_with_range_and_equation(tmp_path: Path) -> None:
    dut = tmp_path / "thin.toml"
    dut.write_text('name = "thin"\n', encoding="utf-8")
    answer = run(tmp_path / "runs", "--dut", dut)
    assert answer.exit_code == 2
    words = " ".join(answer.stderr.split())
    assert "gear.ratio = None: missing; it scales torques and speeds of the procedures: at least 1 and at most" in words
    assert "theta_m = -N theta_o, Zhang (4), needs it" in words
    assert "gear.rated_torque = None: missing;" in words

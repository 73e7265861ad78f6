"""The loop on measured logs: a robot joint with torque and position only, a motor with current and position only."""

from pathlib import Path

import numpy as np
import pytest

from rig.log.run import Run
from rig.loop.campaign import LoopOptions
from rig.loop.trace import trace
from tests.rig.loop.runs import dut, make_run

DATA = Path(__file__).parents[4] / "shared" / "data"
JOINT = DATA / "kuka_iiwa_joint4"
MAP = DATA / "motor_cogging_map" / "hold_sweep.csv"

needs_joint = pytest.mark.skipif(not JOINT.exists(), reason="measured joint logs are not part of the repository")
needs_map = pytest.mark.skipif(not MAP.exists(), reason="the measured cogging map is not part of the repository")


def joint_runs() -> list[Run]:
    runs = []
    for file in sorted(JOINT.glob("*.csv")):
        table = np.genfromtxt(file, delimiter=",", names=True)
        table = table[np.concatenate([[True], np.diff(table["t_s"]) > 0])]
        signals = {
            "output_position": table["q_rad"],
            "output_velocity": table["dq_rad_s"],
            "output_torque": table["tau_Nm"],
        }
        runs.append(make_run(file.stem, "free-run", table["t_s"] - table["t_s"][0], signals))
    return runs


def map_runs(blocks: int = 8) -> list[Run]:
    table = np.genfromtxt(MAP, delimiter=",", names=True)
    table = table[np.concatenate([[True], np.diff(table["Time"]) > 0])]
    runs = []
    for number, part in enumerate(np.array_split(table, blocks), start=1):
        signals = {"motor_position": part["Position"], "motor_current": part["Iq"]}
        split = {"split": f"{number} of {blocks} by time"}
        runs.append(make_run(f"hold-{number:02d}", "other", part["Time"] - part["Time"][0], signals, metadata=split))
    return runs


@needs_joint
def test_a_joint_with_torque_and_position_only_gets_gravity_and_its_error_before_and_after() -> None:
    result = trace(joint_runs(), dut('name = "joint 4"\n'), LoopOptions(held_out=("vel_p2*", "vel_p5*")))
    assert tuple(result.equations) == ("output-torque",)
    assert result.effects[0] == "gravity-load"
    held_out = result.equations["output-torque"].held_out
    assert held_out is not None
    # gravity of several N*m goes; what is left is friction and ripple of a few tenths of 1 N*m
    assert held_out.rms_before > 3.0
    assert held_out.rms_after < 0.3
    assert held_out.floor is None


@needs_map
@pytest.mark.timeout(600)  # 16 sectors, a dozen lines, each with a joint refit
def test_a_map_in_amperes_shows_cogging_lines_and_says_that_the_hold_out_is_weak() -> None:
    result = trace(map_runs(), dut('name = "motor"\n'), LoopOptions())
    assert tuple(result.equations) == ("motor-current",)
    assert result.effects[0] == "cogging"
    held_out = result.equations["motor-current"].held_out
    assert held_out is not None
    assert held_out.rms_after < 0.5 * held_out.rms_before
    assert result.steps[0].lines[0].order == pytest.approx(72.0, abs=0.1)
    assert result.steps[0].parameters["amplitude"].unit == "A"
    assert any("Weak hold-out" in warning for warning in result.warnings)

"""The loop on measured logs, by the documented way: imported with the example mappings, then traced."""

from pathlib import Path

import pytest

from rig.log.importer import import_files
from rig.log.load import load_runs
from rig.loop.campaign import LoopOptions
from rig.loop.result import Verdict
from rig.loop.trace import trace
from tests.measured_data import EXAMPLES, JOINT, MAP, needs_joint, needs_map
from tests.rig.loop.runs import dut


@needs_joint
def test_a_joint_with_torque_and_position_only_gets_gravity_and_its_error_before_and_after(tmp_path: Path) -> None:
    runs = load_runs(import_files(sorted(JOINT.glob("*.csv")), EXAMPLES / "iiwa_joint4.toml", tmp_path))
    result = trace(runs, dut('name = "joint 4"\n'), LoopOptions(held_out=("vel_p2*", "vel_p5*")))
    assert result.held_out == ("vel_p2", "vel_p5")
    assert tuple(result.equations) == ("output-torque",)
    assert result.effects == ("gravity-load",)
    held_out = result.equations["output-torque"].held_out
    assert held_out is not None
    # gravity of 30 N*m at up to 1 rad goes; others leave 0.127 N*m with harmonics of gravity and friction
    assert held_out.rms_before == pytest.approx(6.692, abs=0.005)
    assert held_out.rms_after == pytest.approx(0.115, abs=0.002)
    assert result.steps[0].parameters["amplitude"].value == pytest.approx(29.78, abs=0.03)
    assert held_out.floor is None
    # one tenth of 1 N*m is far above the white noise, and nothing was repeated: it is not passed over
    assert result.verdict is Verdict.UNTRACED
    # the gear's ripple, 2 x 160 per output turn: seen, too small to pay in the whole torque
    (ripple,) = (text for text in result.warnings if "output_position:product, order 320." in text)
    assert ripple.startswith("Found, not added")
    assert "amplitude 0.031" in ripple
    assert "improves 25 % of the runs" in ripple


@needs_map
@pytest.mark.timeout(600)  # 16 sectors, a dozen lines, each with a joint refit
def test_a_map_in_amperes_shows_the_comb_of_cogging_and_says_that_the_hold_out_is_weak(tmp_path: Path) -> None:
    runs = load_runs(import_files([MAP], EXAMPLES / "cogging_map.toml", tmp_path))
    result = trace(runs, dut('name = "motor"\n'), LoopOptions())
    assert tuple(result.equations) == ("motor-current",)
    assert result.effects[0] == "cogging"
    held_out = result.equations["motor-current"].held_out
    assert held_out is not None
    # others go from 0.145 to 0.056 A with ten harmonics of the turn
    assert held_out.rms_before == pytest.approx(0.1481, abs=0.0005)
    assert held_out.rms_after == pytest.approx(0.0157, abs=0.0005)
    orders = [line.order for line in result.steps[0].lines[:6]]
    assert orders == pytest.approx([72, 18, 12, 144, 24, 36], abs=0.1)
    assert result.steps[0].parameters["amplitude"].unit == "A"
    assert any("Weak hold-out" in warning for warning in result.warnings)
    # a detent whose angle is read a little late flips with the direction, too: at its orders friction is one of a set
    flips = [step for step in result.steps if "position-dependent-friction" in (step.effect, *step.members)]
    at_cogging = [step for step in flips if any(abs(line.order - 72.0) < 0.5 for line in step.lines)]
    assert [set(step.members) for step in at_cogging] == [{"cogging", "position-dependent-friction"}]
    assert [round(line.order, 2) for line in at_cogging[0].lines] == [72.0, 144.06]
    assert [round(line.order, 2) for step in flips if step not in at_cogging for line in step.lines] == [254.24]
    # no line stays of which nothing may be there once the friction's level is in the model
    sizes = [value for step in result.steps for name, value in step.parameters.items() if name.startswith("amplitude")]
    assert all(size.ci95 is not None and size.ci95[0] > 0.0 for size in sizes)

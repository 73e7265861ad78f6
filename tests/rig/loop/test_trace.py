"""The loop on campaigns of the independent generator: nobody tells it which effect acts."""

import json
from functools import cache

import numpy as np
import pytest

from drivers.errors import ConfigError, DataError
from rig.loop.campaign import LoopOptions, split_runs
from rig.loop.result import LoopResult, Verdict
from rig.loop.trace import trace
from tests.independent.campaign import Campaign, Plan
from tests.independent.effects import Arm, Effects, Line
from tests.rig.loop.runs import dut, make_run, runs_of, turning_run

pytestmark = pytest.mark.xdist_group("trace")  # what was traced is shared

KINEMATIC = Effects(kinematic_error=(Line(2.0, 1e-4, 0.7),))
COGGING = Effects(cogging=(Line(84.0, 3e-3, -1.0),))
GRAVITY = Effects(gravity_load=Arm(0.5, 0.4))

SMALL = Plan(locked_angles=6, locked_pairs=1, backdrives=2, backdrive_pairs=1, free_runs=2, free_run_pairs=1)
RATE = 100.0


@cache
def traced(effects: Effects, seed: int = 11) -> LoopResult:
    runs, held_out = runs_of(Campaign(seed, effects=effects, plan=SMALL, rate=RATE))
    return trace(runs, dut(), LoopOptions(held_out=held_out))


def test_a_drive_without_effect_gives_none() -> None:
    result = traced(Effects())
    assert result.verdict is Verdict.NONE
    assert result.effects == ()


def test_a_kinematic_error_is_named_with_amplitude_order_and_phase_in_their_intervals() -> None:
    result = traced(KINEMATIC)
    assert (result.verdict, result.effects) == (Verdict.NAMED, ("kinematic-error",))
    parameters = result.steps[0].parameters
    for name, truth in (("amplitude", 1e-4), ("order", 2.0), ("phase", 0.7)):
        interval = parameters[name].ci95
        assert interval is not None
        # 95 % intervals miss once in twenty: half a width more makes a fixed seed a test of size and sign
        slack = 0.25 * (interval[1] - interval[0])
        assert interval[0] - slack <= truth <= interval[1] + slack


def test_a_traced_kinematic_error_brings_the_held_out_torsion_to_the_floor() -> None:
    torsion = traced(KINEMATIC).equations["torsion"].held_out
    assert torsion is not None
    assert torsion.floor is not None
    assert torsion.rms_before > 8.0 * torsion.floor
    assert torsion.rms_after < 1.15 * torsion.floor


def test_held_out_runs_may_lower_the_verdict_and_never_steer_the_search() -> None:
    """What the fitted runs show stays, to the last digit, where the held-out runs show the opposite."""
    turned = Effects(kinematic_error=(Line(2.0, 1e-4, 0.7 + np.pi),))
    runs, held_out = runs_of(Campaign(11, effects=KINEMATIC, plan=SMALL, rate=RATE))
    others, _ = runs_of(Campaign(11, effects=turned, plan=SMALL, rate=RATE))
    mixed = tuple(other if run.name in held_out else run for run, other in zip(runs, others, strict=True))
    result, plain = trace(mixed, dut(), LoopOptions(held_out=held_out)), traced(KINEMATIC)
    assert [(step.effect, step.parameters) for step in result.steps] == [
        (step.effect, step.parameters) for step in plain.steps
    ]
    assert result.model.base == plain.model.base
    torsion = result.equations["torsion"].held_out
    assert torsion is not None
    assert torsion.rms_after > 1.5 * torsion.rms_before
    assert result.verdict is not Verdict.NAMED
    meanings = [str(item.evidence["meaning"]) for item in result.open]
    assert "what was added on the training runs makes the held-out runs worse" in meanings


@pytest.mark.timeout(600)  # the longest search: a line at order 84 in 220 000 samples
def test_cogging_is_named_alone_and_leaves_no_line_in_the_torsion() -> None:
    result = traced(COGGING)
    assert (result.verdict, result.effects) == (Verdict.NAMED, ("cogging",))
    step = result.steps[0]
    assert step.equation == "motor-torque"
    assert step.lines[0].order == pytest.approx(84.0, abs=1e-3)
    assert step.lines[0].amplitude == pytest.approx(3e-3, rel=0.02)


def test_gravity_is_named_from_motion_and_torque_together() -> None:
    result = traced(GRAVITY)
    assert (result.verdict, result.effects) == (Verdict.NAMED, ("gravity-load",))
    assert result.steps[0].parameters["amplitude"].value == pytest.approx(0.5, rel=0.02)
    assert result.steps[0].parameters["phase"].value == pytest.approx(0.4, abs=0.02)


def test_one_start_angle_without_free_run_never_gives_a_single_name() -> None:
    plan = Plan(locked_angles=1, locked_pairs=1, backdrives=2, backdrive_pairs=1, free_runs=0, free_run_pairs=0)
    strong = Effects(kinematic_error=(Line(7.0, 2e-4, 0.3),))
    runs, _ = runs_of(Campaign(5, effects=strong, plan=plan, rate=RATE))
    # both logs of the only angle are needed on the training side, so a second draw of it is held out
    more, _ = runs_of(Campaign(6, effects=strong, plan=plan, rate=RATE))
    extra = next(run for run in more if run.procedure.value == "locked-output")
    other = type(extra)("held", extra.file, extra.procedure, extra.time, extra.signals)
    result = trace((*runs, other), dut(), LoopOptions(held_out=("held", "backdrive-02*")))
    assert all(step.verdict is not Verdict.NAMED for step in result.steps)
    assert result.verdict in (Verdict.AMBIGUOUS, Verdict.UNTRACED)


def test_a_result_is_json_with_the_contract_keys() -> None:
    content = json.loads(json.dumps(traced(KINEMATIC).to_json(), allow_nan=False))
    assert content["schema"] == "rig.loop/1"
    assert set(content) == {
        "schema", "runs", "verdict", "effects", "equations", "steps", "open", "warnings", "elapsed_s",
    }  # fmt: skip
    errors = content["equations"]["torsion"]["held_out"]
    six = {"rms_before", "rms_after", "max_before", "max_after", "floor", "floor_ci95"}
    assert set(errors) == six | {"by_procedure"}
    assert set(errors["by_procedure"]["free-run"]) == six
    assert set(content["steps"][0]) == {
        "verdict", "effect", "set", "variable", "shape", "lines", "equation", "parameters", "candidates", "p_value",
        "held_out", "shift", "next_experiment",
    }  # fmt: skip
    assert content["steps"][0]["variable"] == "motor_position"
    assert content["steps"][0]["shape"] == "periodic"


def test_saturated_samples_are_masked_and_said() -> None:
    runs = [turning_run("a", 1), turning_run("b", 2), turning_run("c", 3)]
    words = np.zeros(runs[0].time.size)
    words[1500:1600] = 1 << 11
    broken = {**runs[0].signals, "status_word": words}
    broken["motor_torque"] = np.where(words > 0, 5.0, broken["motor_torque"])
    first = type(runs[0])("a", runs[0].file, runs[0].procedure, runs[0].time, broken)
    result = trace((first, *runs[1:]), dut(), LoopOptions(held_out=("c",)))
    assert result.effects == ()
    assert any("Saturated" in warning and "a (100)" in warning for warning in result.warnings)


def test_one_run_cannot_be_traced() -> None:
    with pytest.raises(DataError, match="nothing can be held out"):
        trace([turning_run("a", 1)], dut(), LoopOptions())


def test_holding_out_everything_leaves_nothing_to_fit() -> None:
    with pytest.raises(ConfigError, match="no run is left to fit"):
        trace([turning_run("a", 1), turning_run("b", 2)], dut(), LoopOptions(held_out=("*",)))


def test_every_pattern_of_runs_to_hold_out_that_matches_none_is_told_with_the_runs_there_are() -> None:
    runs = [turning_run(f"run{k}", k) for k in range(10)]
    with pytest.raises(ConfigError, match=r"'b\*'.*matches none of the 10 runs: .*run7 and 2 more.*'c'") as caught:
        split_runs(runs, LoopOptions(held_out=("b*", "run1", "c")))
    assert [mistake.value for mistake in caught.value.mistakes] == ["b*", "c"]
    assert caught.value.exit_code == 2


def test_replicates_of_one_procedure_go_with_a_run_that_is_held_out_and_those_of_another_stay() -> None:
    time, signals = np.arange(10) * 0.1, {"motor_position": np.zeros(10)}
    runs = [
        make_run(f"{procedure}-{k}", procedure, time, signals, replicate="A")
        for procedure in ("locked-output", "backdrive")
        for k in (1, 2)
    ]
    campaign = split_runs(runs, LoopOptions(held_out=("locked-output-1",)))
    assert [run.name for run in campaign.held_out] == ["locked-output-1", "locked-output-2"]


def test_a_fit_of_one_run_is_told_for_what_it_is() -> None:
    runs = [turning_run("a", 1), turning_run("b", 2), turning_run("c", 3)]
    assert any("one run is fitted: a." in word for word in split_runs(runs, LoopOptions(("b", "c"))).warnings)
    assert not any("one run is fitted" in word for word in split_runs(runs, LoopOptions(("c",))).warnings)


@pytest.mark.parametrize(
    ("text", "signs", "words"),
    [
        ('name = "x"\n[gear]\nratio = 50\n', {}, "motor turns 100"),
        ('name = "x"\n[gear]\nratio = 100\nrotation = "same"\n', {}, "encoders say 'opposed'"),
        ('name = "x"\n[gear]\nratio = 100\n', {"motor_torque": -1.0}, "brakes the shaft"),
    ],
)
def test_a_device_file_that_contradicts_the_data_is_refused(text: str, signs: dict[str, float], words: str) -> None:
    runs = [turning_run(name, seed, **signs) for seed, name in enumerate("abc")]
    with pytest.raises(DataError, match=words):
        trace(runs, dut(text), LoopOptions(held_out=("c",)))


def test_an_unknown_ratio_is_measured_and_said() -> None:
    runs = [turning_run(name, seed) for seed, name in enumerate("abc")]
    result = trace(runs, dut('name = "x"\n'), LoopOptions(held_out=("c",)))
    assert result.model.base.ratio == pytest.approx(100.0, rel=1e-5)
    assert any("was measured" in warning for warning in result.warnings)


def test_the_same_arguments_give_the_same_result() -> None:
    runs, held_out = runs_of(Campaign(11, effects=KINEMATIC, plan=SMALL, rate=RATE))
    again = trace(runs, dut(), LoopOptions(held_out=held_out)).to_json()
    first = traced(KINEMATIC).to_json()
    assert {k: v for k, v in again.items() if k != "elapsed_s"} == {k: v for k, v in first.items() if k != "elapsed_s"}

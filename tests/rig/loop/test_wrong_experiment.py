"""Runs taken with another pose, load or temperature: a wrong experiment is said, and no missing effect inferred."""

from dataclasses import replace

import numpy as np
import pytest

from rig.log.run import Run
from rig.loop.campaign import LoopOptions
from rig.loop.model.equations import Equation
from rig.loop.result import LoopResult, Verdict
from rig.loop.signals.tracks import make_track
from rig.loop.statements.before_after import BeforeAfter
from rig.loop.statements.wrong_experiment import Error, inputs_of, outside, worse_than_fitted
from rig.loop.table import headline, text_of
from rig.loop.trace import trace
from tests.independent.campaign import Campaign, Plan
from tests.independent.effects import Arm, Effects, Line
from tests.rig.loop.runs import dut, runs_of, turning_run
from tests.rig.loop.statements.left import left_of

FREE = Plan(locked_angles=0, locked_pairs=0, backdrives=0, free_runs=4, free_run_pairs=1)
KINEMATIC = Effects(kinematic_error=(Line(2.0, 1e-4, 0.3),))
ARM = Arm(0.8, 0.9)
"""0.8 N*m at the output: 8 mN*m at the motor, some tens of times the floor."""


def with_arm_on(names: tuple[str, ...], effects: Effects) -> tuple[tuple[Run, ...], tuple[str, ...]]:
    """Draw a campaign, the runs `names` with an arm on the output that nobody recorded."""
    runs, held_out = runs_of(Campaign(2001, effects=effects, plan=FREE, rate=100.0))
    loaded, _ = runs_of(Campaign(2001, effects=replace(effects, gravity_load=ARM), plan=FREE, rate=100.0))
    assert [run.name for run in runs] == [run.name for run in loaded]
    return tuple(b if a.name in names else a for a, b in zip(runs, loaded, strict=True)), held_out


def odd_runs(result: LoopResult) -> list[str]:
    return [str(item.evidence["run"]) for item in result.open if "wrong experiment" in str(item.evidence["meaning"])]


@pytest.mark.parametrize(
    ("name", "verdict"),
    [
        ("free-run-04", Verdict.UNTRACED),
        ("free-run-03", Verdict.UNTRACED),
        ("free-run-01a", Verdict.UNCONTROLLED),  # its replicate was taken as all others were
    ],
)
def test_one_run_with_another_load_pose_is_named_whether_held_out_or_fitted_and_no_effect_is(
    name: str, verdict: Verdict
) -> None:
    runs, held_out = with_arm_on((name,), Effects())
    result = trace(runs, dut(), LoopOptions(held_out=held_out))
    assert result.effects == ()
    assert result.verdict is verdict
    assert odd_runs(result) == [name]


def test_a_held_out_run_with_another_pose_does_not_speak_against_what_was_added() -> None:
    runs, held_out = with_arm_on(("free-run-04",), KINEMATIC)
    assert held_out == ("free-run-04",)
    result = trace(runs, dut(), LoopOptions(held_out=held_out))
    assert result.effects == ("kinematic-error",)
    assert result.steps[0].verdict is Verdict.NAMED
    assert odd_runs(result) == ["free-run-04"]
    assert [item for item in result.open if "run" not in item.evidence] == []


def test_an_arm_on_every_run_is_a_gravity_load_and_no_wrong_experiment() -> None:
    names = ("free-run-01a", "free-run-01b", "free-run-02", "free-run-03", "free-run-04")
    runs, held_out = with_arm_on(names, Effects())
    result = trace(runs, dut(), LoopOptions(held_out=held_out))
    assert result.effects == ("gravity-load",)
    assert odd_runs(result) == []


@pytest.mark.parametrize("held_out", [("free-run-04",), ("free-run-03", "free-run-04")])
def test_held_out_runs_that_were_hotter_are_told_with_their_range_and_not_held_against_the_model(
    held_out: tuple[str, ...],
) -> None:
    runs, _ = runs_of(Campaign(2001, plan=FREE, rate=100.0))
    result = trace(
        [hotter(run) if run.name in held_out else run for run in runs], dut(), LoopOptions(held_out=held_out)
    )
    assert (result.verdict, result.effects) == (Verdict.NONE, ())
    told = [text for text in result.warnings if "wrong experiment" in text and "temperature reaches" in text]
    assert [text.split()[0] for text in told] == list(held_out)
    assert result.views.apart == held_out
    assert f"held out, not counting {', '.join(held_out)}, of another kind" in headline(result)
    rows = text_of(result).splitlines()
    assert any(row.startswith("motor-torque *") for row in rows)
    assert f"* with {', '.join(held_out)}, of another kind, which the verdict does not count" in rows
    assert all("degC of the free-run runs that were fitted; its larger error" in text for text in told)
    assert all("Hold out a run within that range, or fit one like it" in text for text in told)
    errors = result.equations["motor-torque"].held_out
    assert errors is not None
    assert errors.floor_ci95 is not None
    assert errors.rms_after > errors.floor_ci95[1]  # the error itself is reported as it is


@pytest.mark.parametrize(("slow", "excused"), [(2.0, False), (8.0, True)])
def test_a_held_out_run_beyond_the_range_is_excused_only_where_it_is_worse_than_every_fitted_run(
    slow: float, excused: bool
) -> None:
    def error(run: str, slow: float) -> Error:
        return Error(run, None, Equation.MOTOR_TORQUE, "free-run", slow=slow, whole=slow, noise=0.01)

    fitted = [error("a", 1.0), error("b", 1.0), error("c", 1.0), error("d", 5.0)]
    odd = error("e", slow)
    assert worse_than_fitted([odd], [*fitted, odd], set("abcd")) == ({"e"} if excused else set())


@pytest.mark.parametrize(("factor", "kept"), [(0.5, "after"), (1.05, "after"), (1.3, "before"), (9.0, "before")])
def test_a_run_that_the_effects_make_worse_is_judged_by_what_the_model_left_without_them(
    factor: float, kept: str
) -> None:
    residuals, _ = left_of(Campaign(5, plan=replace(FREE, free_runs=2), rate=100.0).recordings())
    before = residuals[0]
    pair = BeforeAfter(before, replace(before, values=factor * before.values))
    assert pair.kept_apart_by is {"before": pair.before, "after": pair.after}[kept]


def hotter(run: Run) -> Run:
    """Give the run 30 K warmer, with a third less friction."""
    signals = dict(run.signals)
    signals["temperature"] = signals["temperature"] + 30.0
    signals["motor_torque"] = 0.67 * signals["motor_torque"]
    return replace(run, signals=signals)


# -- speeds


def with_friction(speed: float, level: float) -> Run:
    """Turn at one speed, motor friction `level` (N*m)."""
    return turning_run(f"at-{speed:g}", int(speed), speed=speed, motor_torque=level / 0.012)


def fitted_at(*speeds: float) -> list[Run]:
    """Turn twice at each of the speeds, as replicates with noise of their own."""
    return [
        replace(turning_run(f"{v:g}-{k}", 2 * int(v) + n, speed=v), replicate=f"{v:g}")
        for v in speeds
        for n, k in enumerate("ab")
    ]


@pytest.mark.parametrize(("level", "told"), [(0.016, True), (0.012, False)])
def test_friction_that_falls_between_the_speeds_that_were_fitted_is_no_wrong_experiment(
    level: float, told: bool
) -> None:
    pairs = fitted_at(20.0, 22.0, 60.0)
    between = with_friction(38.0, level)
    result = trace([*pairs, between], dut(), LoopOptions(held_out=(between.name,)))
    assert result.effects == ()
    assert odd_runs(result) == []
    assert [item.evidence["run"] for item in result.open if "speeds" in item.evidence] == [between.name] * told
    assert len(result.open) == told  # it is said once
    for item in result.open:
        assert np.array(item.evidence["speeds"], dtype=float) == pytest.approx([38.0], rel=1e-2)
        assert item.next_experiment is not None
        assert item.next_experiment.command.startswith("rig run free-run ")
        assert "free-run.speeds=" in item.next_experiment.command


@pytest.mark.parametrize(("speeds", "of_its_own"), [((20.0, 60.0), True), ((20.0, 40.0, 60.0), False)])
def test_two_speeds_do_not_tell_how_friction_goes_on_and_a_run_a_little_slower_may_show_it(
    speeds: tuple[float, ...], of_its_own: bool
) -> None:
    """T_c and b go through any friction at two speeds: a run 10 % off may differ from it without a cause of its own."""
    slower = with_friction(18.0, 0.016)
    result = trace([*fitted_at(*speeds), slower], dut(), LoopOptions(held_out=(slower.name,)))
    assert result.effects == ()
    assert odd_runs(result) == [slower.name] * (not of_its_own)
    assert [item.evidence["run"] for item in result.open if "speeds" in item.evidence] == [slower.name] * of_its_own


def test_a_leg_at_a_speed_of_its_own_does_not_excuse_a_load_on_all_the_others() -> None:
    both = [joined(turning_run("a", 1), turning_run("b", 2, speed=60.0), name, k) for k, name in enumerate("cdef")]
    odd = joined(with_friction(20.0, 0.016), with_friction(38.0, 0.016), "odd", 9)
    result = trace([*both, odd], dut(), LoopOptions(held_out=("odd",)))
    assert odd_runs(result) == ["odd"]
    assert not any("speeds" in item.evidence for item in result.open)


def joined(one: Run, other: Run, name: str, seed: int) -> Run:
    """Run one after the other, the noise of the motor torque drawn anew."""
    rng = np.random.default_rng(seed)
    time = np.concatenate([one.time, one.time[-1] + 0.01 + other.time])
    signals = {}
    for signal, values in one.signals.items():
        start = values[-1] if signal.endswith("position") else 0.0
        signals[signal] = np.concatenate([values, start + other.signals[signal]])
    signals["motor_torque"] = signals["motor_torque"] + 2e-4 * rng.standard_normal(time.size)
    return replace(one, name=name, time=time, signals=signals)


# -- ranges


def ranges_with(**changes: float) -> tuple[str, ...]:
    """Give the signals by which a run with further torque, temperature or pose leaves the range of three others."""
    others = [inputs_of(make_track(warm(turning_run(n, k)), dut())) for k, n in enumerate("abc")]
    run = warm(turning_run("d", 4, speed=changes.pop("speed", 20.0)))
    signals = {name: values + changes.get(name, 0.0) for name, values in run.signals.items()}
    found = outside(inputs_of(make_track(replace(run, signals=signals), dut())), others)
    return tuple(item.signal for item in found)


def warm(run: Run) -> Run:
    return replace(run, signals={**run.signals, "temperature": np.full(run.time.size, 25.0)})


@pytest.mark.parametrize(
    ("changes", "signals"),
    [
        ({}, ()),
        ({"output_torque": 5.0}, ("output_torque",)),
        ({"output_torque": 0.05}, ()),  # within the noise of the sensor
        ({"temperature": 15.0}, ("temperature",)),
        ({"temperature": 5.0}, ()),
        ({"speed": 40.0}, ("motor_velocity", "output_position")),
        ({"output_position": 2.5}, ("output_position",)),
        ({"output_position": 0.05}, ()),  # the zero of an encoder
    ],
)
def test_a_run_leaves_the_range_of_others_by_what_was_put_into_it(
    changes: dict[str, float], signals: tuple[str, ...]
) -> None:
    assert ranges_with(**changes) == signals

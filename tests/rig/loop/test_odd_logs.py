"""The loop on logs that lack signals, are short, or come with a wrong device file: a statement, never a guess."""

import re
from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest

from drivers.errors import DataError
from rig.log.run import ProcedureName, Run
from rig.log.timeline import averaged
from rig.loop.campaign import LoopOptions
from rig.loop.fitting.base import start_model
from rig.loop.model.equations import pieces_of
from rig.loop.model.prediction import predict
from rig.loop.result import LoopResult, Verdict
from rig.loop.signals.tracks import make_track
from rig.loop.trace import trace
from sim_backend.model.compliance import Compliance
from tests.independent.campaign import DUT, STANDARD, Campaign, Plan
from tests.independent.effects import Effects, Line
from tests.rig.loop.runs import dut, make_run, runs_of, turning_run

SMALL = Plan(locked_angles=6, locked_pairs=1, backdrives=2, backdrive_pairs=1, free_runs=2, free_run_pairs=1)
SLOW = Plan(locked_angles=4, locked_pairs=1, backdrives=2, backdrive_pairs=1, free_runs=2, free_run_pairs=1)
KINEMATIC = Effects(kinematic_error=(Line(2.0, 1e-4, 0.3),))


def with_signals(run: Run, *names: str) -> Run:
    kept = {name: run.signals[name] for name in names}
    return make_run(run.name, run.procedure.value, run.time, kept, replicate=run.replicate)


def traced_with(*names: str, plan: Plan = SMALL) -> LoopResult:
    runs, held_out = runs_of(Campaign(5, effects=KINEMATIC, plan=plan, rate=100.0))
    return trace([with_signals(run, *names) for run in runs], dut(), LoopOptions(held_out=held_out))


@pytest.mark.parametrize("torque", [(), ("output_torque",)])
def test_two_encoders_show_a_kinematic_error_and_the_sweeps_stay_untraced(torque: tuple[str, ...]) -> None:
    result = traced_with("motor_position", "output_position", *torque)
    assert result.effects == ("kinematic-error",)
    parameters = result.steps[0].parameters
    assert parameters["order"].value == pytest.approx(2.0, abs=1e-4)
    assert parameters["amplitude"].value == pytest.approx(1e-4, rel=0.02)
    # the windup of a sweep whose motor torque was not recorded is structure that nothing here explains
    assert result.verdict is Verdict.UNTRACED
    assert {item.evidence.get("procedure") for item in result.open} >= {"locked-output"}


def test_an_offset_of_the_legs_at_one_speed_is_no_line_that_every_sample_sees_alike() -> None:
    # without a torque the windup under another friction stays in the torsion, leg by leg
    plan = replace(SMALL, locked_angles=4, output_turns=0.6)
    runs, _ = runs_of(Campaign(23, plan=plan, rate=100.0))
    angles = ("motor_position", "output_position")
    bare = [replace(run, signals={name: run.signals[name] for name in angles}) for run in runs]
    assert trace(bare, dut(), LoopOptions()).effects == ()


def test_a_campaign_of_which_means_are_kept_is_traced_and_says_so() -> None:
    runs, held_out = runs_of(Campaign(5, effects=KINEMATIC, plan=SMALL, rate=200.0))
    result = trace([averaged(run) for run in runs], dut(), LoopOptions(held_out=held_out))
    assert result.effects == ("kinematic-error",)
    assert result.steps[0].parameters["amplitude"].value == pytest.approx(1e-4, rel=0.02)
    assert sum("every 2 samples" in text for text in result.warnings) == len(runs)


@pytest.mark.parametrize(("seed", "rate", "slowly"), [(8300, 10.0, True), (8301, 10.0, True), (8303, 20.0, False)])
def test_a_slow_log_without_an_effect_shows_none_and_no_leak(seed: int, rate: float, slowly: bool) -> None:
    runs, held_out = runs_of(Campaign(seed, plan=SLOW, rate=rate))
    result = trace(runs, dut(), LoopOptions(held_out=held_out))
    assert result.effects == ()
    assert result.verdict is Verdict.NONE
    assert any("Sampled too slowly" in text for text in result.warnings) == slowly


def test_sweeps_of_an_hour_sampled_once_a_second_show_no_effect() -> None:
    runs, held_out = runs_of(Campaign(8400, plan=replace(SLOW, free_runs=0), rate=100.0))
    slow = [replace(run, time=100.0 * run.time) for run in runs]
    result = trace(slow, dut(), LoopOptions(held_out=held_out))
    assert result.effects == ()
    assert not any("Sampled too slowly" in text for text in result.warnings)


def test_a_backdrive_without_motor_torque_is_not_taken_for_a_moving_output() -> None:
    result = traced_with("output_position", "output_torque")
    assert any("backdrive-01a" in text and "No equation" in text for text in result.warnings)


def short_run(
    name: str, seed: int, kinematic_error: float, cogging: float, seconds: float = 20.0, speed: float | None = None
) -> Run:
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, 0.005)
    half = seconds / 2
    corners = [0.0, 0.5, 0.7, half - 0.7, half - 0.5, half - 0.3, half - 0.1, seconds - 0.5, seconds - 0.3, seconds]
    velocity = (20.0 + seed if speed is None else speed) * np.interp(time, corners, [0, 0, 1, 1, 0, 0, -1, -1, 0, 0])
    angle = np.cumsum(velocity) * 0.005
    error = kinematic_error * np.sin(2 * angle + 0.5)
    torque = 0.012 * np.sign(velocity) + cogging * np.sin(84 * angle + 1.0)
    signals = {
        "motor_position": angle,
        "output_position": -angle / 100 + error + 1e-6 * rng.standard_normal(time.size),
        "motor_torque": torque + 1e-4 * rng.standard_normal(time.size),
        "output_torque": 0.02 * rng.standard_normal(time.size),
    }
    return make_run(name, "free-run", time, signals)


def test_four_short_runs_are_enough_for_effects_far_above_the_noise() -> None:
    runs = [short_run(f"r{seed}", seed, 1e-4, 1e-3) for seed in range(4)]
    result = trace(runs, dut(), LoopOptions())
    assert result.verdict is Verdict.NAMED
    assert set(result.effects) == {"kinematic-error", "cogging"}


def test_where_nothing_tells_noise_from_structure_the_verdict_is_not_none_and_what_is_missing_is_said() -> None:
    result = trace([short_run(f"r{seed}", seed, 0.0, 0.0) for seed in range(4)], dut(), LoopOptions())
    assert (result.verdict, result.effects) == (Verdict.UNTRACED, ())
    (told,) = result.open
    assert told.evidence["missing"] == ["replicate runs", "a dwell of 2 s before the first motion of every run"]
    assert "no equation has a floor" in str(told.evidence["meaning"])
    assert told.next_experiment is not None
    assert told.next_experiment.command == "rig run free-run --repeat 2"


def test_short_runs_without_effect_that_were_repeated_give_none() -> None:
    runs = [
        replace(short_run(f"r{seed}", seed, 0.0, 0.0, speed=20.0 + seed // 2), replicate=f"pair-{seed // 2}")
        for seed in range(4)
    ]
    result = trace(runs, dut(), LoopOptions())
    assert (result.verdict, result.effects) == (Verdict.NONE, ())
    assert all(item.held_out is not None and item.held_out.floor is not None for item in result.equations.values())


def bent_runs() -> list[Run]:
    bent = []
    for run in (turning_run(name, seed) for seed, name in enumerate("abcd")):
        wave = 5e-5 * np.sin(2 * np.pi * run.time / 7.0) ** 3  # in time, which no term of an angle follows
        signals = {**run.signals, "output_position": run.signals["output_position"] + wave}
        bent.append(make_run(run.name, "free-run", run.time, signals))
    return bent


@pytest.mark.parametrize("device", [DUT, re.sub("encoder_counts.*", "", DUT)], ids=["counts", "no counts"])
def test_what_repeats_says_where_the_counts_that_may_make_it_are_not_known(device: str) -> None:
    runs = [replace(run, replicate=None if run.name == "d" else "same") for run in bent_runs()]
    (told,) = trace(runs, dut(device), LoopOptions(held_out=("d",))).open
    assert "repeats between replicates" in str(told.evidence["meaning"])
    missing = [] if device == DUT else ["the encoders' counts per turn in the device file"]
    assert told.evidence.get("missing", []) == missing
    assert ("without the counts" in str(told.evidence["meaning"])) == bool(missing)


def test_structure_without_replicates_is_untraced_and_says_what_is_not_known() -> None:
    result = trace(bent_runs(), dut(), LoopOptions(held_out=("d",)))
    assert result.verdict is Verdict.UNTRACED
    assert result.effects == ()
    assert any("no run was repeated" in str(item.evidence["meaning"]) for item in result.open)


@pytest.mark.parametrize(
    ("given", "wrong"),
    [
        ("K1 = 8.4e3", "K1 = 0.1"),
        ("K1 = 8.4e3\nK2 = 9.4e3", "K1 = 8.4e5\nK2 = 9.4e5"),
        ("starting_torque = 0.012", "starting_torque = 1.2"),
        ("starting_torque = 0.012", "starting_torque = 1.2e-4"),
    ],
)
def test_a_catalogue_that_is_off_by_any_factor_costs_no_accuracy_and_is_said(given: str, wrong: str) -> None:
    runs, held_out = runs_of(Campaign(5, plan=SMALL, rate=100.0))
    right = trace(runs, dut(DUT), LoopOptions(held_out=held_out))
    result = trace(runs, dut(DUT.replace(given, wrong)), LoopOptions(held_out=held_out))
    for name, equation in right.equations.items():
        assert equation.held_out is not None
        found = result.equations[name].held_out
        assert found is not None
        assert found.rms_after == pytest.approx(equation.held_out.rms_after, rel=0.01)
    said = any("starting_torque" in text for text in result.warnings)
    assert said or any(item.parameter == "K_F0" for item in result.open)


def test_a_torque_that_no_bench_reaches_is_refused_with_its_column() -> None:
    runs = [turning_run(name, seed) for seed, name in enumerate("abc")]
    huge = {**runs[0].signals, "output_torque": 1e200 * runs[0].signals["output_torque"]}
    with pytest.raises(DataError, match="output_torque") as caught:
        trace([make_run("a", "free-run", runs[0].time, huge), *runs[1:]], dut(), LoopOptions(held_out=("c",)))
    assert caught.value.column == "output_torque"


def weighted_runs(zero_spread: float) -> list[Run]:
    """Turn eight runs at one speed with 0.5 N*m that repeats with the output; `zero_spread` (rad) of its encoder."""
    rng = np.random.default_rng(8)
    runs = []
    for number in range(8):
        run = turning_run(f"r{number}", number, speed=60.0)
        angle = run.signals["output_position"]
        signals = {
            **run.signals,
            "output_position": angle + zero_spread * rng.standard_normal(),
            "motor_torque": run.signals["motor_torque"] - 0.005 * np.sin(angle + 0.4),
        }
        runs.append(make_run(run.name, "free-run", run.time, signals))
    return runs


def test_a_slow_line_at_one_speed_is_not_taken_for_its_alias() -> None:
    """At 60 rad/s and 100 Hz the order 0.01 of the motor angle cannot be told from 52.37, which would be cogging."""
    (step,) = trace(weighted_runs(0.0), dut(), LoopOptions(held_out=("r7",))).steps
    assert step.variable == "output_position"
    assert step.lines[0].order == pytest.approx(1.0, abs=2e-3)


def test_a_phase_is_no_better_known_than_the_zeros_of_the_runs() -> None:
    """Zeros that differ by 20 mrad between runs, each of which alone knows its phase to some mrad."""
    (step,) = trace(weighted_runs(0.02), dut(), LoopOptions(held_out=("r7",))).steps
    phase = step.parameters["phase"].ci95
    assert phase is not None
    assert 0.5 * (phase[1] - phase[0]) > 0.02 / np.sqrt(7)


@pytest.mark.timeout(300)
def test_a_line_that_may_be_the_encoder_s_is_told_apart_from_one_that_is_the_gear_s_alone() -> None:
    lines = (Line(2.0, 1e-4, 0.3), Line(1.0, 4e-5, 1.0))
    runs, held_out = runs_of(Campaign(21, Effects(kinematic_error=lines), plan=STANDARD, rate=200.0))
    result = trace(runs, dut(), LoopOptions(held_out=held_out))
    told = {step.effect: [round(line.order, 3) for line in step.lines] for step in result.steps}
    assert told == {"kinematic-error": [2.0], "ambiguous:kinematic-error|motor-encoder-eccentricity": [1.0]}
    assert result.verdict is Verdict.AMBIGUOUS


@pytest.mark.parametrize("procedure", ["locked-output", "other"])
def test_a_run_without_a_sample_has_a_track_without_one(procedure: str) -> None:
    nothing = np.zeros(0)
    names = ("motor_position", "output_position", "motor_torque", "output_torque")
    track = make_track(make_run("empty", procedure, nothing, dict.fromkeys(names, nothing)), dut())
    assert track.size == 0


def test_a_speed_is_the_motor_s_only_where_the_log_knows_of_a_motor() -> None:
    run = turning_run("a", 3)
    of_output = {name: run.signals[name] for name in ("output_position",)}
    torque = {"output_torque": np.sign(np.gradient(run.signals["output_position"]))}
    for signals, speed in ((run.signals, "motor_velocity"), (of_output | torque, "output_velocity")):
        track = make_track(replace(run, signals=MappingProxyType(dict(signals))), dut())
        model = start_model(dut(), 100.0, Compliance.ARCTAN, None)
        (known,) = {
            frozenset(predict(piece, model).signals) & {"motor_velocity", "output_velocity"}
            for piece in pieces_of(track, 100.0)
        }
        assert known == {speed}


def test_outliers_in_the_dwell_of_a_held_out_run_make_no_leak_of_it() -> None:
    plan = replace(SMALL, locked_pairs=0, backdrive_pairs=0, free_run_pairs=0)
    runs, held_out = runs_of(Campaign(5, plan=plan, rate=100.0))
    (sweep,) = (run for run in runs if run.name in held_out and run.procedure is ProcedureName.LOCKED_OUTPUT)
    torque = sweep.signals["output_torque"].copy()
    torque[[50, 120, 190]] += 0.3
    odd = replace(sweep, signals=MappingProxyType({**sweep.signals, "output_torque": torque}))
    result = trace([odd if run is sweep else run for run in runs], dut(), LoopOptions(held_out=held_out))
    errors = result.equations["output-torque"].held_out
    assert errors is not None
    assert errors.floor is not None
    assert errors.floor_ci95 is not None
    assert errors.floor_ci95[0] < errors.rms_after < errors.floor, "the dwell is louder than the sweep"

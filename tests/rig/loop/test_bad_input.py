"""Logs and device files that are wrong: what is wrong is said with its name and value, and no effect is made up."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from typer.testing import CliRunner

from drivers.errors import DataError
from rig.cli import app
from rig.log.run import Run
from rig.loop.campaign import LoopOptions, split_runs
from rig.loop.result import LoopResult, Verdict
from rig.loop.signals.checks import check_gear, check_jumps, check_signs, check_torques, torque_factor
from rig.loop.signals.living import living
from rig.loop.signals.sweeps import check_steps
from rig.loop.signals.tracks import make_track
from rig.loop.trace import trace
from tests.challenge.cases import LEAN
from tests.independent.campaign import DUT, Campaign, Plan
from tests.independent.laws import shd_17_100
from tests.rig.loop.runs import dut, make_run, runs_of, turning_run

LOCKED = Plan(locked_angles=6, locked_pairs=1, backdrives=0, free_runs=0)
FREE = Plan(locked_angles=0, locked_pairs=0, backdrives=0, free_runs=4, free_run_pairs=1)
MOTOR = ("motor_torque", "motor_current")


def drawn(plan: Plan, seed: int = 2001) -> tuple[tuple[Run, ...], tuple[str, ...]]:
    return runs_of(Campaign(seed, plan=plan, rate=100.0))


def with_values(run: Run, **values: float) -> Run:
    """Give the run with some signals held at one value throughout."""
    held = {name: np.full(run.time.size, value) for name, value in values.items()}
    return replace(run, signals={**run.signals, **held})


def scaled(run: Run, factors: Mapping[str, float]) -> Run:
    return replace(run, signals={name: factors.get(name, 1.0) * v for name, v in run.signals.items()})


def traced(plan: Plan, text: str = DUT, seed: int = 2001) -> LoopResult:
    runs, held_out = drawn(plan, seed)
    return trace(runs, dut(text), LoopOptions(held_out=held_out))


# -- runs


def test_replicates_alone_leave_nothing_to_hold_out_and_are_named() -> None:
    runs = [replace(turning_run(name, seed), replicate="pair") for seed, name in enumerate("ab")]
    with pytest.raises(DataError, match="no procedure has two that are no replicates of each other") as caught:
        split_runs(runs, LoopOptions())
    assert "replicates of pair" in str(caught.value)
    assert "Record a further run" in str(caught.value)


def test_one_run_of_each_procedure_leaves_nothing_to_hold_out() -> None:
    one = turning_run("a", 1)
    with pytest.raises(DataError, match="nothing can be held out"):
        split_runs([one, make_run("b", "locked-output", one.time, one.signals)], LoopOptions())


# -- channels that stand still


def test_a_campaign_in_which_nothing_changes_is_refused_with_its_channels() -> None:
    runs = [with_values(turning_run(n, 1), motor_position=1.0, output_position=2.0, motor_torque=0.0) for n in "ab"]
    runs = [with_values(run, output_torque=0.0) for run in runs]
    with pytest.raises(DataError, match="nothing changes in any run: motor_position, motor_torque") as caught:
        trace(runs, dut(), LoopOptions())
    assert "connected" in str(caught.value)


def test_a_campaign_in_which_nothing_but_noise_changes_is_refused() -> None:
    rng = np.random.default_rng(7)
    still = {"motor_position": 1e-4, "output_position": 1e-6, "motor_torque": 2e-4, "output_torque": 0.02}
    runs = []
    for name in "ab":
        one = turning_run(name, 1)
        runs.append(replace(one, signals={k: s * rng.standard_normal(one.time.size) for k, s in still.items()}))
    with pytest.raises(DataError, match=r"nothing changes in any run: .* but for noise"):
        living(runs)
    moved, _ = living([turning_run("a", 1), runs[1]])
    assert moved[0].signals.keys() >= still.keys()


@pytest.mark.parametrize("channel", ["motor_position", "output_position", "motor_torque", "output_torque"])
def test_a_channel_that_stands_still_while_the_drive_turns_is_taken_as_not_recorded(channel: str) -> None:
    runs = [with_values(turning_run("a", 1), **{channel: 0.5}), turning_run("b", 2)]
    (first, second), (warning,) = living(runs)
    assert channel not in first.signals
    assert set(first.signals) | {channel} == set(runs[0].signals)
    assert second.signals == runs[1].signals
    assert warning == f"a: {channel} stood still while the drive moved, taken as not recorded."


def test_a_locked_output_and_a_held_motor_are_not_dead() -> None:
    time = np.arange(0.0, 10.0, 0.01)
    sweep = np.sin(time)
    locked = {"motor_position": 0.1 * sweep, "output_position": np.zeros(1000), "output_torque": sweep}
    held = {"motor_position": np.zeros(1000), "output_position": 1e-3 * sweep, "output_torque": sweep}
    runs = [make_run("l", "locked-output", time, locked), make_run("h", "backdrive", time, held)]
    assert living(runs) == (tuple(runs), ())


def without(run: Run, *channels: str) -> Run:
    return replace(run, signals={name: values for name, values in run.signals.items() if name not in channels})


DRIVE = ("motor_torque", "motor_current")


@pytest.mark.parametrize(
    ("spoil", "shaft"),
    [
        (lambda run: with_values(run, output_torque=1.0), "output"),
        (lambda run: without(run, "output_torque"), "output"),
        (lambda run: without(run, *DRIVE), "motor"),
    ],
    ids=["dead output torque", "no output torque", "no motor torque"],
)
def test_a_sweep_without_a_torque_that_others_have_is_left_out_and_no_effect_is_made_of_it(
    spoil: Callable[[Run], Run], shaft: str
) -> None:
    runs, held_out = drawn(LOCKED)
    result = trace([spoil(runs[0]), *runs[1:]], dut(), LoopOptions(held_out=held_out))
    assert (result.verdict, result.effects) == (Verdict.NONE, ())
    kind = "locked-output and backdrive" if shaft == "output" else "locked-output"
    said = f"{runs[0].name}: no torque of the {shaft} was recorded, and other {kind} runs have it"
    assert any(said in text and "Repeat it" in text for text in result.warnings)
    assert runs[0].name not in result.model.runs


def test_where_most_sweeps_lack_a_torque_the_few_are_taken_without_it() -> None:
    runs, _ = drawn(LOCKED)
    kept, warnings = living([runs[0], *(without(run, *DRIVE) for run in runs[1:])])
    assert all(not run.signals.keys() & set(DRIVE) and "output_torque" in run.signals for run in kept)
    assert warnings == (f"{runs[0].name}: most locked-output runs have no torque of the motor: taken without it.",)


def test_a_current_says_the_torque_of_the_motor_too() -> None:
    runs, _ = drawn(LOCKED)
    mixed = [without(runs[0], "motor_torque"), *runs[1:]]
    assert living(mixed) == (tuple(mixed), ())


def test_motor_torque_that_is_zero_throughout_gives_no_equation_of_it_and_no_gain_as_an_effect() -> None:
    runs, held_out = drawn(FREE)
    dead = [with_values(run, motor_torque=0.0, motor_current=0.0) for run in runs]
    result = trace(dead, dut(), LoopOptions(held_out=held_out))
    assert result.effects == ()
    assert "motor-torque" not in result.equations
    assert sum("motor_torque and motor_current stood still" in text for text in result.warnings) == len(runs)


def test_a_dead_motor_encoder_does_not_turn_the_friction_round() -> None:
    runs, held_out = drawn(FREE)
    dead = [with_values(run, motor_position=1.0) for run in runs]
    result = trace(dead, dut(), LoopOptions(held_out=held_out))
    assert result.effects == ()
    assert result.model.base.parameters["T_c"].value == pytest.approx(shd_17_100().T_c, rel=0.02)


# -- a device file that contradicts the data


@pytest.mark.parametrize("given", [200.0, 50.0, 102.0, 1000.0])
def test_a_wrong_ratio_is_refused_with_the_measured_one(given: float) -> None:
    device = dut(f'name = "x"\n[gear]\nratio = {given}\n')
    with pytest.raises(DataError, match=r"gear\.ratio.*but the motor turns 100 times"):
        check_gear([make_track(turning_run("a", 1), device)], device)


@pytest.mark.parametrize(
    ("channel", "factor", "words"),
    [
        ("motor_position", 4.0, "motor turns 400 times"),
        ("output_position", 0.25, "motor turns 400 times"),
        ("motor_position", -1.0, "the encoders say 'same'"),
        ("output_position", -1.0, "the encoders say 'same'"),
    ],
)
def test_a_wrong_count_or_sign_of_an_encoder_is_refused(channel: str, factor: float, words: str) -> None:
    with pytest.raises(DataError, match=words):
        check_gear([make_track(turning_run("a", 1, **{channel: factor}), dut())], dut())


@pytest.mark.parametrize("names", [("output_torque",), MOTOR, ("motor_position",)])
def test_a_wrong_sign_in_a_locked_sweep_is_refused_with_its_channel(names: tuple[str, ...]) -> None:
    runs, _ = drawn(LOCKED)
    track = make_track(scaled(runs[0], dict.fromkeys(names, -1.0)), dut())
    with pytest.raises(DataError, match="and torsion fall together") as caught:
        check_signs([track], 100.0)
    assert caught.value.column in ("output_torque", "motor_torque")
    assert "correct the rotation" in str(caught.value)


@pytest.mark.parametrize(
    ("plan", "ratio", "motor", "said"),
    [
        (LOCKED, 200.0, 1.0, "no run turns"),
        (LOCKED, 50.0, 1.0, "no run turns"),
        (LOCKED, 1000.0, 1.0, "no run turns"),
        (LOCKED, 100.0, 2.0, "the torque constant"),
        (LOCKED, 100.0, 0.5, "the torque constant"),
        (replace(LOCKED, locked_angles=0, locked_pairs=0, backdrives=3), 50.0, 1.0, "no run turns"),
    ],
)
def test_sweeps_alone_contradict_a_gross_ratio_or_torque_constant(
    plan: Plan, ratio: float, motor: float, said: str
) -> None:
    runs, _ = drawn(plan)
    tracks = [make_track(scaled(run, dict.fromkeys(MOTOR, motor)), dut()) for run in runs]
    with pytest.raises(DataError, match="output_torque moves by") as caught:
        check_torques(tracks, ratio)
    assert said in str(caught.value)
    assert caught.value.value == pytest.approx(100.0 / ratio / motor, rel=0.02)


@pytest.mark.parametrize("seed", range(2001, 2006))
def test_the_factor_between_the_torques_is_one_whatever_the_friction_between_them(seed: int) -> None:
    plan = replace(LOCKED, locked_angles=3, backdrives=2, peaks=(0.0, 0.3, -0.3, 0.3, 0.0))
    tracks = [make_track(run, dut()) for run in drawn(plan, seed)[0]]
    assert torque_factor(tracks, 100.0) == pytest.approx(1.0, abs=0.05)


def test_a_ratio_that_no_run_can_measure_is_said_to_be_taken_as_given() -> None:
    result = traced(LOCKED, DUT.replace("ratio = 100", "ratio = 102"))
    assert Verdict.NAMED not in {step.verdict for step in result.steps}
    assert any("102 was taken as given" in text and "a free run of one turn" in text for text in result.warnings)


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_a_catalogue_stiffness_that_is_off_is_absorbed_with_its_group_and_no_effect(factor: float) -> None:
    text = DUT.replace("8.4e3", f"{factor * 8.4e3}").replace("9.4e3", f"{factor * 9.4e3}")
    result = traced(LOCKED, text)
    assert (result.verdict, result.effects) == (Verdict.ABSORBED, ())
    (told,) = result.open
    assert told.parameter == "K_F0"
    assert told.deviation == pytest.approx(1.0 / factor - 1.0, abs=0.02)
    assert {"flexspline-compliance", "torque-sensor-gain"} <= set(told.group)
    assert ("fixture-compliance" in told.group) == (factor > 1.0)  # a fixture yields: it makes no drive stiffer


def test_torques_in_millis_are_said_to_look_like_them() -> None:
    runs, held_out = drawn(LOCKED)
    millis = [scaled(run, {"motor_torque": 1e3, "output_torque": 1e3}) for run in runs]
    result = trace(millis, dut(), LoopOptions(held_out=held_out))
    assert result.effects == ()
    (told,) = (item for item in result.open if item.verdict is Verdict.ABSORBED)
    assert "torques in mN*m that were taken for N*m would do so" in str(told.evidence["meaning"])
    assert any("motor_torque looks like mN*m: state the unit and import again" in text for text in result.warnings)


def test_a_current_in_millis_is_not_held_against_the_torque() -> None:
    runs, held_out = drawn(LOCKED)
    millis = [scaled(run, {"motor_current": 1e3}) for run in runs]
    result = trace(millis, dut(), LoopOptions(held_out=held_out))
    assert any("motor_current looks like mA: state the unit and import again" in text for text in result.warnings)


def test_a_torque_constant_that_is_a_tenth_off_is_told_with_its_group_and_never_as_one_name() -> None:
    runs, held_out = drawn(LOCKED)
    result = trace([scaled(r, dict.fromkeys(MOTOR, 1.1)) for r in runs], dut(), LoopOptions(held_out=held_out))
    assert Verdict.NAMED not in {step.verdict for step in result.steps}
    told = [members for members in (*(s.members for s in result.steps), *(o.group for o in result.open)) if members]
    assert any({"torque-constant-error", "torque-sensor-gain"} <= set(members) for members in told)


@pytest.mark.parametrize("seed", [2001, 2002])
def test_without_a_device_file_the_ratio_is_counted_and_its_error_is_no_eccentricity(seed: int) -> None:
    result = traced(FREE, 'name = "unknown"\n', seed)
    assert result.effects == ()
    assert result.model.base.ratio == 100.0
    assert any("gives no ratio" in text for text in result.warnings)


def test_a_ratio_is_measured_leg_by_leg_because_each_direction_has_its_torsion() -> None:
    run = turning_run("a", 1, ratio=57.3)
    wound = run.signals["output_position"] + 2e-4 * np.sign(np.gradient(run.signals["motor_position"]))
    ratio = check_gear([make_track(replace(run, signals={**run.signals, "output_position": wound}), dut())], BARE)
    assert ratio == pytest.approx(57.3, rel=2e-7)


BARE = dut('name = "x"\n')


# -- the command


def test_the_command_ends_with_5_and_one_paragraph_that_names_channel_value_and_remedy(tmp_path: Path) -> None:
    for name in "ab":
        rows = "\n".join(f"{k / 100},1,2,0" for k in range(200))
        header = "time[s],motor_position[rad],output_position[rad],motor_torque[N*m]"
        (tmp_path / f"{name}.csv").write_text(f"{header}\n{rows}\n")
        (tmp_path / f"{name}.toml").write_text('procedure = "free-run"\n')
    answer = CliRunner().invoke(app, ["loop", str(tmp_path), "-o", str(tmp_path / "out")])
    assert answer.exit_code == 5
    told = " ".join(answer.stderr.split())
    assert "nothing changes in any run: motor_position, motor_torque, output_position constant" in told
    assert "Check that the channels are connected" in told
    assert "Traceback" not in answer.output


# -- one run that is wrong in a campaign that is right


ALL_KINDS = Plan(locked_angles=5, locked_pairs=1, backdrives=3, backdrive_pairs=1, free_runs=3, free_run_pairs=1)
DEGREES = 180.0 / np.pi


def one_spoiled(name: str, spoil: Callable[[Run], Run]) -> list[Run]:
    runs, _ = drawn(ALL_KINDS, 2003)
    assert any(run.name == name for run in runs)
    return [spoil(run) if run.name == name else run for run in runs]


def wrapped(run: Run) -> Run:
    return replace(run, signals={**run.signals, "motor_position": np.mod(run.signals["motor_position"], 2.0 * np.pi)})


def swapped(run: Run) -> Run:
    motor, output = run.signals["motor_position"], run.signals["output_position"]
    return replace(run, signals={**run.signals, "motor_position": output, "output_position": motor})


@pytest.mark.parametrize(
    ("name", "spoil", "said"),
    [
        ("free-run-03", lambda run: scaled(run, {"motor_position": DEGREES}), "motor_position looks like degrees"),
        ("free-run-03", lambda run: scaled(run, {"output_position": DEGREES}), "output_position looks like degrees"),
        ("free-run-03", lambda run: scaled(run, {"output_position": -1.0}), "One encoder counts the other way"),
        ("free-run-03", lambda run: scaled(run, {"motor_position": 1.3}), "One is scaled"),
        ("free-run-03", swapped, "The encoders look swapped"),
        ("free-run-03", wrapped, "It wraps at a full turn"),
        ("locked-output-03", lambda run: scaled(run, {"motor_position": DEGREES}), "Degrees and radians look mixed up"),
        (
            "locked-output-03",
            lambda run: scaled(run, {"motor_position": 1 / DEGREES}),
            "Degrees and radians look mixed",
        ),
    ],
)
def test_an_angle_in_another_unit_in_one_run_is_refused_with_the_run_and_what_it_looks_like(
    name: str, spoil: Callable[[Run], Run], said: str
) -> None:
    with pytest.raises(DataError) as caught:
        trace(one_spoiled(name, spoil), dut(DUT), LoopOptions())
    assert name in str(caught.value)
    assert said in str(caught.value)


def test_an_angle_that_jumps_is_refused_with_the_moment() -> None:
    def jump(run: Run) -> Run:
        moved = run.signals["motor_position"] + np.where(run.time > 20.0, 0.5, 0.0)
        return replace(run, signals={**run.signals, "motor_position": moved})

    with pytest.raises(DataError, match=r"locked-output-03.*motor_position jumps by 0\.50.* rad at 20 s, 1 time"):
        trace(one_spoiled("locked-output-03", jump), dut(DUT), LoopOptions())


def lacking(run: Run, share: float) -> Run:
    """Give a run in which a share of the motor's angles is missing, anywhere."""
    missing = np.random.default_rng(1).random(run.time.size) < share
    angle = np.where(missing, np.nan, run.signals["motor_position"])
    return replace(run, signals={**run.signals, "motor_position": angle})


@pytest.mark.parametrize("share", [0.03, 0.3])
def test_an_angle_that_goes_on_over_missing_samples_does_not_jump(share: float) -> None:
    check_jumps([lacking(turning_run("a", 1, speed=60.0), share)])


@pytest.mark.parametrize("rows", [3, 5])
def test_an_angle_that_is_read_every_few_rows_and_held_does_not_jump(rows: int) -> None:
    run = turning_run("a", 1, speed=60.0)
    held = run.signals["motor_position"][np.arange(run.time.size) // rows * rows]
    check_jumps([replace(run, signals={**run.signals, "motor_position": held})])
    lost = held + np.where(run.time >= 8.0, 40.0, 0.0)
    with pytest.raises(DataError, match=r"motor_position jumps by .* rad at 7\.9\d s, 1 time in this run"):
        check_jumps([replace(run, signals={**run.signals, "motor_position": lost})])


@pytest.mark.parametrize("rows", [1, 3, 5])
@pytest.mark.parametrize("at", [7.9, 8.0])
def test_an_encoder_that_loses_its_place_while_the_shaft_rests_is_refused(rows: int, at: float) -> None:
    run = turning_run("a", 1, speed=60.0)
    place = np.interp(run.time, [0.0, 7.0, 8.0, 24.0], [0.0, 400.0, 400.0, 1300.0])
    held = np.arange(run.time.size) // rows * rows
    check_jumps([replace(run, signals={**run.signals, "motor_position": place[held]})])
    lost = (place + np.where(run.time >= at, 40.0, 0.0))[held]
    with pytest.raises(DataError, match=r"motor_position jumps by .* rad at \d\.\d+ s, 1 time in this run"):
        check_jumps([replace(run, signals={**run.signals, "motor_position": lost})])


@pytest.mark.parametrize("share", [0.03, 0.3])
@pytest.mark.parametrize(("speed", "step"), [(0.5, 0.5), (20.0, 40.0)])
def test_an_angle_that_jumps_over_a_missing_sample_is_refused(share: float, speed: float, step: float) -> None:
    run = turning_run("a", 1, speed)
    moved = run.signals["motor_position"] + np.where(run.time >= 8.0, step, 0.0)
    run = lacking(replace(run, signals={**run.signals, "motor_position": moved}), share)
    run.signals["motor_position"][np.abs(run.time - 8.0) < 0.015] = np.nan
    with pytest.raises(DataError, match=r"motor_position jumps by .* rad at 7\.9\d s, 1 time in this run"):
        check_jumps([run])


@pytest.mark.timeout(300)
@pytest.mark.parametrize(
    ("name", "factors"),
    [
        ("locked-output-03", {"output_torque": 1.3}),
        ("locked-output-03", {"motor_position": 1.3}),
        pytest.param("backdrive-02", {"output_torque": 1.3}, marks=pytest.mark.campaign),
        pytest.param("free-run-03", {"motor_torque": 1.3}, marks=pytest.mark.campaign),
    ],
)
def test_a_gain_that_is_off_in_one_fitted_run_names_the_run_and_no_effect(
    name: str, factors: Mapping[str, float]
) -> None:
    runs = one_spoiled(name, lambda run: scaled(run, factors))
    held_out = ("locked-output-05", "backdrive-03", "free-run-02")
    result = trace(runs, dut(DUT), LoopOptions(held_out=held_out))
    assert (result.verdict, result.effects) == (Verdict.UNTRACED, ())
    assert {item.evidence["run"] for item in result.open} == {name}
    assert f"{name}: left out of the fit, as the others agree without it." in result.warnings
    assert name not in result.model.runs
    for errors in result.equations.values():
        assert errors.held_out is not None
        assert errors.held_out.rms_after < 1.2 * (errors.held_out.floor or 0.0)


# -- readings that are none


def spoiled_torque(spoil: Callable[[NDArray[np.float64]], NDArray[np.float64]]) -> LoopResult:
    runs, held_out = drawn(LOCKED)
    runs = tuple(replace(r, signals={**r.signals, "output_torque": spoil(r.signals["output_torque"])}) for r in runs)
    return trace(runs, dut(), LoopOptions(held_out=held_out))


def spiky(values: NDArray[np.float64]) -> NDArray[np.float64]:
    rng = np.random.default_rng(values.size)
    found = values.copy()
    found[rng.choice(values.size, 20, replace=False)] += np.ptp(values) * rng.choice([-1.0, 1.0], 20)
    return found


def spiky_and_missing(values: NDArray[np.float64]) -> NDArray[np.float64]:
    found = spiky(values)
    found[100] = np.nan
    return found


def lossy(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(np.random.default_rng(values.size).random(values.size) < 0.02, 0.0, values)


def stuck(values: NDArray[np.float64]) -> NDArray[np.float64]:
    found = values.copy()
    found[int(0.4 * values.size) : int(0.6 * values.size)] = values[int(0.4 * values.size)]
    return found


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (spiky, "(spikes, dropouts) were taken as missing: locked-output-01a output_torque (20)"),
        (
            spiky_and_missing,
            "(spikes, dropouts) were taken as missing: locked-output-01a output_torque (20)",
        ),
        (lossy, "(spikes, dropouts) were taken as missing: locked-output-01a output_torque ("),
        (stuck, "or stuck) were masked: locked-output-01a ("),
    ],
)
def test_spikes_dropouts_and_a_sensor_that_sticks_are_masked_and_told_and_change_no_verdict(
    spoil: Callable[[NDArray[np.float64]], NDArray[np.float64]], said: str
) -> None:
    result = spoiled_torque(spoil)
    assert (result.verdict, result.effects) == (Verdict.NONE, ())
    assert any(said in text for text in result.warnings)
    errors = result.equations["output-torque"].held_out
    assert errors is not None
    assert errors.floor is not None
    assert errors.floor < 0.1, "N*m; the sensor's noise is 0.02"


def test_a_run_that_ended_before_anything_moved_is_left_out_and_doubted() -> None:
    runs, held_out = drawn(LOCKED)
    short = replace(
        runs[0], time=runs[0].time[:400], signals={name: values[:400] for name, values in runs[0].signals.items()}
    )
    result = trace([short, *runs[1:]], dut(), LoopOptions(held_out=held_out))
    assert (result.verdict, result.effects) == (Verdict.NONE, ())
    assert f"{short.name}: nothing but noise changes in its 3.99 s, left out. Was it aborted?" in result.warnings
    assert not any("too slowly" in text for text in result.warnings)


def test_where_sweeps_have_no_motor_torque_it_is_said_that_no_shape_was_looked_for() -> None:
    runs, held_out = drawn(LOCKED)
    result = trace([without(run, *DRIVE) for run in runs], dut(), LoopOptions(held_out=held_out))
    said = "Shapes without a name were not looked for: locked-output-01a"
    assert any(text.startswith(said) for text in result.warnings)
    assert result.effects == ()


# -- what the campaign cannot say


def test_a_current_that_stands_in_for_a_dead_motor_torque_is_told_once() -> None:
    both, never = [], []
    for run in (turning_run(name, seed) for seed, name in enumerate("abc")):
        current = {"motor_current": run.signals["motor_torque"] / 0.321}
        both.append(replace(run, signals={**run.signals, **current}))
        others = {name: values for name, values in run.signals.items() if name != "motor_torque"}
        never.append(replace(run, signals={**others, **current}))
    dead = [with_values(run, motor_torque=0.0) for run in both[:2]]
    for mixed, said in (([*dead, both[2]], True), ([*dead, never[2]], True), (never, False)):
        result = trace(mixed, dut(DUT), LoopOptions(held_out=("c",)))
        told = [text for text in result.warnings if text.startswith("Motor torque is")]
        assert told == ["Motor torque is motor_current times torque_constant (0.321 N*m/A) in 2 of 3 runs."] * said


def test_a_torque_that_is_dead_in_every_run_is_told_and_the_campaign_is_traced_without_it() -> None:
    runs, held_out = drawn(LOCKED)
    dead = [replace(run, signals={**run.signals, "output_torque": np.zeros(run.time.size)}) for run in runs]
    result = trace(dead, dut(DUT), LoopOptions(held_out=held_out))
    assert all(any(run.name in text and "stood still" in text for text in result.warnings) for run in dead)


def test_a_temperature_in_kelvin_is_refused_with_what_it_may_be() -> None:
    def warmer(run: Run) -> Run:
        return replace(run, signals={**run.signals, "temperature": run.signals["temperature"] + 273.15})

    with pytest.raises(DataError, match=r"locked-output-03.*temperature reaches 29\d.*kelvin"):
        trace(one_spoiled("locked-output-03", warmer), dut(DUT), LoopOptions())


def test_friction_that_no_fitted_run_shows_is_said_and_not_called_untraced() -> None:
    runs, _ = drawn(ALL_KINDS)
    result = trace(runs, dut(), LoopOptions(held_out=("free-run-*", "locked-output-04")))
    assert any("No run that was fitted has motor-torque in free-run" in text for text in result.warnings)
    assert not [item for item in result.open if "free-run" in str(item.evidence.get("procedure"))]


def test_coulomb_and_viscous_friction_of_runs_at_one_speed_are_not_told_apart() -> None:
    plan = replace(LEAN, locked_angles=0, locked_pairs=0, backdrives=0, backdrive_pairs=0, free_runs=3)
    plan = replace(plan, slow_speed=(30.0, 30.0), fast_speed=(30.0, 30.0))
    runs, held_out = runs_of(Campaign(5, plan=plan, rate=100.0))
    base = trace(runs, dut(), LoopOptions(held_out=held_out)).model.base.parameters
    for name, truth in (("T_c", 0.012), ("b", 1e-4)):
        low, high = base[name].ci95 or (0.0, 0.0)
        assert low < truth < high
        assert high - low > truth


def test_a_base_of_another_drive_is_said() -> None:
    runs, held_out = drawn(LOCKED)
    base = trace(runs, dut(DUT), LoopOptions(held_out=held_out)).model
    named = base.dut.model_copy(update={"name": "OTHER"})
    result = trace(runs, dut(DUT), LoopOptions(held_out=held_out, base=base.model_copy(update={"dut": named})))
    assert any("--base is of another drive (name OTHER, not SHD-17-100)" in text for text in result.warnings)


EACH = Plan(
    locked_angles=4, locked_pairs=1, backdrives=2, backdrive_pairs=1, free_runs=2, free_run_pairs=1, output_turns=1.0
)


@pytest.mark.timeout(300)
@pytest.mark.parametrize(("name", "gain"), [("output_torque", 0.9), ("output_torque", 1.3), ("motor_torque", 1.1)])
def test_a_torque_that_reads_far_too_much_is_the_set_of_both_gains_and_leaves_the_floor(name: str, gain: float) -> None:
    runs, held_out = drawn(EACH, 5)
    read = [scaled(without(run, *({"motor_current"} if name == "motor_torque" else ())), {name: gain}) for run in runs]
    result = trace(read, dut(), LoopOptions(held_out=held_out))
    assert result.effects == ("ambiguous:torque-constant-error|torque-sensor-gain",)
    assert {item.verdict for item in result.open} <= {Verdict.ABSORBED}
    off = gain if name == "output_torque" else 1.0 / gain
    value = result.steps[0].parameters["amplitude"].value
    # whichever of both stands for the set: the sensor reads (1 + a) times, or the motor as much less
    assert min(abs(value - (off - 1.0)), abs(value - (1.0 / off - 1.0))) < 2e-4
    errors = result.equations["motor-torque"].held_out
    assert errors is not None
    backdrive = errors.by_procedure["backdrive"]
    assert backdrive.floor_ci95 is not None
    assert backdrive.rms_after < backdrive.floor_ci95[1] < 0.1 * backdrive.rms_before


@pytest.mark.parametrize("text", [DUT, 'name = "x"\n'])
def test_runs_of_two_gears_are_refused_with_one_of_each(text: str) -> None:
    runs, _ = drawn(FREE)
    other, _ = runs_of(Campaign(12, drive=replace(shd_17_100(), ratio=80.0), plan=FREE, rate=100.0))
    mixed = [replace(run, name=f"{of}-{run.name}") for of, some in (("a", runs), ("b", other)) for run in some]
    with pytest.raises(DataError, match=r"b-free-run-\d.*, a-free-run-\d.*different gears.*80.*100") as caught:
        trace(mixed, dut(text), LoopOptions())
    assert "Give the runs of one drive at a time" in str(caught.value)


@pytest.mark.parametrize(("name", "step"), [("output_torque", 0.5), ("motor_torque", 0.01)])
def test_a_sweep_whose_torque_was_rounded_to_few_steps_is_refused_and_a_finer_one_not(name: str, step: float) -> None:
    runs, _ = drawn(LOCKED)

    def rounded(run: Run, step: float) -> Run:
        return replace(run, signals={**run.signals, name: step * np.round(run.signals[name] / step)})

    with pytest.raises(DataError, match=rf"{name} goes in steps of {step:g} N\*m, \d\d of them in the whole sweep"):
        check_steps([rounded(run, step) for run in runs])
    check_steps([rounded(run, 0.1 * step) for run in runs])
    check_steps(runs)


def test_a_staircase_of_few_torques_is_no_rounded_sweep() -> None:
    run = next(run for run in drawn(LOCKED)[0])
    stairs = 2.0 * np.round(np.sin(0.2 * run.time) * 4.0)
    check_steps([replace(run, signals={**run.signals, "output_torque": stairs})])


def test_held_out_runs_that_test_nothing_that_was_fitted_are_refused() -> None:
    runs, _ = drawn(EACH, 5)
    with pytest.raises(DataError, match="the held-out runs are free-run and none such was fitted"):
        trace(runs, dut(), LoopOptions(held_out=("free-run*",)))


def test_a_motor_torque_that_is_another_number_of_amperes_in_one_run_is_told_with_both() -> None:
    runs, held_out = drawn(EACH, 5)
    odd = [scaled(run, {"motor_torque": 2.0}) if run.name == "free-run-02" else run for run in runs]
    result = trace(odd, dut(), LoopOptions(held_out=held_out))
    (text,) = [text for text in result.warnings if "in most other runs" in text]
    assert text.startswith("free-run-02: motor_torque is 0.642 N*m for 1 A of motor_current, in most other runs 0.321")


def test_an_angle_rounded_coarser_than_its_counts_makes_no_event() -> None:
    runs, held_out = drawn(EACH, 5)
    angle = "output_position"
    rounded = [replace(run, signals={**run.signals, angle: np.round(run.signals[angle], 4)}) for run in runs]
    result = trace(rounded, dut(), LoopOptions(held_out=held_out))
    assert all(item.verdict is not Verdict.UNCONTROLLED for item in result.open)

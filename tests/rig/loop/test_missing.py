"""Rows that a log lacks, channels slower than the log, torques that are cut off."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from rig.log.run import Run
from rig.loop.campaign import LoopOptions
from rig.loop.result import LoopResult, Verdict
from rig.loop.signals.missing import filled, known_between, missing_times, read_together, unheld
from rig.loop.signals.saturation import cut_off
from rig.loop.signals.tracks import make_track
from rig.loop.trace import trace
from tests.independent.campaign import Campaign, Plan
from tests.independent.effects import Effects, Line
from tests.rig.loop.runs import dut, make_run, runs_of, turning_run

LOCKED = Plan(locked_angles=6, locked_pairs=1, backdrives=0, free_runs=0)
FREE = Plan(locked_angles=0, locked_pairs=0, backdrives=0, free_runs=4, free_run_pairs=1)
KINEMATIC = Effects(kinematic_error=(Line(2.0, 1e-4, 0.3),))
Flags = NDArray[np.bool_]


def rows(run: Run, keep: Flags) -> Run:
    return replace(run, time=run.time[keep], signals={name: v[keep] for name, v in run.signals.items()})


def without_rows(run: Run, share: float, seed: int) -> Run:
    keep = np.random.default_rng(seed).random(run.time.size) >= share
    keep[[0, -1]] = True
    return rows(run, keep)


def with_gap(run: Run) -> Run:
    keep = np.ones(run.time.size, dtype=bool)
    keep[run.time.size // 3 : run.time.size // 2] = False
    return rows(run, keep)


def slower(run: Run, step: int) -> Run:
    return rows(run, np.arange(run.time.size) % step == 0)


def held(run: Run, name: str, step: int) -> Run:
    place = np.arange(run.time.size) // step * step
    return replace(run, signals={**run.signals, name: run.signals[name][place]})


def lacking(run: Run, name: str, step: int) -> Run:
    there = np.arange(run.time.size) % step == 0
    return replace(run, signals={**run.signals, name: np.where(there, run.signals[name], np.nan)})


def traced(runs: list[Run], held_out: tuple[str, ...]) -> LoopResult:
    return trace(runs, dut(), LoopOptions(held_out=held_out))


# -- what the parts do


def test_the_rows_that_are_missing_are_found_from_the_logs_own_clock() -> None:
    time = np.arange(0.0, 2.0, 0.01)
    keep = np.ones(time.size, dtype=bool)
    keep[[7, 50, 51, 120]] = False
    assert np.sort(missing_times(time[keep])) == pytest.approx(time[~keep], abs=1e-9)


@pytest.mark.parametrize("time", [np.geomspace(0.1, 10.0, 500), np.cumsum(np.random.default_rng(1).random(500))])
def test_a_log_that_no_clock_sampled_lacks_no_rows(time: NDArray[np.float64]) -> None:
    assert missing_times(time).size == 0


def test_rows_that_are_there_stay_as_they_are_and_the_others_are_not_usable() -> None:
    run = turning_run("a", 1)
    track = make_track(without_rows(run, 0.4, 1), dut())
    there = np.isin(track.time, without_rows(run, 0.4, 1).time)
    assert track.size == run.time.size
    assert not track.usable[~there].any()
    assert track.usable[there].all()


@pytest.mark.parametrize(("procedure", "swept"), [("backdrive", "output_torque"), ("locked-output", "motor_torque")])
@pytest.mark.parametrize("whole_rows", [False, True])
def test_after_a_gap_a_sweep_counts_again_once_its_torque_has_moved_a_quarter_of_its_range(
    procedure: str, swept: str, whole_rows: bool
) -> None:
    time = np.arange(0.0, 40.0, 0.01)
    rng = np.random.default_rng(1)
    torque = np.interp(time, [0, 10, 30, 40], [0, 8, -8, 0]) + 1e-3 * rng.standard_normal(time.size)
    signals = {swept: torque, "motor_position": 1e-5 * rng.standard_normal(time.size)}
    gap = (time > 8.0) & (time < 14.0)
    run = make_run("a", procedure, time, {**signals, swept: np.where(gap, np.nan, torque)})
    track = make_track(rows(run, ~gap) if whole_rows else run, dut())
    # 4.8 N*m at the end of the gap, less a quarter of 14.4 N*m, is reached at 18.5 s
    assert not track.usable[(track.time > 8.0) & (track.time < 18.4)].any()
    assert track.usable[(track.time <= 8.0) | (track.time > 18.6)].all()


def test_a_channel_that_is_held_between_readings_is_its_readings() -> None:
    noisy = np.random.default_rng(1).standard_normal(100)
    found = unheld(np.repeat(noisy, 5))
    assert found[::5] == pytest.approx(noisy)
    assert np.isnan(found[1::5]).all()


def test_an_encoder_that_turns_slowly_is_not_held() -> None:
    counts = np.floor(np.arange(1000) / 5.0) * 1e-4
    assert np.array_equal(unheld(counts), counts)


def test_a_slow_channel_is_known_between_its_readings_but_not_where_one_is_lost() -> None:
    good = np.arange(100) % 5 == 0
    good[50] = False
    known = known_between(good)
    assert known[:46].all()
    assert known[56:96].all()
    assert known_between(np.arange(100) != 50).sum() == 99


def test_a_sweep_keeps_the_rows_in_which_its_slowest_channel_was_read() -> None:
    run = held(turning_run("a", 1), "output_torque", 4)
    assert read_together(run, ("motor_position", "output_torque")).time == pytest.approx(run.time[::4])


def test_a_noisy_torque_that_repeats_its_largest_value_is_cut_off() -> None:
    run = turning_run("a", 1)
    torque = run.signals["motor_torque"]
    cut = cut_off(replace(run, signals={**run.signals, "motor_torque": np.clip(torque, -0.0115, 1.0)}))
    assert set(cut) == {"motor_torque"}
    # chance breaks a stretch where the noise comes back from beyond the end of the range
    assert torque[cut["motor_torque"]].max() < -0.0115
    assert cut["motor_torque"].sum() > 0.9 * (torque < -0.0115).sum()


def test_a_commanded_torque_that_rests_between_ramps_has_not_stuck() -> None:
    time = np.arange(3000) * 0.01
    torque = np.interp(time, [0.0, 8.0, 12.0, 20.0, 22.0, 30.0], [0.0, 4.0, 4.0, 9.0, 9.0, 0.0])
    flags = cut_off(make_run("a", "locked-output", time, {"motor_torque": torque})).get("motor_torque")
    assert flags is None or not flags[800:1200].any()


def test_a_quantised_torque_that_is_held_at_its_peak_is_not_cut_off() -> None:
    time = np.arange(0.0, 20.0, 0.01)
    torque = np.round(np.interp(time, [0, 5, 10, 20], [0, 10, 10, -10]), 1)
    assert cut_off(make_run("a", "locked-output", time, {"output_torque": torque})) == {}


# -- what comes out


@pytest.mark.parametrize("change", ["5 %", "40 %", "one gap", "rates", "held", "NaN"])
def test_sweeps_with_missing_rows_or_slow_channels_show_no_effect_and_no_leak(change: str) -> None:
    runs, held_out = runs_of(Campaign(2001, plan=LOCKED, rate=100.0))
    changes = {
        "5 %": lambda k, run: without_rows(run, 0.05, k),
        "40 %": lambda k, run: without_rows(run, 0.40, k),
        "one gap": lambda _, run: with_gap(run),
        "rates": lambda k, run: slower(run, 5) if k % 2 else run,
        "held": lambda _, run: held(run, "output_torque", 5),
        "NaN": lambda _, run: lacking(run, "output_torque", 5),
    }
    result = traced([changes[change](k, run) for k, run in enumerate(runs)], held_out)
    assert (result.verdict, result.effects) == (Verdict.NONE, ())


@pytest.mark.parametrize("share", [0.05, 0.4])
def test_a_kinematic_error_is_found_in_logs_that_lack_rows(share: float) -> None:
    runs, held_out = runs_of(Campaign(2001, effects=KINEMATIC, plan=FREE, rate=100.0))
    result = traced([without_rows(run, share, k) for k, run in enumerate(runs)], held_out)
    assert result.effects == ("kinematic-error",)
    assert result.steps[0].parameters["order"].value == pytest.approx(2.0, abs=1e-3)
    assert result.steps[0].parameters["amplitude"].value == pytest.approx(1e-4, rel=0.05)


def test_a_motor_torque_cut_off_at_its_range_is_masked_said_and_no_effect() -> None:
    runs, held_out = runs_of(Campaign(2001, plan=LOCKED, rate=100.0))
    cut = [clipped(run, 0.7) for run in runs]
    result = traced(cut, held_out)
    assert (result.verdict, result.effects) == (Verdict.NONE, ())
    (warning,) = [text for text in result.warnings if text.startswith("Saturated")]
    assert all(run.name in warning for run in runs)


def clipped(run: Run, share: float) -> Run:
    torque = run.signals["motor_torque"]
    most = share * float(np.abs(torque).max())
    return replace(run, signals={**run.signals, "motor_torque": np.clip(torque, -most, most)})


@pytest.mark.parametrize("device", ["known", "unknown"])
def test_motor_current_and_position_alone_show_cogging(device: str) -> None:
    runs = []
    for seed, name in enumerate("abcd"):
        run = turning_run(name, seed, speed=19.0 + seed)
        angle = run.signals["motor_position"]
        current = (run.signals["motor_torque"] + 2e-3 * np.sin(14 * angle + 1.0)) / 0.321
        runs.append(make_run(name, "free-run", run.time, {"motor_position": angle, "motor_current": current}))
    result = trace(runs, dut() if device == "known" else dut('name = "x"\n'), LoopOptions(held_out=("d",)))
    (step,) = result.steps
    assert "cogging" in (step.effect, *step.members)
    assert step.lines[0].order == pytest.approx(14.0, abs=1e-3)
    # without a torque constant the equation is one of the current, in A
    assert (step.equation, step.lines[0].amplitude) == (
        ("motor-torque", pytest.approx(2e-3, rel=0.05))
        if device == "known"
        else ("motor-current", pytest.approx(2e-3 / 0.321, rel=0.05))
    )


def test_filling_changes_nothing_in_a_log_that_lacks_nothing() -> None:
    run = turning_run("a", 1)
    assert filled(run) is run

"""Parts of the loop against closed forms."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from drivers.errors import DataError
from rig.log.run import Run
from rig.loop.campaign import LoopOptions, split_runs
from rig.loop.fitting.base import start_model
from rig.loop.fitting.normal import correlation_length, solve
from rig.loop.model.equations import Equation, distinct_readings, pieces_of
from rig.loop.model.evaluation import Added
from rig.loop.model.frames import turned
from rig.loop.model.parameters import flexspline_from_catalogue
from rig.loop.model.prediction import predict
from rig.loop.model.shapes import CORNERS, SWEPT_TORQUE, ShapeTerm, addition
from rig.loop.model.terms import Entry, Line, TermClass, line_values, periodic_effects
from rig.loop.signals.play import play_path
from rig.loop.signals.tracks import make_track, thin_track
from sim_backend.model.arrays import evaluate
from sim_backend.model.compliance import Compliance
from sim_backend.model.effects import CATALOGUE
from tests.rig.loop.runs import dut, make_run, turning_run
from tests.slopes import evaluate_slope

Floats = NDArray[np.float64]


def test_the_catalogue_gives_the_worked_stiffness_of_the_paper() -> None:
    K_F0, C_F = flexspline_from_catalogue(8.4e3, 9.4e3, 3.9, 12.0)
    assert pytest.approx(8335.98, abs=0.01) == K_F0
    assert pytest.approx(0.044940, abs=1e-6) == C_F


def test_a_play_is_known_only_after_it_has_slipped_from_either_start() -> None:
    path = play_path(np.array([0.0, 0.5, 1.5, 3.0, 2.0, 0.0]), 1.0)
    # from 0: rests, rests, 0.5, 2, rests, 1; a start at the other wall joins once the input has moved 2 radii
    assert path.output.tolist() == [0.0, 0.0, 0.5, 2.0, 2.0, 1.0]
    assert path.settled.tolist() == [False, False, False, True, True, True]
    assert path.side[-1] == -1.0


def test_a_thinned_play_keeps_the_peaks_that_its_input_had_in_between() -> None:
    inputs = np.array([0.0, 1.0, 2.0, 3.0, 5.0, 3.0, 2.5, 2.4, 2.3])
    path = play_path(inputs, 1.0, fine=3)
    # sample by sample: 0 0 1 | 2 4 4 | 3.5 3.4 3.3
    assert path.output == pytest.approx([1 / 3, 10 / 3, 3.4])
    assert path.slip.tolist() == [0, 1, 2]


def swept_torque_and_lag(time, lag):
    """Give a torque that rises at 4 N*m/s from 1 s to 2 s and rests, and its first-order lag in closed form."""
    up, down = np.maximum(time - 1.0, 0.0), np.maximum(time - 2.0, 0.0)
    behind = [after - lag * (1.0 - np.exp(-after / lag)) for after in (up, down)]
    return 4.0 * (up - down), 4.0 * (behind[0] - behind[1])


@pytest.mark.parametrize("late", [0.02, 0.0203], ids=["whole samples", "a part of a sample"])
@pytest.mark.parametrize("fine", [1, 20])
def test_a_late_torque_is_set_right_at_its_corners_too(fine, late) -> None:
    time = np.arange(3000) * 1e-3
    truth, lagged = swept_torque_and_lag(time, late)
    delayed, _ = swept_torque_and_lag(time - late, late)
    for effect, reading, within in (("channel-delay", delayed, 2e-3), ("torque-sensor-lag", lagged, 0.14)):
        wrong = (reading - truth).reshape(-1, fine).mean(axis=1)
        signals = {"output_torque": reading.reshape(-1, fine).mean(axis=1), SWEPT_TORQUE: reading}
        found = addition(ShapeTerm(CATALOGUE[effect], (late,)), signals, 1e-3 * fine)
        assert found == pytest.approx(wrong, abs=within * 4.0 * late), effect
        assert found.sum() == pytest.approx(wrong.sum(), rel=1e-9), effect
        assert np.abs(wrong).max() == pytest.approx(4.0 * late, rel=0.1)


def test_what_rings_does_so_when_the_torque_had_its_corner_and_not_when_a_late_reading_shows_it() -> None:
    time, late = np.arange(3000) * 1e-3, 0.02
    truth, _ = swept_torque_and_lag(time, late)
    delayed, _ = swept_torque_and_lag(time - late, late)
    signals = {"output_torque": delayed, SWEPT_TORQUE: delayed, CORNERS: delayed}
    terms = (ShapeTerm(CATALOGUE["channel-delay"], (late,)), ShapeTerm(CATALOGUE["torque-sensor-offset"], (0.3,)))
    assert Added((), terms, 1e-3, 100.0).corners(signals)[CORNERS] == pytest.approx(truth, abs=1e-9)
    assert Added((), terms[1:], 1e-3, 100.0).corners(signals)[CORNERS] == pytest.approx(delayed, abs=1e-12)


@pytest.mark.parametrize("kind", periodic_effects(), ids=lambda kind: kind.id)
def test_a_line_is_the_function_of_its_catalogue_effect(kind) -> None:
    effect = CATALOGUE[kind.effect]
    order = kind.fixed_order or 3.3
    line = Line(kind, order, 0.5 * math.cos(0.7), 0.5 * math.sin(0.7))
    angle = np.linspace(-9.0, 9.0, 301)
    given = {"amplitude": 0.5 * effect_scale(effect), "order": order, "phase": 0.7}
    values = [given[parameter.name] for parameter in effect.parameters]
    torque = np.cos(angle) + 2.0
    signals = dict.fromkeys(effect.signals, torque) | {kind.variable: angle}
    expected = evaluate(effect, signals, values) / effect_scale(effect)
    factor = torque if len(effect.signals) > 1 else 1.0
    assert np.allclose(factor * line_values(line, angle).value, expected, atol=1e-12)
    if effect.slope is not None:
        slope = evaluate_slope(effect, signals, values) / effect_scale(effect)
        of_torque = 0.5 * factor if len(effect.signals) > 1 else 1.0
        assert np.allclose(of_torque * line_values(line, angle).slope, slope, atol=1e-12)


def effect_scale(effect) -> float:
    return float(next(p.typical for p in effect.parameters if p.name == effect.amplitudes[0]))


def test_white_noise_has_a_correlation_length_of_one_sample() -> None:
    assert correlation_length(np.random.default_rng(0).standard_normal(20_000)) == pytest.approx(1.0, abs=0.2)


def test_ar1_noise_has_its_closed_form_correlation_length() -> None:
    rng = np.random.default_rng(1)
    noise = np.zeros(200_000)
    for k, step in enumerate(rng.standard_normal(noise.size - 1)):
        noise[k + 1] = 0.9 * noise[k] + step
    # (1 + a)/(1 - a); a sum up to the first zero of an estimate scatters by a few per cent
    assert correlation_length(noise) == pytest.approx(19.0, rel=0.15)


def test_a_direction_without_information_stays_where_it_is() -> None:
    A = np.diag([4.0, 0.0, 2.0])
    assert solve(A, np.array([8.0, 0.0, 3.0])).tolist() == pytest.approx([2.0, 0.0, 1.5])


def test_legs_of_constant_speed_are_found_and_their_ends_cut() -> None:
    track = make_track(turning_run("a", 0, speed=20.0), dut())
    assert set(np.round(np.unique(track.speed)).tolist()) == {-20.0, 0.0, 20.0}
    forward = track.time[track.speed > 0]
    # the leg lasts from 1.2 to 12 s; 0.2 s are cut at each end
    assert 1.3 < forward[0] < 1.7
    assert 11.5 < forward[-1] < 11.9


def test_rotation_same_gives_the_torsion_of_rotation_opposed() -> None:
    opposed = turning_run("a", 0)
    mirrored = {k: (-v if k.startswith("motor") else v) for k, v in opposed.signals.items()}
    same = make_run("a", "free-run", opposed.time, mirrored)
    text = 'name = "x"\n[gear]\nratio = 100\nrotation = "{}"\n'
    one = pieces_of(make_track(opposed, dut(text.format("opposed"))), 100.0)
    two = pieces_of(make_track(same, dut(text.format("same"))), 100.0)
    assert [piece.equation for piece in one] == [piece.equation for piece in two]
    assert all(np.array_equal(a.target, b.target) for a, b in zip(one, two, strict=True))


@pytest.mark.parametrize("variable", ["motor_position", "output_position"])
@pytest.mark.parametrize("entry", Entry)
def test_a_line_adds_the_same_in_the_frame_of_the_log_and_in_that_of_computing(entry: Entry, variable: str) -> None:
    rng = np.random.default_rng(4)
    angle, motion, motor_torque = rng.uniform(-9.0, 9.0, 50), np.sign(rng.standard_normal(50)), rng.standard_normal(50)
    line = Line(TermClass(None, entry, variable), 3.0, 0.7, -0.4)
    same = dut('name = "x"\n[gear]\nratio = 100\nrotation = "same"\n')
    of_motor = -1.0 if variable == "motor_position" else 1.0

    def added(of: Line, x: Floats, sign: float) -> Floats:
        times = {
            Entry.MOTOR_AGAINST_MOTION: sign * motion,
            Entry.OUTPUT_AGAINST_MOTION: sign * motion,
            Entry.MOTOR_TIMES_TORQUE: sign * motor_torque,
        }
        value = of.sine * np.sin(of.order * x) + of.cosine * np.cos(of.order * x)
        return np.asarray(times.get(entry, 1.0) * value)

    at_motor = entry in (Entry.MOTOR, Entry.MOTOR_ANGLE, Entry.MOTOR_TIMES_TORQUE, Entry.MOTOR_AGAINST_MOTION)
    in_log = added(turned(line, same), of_motor * angle, -1.0)
    assert np.allclose(in_log, (-1.0 if at_motor else 1.0) * added(line, angle, 1.0))
    again = turned(turned(line, same), same)
    assert [again.sine, again.cosine] == pytest.approx([line.sine, line.cosine])


def test_replicates_are_held_out_together() -> None:
    runs = [make_run(name, "free-run", np.arange(3.0), {}, replicate=group) for name, group in
            (("a", "g"), ("b", "g"), ("c", None))]  # fmt: skip
    campaign = split_runs(runs, LoopOptions(held_out=("a*",)))
    assert [run.name for run in campaign.held_out] == ["a", "b"]
    assert split_runs(runs, LoopOptions(held_out=("some/folder/a*",))).held_out == campaign.held_out
    assert any("Replicates stay on one side" in warning for warning in campaign.warnings)


def test_a_drawn_split_takes_from_every_procedure_and_repeats_with_its_seed() -> None:
    runs = [make_run(f"{p}-{k}", p, np.arange(3.0), {}) for p in ("free-run", "backdrive") for k in range(4)]
    one, two = (split_runs(runs, LoopOptions(seed=3)) for _ in range(2))
    assert [run.name for run in one.held_out] == [run.name for run in two.held_out]
    assert {run.procedure.value for run in one.held_out} == {"free-run", "backdrive"}


@pytest.mark.parametrize("seed", range(6))
def test_what_alone_went_slow_far_or_warm_is_fitted_and_not_drawn(seed: int) -> None:
    """A further run at a rate of its own, as the next experiment asks for, would settle nothing if it were held out."""
    time = np.arange(600) * 0.1

    def sweep(name: str, peak: float, turns: float, degrees: float) -> Run:
        torque = peak * np.sin(2.0 * np.pi * turns * time / time[-1])
        return make_run(name, "locked-output", time, {"output_torque": torque, "temperature": np.full(600, degrees)})

    def spin(name: str, speed: float) -> Run:
        return make_run(name, "free-run", time, {"motor_position": speed * time})

    usual = [sweep(f"usual-{k}", 10.0 + 0.1 * k, 4.0, 22.0) for k in range(4)]
    lone = [sweep("slow", 10.0, 0.5, 22.0), sweep("far", 20.0, 2.0, 22.0), sweep("warm", 10.0, 4.0, 35.0)]
    runs = [*usual, *lone, spin("crawls", 2.0), *(spin(f"turns-{k}", 20.0 + k) for k in range(3))]
    held_out = {run.name for run in split_runs(runs, LoopOptions(seed=seed)).held_out}
    assert len(held_out) == 3
    assert held_out.isdisjoint({"slow", "far", "warm", "crawls"})


def test_two_runs_of_one_name_are_refused() -> None:
    runs = [make_run("a", "free-run", np.arange(3.0), {}) for _ in range(2)]
    with pytest.raises(DataError, match="two runs have this name"):
        split_runs(runs, LoopOptions())


def test_the_sample_that_stands_for_equal_readings_is_neither_early_nor_late() -> None:
    """Else every torque would seem to come half a sample beside the angle."""
    time = np.arange(400) * 0.01
    reading = 1e-4 * (np.arange(400) // 2)
    signals = {"motor_position": 1e-3 * reading, "output_position": reading, "output_torque": 4.0 * time}
    track = make_track(make_run("r", "locked-output", time, signals), dut())
    piece = next(piece for piece in pieces_of(track, 100.0) if piece.equation is Equation.TORSION)
    chosen = distinct_readings(piece).index
    assert chosen.size == 200
    # pairs begin at the even samples: their middle is half a sample later
    assert np.mean(chosen - (2 * np.arange(200) + 0.5)) == pytest.approx(0.0, abs=1e-12)


def test_a_gap_that_is_crossed_within_a_sample_of_means_counts_by_the_mean_of_its_law() -> None:
    time = np.arange(4000) * 1e-3
    torque = 0.1 * np.sin(2.0 * np.pi * 0.5 * time)
    signals = {"motor_position": 0.2 * torque, "output_position": np.zeros(4000), "motor_torque": torque}
    track = thin_track(make_track(make_run("r", "locked-output", time, signals), dut()))
    piece = next(piece for piece in pieces_of(track, 100.0) if piece.equation is Equation.TORSION)
    gap = ShapeTerm(CATALOGUE["backlash"], (2e-3, 1e-3, 100.0))
    plain = start_model(dut(), 100.0, Compliance.ARCTAN, None)
    added = predict(piece, replace(plain, shapes=(gap,))).value - predict(piece, plain).value
    factor = 4000 // track.size
    expected = (2e-5 * np.clip(torque / 1e-3, -1.0, 1.0)).reshape(-1, factor).mean(axis=1)
    crossing = (np.abs(expected) > 1e-7) & (np.abs(expected) < 1.99e-5)
    assert crossing.sum() >= 4
    assert added == pytest.approx(expected, abs=5e-7)


def test_a_free_run_takes_the_mean_of_what_its_torque_reading_is_wrong_by() -> None:
    """N*m at the motor: friction + (mean reading - mean error) / N; the torque of a drive that turns freely is one."""
    noise = 0.02 * np.random.default_rng(3).standard_normal(2400)
    run = turning_run("free-run-01", 1)
    drift = 1e-3 * run.time
    further = {"output_torque": noise + 0.4 + drift, "temperature": np.full(run.time.size, 25.0)}
    run = replace(run, signals={**run.signals, **further})
    track = make_track(run, dut())
    (piece,) = [p for p in pieces_of(track, 100.0) if p.equation is Equation.MOTOR_TORQUE]
    start = start_model(dut(), 100.0, Compliance.ARCTAN, None)
    effect = CATALOGUE["torque-sensor-drift"]
    given = {"per_kelvin": 0.0, "per_second": 1e-3, "reference": 25.0}
    term = ShapeTerm(effect, tuple(given[parameter.name] for parameter in effect.parameters))
    without, with_it = (predict(piece, replace(start, shapes=shapes)) for shapes in ((), (term,)))
    fell = without.value - with_it.value
    assert fell == pytest.approx(np.full(fell.size, float(drift[: track.size].mean()) / 100.0), abs=1e-6)


def test_a_turning_run_follows_the_corners_of_the_load_that_was_held() -> None:
    """Averaged over a share of a turn, a load is wrong by 0.8 N*m around the ramps from one level to the next."""
    run = turning_run("free-run-00", 5, speed=2.0)
    load = np.interp(run.time, [0.0, 4.0, 5.0, 16.0, 17.0, 24.0], [0.0, 0.0, 6.0, 6.0, -11.0, -11.0])
    loaded = replace(run, signals=dict(run.signals) | {"output_torque": run.signals["output_torque"] + load})
    track = make_track(loaded, dut())
    assert track.T is not None
    assert track.moves
    assert np.abs(track.T - load).max() < 0.02
    assert np.std(track.T - load) < 0.005

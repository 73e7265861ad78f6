"""Shapes without a formula: what they compute, and that the loop finds physics which no effect of the catalogue has."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest
from numpy.typing import NDArray

from drivers.errors import ConfigError, DataError
from rig.log.run import ProcedureName, Run
from rig.loop.campaign import LoopOptions
from rig.loop.files.model_file import Model as ModelFile
from rig.loop.files.model_file import ModelBase, ModelEffect, ModelEstimate
from rig.loop.files.model_storage import load_model, write_model
from rig.loop.fitting.base import start_model
from rig.loop.model.curves import SHAPES, TURNING_LOAD, WITHOUT_KNOTS, Curve, Form, basis, curve_of, mirrored, zero_of
from rig.loop.model.equations import Equation, pieces_of
from rig.loop.model.prediction import Model, predict
from rig.loop.model.shapes import ShapeTerm, units_of
from rig.loop.model.terms import entry_of
from rig.loop.predict import predict_run
from rig.loop.result import LoopResult, Verdict
from rig.loop.search.shape_trials import ShapeTrial
from rig.loop.search.trial import Trial
from rig.loop.search.unknown import time_last
from rig.loop.signals.tracks import make_track
from rig.loop.trace import trace
from sim_backend.model.compliance import Compliance
from sim_backend.model.effects import CATALOGUE, Enters, Shape
from tests.independent.campaign import Campaign, Plan
from tests.rig.loop.runs import dut, runs_of

pytestmark = pytest.mark.xdist_group("curves")  # what was traced is shared

Floats = NDArray[np.float64]
STEP = 0.01
TIME = np.arange(0.0, 40.0, STEP)
TORQUE = 10.0 * np.sin(0.4 * TIME) + 3.0 * np.sin(1.1 * TIME)
SIGNALS = {"output_torque": TORQUE, "temperature": 20.0 + TIME, "motor_position": 3.0 * TIME}


def start() -> Model:
    return start_model(dut(), 100.0, Compliance.ARCTAN, None)


def curve(form: Form, at: tuple[float, ...] = (), variable: str = "output_torque", factor: str = "") -> Curve:
    zero = zero_of(at, Enters.TORSION, factor) if form is Form.CURVE else -1
    return Curve(Enters.TORSION, variable, form, factor, len(at), zero)


def test_a_curve_is_the_polyline_through_its_knots_and_zero_at_the_knot_nearest_to_zero() -> None:
    at = (-12.0, -5.0, 1.0, 6.0, 11.0)
    values = np.array([3.0, -1.0, 2.0, 0.5])
    found = basis(curve(Form.CURVE, at), at, SIGNALS, STEP) @ values
    assert np.allclose(found, np.interp(TORQUE, at, [3.0, -1.0, 0.0, 2.0, 0.5]), atol=1e-12)


def test_a_curve_of_what_has_no_zero_may_be_a_constant() -> None:
    at = (20.0, 60.0)
    one = curve(Form.CURVE, at, "temperature")
    assert [p.name for p in one.parameters if not p.known] == ["value_1", "value_2"]
    found = basis(one, at, SIGNALS, STEP) @ np.array([3.0, 3.0])
    assert np.allclose(found, 3.0, atol=1e-12)
    assert curve(Form.CURVE, (-20.0, 60.0), "temperature").amplitudes == ("value_2",)


def test_a_curve_times_a_factor_is_multiplied_and_a_friction_by_its_size() -> None:
    at = (-20.0, 60.0)
    plain = basis(curve(Form.CURVE, at, "temperature"), at, SIGNALS, STEP)
    times = curve(Form.CURVE, at, "temperature", "output_torque")
    assert np.allclose(basis(times, at, SIGNALS, STEP), plain * TORQUE[:, None])
    friction = replace(times, enters=Enters.FRICTION)
    assert np.allclose(basis(friction, at, SIGNALS, STEP), plain * np.abs(TORQUE)[:, None])


def test_an_angle_times_the_torque_changes_with_its_variable_as_a_constant_is_the_flexspline_s_own() -> None:
    at = (20.0, 40.0, 60.0)
    times = curve(Form.CURVE, at, "temperature", "output_torque")
    assert times.amplitudes == ("value_1", "value_3")
    found = basis(times, at, SIGNALS, STEP) @ np.array([-1.0, 1.0])
    assert np.allclose(found, TORQUE * (SIGNALS["temperature"] - 40.0) / 20.0)
    assert zero_of(at, Enters.FRICTION, "output_torque") == -1


def test_a_level_of_friction_times_the_load_while_turning_is_nothing_where_the_motor_is_held() -> None:
    runs, _ = runs_of(Campaign(3, plan=SMALL, rate=100.0))
    law = Curve(Enters.FRICTION, "temperature", Form.CURVE, TURNING_LOAD, 2)
    for run in runs:
        track = make_track(run, dut())
        warm = replace(track, auxiliary={"temperature": np.full(track.size, 30.0)})
        for piece in pieces_of(warm, 100.0):
            signals = predict(piece, start()).signals
            (added,) = basis(law, (20.0, 40.0), signals, track.step)[:, :1].T
            held = run.procedure is ProcedureName.BACKDRIVE
            assert np.allclose(added, 0.0 if held else 0.5 * np.abs(signals["output_torque"]))


def test_a_rate_is_the_derivative_and_its_size() -> None:
    found = basis(curve(Form.RATE), (), SIGNALS, STEP)
    exact = 4.0 * np.cos(0.4 * TIME) + 3.3 * np.cos(1.1 * TIME)
    inner = slice(20, -20)
    assert np.allclose(found[inner, 0], exact[inner], atol=2e-2)
    assert np.allclose(found[inner, 1], np.abs(exact[inner]), atol=2e-2)


def test_a_rate_keeps_the_corners_of_a_polyline_and_takes_nearly_the_mean_of_both_sides_of_a_noise() -> None:
    corners, heights = (0.0, 8.0, 12.0, 26.0, 40.0), (0.0, 4.0, 4.0, -3.0, 4.0)
    swept = np.interp(TIME, corners, heights)
    (found,) = basis(curve(Form.RATE), (), {"output_torque": swept}, STEP)[:, :1].T
    exact = np.diff(heights) / np.diff(corners)
    away = np.min([np.abs(TIME - corner) for corner in corners[1:-1]], axis=0) > 1.5 * STEP
    assert np.allclose(found[away], exact[np.searchsorted(corners[1:-1], TIME)][away], atol=1e-9)
    noise = np.random.default_rng(1).standard_normal(TIME.size)
    (noisy,) = basis(curve(Form.RATE), (), {"output_torque": noise}, STEP)[:, :1].T
    assert noisy.std() < 1.2 * np.sqrt(2.0) / 0.2  # of the difference over both sides


def test_a_lag_of_a_ramp_is_its_rate_times_the_time_constant() -> None:
    ramp = {"output_torque": 2.0 * TIME}
    found = basis(curve(Form.LAG, (0.5,)), (0.5,), ramp, STEP)
    assert found[-1, 0] == pytest.approx(2.0 * 0.5, rel=0.02)  # sampled: half a step of the ramp short


def test_a_peak_is_the_largest_size_so_far_and_that_times_the_signal() -> None:
    found = basis(curve(Form.PEAK), (), SIGNALS, STEP)
    assert found[-1, 0] == np.abs(TORQUE).max()
    assert found[-1, 1] == pytest.approx(np.abs(TORQUE).max() * TORQUE[-1])


def test_a_play_of_a_closed_cycle_is_as_wide_as_twice_its_radius() -> None:
    cycle = {
        "output_torque": np.concatenate([np.linspace(0, 8, 400), np.linspace(8, -8, 800), np.linspace(-8, 8, 800)])
    }
    (found,) = basis(curve(Form.PLAY, (2.0,)), (2.0,), cycle, STEP).T
    falling, rising = (
        np.interp(0.0, *np.array([cycle["output_torque"][500:1100], found[500:1100]])[:, ::-1]),
        found[1600],
    )
    assert falling - rising == pytest.approx(4.0, abs=0.1)


def test_a_wave_is_a_line_of_the_angle_times_size_and_square_of_the_factor() -> None:
    wave = Curve(Enters.TORSION, "motor_position", Form.WAVE, "output_torque", 1)
    found = basis(wave, (2.0,), SIGNALS, STEP) @ np.array([0.0, 0.0, math.cos(0.3), math.sin(0.3)])
    assert np.allclose(found, TORQUE**2 * np.sin(2.0 * SIGNALS["motor_position"] + 0.3))


AT = {Form.CURVE: (-8.0, -1.0, 4.0), Form.PLAY: (1.0, 3.0), Form.LAG: (0.2, 2.0), Form.WAVE: (2.0,)}


@pytest.mark.parametrize("form", Form)
def test_a_mirrored_curve_of_the_mirrored_signal_is_the_mirrored_addition(form: Form) -> None:
    at = AT.get(form, ())
    variable, factor = ("motor_position", "output_torque") if form is Form.WAVE else ("output_torque", "")
    one = curve(form, at, variable, factor)
    fitted = np.arange(1.0, 1.0 + sum(not p.known for p in one.parameters))
    every = np.zeros(len(one.parameters))
    every[[k for k, p in enumerate(one.parameters) if not p.known]] = fitted
    every[: len(at)] = at
    other, values = mirrored(one, every.tolist(), variable=True, added=True)
    known = [v for v, p in zip(values, other.parameters, strict=True) if not p.known]
    turned = {**SIGNALS, variable: -SIGNALS[variable]}
    here = basis(one, at, SIGNALS, STEP) @ fitted
    assert np.allclose(basis(other, values[: other.knots], turned, STEP) @ np.array(known), -here, atol=1e-9)


@pytest.mark.parametrize("form", Form)
def test_a_curve_is_known_again_from_the_names_in_a_model_file(form: Form) -> None:
    at = AT.get(form, ())
    variable, factor = ("motor_position", "output_torque") if form is Form.WAVE else ("output_torque", "")
    one = curve(form, at, variable, factor)
    known = dict(zip((p.name for p in one.parameters), at, strict=False))
    values = {p.name: known.get(p.name, 0.0 if p.known else 1.0) for p in one.parameters}
    assert curve_of(one.id, one.place, values.keys(), values) == one
    assert (form in WITHOUT_KNOTS) == (not at)
    assert form in SHAPES


def test_what_follows_a_recorded_signal_nearly_as_well_as_the_time_is_taken_first() -> None:
    def trial(variable: str, gain: float) -> ShapeTrial:
        one = curve(Form.CURVE, (1.0, 2.0), variable)
        shape = Trial(one.id, gain, 1.0, 2, np.zeros(2), {}, 1.0, 1.0)
        return ShapeTrial(ShapeTerm(one, (1.0, 2.0, 0.0, 0.0)), shape, 1.0)

    near = [trial("time", 100.0), trial("temperature", 96.0), trial("supply_voltage", 10.0)]
    assert [x.term.effect.variable for x in time_last(near)] == ["temperature", "time", "supply_voltage"]
    far = [trial("time", 100.0), trial("temperature", 94.0)]
    assert time_last(far) == far
    assert time_last([]) == []


def test_a_knot_that_a_model_file_does_not_hold_at_zero_is_no_zero() -> None:
    values = {"at_1": -1.0, "at_2": 0.0, "at_3": 1.0, "value_1": 3.0, "value_2": 2.0, "value_3": 1.0}
    found = curve_of("unnamed:output_torque:static", "torsion", values.keys(), values)
    assert found is not None
    assert found.zero == -1
    assert curve_of("unnamed:output_torque:static", "torsion", values.keys(), {**values, "value_2": 0.0}).zero == 1


SMALL = Plan(locked_angles=6, locked_pairs=1, backdrives=3, backdrive_pairs=1, free_runs=2, free_run_pairs=1)
STEPS_AT, HEIGHT = 5.0, 8e-6
"""N*m at which the torsion jumps, and by how much (rad) either way."""


def gap(run: Run, rng: np.random.Generator) -> Run:
    """Let the torsion jump at a torque: a gap that closes there, in series with the springs."""
    angle = HEIGHT * np.tanh((run.signals["output_torque"] - STEPS_AT) / 0.5)
    return twisted(run, angle)


def draught(run: Run, rng: np.random.Generator) -> Run:
    """Let the torsion follow the temperature of the room, which only an auxiliary channel has."""
    room = 3.0 * np.sin(2.0 * np.pi * run.time / float(rng.uniform(15.0, 40.0)) + float(rng.uniform(0.0, 6.0)))
    moved = twisted(run, 3e-6 * room)
    return replace(moved, auxiliary=MappingProxyType({"room": 22.0 + room + 0.05 * rng.standard_normal(room.size)}))


def twisted(run: Run, angle: Floats) -> Run:
    held = run.procedure is ProcedureName.LOCKED_OUTPUT
    name, share = ("motor_position", 100.0) if held else ("output_position", 1.0)
    return replace(run, signals=MappingProxyType({**run.signals, name: run.signals[name] + share * angle}))


@cache
def traced(hide: Callable[[Run, np.random.Generator], Run], seed: int) -> tuple[LoopResult, tuple[Run, ...]]:
    runs, held_out = runs_of(Campaign(seed, plan=SMALL, rate=100.0))
    rng = np.random.default_rng(seed)
    changed = tuple(hide(run, rng) for run in runs)
    return trace(changed, dut(), LoopOptions(held_out=held_out)), changed


CASES = [(gap, "output_torque"), (draught, "room")]


@pytest.mark.parametrize(("hide", "variable"), CASES)
@pytest.mark.timeout(300)
def test_physics_of_no_catalogue_is_unnamed_with_its_variable_and_shape(
    hide: Callable[[Run, np.random.Generator], Run], variable: str
) -> None:
    result, _ = traced(hide, 5)
    assert [(step.verdict, step.variable, step.shape) for step in result.steps] == [
        (Verdict.UNNAMED, variable, Shape.STATIC)
    ]
    further = result.steps[0].next_experiment
    assert further is not None
    assert further.command.startswith("rig run locked-output ")
    torsion = result.equations["torsion"].held_out
    assert torsion is not None
    assert torsion.rms_after < 0.85 * torsion.rms_before


@pytest.mark.timeout(300)
def test_the_values_of_a_curve_follow_what_was_hidden() -> None:
    (step,) = traced(gap, 5)[0].steps
    count = sum(name.startswith("at_") for name in step.parameters)
    at = np.array([step.parameters[f"at_{k + 1}"].value for k in range(count)])
    values = np.array([step.parameters[f"value_{k + 1}"].value for k in range(count)])
    low, high = np.interp([STEPS_AT - 2.0, STEPS_AT + 2.0], at, values)
    # the springs take up a slope of it, and straight lines between knots smear the rest
    assert 0.4 < (high - low) / (2.0 * HEIGHT) < 1.1


@pytest.mark.timeout(300)
def test_a_model_with_a_curve_is_read_back_and_predicts_alike(tmp_path: Path) -> None:
    result, runs = traced(gap, 5)
    write_model(result.model, tmp_path / "model.json")
    again = load_model(tmp_path / "model.json")
    (run,) = (run for run in runs if run.name in result.held_out and run.procedure is ProcedureName.LOCKED_OUTPUT)
    of_file = next(p for p in predict_run(run, again) if p.equation == "torsion")
    expected = result.equations["torsion"].held_out
    assert expected is not None
    assert of_file.rms == pytest.approx(expected.by_procedure["locked-output"].rms_after, rel=1e-6)


@pytest.mark.timeout(300)
@pytest.mark.parametrize(
    ("name", "value", "rule"),
    [("at_2", 1e9, "ascending"), ("value_1", 1e300, "must be"), ("slope", 1.0, "is none of")],
)
def test_a_wrong_curve_in_a_model_file_is_refused(tmp_path: Path, name: str, value: float, rule: str) -> None:
    result, _ = traced(gap, 5)
    (effect,) = result.model.effects
    old = effect.parameters.get(name, effect.parameters["at_1"])
    parameters = {**effect.parameters, name: old.model_copy(update={"value": value})}
    wrong = result.model.model_copy(update={"effects": (effect.model_copy(update={"parameters": parameters}),)})
    write_model(wrong, tmp_path / "model.json")
    with pytest.raises((ConfigError, DataError), match=rule):
        load_model(tmp_path / "model.json")


def test_where_the_motor_is_known_by_its_current_alone_what_it_must_overcome_is_in_ampere() -> None:
    over_time = Curve(Enters.MOTOR_BALANCE, "time", Form.CURVE, "", 2)
    assert units_of(over_time, Equation.MOTOR_CURRENT) == {"at_1": "s", "at_2": "s", "value_1": "A", "value_2": "A"}
    assert units_of(over_time, Equation.MOTOR_TORQUE)["value_1"] == "N*m"
    by_load = Curve(Enters.FRICTION, "temperature", Form.CURVE, "output_torque", 2)
    assert units_of(by_load, Equation.MOTOR_CURRENT)["value_1"] == "A/(N*m)"
    assert units_of(Curve(Enters.OUTPUT_BALANCE, "time", Form.CURVE, "", 2), Equation.MOTOR_CURRENT)["value_1"] == "N*m"
    stribeck = CATALOGUE["stribeck-friction"]
    assert units_of(stribeck, Equation.MOTOR_CURRENT) == {"amplitude": "A", "velocity": "rad/s", "exponent": "1"}
    assert units_of(stribeck, Equation.MOTOR_TORQUE)["amplitude"] == "N*m"


@pytest.mark.parametrize("name", ["torque-ripple", "stiffness-modulation", "cogging", "kinematic-error"])
def test_the_amplitude_of_a_line_has_the_unit_of_the_catalogue(name: str) -> None:
    entry = entry_of(CATALOGUE[name])
    (amplitude,) = (p for p in CATALOGUE[name].parameters if p.name == "amplitude")
    assert entry.unit_in(entry.equation) == amplitude.unit


def test_a_model_in_ampere_is_read_back(tmp_path: Path) -> None:
    over_time = Curve(Enters.MOTOR_BALANCE, "time", Form.CURVE, "", 2)
    units = units_of(over_time, Equation.MOTOR_CURRENT)
    values = {name: ModelEstimate(value=float(k), unit=unit) for k, (name, unit) in enumerate(units.items())}
    term = ModelEffect(
        effect=over_time.id, enters=over_time.place, variable="time", shape=str(over_time.shape), parameters=values
    )
    base = ModelBase(model="zhang-2014", ratio=None, parameters={})
    written = ModelFile.model_validate(
        {"schema": "rig.model/1", "dut": dut(), "base": base, "effects": (term,), "software": "0"}
    )
    write_model(written, tmp_path / "model.json")
    assert load_model(tmp_path / "model.json") == written

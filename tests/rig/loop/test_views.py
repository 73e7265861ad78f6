"""What a report draws of a loop, on a small campaign with a line of the motor angle in the motor torque."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from rig.config.dut import SHD_17_100
from rig.log.run import Run
from rig.loop.campaign import LoopOptions
from rig.loop.files.views_file import ResidualView, Views, write_views
from rig.loop.fitting.base import start_model
from rig.loop.model.equations import pieces_of
from rig.loop.model.terms import Entry, Line, TermClass
from rig.loop.result import LoopResult
from rig.loop.signals.tracks import make_track
from rig.loop.statements.residuals import residual_of
from rig.loop.statements.views import Added, Pair, _fold, views_of
from rig.loop.trace import trace
from sim_backend.model.compliance import Compliance
from tests.independent.campaign import Campaign, Plan
from tests.rig.loop.runs import dut, make_run, runs_of, turning_run

AMPLITUDE, ORDER, PHASE = 2e-3, 2.0, 0.7
"""N*m, cycles a turn, rad."""


def run_with_line(name: str, seed: int, sense: float = 1.0) -> Run:
    """Turn the drive; of a drive with `sense` -1 the motor's signals have the other sign."""
    plain = turning_run(name, seed)
    signals = {key: values.copy() for key, values in plain.signals.items()}
    if sense < 0.0:
        signals["motor_position"] *= -1.0
        signals["motor_torque"] *= -1.0
    signals["motor_torque"] += AMPLITUDE * np.sin(ORDER * signals["motor_position"] + PHASE)
    metadata = {"operator": "Ada", "outcome.status": "done"}
    return make_run(name, "free-run", plain.time, signals, metadata=metadata)


@cache
def result(rotation: str = "opposed") -> LoopResult:
    sense = 1.0 if rotation == "opposed" else -1.0
    runs = [run_with_line(name, seed, sense) for seed, name in enumerate("abc")]
    device = dut(SHD_17_100.replace('rotation = "opposed"', f'rotation = "{rotation}"'))
    return trace(runs, device, LoopOptions(held_out=("c",)))


def residual(found: LoopResult, equation: str, variable: str) -> ResidualView:
    return next(v for v in found.views.residuals if (v.equation, v.variable) == (equation, variable))


def test_the_residual_is_that_of_the_held_out_runs_with_the_errors_of_the_table() -> None:
    view = residual(result(), "motor-torque", "motor_position")
    errors = result().equations["motor-torque"].held_out
    assert errors is not None
    assert (view.side, view.runs, view.effects) == ("held_out", ("c",), result().effects)
    assert view.rms_before == pytest.approx(errors.rms_before)
    assert view.rms_after == pytest.approx(errors.rms_after)


@pytest.mark.parametrize("rotation", ["opposed", "same"])
def test_a_line_is_seen_over_one_of_its_periods_with_the_signs_of_the_log(rotation: str) -> None:
    view = residual(result(rotation), "motor-torque", "motor_position")
    assert view.order == pytest.approx(ORDER, abs=1e-3)
    assert 0.0 <= min(view.x) <= max(view.x) <= 2.0 * np.pi / ORDER
    hidden = AMPLITUDE * np.sin(ORDER * np.array(view.means.x) + PHASE)
    assert np.array(view.means.before) == pytest.approx(hidden, abs=0.1 * AMPLITUDE)
    assert np.array(view.means.after) == pytest.approx(0.0, abs=0.05 * AMPLITUDE)


def test_an_angle_that_stays_within_one_period_is_shown_as_it_is() -> None:
    wide, narrow = np.linspace(-0.5, 9.0, 50), np.linspace(-0.5, 0.6, 50)
    line = [Added("gravity-load", "output_position", (1.0,))]
    assert _fold("output_position", wide, line) == 1.0
    assert _fold("output_position", narrow, line) is None
    assert _fold("output_position", narrow, [Added("x", "output_position", (37.3, 2.0))]) == 37.3
    assert _fold("output_torque", wide, []) is None


def test_the_spectrum_has_the_line_before_and_not_after() -> None:
    (view,) = (v for v in result().views.spectra if v.equation == "motor-torque")
    assert view.lines == pytest.approx((ORDER,), abs=1e-3)
    top = int(np.argmax(view.before))
    assert view.orders[top] == pytest.approx(ORDER, rel=0.02)
    assert view.before[top] == pytest.approx(AMPLITUDE, rel=0.05)
    assert view.after[top] < 0.05 * AMPLITUDE


def test_a_hysteresis_loop_is_the_measured_torsion_beside_the_modelled_one() -> None:
    nothing = dict.fromkeys(("locked_pairs", "backdrives", "backdrive_pairs", "free_runs", "free_run_pairs"), 0)
    runs, _ = runs_of(Campaign(5, plan=Plan(locked_angles=3, **nothing), rate=50.0))
    found = trace(runs, dut(), LoopOptions(held_out=(runs[2].name,)))
    (view,) = (v for v in found.views.cycles if v.equation == "torsion")
    (stretch,) = view.stretches
    assert (view.variable, view.runs, stretch.run) == ("output_torque", (runs[2].name,), runs[2].name)
    signals = runs[2].signals
    torsion = signals["output_position"] + signals["motor_position"] / 100.0
    assert np.ptp(stretch.measured) == pytest.approx(np.ptp(torsion), rel=0.02)
    assert np.ptp(stretch.x) == pytest.approx(np.ptp(signals["output_torque"]), rel=0.02)
    left = np.array(stretch.measured) - np.array(stretch.after)
    errors = found.equations["torsion"].held_out
    assert errors is not None
    assert np.sqrt(np.mean(left**2)) == pytest.approx(errors.rms_after, rel=0.1)


def test_long_runs_are_thinned_and_say_so() -> None:
    for view in result().views.residuals:
        assert len(view.x) == len(view.before) == len(view.after) <= 2000
        assert view.samples >= len(view.x)


def test_the_runs_are_told_with_their_side_and_operator() -> None:
    assert [(run.name, run.side, run.operator) for run in result().views.runs] == [
        ("a", "train", "Ada"),
        ("b", "train", "Ada"),
        ("c", "held_out", "Ada"),
    ]


def test_the_file_comes_back_as_it_was_written(tmp_path: Path) -> None:
    write_views(result().views, tmp_path / "views.json")
    assert Views.model_validate_json((tmp_path / "views.json").read_bytes()) == result().views


def test_of_a_motor_known_by_its_current_alone_nothing_is_drawn_over_a_torque() -> None:
    time = np.arange(0.0, 120.0, 0.05)
    angle = 0.003 * np.floor(time)
    current = 0.1 * np.sin(72.0 * angle + 0.3)
    device = dut('name = "motor"\n')
    track = make_track(make_run("a", "other", time, {"motor_position": angle, "motor_current": current}), device)
    (piece,) = pieces_of(track, None)
    base = start_model(device, None, Compliance.ARCTAN, None)
    cogging = TermClass("cogging", Entry.MOTOR, "motor_position")
    friction = TermClass("position-dependent-friction", Entry.MOTOR_AGAINST_MOTION, "motor_position")
    lines = (Line(cogging, 72.0, 0.1 * np.cos(0.3), 0.1 * np.sin(0.3)), Line(friction, 36.0, 0.01, 0.0))
    with_line = replace(base, lines=lines)
    pair = Pair("held_out", residual_of(piece, base), residual_of(piece, with_line))
    views = views_of([pair], with_line, [Added("cogging", "motor_position", (72.0,))], (), device)
    assert [(view.equation, view.variable) for view in views.residuals] == [("motor-current", "motor_position")]
    assert views.cycles == ()

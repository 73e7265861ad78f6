"""The verdict `uncontrolled` and the refusal of leaks on whole campaigns of the independent generator."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from drivers.errors import DataError
from rig.log.run import ProcedureName
from rig.loop.campaign import LoopOptions
from rig.loop.result import Verdict
from rig.loop.statements.floor import floor_of
from rig.loop.statements.open_statements import ABOVE_FLOOR
from rig.loop.statements.residuals import residual_of
from rig.loop.table import statements
from rig.loop.trace import trace
from tests.independent.campaign import held_out
from tests.independent.instruments import NoiseKind
from tests.independent.terms import Effects, term
from tests.rig.loop.runs import as_run, dut
from tests.rig.loop.statements.left import by_place, changed, left_of, recorded

COUNT = 2.0 * math.pi / 16384
"""Of the motor's encoder, rad at the motor."""

AT = 20.0
"""s at which a run goes wrong."""


def test_an_odd_run_of_no_procedure_is_told_without_a_command_that_repeats_it():
    made = recorded(21)
    runs = [as_run(item) for item in made]
    for place, run in enumerate(runs):
        if run.procedure is ProcedureName.FREE_RUN:
            runs[place] = replace(run, procedure=ProcedureName.OTHER)
        if run.name == "free-run-01b":
            runs[place] = changed(runs[place], "motor_position", lambda t: np.where(t > AT, -30 * COUNT, 0.0))
    result = trace(runs, dut(), LoopOptions(held_out=held_out(made)))
    (told,) = (item for item in result.open if item.verdict is Verdict.UNCONTROLLED)
    assert told.evidence["procedure"] == "other"
    assert told.next_experiment.command == ""
    assert "free-run-01b is the odd one" in told.next_experiment.why


@pytest.mark.parametrize("size", [5e-4, 3e-3], ids=["twice the noise", "ten times the noise"])
def test_a_run_in_which_something_fast_acts_that_its_replicate_lacks_is_named_and_no_leak(size):
    made = recorded(23)
    runs = []
    for item in made:
        run = as_run(item)
        if item.name == "free-run-01a":
            cogging = size * np.sin(14.0 * run.signals["motor_position"])
            run = changed(run, "motor_torque", lambda _, cogging=cogging: cogging)
        runs.append(run)
    result = trace(runs, dut(), LoopOptions(held_out=held_out(made)))
    assert (result.verdict, result.effects) == (Verdict.UNCONTROLLED, ())
    (told,) = (item for item in result.open if item.evidence.get("equation") == "motor-torque")
    assert told.evidence["odd_runs"] == ["free-run-01a"]
    assert "free-run-01b" in str(told.evidence["replicates"])


def test_a_torque_sensor_whose_zero_differs_from_run_to_run_makes_no_effect_of_the_temperature():
    made, rng = recorded(24), np.random.default_rng(1)
    zeros = 0.02 * rng.standard_normal(len(made))
    runs = [
        changed(as_run(item), "output_torque", lambda t, zero=zero: np.full(t.size, zero))
        for item, zero in zip(made, zeros, strict=True)
    ]
    result = trace(runs, dut(), LoopOptions(held_out=held_out(made)))
    assert (result.verdict, result.effects) == (Verdict.UNCONTROLLED, ())
    held = result.equations["motor-torque"].held_out
    assert held is not None
    assert held.rms_after < 1.02 * held.rms_before


def test_a_run_that_lost_counts_is_named_with_time_and_counts_and_is_to_be_repeated():
    made = recorded(21)
    runs = []
    for item in made:
        run = as_run(item)
        if item.name == "locked-output-01b":
            run = changed(run, "motor_position", lambda t: np.where(t > AT, -30 * COUNT, 0.0))
        runs.append(replace(run, metadata={"parameters": json.dumps({"dwell": 7.0, "amplitudes": [0.9]})}))
    result = trace(runs, dut(), LoopOptions(held_out=held_out(made)))
    assert (result.verdict, result.effects) == (Verdict.UNCONTROLLED, ())
    (told,) = (item for item in result.open if item.verdict is Verdict.UNCONTROLLED)
    (event,) = told.evidence["events"]
    assert (event["run"], event["counts"]) == ("locked-output-01b", -30)
    assert event["rad"] == pytest.approx(-30 * COUNT / 100)
    assert told.times == (event["time_s"],)
    assert event["time_s"] == pytest.approx(AT, abs=0.1)
    assert told.evidence["odd_runs"] == ["locked-output-01b"]
    assert "no replicate steps with it" in told.evidence["meaning"]
    assert "by many counts" in told.evidence["meaning"]  # the error of a large step tells no whole number
    assert set(told.evidence["channels"]) == {"temperature"}
    again = told.next_experiment
    assert again.command == (
        "rig run locked-output --set locked-output.dwell=7 --set locked-output.amplitudes=0.9 --repeat 2"
    )
    assert "locked-output-01b is the odd one" in again.why
    assert again.minutes > 1.0
    printed = "\n".join(statements(result))
    assert "? uncontrolled: torsion in locked-output" in printed
    assert "run locked-output-01b time_s 20 counts -30" in printed
    json.dumps(result.to_json())
    # the floor comes from this pair too: the step is no noise
    assert result.equations["torsion"].held_out.floor < 6e-6


def test_missed_counts_everywhere_are_uncontrolled_and_nothing_is_added():
    missed = Effects(
        others=(term("encoder-missed-counts", amplitude=6.0, rate=0.03, seed=5.0, encoder_counts=16384.0),)
    )
    made = recorded(6, NoiseKind.STUDENT_T, missed)
    result = trace([as_run(item) for item in made], dut(), LoopOptions(held_out=held_out(made)))
    assert (result.verdict, result.effects) == (Verdict.UNCONTROLLED, ())
    assert sum(len(item.times) for item in result.open) > 5


def test_events_without_a_replicate_are_still_told_and_what_is_missing_with_them():
    missed = Effects(
        others=(term("encoder-missed-counts", amplitude=6.0, rate=0.03, seed=5.0, encoder_counts=16384.0),)
    )
    made = recorded(6, NoiseKind.WHITE, missed)
    alone = [replace(as_run(item), replicate=None) for item in made]
    result = trace(alone, dut(), LoopOptions(held_out=held_out(made)))
    told = [item for item in result.open if item.verdict is Verdict.UNCONTROLLED]
    assert told
    assert all("no run was repeated" in item.evidence["meaning"] for item in told)
    assert all(item.next_experiment.command.endswith("--repeat 2") for item in told)


@pytest.mark.parametrize("noise", [NoiseKind.WHITE, NoiseKind.AR1])
def test_a_model_that_knows_noise_of_runs_it_has_not_seen_is_refused(noise, monkeypatch):
    """A channel that is predicted leaks into a regressor: of the noise of the held-out torques 60 % are left."""
    made = recorded(22, noise)
    out = held_out(made)

    def leaking(piece, model, judge=None):
        found = residual_of(piece, model, judge)
        knows = piece.track.name in out and piece.equation.value == "motor-torque"
        return replace(found, values=0.6 * found.values) if knows else found

    monkeypatch.setattr("rig.loop.statements.before_after.residual_of", leaking)
    with pytest.raises(DataError, match=r"error of motor-torque after the fit is .* below the floor") as refused:
        trace([as_run(item) for item in made], dut(), LoopOptions(held_out=out))
    assert "leak" in str(refused.value)


@pytest.mark.parametrize("noise", list(NoiseKind))
def test_a_floor_from_few_replicates_holds_for_noise_of_any_colour(noise):
    """Each run in turn stands for one that was held out; the floor comes from one or two pairs."""
    residuals, model = left_of(recorded(23, noise))
    for members in by_place(residuals).values():
        for held in members:
            floor = floor_of([held], members, dut(), model)
            rms = float(np.sqrt(np.mean(held.values**2)))
            assert floor.low < rms < ABOVE_FLOOR * floor.high, held.piece.track.name

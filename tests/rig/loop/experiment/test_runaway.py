"""A rival that no drive can be like beyond what was recorded takes no part in the choice, and stops nothing."""

from dataclasses import replace

from rig.loop.campaign import LoopOptions
from rig.loop.experiment import choice
from rig.loop.result import Verdict
from rig.loop.trace import trace
from sim_backend.errors import ModelError
from tests.challenge.cases import LEAN
from tests.independent.campaign import Campaign
from tests.independent.terms import Effects, term
from tests.rig.loop.runs import dut, runs_of


def one_start_angle():
    """Trace a stiffness that varies with the angle, seen at one start angle; give its only step."""
    hidden = Effects(others=(term("stiffness-modulation", amplitude=4e-6, order=2.0, phase=0.7),))
    plan = replace(LEAN, locked_angles=1, sweeps_per_angle=6, locked_pairs=2, free_runs=0, free_run_pairs=0)
    runs, held_out = runs_of(Campaign(46, effects=hidden, plan=plan, rate=100.0))
    (step,) = trace(runs, dut(), LoopOptions(held_out=held_out)).steps
    assert step.verdict is Verdict.AMBIGUOUS
    return step


def test_a_rival_that_runs_away_in_every_planned_run_is_left_out_of_the_choice(monkeypatch):
    told = one_start_angle().next_experiment
    assert told.command.startswith("rig run locked-output ")
    assert "stiffness-modulation" in told.why
    forecast = choice.forecast

    def running_away(rival, coming, noise):
        if rival.effect == "stiffness-modulation":
            raise ModelError("inputs[53] = inf is not possible: it must be finite.")
        return forecast(rival, coming, noise)

    monkeypatch.setattr(choice, "forecast", running_away)
    told = one_start_angle().next_experiment
    assert told.command == ""  # of two rivals one is left, so that nothing is to be told apart
    assert told.why.startswith("No run of this bench tells ")

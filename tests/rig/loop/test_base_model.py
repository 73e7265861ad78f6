"""A loop that starts from the model of another: what that has stays and is fitted again, apart from what is new."""

import functools

import numpy as np
import pytest

from rig.loop.campaign import LoopOptions
from rig.loop.model.terms import Line, TermClass, periodic_effects
from rig.loop.result import LoopResult, Verdict
from rig.loop.search.decision import Decision, lines_decided
from rig.loop.trace import trace
from tests.challenge.cases import LEAN
from tests.independent.campaign import Campaign, Plan
from tests.independent.terms import Effects, term
from tests.independent.terms import Line as Hidden
from tests.rig.loop.runs import dut, runs_of

pytestmark = pytest.mark.xdist_group("base-model")  # what was traced is shared

KINEMATIC = Effects(kinematic_error=(Hidden(2.0, 4e-5, 0.7), Hidden(4.0, 2e-5, -1.0)))
OFFSET = Effects(others=(term("torque-sensor-offset", amplitude=0.3),))
FREE_RUNS = Plan(locked_angles=0, locked_pairs=0, backdrives=0, backdrive_pairs=0, free_runs=4, free_run_pairs=2)


@functools.cache
def monday() -> LoopResult:
    runs, held_out = runs_of(Campaign(61, effects=KINEMATIC, plan=LEAN, rate=100.0))
    return trace(runs, dut(), LoopOptions(held_out=held_out))


def tuesday(effects: Effects, plan: Plan, seed: int) -> LoopResult:
    runs, held_out = runs_of(Campaign(seed, effects=effects, plan=plan, rate=100.0))
    return trace(runs, dut(), LoopOptions(held_out=held_out, base=monday().model))


def test_what_the_base_model_has_is_no_step_and_stays_in_the_model() -> None:
    result = tuesday(KINEMATIC, LEAN, 62)
    assert monday().effects == ("kinematic-error",)
    assert result.verdict is Verdict.NONE
    (effect,) = result.model.effects
    assert effect.effect == "kinematic-error"
    assert np.allclose([line.order for line in effect.lines], [2.0, 4.0], rtol=1e-3)
    assert np.allclose([line.amplitude for line in effect.lines], [4e-5, 2e-5], rtol=0.05)
    held_out = result.equations["torsion"].held_out
    assert held_out is not None
    assert held_out.rms_before < 1.1 * held_out.rms_after


def test_what_comes_on_top_of_the_base_model_is_the_only_step() -> None:
    result = tuesday(KINEMATIC + OFFSET, LEAN, 63)
    assert result.effects == ("torque-sensor-offset",)
    assert {effect.effect for effect in result.model.effects} == {"kinematic-error", "torque-sensor-offset"}


def test_what_the_new_runs_tell_nothing_of_stays_as_the_base_model_had_it() -> None:
    result = tuesday(KINEMATIC, FREE_RUNS, 64)
    known, now = monday().model.base.parameters, result.model.base.parameters
    assert "T_fb" in known
    assert now["T_fb"] == known["T_fb"]
    assert now["T_c"] != known["T_c"]


def test_every_line_belongs_to_the_decision_whose_orders_are_nearest() -> None:
    (kind,) = (one for one in periodic_effects() if one.effect == "kinematic-error")
    lines = [Line(kind, order, 1.0, 0.0) for order in (1.0, 2.0001, 4.0, 8.001)]
    one = Decision(kind, Verdict.AMBIGUOUS, ("kinematic-error", "motor-encoder-eccentricity"), (), 0.0, (1.0,))
    two = Decision(kind, Verdict.NAMED, (), (), 0.0, (2.0, 4.0, 8.0))
    both = (one, two)
    assert [lines_decided(decision, both, lines) for decision in both] == [[0], [1, 2, 3]]
    other = Decision(TermClass(None, kind.entry, "motor_position"), Verdict.UNNAMED, (), (), 0.0, (3.0,))
    assert lines_decided(other, (*both, other), lines) == []

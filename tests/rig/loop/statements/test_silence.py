"""What the verdict `none` rests on, checked by hiding effects a few times above and below what it says is seen."""

from functools import cache

import pytest

from rig.loop.campaign import LoopOptions
from rig.loop.result import LoopResult, Verdict
from rig.loop.table import text_of
from rig.loop.trace import trace
from tests.independent.campaign import STANDARD, Campaign
from tests.independent.terms import Effects, Line
from tests.rig.loop.runs import dut, runs_of

SEED = 914

pytestmark = pytest.mark.xdist_group("silence")  # the silent campaign is shared


@cache
def traced(effects: Effects) -> LoopResult:
    runs, held_out = runs_of(Campaign(SEED, effects, plan=STANDARD, rate=100.0))
    return trace(runs, dut(), LoopOptions(held_out=held_out))


def smallest(effect: str) -> float:
    silence = traced(Effects()).silence
    assert silence is not None
    return next(item.amplitude for item in silence.smallest if item.effect == effect)


@pytest.mark.timeout(300)
def test_silence_says_how_like_noise_the_replicates_are_and_what_would_have_been_seen():
    result = traced(Effects())
    assert result.verdict is Verdict.NONE
    silence = result.silence
    assert silence is not None
    assert {(item.equation, item.procedure) for item in silence.replicates} >= {
        ("torsion", "locked-output"),
        ("torsion", "free-run"),
        ("motor-torque", "free-run"),
    }
    assert all(abs(item.rho) <= 1.0 for item in silence.replicates)
    units = {item.effect: item.unit for item in silence.smallest}
    assert units["kinematic-error"] == "rad"
    assert units["cogging"] == "N*m"
    assert ". would have been seen from: " in text_of(result)
    written = result.to_json()["none"]
    assert isinstance(written, dict)
    assert set(written) == {"replicates", "smallest"}


@pytest.mark.campaign
@pytest.mark.timeout(300)
@pytest.mark.parametrize(("effect", "order"), [("kinematic-error", 2.0), ("cogging", 12.0)])
def test_half_more_than_what_is_said_to_be_seen_is_seen_and_a_third_is_not(effect: str, order: float):
    def hidden(times: float) -> LoopResult:
        line = Line(order, times * smallest(effect), 0.7)
        return traced(Effects(**{effect.replace("-", "_"): (line,)}))

    loud = hidden(1.5)
    assert (loud.verdict, loud.effects, loud.silence) == (Verdict.NAMED, (effect,), None)
    assert hidden(1.0 / 3.0).verdict is Verdict.NONE

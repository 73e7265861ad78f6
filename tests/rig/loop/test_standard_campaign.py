"""What docs/effects.md says a campaign establishes, and what the loop answers on it."""

import re
from pathlib import Path

import pytest

from sim_backend.model.effects import CATALOGUE
from tests.independent.instruments import NoiseKind
from tests.rig.loop.standard import CONTROL, establish, hidden_effects

PAGE = Path(__file__).resolve().parents[3] / "docs" / "effects.md"
SEED = 8
IN_CI = (
    "soft-windup",
    "maxwell-slip",
    "rate-dependent-hysteresis",
    "stribeck-friction",
    "stiffness-modulation",
    "structural-resonance",
    "encoder-subdivision-error",
)
"""One of every kind: a spring, a play, a play with a lag, a friction, a product, what rings, an encoder's own error.
The whole table takes half an hour."""

SETS_IN_CI = ("torque-constant-error",)
"""Of the effects that come out as a set, the ones tried here."""

WIDE = 3.0
"""Half widths of its 95 % interval by which a parameter may be off: one seed of seven effects with up to three each."""


def answers() -> dict[str, str]:
    section = PAGE.read_text("utf-8").partition("## What a campaign establishes")[2]
    return dict(re.findall(r"^\| ([a-z-]+) \| ([a-z, ]+) \|", section, flags=re.M))


def test_the_page_has_an_answer_for_every_effect():
    told = answers()
    del told["effect"]
    assert set(told) == set(CATALOGUE)
    assert {effect for effect, answer in told.items() if answer == "base"} == set(CATALOGUE) - set(hidden_effects())
    assert set(told.values()) <= {"base", "named", "named, and more", "ambiguous", "untraced"}


@pytest.mark.timeout(400)
@pytest.mark.parametrize("effect", SETS_IN_CI)
def test_what_cannot_be_told_apart_comes_out_as_a_set(effect: str):
    outcome = establish(effect, SEED)
    assert outcome.answer == answers()[effect] == "ambiguous", outcome.result.effects


@pytest.mark.timeout(400)
@pytest.mark.parametrize("noise", [NoiseKind.WHITE, NoiseKind.AR1, NoiseKind.TORQUE_PROPORTIONAL])
def test_nothing_is_found_where_nothing_is_hidden(noise: NoiseKind):
    outcome = establish(CONTROL, SEED, noise)
    assert outcome.result.effects == ()


@pytest.mark.timeout(400)
@pytest.mark.parametrize("effect", IN_CI)
def test_an_effect_is_found_as_the_page_says(effect: str):
    outcome = establish(effect, SEED)
    assert outcome.answer == answers()[effect], outcome.result.effects
    assert outcome.off
    for name, half_widths in outcome.off.items():
        assert abs(half_widths) < WIDE, (name, half_widths)
    (equation,) = (step.equation for step in outcome.result.steps)
    held_out = outcome.result.equations[equation].held_out
    assert held_out is not None
    assert held_out.floor_ci95 is not None
    # the floor's interval, and what single outliers of the full-rate logs add to it
    assert held_out.rms_after < 1.5 * held_out.floor_ci95[1] < held_out.rms_before

"""What docs/effects.md says a campaign establishes, and what the loop answers on it."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import pytest

from rig.loop.result import Verdict
from sim_backend.model.effects import CATALOGUE
from tests.independent.instruments import NoiseKind
from tests.rig.loop.standard import CONTROL, establish, hidden_effects

PAGE = Path(__file__).resolve().parents[3] / "docs" / "effects.md"
SEED = 8
IN_CI = ("stribeck-friction", "structural-resonance")
"""A friction and what rings; others and sets are in other tests. All rows: `make campaign`."""

WIDE = 3.0
"""Half widths of its 95 % interval by which a parameter may be off: one seed of four effects with up to three each."""


class PageRow(NamedTuple):
    """What the page says of one effect. `off`: half widths of its interval by which each parameter misses the truth."""

    answer: str
    off: Mapping[str, float]
    remarks: str


def page() -> dict[str, PageRow]:
    section = PAGE.read_text("utf-8").partition("## What a campaign establishes")[2]
    lines = re.findall(r"^\| ([a-z-]+) \| ([a-z, ]+) \|[^|]*\| ([^|]*) \| ?([^|]*) \|$", section, flags=re.M)
    off = {effect: re.findall(r"(\w+) ([+-]\d+\.\d)", cell) for effect, _, cell, _ in lines}
    rows = {
        effect: PageRow(answer, {name: float(size) for name, size in off[effect]}, remarks)
        for effect, answer, _, remarks in lines
    }
    del rows["effect"]
    return rows


ROWS = page()


def test_the_page_has_an_answer_for_every_effect():
    assert set(ROWS) == set(CATALOGUE)
    assert {effect for effect, row in ROWS.items() if row.answer == "base"} == set(CATALOGUE) - set(hidden_effects())
    assert {row.answer for row in ROWS.values()} <= {"base", "named", "named, and more", "ambiguous", "uncontrolled"}


def test_the_page_gives_every_fitted_parameter_of_what_is_named_and_remarks_on_those_that_are_far_off():
    for effect, row in ROWS.items():
        fitted = {parameter.name for parameter in CATALOGUE[effect].parameters if not parameter.known}
        assert set(row.off) == (fitted if row.answer.startswith("named") else set()), effect
        for name, half_widths in row.off.items():
            assert abs(half_widths) < WIDE or name in row.remarks, (effect, name)


@pytest.mark.campaign
@pytest.mark.timeout(900)
@pytest.mark.parametrize("effect", hidden_effects())
def test_every_row_of_the_page_is_what_the_loop_answers(effect: str):
    row, outcome = ROWS[effect], establish(effect, SEED)
    assert outcome.answer == row.answer, outcome.result.effects
    assert set(outcome.off) == set(row.off)
    far_off = {name for name, half_widths in row.off.items() if abs(half_widths) >= WIDE}
    assert {name: off for name, off in outcome.off.items() if abs(off) >= WIDE and name not in far_off} == {}


@pytest.mark.timeout(400)
@pytest.mark.parametrize(
    "noise",
    # white noise: test_silence.py
    [pytest.param(noise, marks=pytest.mark.campaign) if noise is NoiseKind.WHITE else noise for noise in NoiseKind],
)
def test_nothing_is_found_where_nothing_is_hidden(noise: NoiseKind):
    result = establish(CONTROL, SEED, noise).result
    assert (result.verdict, result.effects) == (Verdict.NONE, ())


@pytest.mark.timeout(400)
@pytest.mark.parametrize("effect", IN_CI)
def test_an_effect_is_found_as_the_page_says(effect: str):
    outcome = establish(effect, SEED)
    assert outcome.answer == ROWS[effect].answer, outcome.result.effects
    assert outcome.off
    for name, half_widths in outcome.off.items():
        assert abs(half_widths) < WIDE, (name, half_widths)
    (equation,) = (step.equation for step in outcome.result.steps)
    held_out = outcome.result.equations[equation].held_out
    assert held_out is not None
    assert held_out.floor_ci95 is not None
    # the floor's interval, and what single outliers of the full-rate logs add to it
    assert held_out.rms_after < 1.5 * held_out.floor_ci95[1] < held_out.rms_before

"""Names that a person typed, held against those that there are."""

import pytest

from drivers.spelling import did_you_mean


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("free-rnu", " (did you mean free-run?)"),
        ("Free_Run", " (did you mean free-run?)"),
        ("run", " (did you mean free-run or dry-run?)"),
        ("backdriv", " (did you mean backdrive?)"),
        ("nosuch", ""),
        ("", ""),
    ],
)
def test_a_name_is_answered_with_those_that_are_near_or_hold_the_word(name: str, told: str):
    assert did_you_mean(name, ("free-run", "dry-run", "backdrive")) == told


def test_no_more_than_three_names_are_suggested():
    assert did_you_mean("fig1", [f"fig{n}" for n in range(1, 15)]).count(" or ") == 2

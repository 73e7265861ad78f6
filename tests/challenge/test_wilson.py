"""Rates and their intervals against published values, and what they say of a bar."""

import pytest

from tests.challenge.wilson import Rate, Standing


@pytest.mark.parametrize(
    ("hits", "count", "low", "high"),
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)],
)
def test_the_interval_is_that_of_the_literature(hits: int, count: int, low: float, high: float):
    """R. G. Newcombe, Stat. Med. 17 (1998) 857-872, table I, the score method without continuity correction."""
    assert Rate(hits, count).interval == pytest.approx((low, high), abs=5e-5)


def test_a_bar_is_met_only_where_the_whole_interval_is_above_it():
    assert Rate(73, 73).standing(0.95) is Standing.MET
    assert Rate(72, 72).standing(0.95) is Standing.UNDECIDED  # 72 of 72 leave 94.94 %
    assert Rate(80, 100).standing(0.95) is Standing.NOT_MET
    assert Rate(0, 3).standing(0.95) is Standing.UNDECIDED


def test_coverage_that_is_too_high_does_not_meet_its_bar():
    assert Rate(1000, 1000).standing(0.93, 0.97) is Standing.NOT_MET
    assert Rate(950, 1000).standing(0.93, 0.97) is Standing.MET
    assert Rate(190, 200).standing(0.93, 0.97) is Standing.UNDECIDED


def test_nothing_counted_says_nothing():
    assert Rate(0, 0).interval == (0.0, 1.0)
    assert Rate(0, 0).standing(0.95) is Standing.UNDECIDED

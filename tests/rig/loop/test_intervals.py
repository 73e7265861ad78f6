"""Intervals of estimates that few blocks of time tell of."""

import numpy as np
import pytest
from scipy.stats import t as student

from rig.loop.fitting.intervals import of_few


def test_equal_blocks_are_counted_and_a_block_that_tells_all_leaves_one_degree_of_freedom() -> None:
    equal, one = np.ones(10), np.array([1.0, *np.zeros(9)])
    found = of_few(np.column_stack([equal, one, 1e-9 * equal]))
    ten = np.sqrt(10.0 / 9.0) * student.ppf(0.975, 9) / student.ppf(0.975, 1000)
    assert found == pytest.approx([ten, np.sqrt(2.0) * student.ppf(0.975, 1) / student.ppf(0.975, 1000), ten])


@pytest.mark.parametrize("unequal", [0.0, 1.0])
@pytest.mark.parametrize("blocks", [6, 30])
def test_a_mean_over_few_unequal_blocks_is_covered_as_often_as_told(blocks: int, unequal: float) -> None:
    rng = np.random.default_rng(4)
    told, plain, draws = 0, 0, 4000
    for _ in range(draws):
        size = np.exp(unequal * rng.standard_normal(blocks))  # samples of a block
        sums = np.sqrt(size) * rng.standard_normal(blocks)
        mean = sums.sum() / size.sum()
        spread = 1.96 * np.sqrt(np.sum((sums - size * mean) ** 2)) / size.sum()
        told += abs(mean) <= spread * of_few(size[:, None])[0]
        plain += abs(mean) <= spread
    assert 0.94 < told / draws < 0.98
    assert plain / draws < (0.945 if blocks == 30 else 0.92)  # as many as normal intervals of so few hold

"""Intervals of estimates that few blocks of time tell of."""

import numpy as np
import pytest
from scipy.stats import t as student

from rig.loop.fitting.intervals import HELD_ALONE, left_out, of_few


def test_equal_blocks_are_counted_and_a_block_that_tells_all_leaves_one_degree_of_freedom() -> None:
    equal, one = np.ones(10), np.array([1.0, *np.zeros(9)])
    found = of_few(np.column_stack([equal, one, 1e-9 * equal]))
    ten, alone = student.ppf(0.975, [9, 1]) / student.ppf(0.975, 1000)
    assert found == pytest.approx([ten, alone, ten])


def test_what_is_left_out_is_told_by_the_others_and_a_block_that_tells_alone_keeps_a_hundredth() -> None:
    rng = np.random.default_rng(2)
    blocks, truth = [rng.standard_normal((5, 2)) for _ in range(40)], np.array([1.0, -2.0])
    said = [X @ truth + rng.standard_normal(5) for X in blocks]
    estimate = np.linalg.lstsq(np.vstack(blocks), np.concatenate(said))[0]
    information = np.array([X.T @ X for X in blocks])
    scores = np.array([X.T @ (y - X @ estimate) for X, y in zip(blocks, said, strict=True)])
    without = [
        np.linalg.lstsq(np.vstack(blocks[:k] + blocks[k + 1 :]), np.concatenate(said[:k] + said[k + 1 :]))[0]
        for k in range(40)
    ]
    total = information.sum(axis=0)
    moved = left_out(total, information, scores, np.linalg.inv(total))
    assert moved == pytest.approx(np.sqrt(39 / 40) * (estimate - without), rel=0.05, abs=0.002)
    alone = left_out(np.eye(1), np.eye(1)[None], np.ones((1, 1)), np.eye(1))
    assert alone == pytest.approx(0.0)  # nobody else to ask
    two = left_out(np.eye(2), np.array([np.diag([1.0, 0.0]), np.diag([0.0, 1.0])]), np.eye(2), np.eye(2))
    assert two == pytest.approx(np.sqrt(0.5) / (1.0 - HELD_ALONE) * np.eye(2))


@pytest.mark.parametrize("unequal", [0.0, 1.0])
@pytest.mark.parametrize("blocks", [6, 30])
def test_a_mean_over_few_unequal_blocks_is_covered_as_often_as_told(blocks: int, unequal: float) -> None:
    rng = np.random.default_rng(4)
    told, plain, draws = 0, 0, 3000
    for _ in range(draws):
        size = np.exp(unequal * rng.standard_normal(blocks))  # samples of a block
        sums = np.sqrt(size) * rng.standard_normal(blocks)
        mean = sums.sum() / size.sum()
        scores = sums - size * mean
        moved = left_out(
            np.full((1, 1), size.sum()), size[:, None, None], scores[:, None], np.full((1, 1), 1 / size.sum())
        )
        told += abs(mean) <= 1.96 * np.sqrt(np.sum(moved**2)) * of_few(size[:, None])[0]
        plain += abs(mean) <= 1.96 * np.sqrt(np.sum(scores**2)) / size.sum()
    assert 0.935 < told / draws < 0.98
    assert plain / draws < (0.945 if blocks == 30 else 0.92)  # as many as normal intervals of so few hold

"""The spectrum over the angle, against least squares written out and against what was put in."""

import numpy as np
import pytest

from rig.loop.statements.angle_spectrum import Signal, amplitudes


def uneven_angle(seed: int, turns: float, samples: int) -> np.ndarray:
    return np.sort(np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi * turns, samples))


@pytest.mark.parametrize("order", [2.0, 7.31, 150.0])
def test_a_line_shows_at_its_order_with_its_amplitude(order: float) -> None:
    x = uneven_angle(1, 60.0, 9000)
    orders, (found,) = amplitudes([Signal(x, (3.0 * np.cos(order * x + 0.4) + 5.0,))], 200.0)
    assert orders[found.argmax()] == pytest.approx(order, abs=0.5 / 60.0)
    assert found.max() == pytest.approx(3.0, rel=0.04)
    far = np.abs(orders - order) > 2.0
    assert found[far].max() < 0.2


def test_the_amplitude_is_that_of_least_squares_with_a_constant_for_every_run() -> None:
    rng = np.random.default_rng(2)
    angles = [uneven_angle(3, 4.0, 700), 1.3 + uneven_angle(4, 0.4, 150)]
    noisy = [np.sin(2.2 * x) + rng.standard_normal(x.size) for x in angles]
    runs = [Signal(angles[0], (noisy[0] + 9.0,)), Signal(angles[1], (noisy[1] - 4.0,))]
    orders, (found,) = amplitudes(runs, 20.0)
    values = np.concatenate([run.values[0] for run in runs])
    own = np.repeat(np.eye(2), [x.size for x in angles], axis=0)
    x = np.concatenate(angles)
    for place in (5, 40, 100, 200):
        columns = np.column_stack([np.cos(orders[place] * x), np.sin(orders[place] * x), own])
        a, b = np.linalg.lstsq(columns, values, rcond=None)[0][:2]
        assert found[place] == pytest.approx(np.hypot(a, b), rel=0.03, abs=0.02)


def test_what_repeats_with_the_angle_stands_at_one_order_whatever_the_speed() -> None:
    time = np.arange(0.0, 30.0, 0.01)
    legs = [speed * time for speed in (5.0, 11.0, 31.0)]
    orders, (found,) = amplitudes([Signal(x, (np.sin(4.0 * x),)) for x in legs], 40.0)
    assert orders[found.argmax()] == pytest.approx(4.0, abs=0.01)
    assert found.max() == pytest.approx(1.0, rel=0.04)


def test_several_values_over_one_angle_keep_their_own_amplitudes() -> None:
    x = uneven_angle(5, 10.0, 2000)
    _, (one, two) = amplitudes([Signal(x, (np.sin(3.0 * x), 0.1 * np.sin(3.0 * x)))], 30.0)
    assert one.max() == pytest.approx(10.0 * two.max(), rel=1e-9)


def test_without_travel_there_is_no_order() -> None:
    orders, (found,) = amplitudes([Signal(np.full(50, 1.7), (np.arange(50.0),))], 30.0)
    assert orders.size == found.size == 0

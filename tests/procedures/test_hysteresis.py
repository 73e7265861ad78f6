import numpy as np
import pytest

from drivers.errors import DataError
from procedures.hysteresis import gap_at_zero, stiffness


def test_the_gap_of_two_curved_branches_is_found_at_zero() -> None:
    x = np.linspace(-10.0, 10.0, 2001)
    upper = (x, 0.3 + 0.1 * x + 0.02 * x**2)
    lower = (x[::-1], -0.1 + 0.2 * x[::-1])
    # within rounding: parabolas are fitted exactly
    assert gap_at_zero(upper, lower).value == pytest.approx(0.4, abs=1e-10)


def test_the_uncertainty_of_the_gap_covers_the_noise() -> None:
    random = np.random.default_rng(1)
    x = np.linspace(-10.0, 10.0, 20001)
    errors = []
    for _ in range(50):
        upper = (x, 1.0 + 0.1 * x + 0.05 * random.standard_normal(x.size))
        lower = (x, 0.1 * x + 0.05 * random.standard_normal(x.size))
        gap = gap_at_zero(upper, lower)
        errors.append((gap.value - 1.0) / gap.uncertainty)
    # 50 draws of a unit normal: rms 1 +- 0.1
    assert 0.7 < np.sqrt(np.mean(np.square(errors))) < 1.3


def test_missing_readings_are_left_out() -> None:
    x = np.linspace(-10.0, 10.0, 2001)
    y = 0.5 + 0.1 * x
    y[1000:1010] = np.nan
    assert gap_at_zero((x, y), (x, 0.1 * x)).value == pytest.approx(0.5, abs=1e-10)


def test_a_branch_that_never_comes_near_zero_is_refused() -> None:
    x = np.linspace(5.0, 10.0, 1000)
    with pytest.raises(DataError, match="near zero torque"):
        gap_at_zero((x, x), (x, x))


def test_the_stiffness_of_a_straight_spring_is_its_constant() -> None:
    torque = np.linspace(-16.0, 16.0, 4001)
    assert stiffness(torque, torque / 9000.0).value == pytest.approx(9000.0, rel=1e-12)


def test_a_loop_does_not_change_the_chord() -> None:
    down, up = np.linspace(16.0, -16.0, 4001), np.linspace(-16.0, 16.0, 4001)
    width = 5e-5 * (1.0 - (up / 16.0) ** 2)
    torque = np.concatenate([down, up])
    torsion = torque / 9000.0 + np.concatenate([-width, width])
    assert stiffness(torque, torsion).value == pytest.approx(9000.0, rel=1e-9)


def test_an_angle_that_stands_still_has_no_stiffness() -> None:
    with pytest.raises(DataError, match="did not change"):
        stiffness(np.linspace(-1.0, 1.0, 100), np.zeros(100))

import numpy as np
import pytest

from procedures.friction import friction_line, leg_mean
from procedures.hysteresis import Value


def test_coulomb_and_viscous_friction_come_back_from_their_line() -> None:
    speeds = [20.0, 40.0, 80.0, 160.0]
    line = friction_line(speeds, [Value(0.012 + 1e-4 * w, 1e-6) for w in speeds])
    assert line is not None
    assert line.coulomb.value == pytest.approx(0.012, rel=1e-12)
    assert line.viscous.value == pytest.approx(1e-4, rel=1e-12)


def test_points_off_the_line_widen_the_uncertainty() -> None:
    speeds = [20.0, 40.0, 80.0, 160.0]
    straight = friction_line(speeds, [Value(0.012 + 1e-4 * w, 1e-6) for w in speeds])
    bent = friction_line(speeds, [Value(0.012 + 1e-4 * w + 1e-3 * np.exp(-w / 30.0), 1e-6) for w in speeds])
    assert straight is not None
    assert bent is not None
    assert bent.coulomb.uncertainty > 10.0 * straight.coulomb.uncertainty


def test_one_speed_gives_no_line() -> None:
    assert friction_line([20.0, 20.0], [Value(0.012, 1e-6), Value(0.013, 1e-6)]) is None


def test_what_repeats_in_every_turn_does_not_count_as_uncertainty() -> None:
    angle = np.linspace(0.0, 20.0 * 2.0 * np.pi, 20_000, endpoint=False)
    leg = leg_mean(0.01 + 0.005 * np.sin(12.0 * angle), 20)
    assert leg.value == pytest.approx(0.01, rel=1e-9)
    assert leg.uncertainty < 1e-9


def test_the_uncertainty_of_a_leg_is_that_of_its_turns() -> None:
    random = np.random.default_rng(2)
    means = [leg_mean(0.01 + 1e-3 * random.standard_normal(10_000), 100) for _ in range(50)]
    # white noise: 1e-3 / sqrt(10 000); 50 draws give the scatter to 10 %
    assert np.std([leg.value for leg in means]) == pytest.approx(1e-5, rel=0.3)
    assert np.mean([leg.uncertainty for leg in means]) == pytest.approx(1e-5, rel=0.1)


def test_a_missing_reading_is_left_out_of_the_mean() -> None:
    torque = np.full(100, 0.02)
    torque[3] = np.nan
    assert leg_mean(torque, 10).value == pytest.approx(0.02)

"""Each second formula does what the physics says of the effect."""

import math

import numpy as np
import pytest

from tests.independent import effects as fx

ANGLE = np.linspace(-10.0, 10.0, 301)
LINES = (fx.Line(2.0, 1e-4, 0.7), fx.Line(4.0, 3e-5, -2.0))


def test_a_line_is_a_sine_of_order_times_angle_plus_phase():
    expected = 1e-4 * np.sin(2.0 * ANGLE + 0.7) + 3e-5 * np.sin(4.0 * ANGLE - 2.0)
    assert fx.kinematic_error(ANGLE, LINES) == pytest.approx(expected, abs=1e-18)
    assert fx.cogging(ANGLE, LINES) == pytest.approx(expected, abs=1e-18)


def test_the_slope_is_the_derivative_of_the_kinematic_error():
    step = 1e-5
    difference = (fx.kinematic_error(ANGLE + step, LINES) - fx.kinematic_error(ANGLE - step, LINES)) / (2 * step)
    assert fx.kinematic_error_slope(ANGLE, LINES) == pytest.approx(difference, abs=1e-12)


def test_an_arm_hanging_straight_down_needs_no_torque_and_a_raised_one_its_moment():
    arm = fx.Arm(0.5, 0.0)
    assert fx.gravity_load(0.0, arm) == pytest.approx(0.0, abs=1e-16)
    assert fx.gravity_load(math.pi / 2, arm) == pytest.approx(0.5)
    assert fx.gravity_load(-math.pi / 2, arm) == pytest.approx(-0.5)


def test_raising_the_arm_by_half_a_turn_costs_twice_its_moment():
    angle = np.linspace(0.0, math.pi, 2001)
    work = np.trapezoid(fx.gravity_load(angle, fx.Arm(0.5, 0.0)), angle)
    assert work == pytest.approx(1.0, rel=1e-6)


@pytest.mark.parametrize("effect", sorted(fx.SECOND_FORMULAS))
def test_an_effect_can_be_drawn_and_is_then_alone(effect: str):
    drawn = fx.draw(effect, np.random.default_rng(1))
    present = {
        fx.KINEMATIC_ERROR: bool(drawn.kinematic_error),
        fx.COGGING: bool(drawn.cogging),
        fx.GRAVITY_LOAD: drawn.gravity_load.moment != 0.0,
    }
    assert [name for name, there in present.items() if there] == [effect]


def test_an_unknown_effect_is_refused():
    with pytest.raises(ValueError, match="goblins"):
        fx.draw("goblins", np.random.default_rng(1))

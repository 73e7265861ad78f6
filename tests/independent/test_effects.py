"""Each second formula does what the physics says of the effect."""

import inspect
import math

import numpy as np
import pytest

from tests.independent import effects as fx
from tests.independent import laws
from tests.independent.draws import draw_drive

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


OF_THE_DRIVE = {"flexspline-compliance", "wave-generator-compliance", "coulomb-friction", "viscous-friction"}
"""Base terms that are always there; their parameters are those of the drive."""


@pytest.mark.parametrize("effect", sorted(set(fx.SECOND_FORMULAS) - OF_THE_DRIVE))
def test_an_effect_can_be_drawn_and_is_then_alone(effect: str):
    drawn = fx.draw(effect, np.random.default_rng(1))
    assert drawn.ids() == (effect,)
    assert hash(drawn) == hash(fx.draw(effect, np.random.default_rng(1)))
    assert drawn != fx.draw(effect, np.random.default_rng(2))


@pytest.mark.parametrize("effect", sorted(set(fx.SECOND_FORMULAS) - OF_THE_DRIVE))
def test_drawn_parameters_are_those_of_the_formula(effect: str):
    names = inspect.signature(fx.SECOND_FORMULAS[effect]).parameters
    for parameters in fx.draw(effect, np.random.default_rng(4)).of(effect):
        assert tuple(parameters) == tuple(names)[len(names) - len(parameters) :]


def test_the_parameters_of_the_base_are_drawn_as_a_drive():
    usual, drawn = laws.shd_17_100(), draw_drive(np.random.default_rng(2))
    for name in ("K_F0", "C_F", "K_w0", "C_w", "T_fs", "T_fb", "T_c", "b"):
        assert 0.5 < getattr(drawn, name) / getattr(usual, name) < 2.0
        assert getattr(drawn, name) != getattr(usual, name)


def test_effects_add_up():
    both = fx.draw("creep", np.random.default_rng(1)) + fx.draw("cogging", np.random.default_rng(1))
    twice = both + fx.draw("creep", np.random.default_rng(2))
    assert both.ids() == ("cogging", "creep")
    assert len(twice.of("creep")) == 2
    hanging = fx.Effects(gravity_load=fx.Arm(0.3, 0.1))
    assert (hanging + both).of("gravity-load") == ({"amplitude": 0.3, "phase": 0.1},)


def test_instances_of_an_effect_make_a_stack():
    stack = fx.Effects(
        others=(
            fx.term("maxwell-slip", amplitude=2e-6, radius=1.0),
            fx.term("maxwell-slip", amplitude=3e-6, radius=4.0),
        )
    )
    torque = np.linspace(0.0, 10.0, 11)
    stacked = fx.total(["maxwell-slip"], stack, {"output_torque": torque}, torque.shape)
    assert stacked == pytest.approx(2e-6 * np.maximum(torque - 1.0, 0.0) + 3e-6 * np.maximum(torque - 4.0, 0.0))


def test_an_unknown_effect_is_refused():
    with pytest.raises(ValueError, match="goblins"):
        fx.draw("goblins", np.random.default_rng(1))

"""The second formulas of the torque balance do what the physics says."""

import numpy as np
import pytest

from tests.independent import balance, base_terms

ANGLE = np.linspace(-10.0, 10.0, 301)


def test_stribeck_friction_is_whole_at_rest_and_gone_at_speed():
    speed = np.array([0.0, -8.0, 8.0, 400.0])
    for exponent in (0.5, 1.0, 2.0):
        level = balance.stribeck_friction(speed, 6e-3, 8.0, exponent)
        assert level == pytest.approx([6e-3, 6e-3 / np.e, 6e-3 / np.e, 6e-3 * np.exp(-(50.0**exponent))], rel=1e-12)


def test_friction_of_the_load_is_even_in_it():
    assert balance.load_dependent_friction([-10.0, 0.0, 10.0], 0.2, 100.0) == pytest.approx([0.02, 0.0, 0.02])


def test_friction_falls_to_the_e_th_part():
    base = np.array([0.012, 0.012 + 1e-4 * 20.0])
    change = balance.temperature_dependent_friction(20.0 + 1.0 / 0.04, base, 0.04, 20.0)
    assert base + change == pytest.approx(base / np.e)
    assert balance.temperature_dependent_friction(20.0, base, 0.04, 20.0) == pytest.approx(0.0)


def test_waves_are_sines_of_order_times_angle_plus_phase():
    expected = 3e-3 * np.sin(3.0 * ANGLE - 0.4)
    assert balance.cogging(ANGLE, 3e-3, 3.0, -0.4) == pytest.approx(expected, abs=1e-17)
    assert balance.position_dependent_friction(ANGLE, 3e-3, 3.0, -0.4) == pytest.approx(expected, abs=1e-17)
    assert balance.torque_ripple(np.full(ANGLE.shape, 0.1), ANGLE, 3e-2, 3.0, -0.4) == pytest.approx(
        expected, abs=1e-17
    )


def test_base_terms_are_the_laws():
    torque = np.array([0.0, 0.05, 0.16, 0.15, -0.16])
    through = base_terms.coulomb_friction(torque, 0.012, 100.0)
    assert through == pytest.approx([0.0, 3.8, 14.8, 14.8, -14.8])
    assert base_terms.viscous_friction(np.array([-20.0, 0.0, 20.0]), 1e-4) == pytest.approx([-2e-3, 0.0, 2e-3])
    assert base_terms.inertia(np.array([400.0]), 2e-4) == pytest.approx(0.08)
    assert base_terms.wave_generator_compliance(np.array([1.0]), 4.0 / 3.0, 250.0 / 3.0, 100.0) == pytest.approx(9e-5)
    assert base_terms.flexspline_compliance(np.array([12.0]), 8335.98, 0.04494) == pytest.approx(1.3202e-3, abs=5e-8)

"""The second formulas give the numbers of the papers."""

import math

import numpy as np
import pytest

from tests.independent import laws

DRIVE = laws.shd_17_100()


def test_the_catalogue_gives_the_stiffness_of_the_flexspline():
    K_F0, C_F = laws.flexspline_from_catalogue(8.4e3, 9.4e3, 3.9, 12.0)
    assert np.array([K_F0, C_F]) == pytest.approx([8335.98, 0.044940], rel=2e-5)  # printed digits
    at = np.array([3.9 / 2, (3.9 + 12.0) / 2, 12.0, 16.0, 24.0])
    stiffness = laws.flexspline_stiffness(at, K_F0, C_F)
    assert stiffness[:2] == pytest.approx([8400.0, 9400.0], rel=1e-12)
    assert stiffness[2:] == pytest.approx([10.76e3, 12.65e3, 18.03e3], abs=5.0)


def test_two_tests_give_the_stiffness_of_the_wave_generator():
    K_w0, C_w = laws.wave_generator_from_tests(100.0, 1.8e-4, 0.012)
    assert K_w0 == pytest.approx(4 / 3, rel=1e-12)
    assert C_w == pytest.approx(1 / 0.012, rel=1e-12)
    assert laws.wave_generator_torsion(1.0, K_w0, C_w) / 100.0 == pytest.approx(9.0e-5, rel=1e-9)


def test_the_torsion_of_the_flexspline_has_the_printed_values():
    torsion = laws.flexspline_torsion(np.array([3.9, 12.0, 16.0, 24.0]), DRIVE.K_F0, DRIVE.C_F)
    assert torsion == pytest.approx([4.631e-4, 1.3202e-3, 1.6641e-3, 2.1974e-3], abs=6e-8)  # last printed digit


def test_the_integrated_compliances_are_the_closed_laws():
    torque = np.linspace(-40.0, 40.0, 401)
    closed = np.arctan(DRIVE.C_F * torque) / (DRIVE.C_F * DRIVE.K_F0)
    assert laws.flexspline_torsion(torque, DRIVE.K_F0, DRIVE.C_F) == pytest.approx(closed, abs=1e-15)
    torque = np.linspace(-0.4, 0.4, 401)
    closed = np.sign(torque) * (1 - np.exp(-DRIVE.C_w * np.abs(torque))) / (DRIVE.C_w * DRIVE.K_w0)
    assert laws.wave_generator_torsion(torque, DRIVE.K_w0, DRIVE.C_w) == pytest.approx(closed, abs=1e-14)


@pytest.mark.parametrize("torque", [-24.0, -3.9, 0.0, 0.1, 16.0])
def test_the_inverse_of_the_flexspline_returns_the_torque(torque: float):
    torsion = float(laws.flexspline_torsion(torque, DRIVE.K_F0, DRIVE.C_F))
    assert laws.flexspline_torque(torsion, DRIVE.K_F0, DRIVE.C_F) == pytest.approx(torque, abs=1e-9)


@pytest.mark.parametrize("torque", [-0.05, -1e-4, 0.0, 0.012])
def test_the_inverse_of_the_wave_generator_returns_the_torque(torque: float):
    torsion = float(laws.wave_generator_torsion(torque, DRIVE.K_w0, DRIVE.C_w))
    assert laws.wave_generator_torque(torsion, DRIVE.K_w0, DRIVE.C_w) == pytest.approx(torque, abs=1e-11)


def test_no_torque_reaches_the_largest_torsions():
    with pytest.raises(ValueError, match="wave-generator"):
        laws.wave_generator_torque(9.001e-3, DRIVE.K_w0, DRIVE.C_w)
    with pytest.raises(ValueError, match="flexspline"):
        laws.flexspline_torque(4.21e-3, DRIVE.K_F0, DRIVE.C_F)


def test_the_corrected_backdrive_logic_is_the_play_operator():
    T = 14.0 * np.interp(np.linspace(0.0, 4.0, 2001), [0.0, 0.5, 1.5, 2.5, 3.5, 4.0], [0.0, 1.0, -1.0, 1.0, -0.6, 0.2])
    by_logic = laws.backdrive_torque(T, 100.0, 2.0)
    assert by_logic == pytest.approx(laws.play(T / 100.0, 0.02), abs=1e-15)
    assert np.max(np.abs(by_logic - T / 100.0)) == pytest.approx(0.02, abs=1e-15)


def test_the_printed_backdrive_logic_differs_as_much_as_the_errata_say():
    """Printed (36), line 2: T_F - N T_w > -T_fb. A triangle of 14 N*m."""
    T = 14.0 * np.interp(np.arange(8000) / 4000.0 % 1.0, [0.0, 0.25, 0.75, 1.0], [0.0, 1.0, -1.0, 0.0])
    T_w, printed = 0.0, []
    for T_F in T.tolist():
        if T_F + 100.0 * T_w > 2.0:
            T_w = -(T_F - 2.0) / 100.0
        elif T_F - 100.0 * T_w > -2.0:
            T_w = -(T_F + 2.0) / 100.0
        printed.append(-T_w)
    corrected = laws.backdrive_torque(T, 100.0, 2.0)
    apart = np.array(printed) - corrected
    assert np.mean(np.abs(apart) > 1e-12) == pytest.approx(0.785, abs=1e-3)
    assert np.sqrt(np.mean(apart**2)) == pytest.approx(59e-3, abs=5e-4)
    in_torsion = laws.total_torsion(T, printed, DRIVE) - laws.total_torsion(T, corrected, DRIVE)
    assert np.sqrt(np.mean(in_torsion**2)) == pytest.approx(65e-6, abs=1e-6)


def test_a_play_keeps_its_distance_and_stands_still_inside():
    follower = laws.play(np.array([0.0, 0.5, 1.5, 3.0, 2.5, 1.0, 0.9, -2.0]), 1.0)
    assert follower == pytest.approx([0.0, 0.0, 0.5, 2.0, 2.0, 2.0, 1.9, -1.0])


def test_the_hysteresis_loop_is_as_wide_as_the_law_says():
    width = 2.0 * laws.wave_generator_torsion(np.array([0.012, 0.020]), DRIVE.K_w0, DRIVE.C_w) / DRIVE.ratio
    assert width == pytest.approx([1.14e-4, 1.46e-4], abs=5e-7)
    assert width[0] / 1.8e-4 == pytest.approx(1 - math.exp(-1), rel=1e-9)

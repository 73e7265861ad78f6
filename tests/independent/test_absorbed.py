"""What a refit of the base model takes up of an effect: what is left, on one locked cycle of +-16 N*m.

The cycle is a triangle of the output torque; the motor's torque is 1.2 N*m ahead of it by friction.
"""

import dataclasses

import numpy as np
import pytest
from scipy.optimize import least_squares

from tests.independent import effects as fx
from tests.independent import laws

DRIVE = laws.shd_17_100()
T = 16.0 * np.interp((np.arange(4000) + 0.5) / 1000.0, [0, 1, 3, 4], [0, 1, -1, 0])
M = (T + 1.2 * np.where((np.arange(4000) < 1000) | (np.arange(4000) >= 3000), 1.0, -1.0)) / 100.0
BASE = laws.total_torsion(T, M, DRIVE)
FLEXSPLINE = ("K_F0", "C_F")
ALL = ("K_F0", "C_F", "K_w0", "C_w")


def refit(torsion, output_torque=T, motor_torque=M, free=FLEXSPLINE) -> tuple[float, dict[str, float]]:
    """Fit base parameters and the run's zero; give the rms left (rad) and each parameter over its true value."""

    def residual(factors):
        changed = {name: getattr(DRIVE, name) * factor for name, factor in zip(free, factors, strict=True)}
        left = laws.total_torsion(output_torque, motor_torque, dataclasses.replace(DRIVE, **changed)) - torsion
        return (left - left.mean()) * 1e6

    found = least_squares(residual, np.ones(len(free)), x_scale="jac", xtol=1e-13, ftol=1e-13)
    return float(np.sqrt(np.mean(found.fun**2))) * 1e-6, dict(zip(free, found.x.tolist(), strict=True))


def added(effect: str, **parameters: float) -> np.ndarray:
    signals = {"output_torque": T, "motor_torque": M, "locked": np.ones(T.shape)}
    return fx.total([effect], fx.Effects(others=(fx.term(effect, **parameters),)), signals, T.shape)


@pytest.mark.parametrize(
    ("zone", "size", "left", "left_of_all"), [(0.8, 29.2e-6, 8.4e-6, 6.4e-6), (3.0, 27.0e-6, 4.0e-6, 2.9e-6)]
)
def test_a_soft_windup_is_seen_only_with_a_third_of_its_size(zone, size, left, left_of_all):
    """The reference says 8.5 and 4.1 left of 29.2 and 27.0, and 6.4 and 2.9 with the wave generator free."""
    windup = added("soft-windup", amplitude=30e-6, zone=zone)
    assert np.std(windup) == pytest.approx(size, abs=6e-8)
    assert refit(BASE + windup)[0] == pytest.approx(left, abs=1.5e-7)
    assert refit(BASE + windup, free=ALL)[0] == pytest.approx(left_of_all, abs=1e-7)


def test_a_gap_of_30_microradian_leaves_10_5():
    """A gap that follows the sign of the torque: which torque makes 7 % of a difference, motion would leave 29.7."""
    by_output = 30e-6 * np.sign(T)
    assert refit(BASE + by_output)[0] == pytest.approx(10.5e-6, abs=1e-7)
    by_motor = added("backlash", amplitude=3e-3, contact=1e-4, ratio=100.0)
    assert refit(BASE + by_motor)[0] == pytest.approx(11.2e-6, abs=1e-7)


@pytest.mark.parametrize(("stiffness", "bias"), [(2e4, -0.29), (5e4, -0.14), (2e5, -0.04)])
def test_a_soft_fixture_is_absorbed_by_the_stiffness(stiffness: float, bias: float):
    yielding = added("fixture-compliance", amplitude=1.0 / stiffness)
    left, found = refit(BASE + yielding)
    assert found["K_F0"] - 1.0 == pytest.approx(bias, abs=0.005)
    if stiffness == 5e4:
        assert np.std(yielding) == pytest.approx(185e-6, abs=5e-7)
        assert left == pytest.approx(0.4e-6, abs=5e-8)


def shown_by(effect: str, **parameters: float) -> np.ndarray:
    return T + added(effect, **parameters)


def model_error(shown: np.ndarray) -> np.ndarray:
    return laws.total_torsion(shown, M, DRIVE) - BASE


def test_a_gain_of_the_transducer_is_absorbed_exactly():
    shown = shown_by("torque-sensor-gain", amplitude=0.02)
    assert np.std(model_error(shown)) == pytest.approx(17e-6, abs=2e-7)
    left, found = refit(BASE, shown)
    assert left < 2e-9
    assert found["K_F0"] == pytest.approx(1.02, rel=1e-6)
    assert found["C_F"] == pytest.approx(1.0 / 1.02, rel=1e-6)


def test_an_offset_of_the_transducer_is_constant_and_an_even_rest_that_nothing_absorbs():
    shown = shown_by("torque-sensor-offset", amplitude=0.1)
    assert np.mean(model_error(shown)) == pytest.approx(10.4e-6, abs=5e-8)
    assert np.std(model_error(shown)) == pytest.approx(1.28e-6, abs=1e-8)
    assert refit(BASE, shown)[0] == pytest.approx(1.28e-6, abs=1e-8)


def test_16_millinewton_metres_of_bend_leave_0_4_microradian():
    at_30 = 0.016 * (30.0 / 16.0) ** 2
    shown = shown_by("torque-sensor-nonlinearity", even=at_30, odd=0.0, full_scale=30.0)
    assert refit(BASE, shown)[0] == pytest.approx(0.4e-6, abs=1e-8)


def test_a_torque_constant_is_absorbed_by_the_wave_generator():
    shown = M + added("torque-constant-error", amplitude=0.05)
    left, found = refit(BASE, motor_torque=shown, free=ALL)
    assert left < 2e-9
    assert found["K_w0"] == pytest.approx(1.05, rel=1e-5)
    assert found["C_w"] == pytest.approx(1.0 / 1.05, rel=1e-5)


def test_a_kinematic_error_at_one_start_angle_biases_the_stiffness_by_two_per_cent():
    """K_F0 is off by k N A cos(phase) in the limit of a small sweep: seen at the slope without torque."""
    small = 0.05 * T
    for phase, bias in ((0.0, 0.02), (np.pi, -0.02)):
        # a locked motor turns by N times the torsion, here of the flexspline alone
        turned = 100.0 * laws.flexspline_torsion(small, DRIVE.K_F0, DRIVE.C_F)
        error = fx.kinematic_error(turned, [fx.Line(2.0, 1e-4, phase)])
        torsion = laws.flexspline_torsion(small, DRIVE.K_F0, DRIVE.C_F) + error - error.mean()
        slope = np.polyfit(small, torsion, 1)[0]
        assert 1.0 / slope / DRIVE.K_F0 - 1.0 == pytest.approx(-bias, abs=1.5e-3)


def test_three_lines_are_left_by_6_microradian():
    """Reference: three lines with K3 = 1.2e4 differ from the arctangent by 10.8 urad rms; after a refit by 6.0."""
    lines = np.interp(np.abs(T), [0.0, 3.9, 12.0, 16.0], np.cumsum([0.0, 3.9 / 8.4e3, 8.1 / 9.4e3, 4.0 / 1.2e4]))
    torsion = BASE - laws.flexspline_torsion(T, DRIVE.K_F0, DRIVE.C_F) + np.sign(T) * lines
    assert np.std(torsion - BASE) == pytest.approx(10.8e-6, abs=1e-7)
    assert refit(torsion)[0] == pytest.approx(6.0e-6, abs=1e-7)

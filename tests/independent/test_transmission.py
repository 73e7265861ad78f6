"""The second formulas of the torsion give known numbers and closed forms."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.independent import laws, transmission

DRIVE = laws.shd_17_100()
TIME = np.arange(8001) * 5e-3
TRIANGLE = 16.0 * np.interp(TIME % 20.0, [0.0, 5.0, 15.0, 20.0], [0.0, 1.0, -1.0, 0.0])
CYCLE = slice(4000, 8001)


def loop_area(torsion, torque) -> float:
    """J dissipated over the last cycle, from the torque on the torsion."""
    return float(np.trapezoid(torque[CYCLE], torsion[CYCLE]))


def test_a_soft_windup_is_odd_saturates_and_has_its_slope_at_zero():
    torque = np.array([-50.0, -0.8, 0.0, 1e-6, 0.8, 50.0])
    angle = transmission.soft_windup(torque, 3e-5, 0.8)
    assert angle == pytest.approx(3e-5 * np.tanh(torque / 0.8), rel=1e-9, abs=1e-20)
    assert angle[3] / 1e-6 == pytest.approx(3e-5 / 0.8, rel=1e-6)


def test_a_gap_steps_by_its_width_at_the_output_where_the_torque_changes_sign_and_nowhere_else():
    torque = np.array([-0.16, -0.012, -1e-3, 0.0, 5e-4, 1e-3, 0.012, 0.16])
    lost = transmission.backlash(torque, 5e-3, 1e-3, 100.0)
    assert lost * 100.0 == pytest.approx([-5e-3, -5e-3, -5e-3, 0.0, 2.5e-3, 5e-3, 5e-3, 5e-3], abs=1e-15)


def test_creep_reaches_its_share_of_the_elastic_torsion_after_five_time_constants():
    step = np.where(TIME < 1.0, 0.0, 10.0)
    crept = transmission.creep(TIME, step, 0.03, 5.0, 8336.0)
    at = np.searchsorted(TIME, 1.0 + 25.0)
    assert crept[at] == pytest.approx(0.03 * 10.0 / 8336.0 * (1.0 - np.exp(-5.0)), rel=1e-3)


def test_creep_is_a_spring_and_a_damper_side_by_side():
    def rate(t, angle):
        spring = 8336.0 / 0.03
        return [(np.interp(t, TIME, TRIANGLE) - spring * angle[0]) / (spring * 5.0)]

    solved = solve_ivp(rate, (0.0, 40.0), [0.0], t_eval=TIME, rtol=1e-9, atol=1e-14, max_step=0.05)
    assert transmission.creep(TIME, TRIANGLE, 0.03, 5.0, 8336.0) == pytest.approx(solved.y[0], abs=1e-10)


def test_maxwell_slip_dissipates_what_its_sliders_slide():
    """4 r (A - r) w for a sweep of +-A: the parallelogram of a play."""
    torsion = transmission.maxwell_slip(TRIANGLE, 6e-6, 4.0)
    assert loop_area(torsion, TRIANGLE) == pytest.approx(4.0 * 4.0 * (16.0 - 4.0) * 6e-6, rel=1e-3)


def test_maxwell_slip_remembers_its_turning_points():
    """Masing: a minor loop closes, and the branch goes on as if it had not been."""
    through = np.concatenate([np.linspace(0, 10, 101), np.linspace(10, 2, 81)[1:], np.linspace(2, 14, 121)[1:]])
    straight = np.linspace(0, 14, 141)
    assert transmission.maxwell_slip(through, 1.0, 3.0)[-40:] == pytest.approx(
        transmission.maxwell_slip(straight, 1.0, 3.0)[-40:]
    )


def test_rate_dependent_hysteresis_is_maxwell_slip_when_slow_and_wider_when_fast():
    slow = transmission.rate_dependent_hysteresis(TIME * 1000.0, TRIANGLE, 6e-6, 4.0, 0.5)
    assert slow == pytest.approx(transmission.maxwell_slip(TRIANGLE, 6e-6, 4.0), abs=6e-6 * 3.2 / 1000.0)
    fast = transmission.rate_dependent_hysteresis(TIME, TRIANGLE, 6e-6, 4.0, 0.5)
    assert loop_area(fast, TRIANGLE) > 1.2 * loop_area(slow, TRIANGLE)


def test_the_reaction_of_a_modulated_stiffness_is_the_slope_of_its_stored_energy():
    """Turn under constant torque: what the torque gives to the torsion is half stored, half taken from the motor."""
    angle = np.linspace(0.0, 1.0, 2001)
    torque = np.full(angle.shape, 12.0)
    torsion = transmission.stiffness_modulation(torque, angle, 8e-6, 3.0, 0.4)
    slope = transmission.stiffness_modulation_slope(torque, angle, 8e-6, 3.0, 0.4)
    given = 12.0 * (torsion[-1] - torsion[0])
    stored = 0.5 * 12.0 * (torsion[-1] - torsion[0])
    to_motor = np.trapezoid(torque * slope, angle)
    assert given == pytest.approx(stored + to_motor, rel=1e-6)


def test_a_modulated_stiffness_reacts_without_torque_not_at_all():
    assert transmission.stiffness_modulation_slope(np.zeros(3), np.arange(3.0), 8e-6, 3.0, 0.4) == pytest.approx(0.0)


def test_15_kelvin_soften_a_drive_by_7_5_microradian_at_16_newton_metres():
    elastic = laws.flexspline_torsion(16.0, DRIVE.K_F0, DRIVE.C_F)
    more = transmission.temperature_dependent_stiffness(35.0, elastic, 3e-4, 20.0)
    assert more == pytest.approx(7.5e-6, abs=5e-8)


def test_only_a_lock_yields():
    yielding = transmission.fixture_compliance(np.full(2, 10.0), np.array([0.0, 1.0]), 1.0 / 5e4)
    assert yielding == pytest.approx([0.0, 2e-4])


def test_thermal_expansion_follows_the_warmth_with_its_own_time_constant():
    warmed = np.where(TIME < 1.0, 20.0, 30.0)
    angle = transmission.thermal_expansion(TIME, warmed, 5e-6, 10.0, 20.0)
    assert angle[:200] == pytest.approx(0.0, abs=1e-15)
    assert angle[np.searchsorted(TIME, 11.0)] == pytest.approx(5e-5 * (1.0 - np.exp(-1.0)), rel=1e-3)


def test_a_frame_rings_by_its_amplitude_per_jump_of_the_torque_rate():
    """A kink of 8 N*m/s; the undamped answer is amplitude * jump * sin(w t)."""
    time = np.arange(4000) * 1e-4
    kink = 8.0 * np.maximum(time - 0.1, 0.0)
    rung = transmission.structural_resonance(time, kink, 1e-5, 20.0, 0.0)
    after = time >= 0.1
    assert rung[after] == pytest.approx(8e-5 * np.sin(2.0 * np.pi * 20.0 * (time[after] - 0.1)), abs=1e-9)
    assert rung[~after] == pytest.approx(0.0, abs=1e-15)


def test_a_ringing_frame_decays_with_its_damping():
    time = np.arange(20001) * 1e-4
    rung = transmission.structural_resonance(time, 8.0 * np.maximum(time - 0.1, 0.0), 1e-5, 20.0, 0.03)
    w_d = 2.0 * np.pi * 20.0 * np.sqrt(1.0 - 0.03**2)
    peaks = 0.1 + (np.arccos(0.03) + 2.0 * np.pi * np.arange(12)) / w_d
    heights = np.interp(peaks, time, rung)
    assert heights[1:] / heights[:-1] == pytest.approx(np.exp(-2.0 * np.pi * 0.03 / np.sqrt(1.0 - 0.03**2)), rel=2e-3)

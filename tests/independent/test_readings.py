"""The second formulas of the instruments' errors give known numbers."""

import numpy as np
import pytest

from tests.independent import laws, readings

DRIVE = laws.shd_17_100()
TIME = np.arange(20001) * 5e-3


def test_ten_micrometres_on_25_millimetres_are_82_5_seconds_of_arc():
    """The exact angle of a disc beside its axis, seen by one head; the formula is its first order."""
    angle = np.linspace(0.0, 2.0 * np.pi, 1001)
    eccentricity = 10e-6 / 25e-3
    head = np.arctan2(np.sin(angle), np.cos(angle) - eccentricity) - angle
    head = (head + np.pi) % (2.0 * np.pi) - np.pi
    first_order = readings.motor_encoder_eccentricity(angle, eccentricity, 1.0, 0.0)
    assert head == pytest.approx(first_order, abs=eccentricity**2)
    assert np.degrees(np.max(first_order)) * 3600.0 == pytest.approx(82.5, abs=0.05)


def test_lines_between_lines_repeat_with_the_line_count():
    angle = np.linspace(0.0, 0.01, 501)
    error = readings.encoder_subdivision_error(angle, 5e-5, 2048.0, 0.3)
    again = readings.encoder_subdivision_error(angle + 2.0 * np.pi / 2048.0, 5e-5, 2048.0, 0.3)
    assert again == pytest.approx(error, abs=1e-15)
    assert np.max(np.abs(error)) == pytest.approx(5e-5, rel=1e-3)
    both = readings.output_encoder_eccentricity(angle, 2e-4, 2.0, 0.1)
    assert both == pytest.approx(2e-4 * np.sin(2.0 * angle + 0.1), abs=1e-17)


def test_four_missed_counts_are_15_microradian_at_the_output():
    steps = np.unique(np.diff(readings.encoder_missed_counts(TIME, 4.0, 0.1, 7.0, 16384.0)))
    assert np.max(np.abs(steps)) / 100.0 == pytest.approx(15e-6, abs=0.5e-6)


def test_missed_counts_are_whole_rare_and_memoryless():
    """Over many seeds: as many events as the rate says, at exponential intervals; the same seed repeats itself."""
    count = 2.0 * np.pi / 16384.0
    events, waits = [], []
    for seed in range(200):
        angle = readings.encoder_missed_counts(TIME, 30.0, 0.1, float(seed), 16384.0)
        assert angle[0] == 0.0
        assert np.allclose(angle / (30.0 * count), np.round(angle / (30.0 * count)), rtol=0.0, atol=1e-9)
        at = TIME[1:][np.diff(angle) != 0.0]
        events.append(at.size)
        waits += np.diff(at).tolist()
    # 100 s at 0.1/s: 10 events, 200 records: 2000 events, 2.2 % each
    assert np.mean(events) == pytest.approx(10.0, rel=0.07)
    assert np.var(events) == pytest.approx(10.0, rel=0.3)
    assert np.std(waits) == pytest.approx(np.mean(waits), rel=0.1)
    assert np.array_equal(
        readings.encoder_missed_counts(TIME, 30.0, 0.1, 3.0, 16384.0),
        readings.encoder_missed_counts(TIME, 30.0, 0.1, 3.0, 16384.0),
    )


def test_a_tenth_of_a_newton_metre_of_offset_is_ten_microradian():
    """It enters through 1/K_FL: 10.4 urad on average over a sweep, 1.28 rms of even shape."""
    torque = np.interp(np.linspace(0.0, 4.0, 8001), [0.0, 1.0, 3.0, 4.0], [0.0, 16.0, -16.0, 0.0])
    shown = torque + readings.torque_sensor_offset(torque, 0.1)
    wrong = laws.flexspline_torsion(shown, DRIVE.K_F0, DRIVE.C_F) - laws.flexspline_torsion(
        torque, DRIVE.K_F0, DRIVE.C_F
    )
    assert np.mean(wrong) == pytest.approx(10.4e-6, abs=5e-8)
    assert np.std(wrong) == pytest.approx(1.28e-6, abs=1e-8)


def test_a_good_flange_drifts_by_15_millinewton_metres_in_10_kelvin():
    drift = readings.torque_sensor_drift([20.0, 30.0, 20.0], [0.0, 0.0, 100.0], 1.5e-3, 1e-5, 20.0)
    assert drift == pytest.approx([0.0, 0.015, 1e-3])


def test_gain_and_nonlinearity_of_a_transducer():
    torque = np.array([-30.0, -16.0, 0.0, 16.0, 30.0])
    assert readings.torque_sensor_gain(torque, 0.02) == pytest.approx(0.02 * torque, abs=1e-14)
    bent = readings.torque_sensor_nonlinearity(torque, 0.03, -0.01, 30.0)
    assert bent == pytest.approx([0.04, 0.03 * (16 / 30) ** 2 + 0.01 * (16 / 30) ** 3, 0.0, bent[3], 0.02])
    assert bent[3] == pytest.approx(0.03 * (16 / 30) ** 2 - 0.01 * (16 / 30) ** 3)


def test_lag_and_delay_are_equal_on_a_slow_ramp_and_50_ms_at_4_newton_metres_a_second_are_24_microradian():
    ramp = 4.0 * TIME
    late, lagged = readings.channel_delay(TIME, ramp, 0.05), readings.torque_sensor_lag(TIME, ramp, 0.05)
    assert late[100:] == pytest.approx(lagged[100:], abs=1e-4)
    assert late[100] / DRIVE.K_F0 == pytest.approx(-24e-6, abs=0.1e-6)


def test_a_chirp_splits_lag_from_delay():
    """The delay keeps the gain; the lag of 50 ms at 10 Hz leaves 30 %."""
    wave = np.sin(2.0 * np.pi * 10.0 * TIME)
    late, lagged = (wave + error(TIME, wave, 0.05) for error in (readings.channel_delay, readings.torque_sensor_lag))
    assert np.max(np.abs(late[1000:])) == pytest.approx(1.0, abs=1e-2)
    assert np.max(np.abs(lagged[1000:])) == pytest.approx(1.0 / np.hypot(1.0, np.pi), abs=5e-3)


def test_current_errors_in_torque():
    torque = np.array([-0.1, 0.0, 0.1])
    assert readings.current_sensor_offset(torque, 0.01, 0.321) == pytest.approx(3.21e-3)
    assert readings.torque_constant_error(torque, 0.05) == pytest.approx(0.05 * torque)
    current = np.array([-1.0, 0.0, 0.5])
    lost = readings.torque_constant_saturation(current, 1.0 / 2.0**2, 0.321)
    # k_t falls by (i/i_s)^2: a quarter at half the saturation current
    assert lost == pytest.approx(0.321 * current * np.array([0.25, 0.0, 0.0625]))

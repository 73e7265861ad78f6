"""Torques that were swept in straight lines: what is left of their noise, and where their corners are found."""

import math

import numpy as np
import pytest
from scipy.signal import lfilter

from rig.loop.signals.outliers import outliers_drawn_in
from rig.loop.signals.polyline import polyline
from rig.loop.signals.smoothing import THERMAL_SPANS, smooth

NOISE = 0.02
"""N*m."""


def with_noise(torque, seed, noise=NOISE):
    return torque + np.random.default_rng(seed).normal(0.0, noise, torque.size)


def found(torque, period, seed, noise=NOISE):
    """Give the polyline found under white noise."""
    return polyline(with_noise(torque, seed, noise), round(0.1 / period), period)


def ladder(time):
    """Loads that change within a second every seven seconds: 75 corners in 262 s."""
    starts = np.arange(0.0, time[-1], 7.0)
    levels = np.resize([0.0, 6.0, -6.0, 11.0, -11.0], starts.size)
    return np.interp(time, np.sort(np.concatenate([starts, starts + 6.0])), np.repeat(levels, 2))


def triangle(time):
    """Give a sweep to 12 N*m and back with a hold at the top."""
    return np.interp(time, [0.0, 5.0, 9.0, 16.0, 24.0, 28.0], [0.0, 0.0, 12.0, 12.0, -12.0, 0.0])


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("shape", "seconds", "corners"), [(ladder, 262.0, 75), (triangle, 28.0, 4)])
@pytest.mark.parametrize("rate", [100.0, 1000.0])
def test_a_polyline_is_found_with_little_of_its_noise(shape, seconds, corners, rate, seed):
    time = np.arange(0.0, seconds, 1.0 / rate)
    line = found(shape(time), 1.0 / rate, seed)
    assert line is not None
    # two numbers for every corner are estimated from all samples
    least = NOISE * np.sqrt(2.0 * (corners + 1) / time.size)
    assert np.sqrt(np.mean((line - shape(time)) ** 2)) < 1.6 * least


@pytest.mark.parametrize("seed", range(4))
def test_a_corner_is_placed_to_a_fraction_of_a_sample(seed):
    time = np.arange(0.0, 28.0, 0.01)
    torque = triangle(time + 0.0037)
    line = found(torque, 0.01, seed)
    assert line is not None
    for corner in (5.0, 9.0, 16.0):
        near = np.abs(time - corner) < 0.2
        assert np.abs(line - torque)[near].max() < 0.6 * NOISE


@pytest.mark.parametrize("seed", range(4))
def test_a_sine_is_no_polyline(seed):
    time = np.arange(0.0, 60.0, 0.01)
    assert found(12.0 * np.sin(0.2 * time), 0.01, seed) is None


def error_of_a_sweep(slopes, seed):
    """Give the rms error of what is found of ramps in turn, in shares of the noise, and what one rate leaves."""
    times = 2.0 + np.cumsum([0.0, *(3.0 / np.abs(slopes))])
    heights = np.append(0.0, np.cumsum(3.0 * np.sign(slopes)))
    time = np.arange(0.0, times[-1] + 2.0, 0.01) + 0.0037
    torque = np.interp(time, times, heights)
    line = found(torque, 0.01, seed)
    assert line is not None
    # one rate, and a place for each of the pieces, which include the rests at both ends
    return np.sqrt(np.mean((line - torque) ** 2)) / NOISE, np.sqrt((len(slopes) + 3) / time.size)


def test_of_a_sweep_at_one_rate_nothing_but_the_rate_and_the_places_of_its_pieces_stays_unknown():
    errors, least = zip(*(error_of_a_sweep(np.resize([2.0, -2.0], 8), seed) for seed in range(12)), strict=True)
    assert np.sqrt(np.mean(np.square(errors))) < 1.15 * least[0]


def test_a_sweep_at_several_rates_keeps_them():
    slopes = np.array([2.0, -2.2, 2.0, -2.2, 2.0, -2.2])
    errors, least = zip(*(error_of_a_sweep(slopes, seed) for seed in range(4)), strict=True)
    assert np.sqrt(np.mean(np.square(errors))) < 2.0 * least[0]


@pytest.mark.parametrize("seed", range(4))
def test_a_bump_in_a_hold_of_a_sweep_at_one_rate_is_no_part_of_the_hold(seed):
    time = np.arange(0.0, 40.0, 0.01)
    torque = np.interp(time, [0, 4, 10, 12, 13, 14, 16, 22, 28, 34, 40], [0, 0, 12, 12, 12.3, 12, 12, 0, 12, 0, 0])
    line = found(torque, 0.01, seed)
    assert line is not None
    assert np.sqrt(np.mean((line - torque) ** 2)) < 0.2 * NOISE


def coloured(count, seed):
    """First-order autoregression, 0.97 from sample to sample, of the size of the white noise."""
    white = np.random.default_rng(seed).standard_normal(count)
    return NOISE * lfilter([math.sqrt(1.0 - 0.97**2)], [1.0, -0.97], white)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("seconds", [12.0, 30.0])
def test_a_sine_in_a_noise_that_remembers_is_no_polyline(seconds, seed):
    """Its chords would miss it by up to ten times the noise and pass for a slower noise."""
    time = np.arange(0.0, 2.0 * seconds, 0.01)
    torque = 13.0 * np.sin(2.0 * math.pi * time / seconds)
    assert polyline(torque + coloured(time.size, seed), 10, 0.01) is None


@pytest.mark.parametrize("seed", range(6))
def test_a_sweep_with_holds_in_a_noise_that_remembers_is_a_polyline(seed):
    time = np.arange(0.0, 60.0, 0.01)
    torque = np.interp(time, [0, 5, 10, 14, 24, 28, 33, 60], [0, 0, 14, 14, -14, -14, 0, 0])
    line = polyline(torque + coloured(time.size, seed), 10, 0.01)
    assert line is not None
    assert np.std(line - torque) < NOISE


@pytest.mark.parametrize("seed", range(6))
def test_a_hold_is_level_although_its_noise_is_not(seed):
    """A play keeps the higher end: of two ends that differ by chance that is on average too much."""
    line = found(triangle(np.arange(0.0, 28.0, 0.01)), 0.01, seed)
    assert line is not None
    assert line[910:1590] == pytest.approx(line[1200], abs=1e-4 * NOISE)
    # 700 samples of the hold, and the corners at its ends
    assert line[1200] == pytest.approx(12.0, abs=3.5 * NOISE / math.sqrt(700.0))


def test_a_slow_rise_between_steep_ones_is_not_made_level():
    time = np.arange(0.0, 28.0, 0.01)
    torque = np.interp(time, [0.0, 5.0, 9.0, 16.0, 24.0, 28.0], [0.0, 0.0, 12.0, 12.02, -12.0, 0.0])
    line = found(torque, 0.01, 0)
    assert line is not None
    assert line[1590] - line[910] == pytest.approx(0.02, abs=3.0 * NOISE * math.sqrt(12.0 / 700.0))
    assert line[1590] - line[910] > 0.01


@pytest.mark.parametrize("seed", range(6))
def test_heavy_tails_are_drawn_in_and_what_lasts_stays(seed):
    time = np.arange(0.0, 60.0, 0.01)
    torque = np.interp(time, [0, 5, 10, 35, 45, 60], [0, 0, 14, 14, -14, 0])
    tails = np.random.default_rng(seed).standard_t(3, time.size) / math.sqrt(3.0)
    noisy = torque + NOISE * tails
    calm = outliers_drawn_in(noisy, 0.01)
    assert np.abs(noisy - torque).max() > 10.0 * NOISE > 9.0 * NOISE > np.abs(calm - torque).max()
    assert np.mean(calm != noisy) < 0.03
    line = polyline(calm, 10, 0.01)
    assert line is not None
    assert np.std(line - torque) < 0.1 * NOISE
    pulse = np.where(np.abs(time - 30.0) < 0.015, 1.0, 0.0)  # of three samples
    assert (outliers_drawn_in(noisy + pulse, 0.01) - calm)[2998:3003].max() > 0.9


@pytest.mark.parametrize("seed", [123, 133, 140, 164, 169, 242, *range(1000, 1010)])
def test_a_few_samples_of_a_hold_that_lie_low_by_chance_are_not_followed(seed):
    dice = np.random.default_rng(seed)
    time = np.arange(0.0, 28.0, 0.01)
    torque = triangle(time)
    noisy = torque + NOISE * dice.standard_t(3, time.size) / math.sqrt(3.0)
    low = int(dice.integers(950, 1500))
    noisy[low : low + 4] = 12.0 + NOISE * np.array([-2.6, -4.7, -3.0, -1.1])
    line = polyline(outliers_drawn_in(noisy, 0.01), 10, 0.01)
    assert line is not None
    assert np.abs(line - torque)[920:1580].max() < 0.5 * NOISE


def test_a_torque_without_noise_has_none_to_lose():
    assert found(triangle(np.arange(0.0, 28.0, 0.01)), 0.01, 0, noise=0.0) is None


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("rate", [100.0, 1000.0])
def test_a_curve_keeps_its_form_and_loses_most_of_its_noise(rate, seed):
    time = np.arange(0.0, 60.0, 1.0 / rate)
    torque = 12.0 * np.sin(0.2 * time) + 0.3 * np.sin(2.0 * time)
    noisy = with_noise(torque, seed)
    left = smooth(noisy, round(0.025 * rate), 1.0 / rate) - torque
    # what a cubic over 0.6 s leaves in its middle, and a quarter: over two seconds it no longer follows 2 rad/s
    assert np.sqrt(np.mean(left**2)) < 1.25 * NOISE * np.sqrt(2.25 / (0.6 * rate))


@pytest.mark.parametrize("seed", range(4))
def test_what_rings_in_a_torque_is_no_noise(seed):
    time = np.arange(0.0, 10.0, 0.001)
    torque = triangle(time) + 0.1 * np.sin(2.0 * np.pi * 34.0 * time)
    noisy = with_noise(torque, seed)
    left = smooth(noisy, 25, 0.001) - torque
    assert np.sqrt(np.mean(left**2)) < 0.1 / np.sqrt(2.0)


@pytest.mark.parametrize("rate", [50.0, 100.0, 200.0, 1000.0])
@pytest.mark.parametrize("seconds", [0.5, 3.0, 10.0])
@pytest.mark.parametrize("noise", [0.0, NOISE])
def test_what_a_play_gets_does_not_overshoot_a_step_or_a_pulse(rate, seconds, noise):
    time = np.arange(round(seconds * rate)) / rate
    for torque in (np.where(time < 0.5 * seconds, 0.0, 10.0), np.where(np.abs(time - 0.5 * seconds) < 0.1, 10.0, 0.0)):
        noisy = with_noise(torque, 0, noise)
        line = polyline(noisy, round(0.1 * rate), 1.0 / rate)
        got = smooth(noisy, round(0.1 * rate), 1.0 / rate) if line is None else line
        assert got.min() > -0.5
        assert got.max() < 10.5


@pytest.mark.parametrize("period", [1.0, 0.1, 0.05, 1e-3, 5e-5])
@pytest.mark.parametrize("torque", [np.zeros(41), np.full(3000, 3.0), 3001.0 * np.arange(3000)])
def test_a_torque_without_noise_stays_what_it_is_at_any_rate(torque, period):
    for side in (round(0.025 / period), round(0.1 / period)):
        assert smooth(torque, side, period) == pytest.approx(torque, rel=1e-9, abs=1e-6)


def test_at_its_ends_a_slow_signal_loses_its_noise_too():
    time = np.arange(0.0, 40.0, 0.01)
    slow = 27.0 + 5.0 * -np.expm1(-time / 300.0)
    left = [smooth(with_noise(slow, seed, 0.05), 50, 0.01, THERMAL_SPANS) - slow for seed in range(30)]
    ends = np.array(left)[:, [0, -1]]
    # the end of a cubic through 20 s is known to 4.5 mK, that of a line through half a second to 14 mK
    assert np.sqrt(np.mean(ends**2)) < 0.009

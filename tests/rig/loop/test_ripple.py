"""The rotor's ripple from an encoder whose count is ten times as large as the ripple."""

import numpy as np
import pytest

from rig.loop.signals.ripple import speed_ripple

COUNT = 2 * np.pi / 16384
OMEGA = 84 * 20.0


def leg(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 30.0, 1e-3)
    ripple = 3.3e-5 * np.sin(OMEGA * time + 1.0)
    position = COUNT * np.floor((20.0 * time + rng.uniform(0, 1) + ripple + 2e-5 * rng.standard_normal(30_000)) / COUNT)
    torque = 0.012 + 3e-3 * np.sin(OMEGA * time) + 2e-4 * rng.standard_normal(time.size)
    return time, position, torque, np.full(time.size, 20.0), ripple


def test_ripple_below_one_count_is_found_within_the_noise_it_states() -> None:
    away = []
    for seed in range(12):
        time, position, torque, speed, ripple = leg(seed)
        found = speed_ripple(time, position, torque, speed)
        amplitudes = [2 * float(np.mean((found.position - ripple) * wave(OMEGA * time))) for wave in (np.sin, np.cos)]
        away += [amplitude / float(found.noise[0]) for amplitude in amplitudes]
    # 24 values of unit variance: their mean square lies within 0.52 and 1.64 with 95 %
    assert 0.3 < np.mean(np.square(away)) < 2.0


def test_acceleration_is_the_second_derivative_of_the_ripple() -> None:
    time, position, torque, speed, _ = leg(1)
    found = speed_ripple(time, position, torque, speed)
    assert found.acceleration == pytest.approx(-(OMEGA**2) * found.position, rel=1e-3, abs=0.1)


def test_nothing_is_found_where_the_torque_has_no_line() -> None:
    time, position, _, speed, _ = leg(1)
    noise = 2e-4 * np.random.default_rng(3).standard_normal(time.size)
    assert not np.any(speed_ripple(time, position, noise, speed).acceleration)

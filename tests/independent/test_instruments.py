"""The instruments quantise, shift and add noise as declared."""

import numpy as np
import pytest

from tests.independent.instruments import Instruments, NoiseKind, Truth, measure

N = 40_000


def truth(load: float = 12.0) -> Truth:
    ramp = np.linspace(0.0, 3.0, N)
    constant = np.ones(N)
    return Truth(100.0 * ramp, -ramp, load / 100.0 * constant, load * constant, 25.0 * constant)


@pytest.mark.parametrize("kind", list(NoiseKind))
def test_every_noise_has_the_declared_rms(kind: NoiseKind):
    measured, _ = measure(truth(), Instruments(noise=kind), 100.0, np.random.default_rng(2))
    # 40 000 samples: 0.4 % for white noise, 3 % for AR(1) 0.97 (66 samples of memory); Student-t(3) has no 4th moment
    tolerance = {NoiseKind.AR1: 0.1, NoiseKind.STUDENT_T: 0.2}.get(kind, 0.02)
    assert np.std(measured["output_torque"] - 12.0) == pytest.approx(0.02, rel=tolerance)
    assert np.std(measured["motor_torque"] - 0.12) == pytest.approx(2e-4, rel=tolerance)


def test_torque_proportional_noise_is_small_without_load():
    measured, _ = measure(truth(0.0), Instruments(noise=NoiseKind.TORQUE_PROPORTIONAL), 100.0, np.random.default_rng(2))
    assert np.std(measured["output_torque"]) == pytest.approx(0.005, rel=0.02)


def test_ar1_noise_remembers_its_past():
    measured, _ = measure(truth(), Instruments(noise=NoiseKind.AR1), 100.0, np.random.default_rng(2))
    noise = measured["output_torque"] - 12.0
    assert np.corrcoef(noise[1:], noise[:-1])[0, 1] == pytest.approx(0.97, abs=0.005)


@pytest.mark.parametrize("dither", [False, True])
def test_encoders_show_whole_counts_below_the_shifted_angle(dither: bool):
    true = truth()
    measured, zeros = measure(true, Instruments(dither=dither), 100.0, np.random.default_rng(5))
    for name, counts in (("motor_position", 16384), ("output_position", 524288)):
        in_counts = measured[name] / (2 * np.pi / counts)
        assert in_counts == pytest.approx(np.round(in_counts), abs=1e-6)
        behind = (getattr(true, name) + zeros[name] - measured[name]) / (2 * np.pi / counts)
        reach = 0.5 if dither and name == "output_position" else 0.0
        assert behind.min() >= -reach - 1e-6
        assert behind.max() <= 1.0 + reach + 1e-6


def test_the_motor_encoder_is_off_by_whole_turns_within_a_count():
    _, zeros = measure(truth(), Instruments(), 100.0, np.random.default_rng(9))
    beyond_turns = zeros["motor_position"] % (2 * np.pi)
    assert beyond_turns < 2 * np.pi / 16384


def test_current_and_torque_are_one_measurement():
    measured, _ = measure(truth(), Instruments(), 100.0, np.random.default_rng(5))
    assert measured["motor_current"] * 0.321 == pytest.approx(measured["motor_torque"], abs=1e-15)

"""The instruments quantise, shift and add noise as declared."""

import numpy as np
import pytest

from tests.independent import effects as fx
from tests.independent.instruments import (
    Instruments,
    NoiseKind,
    Truth,
    measure,
    shown_motor_torque,
    true_motor_torque,
)

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


QUIET = Instruments(output_torque_noise=0.0, motor_torque_noise=0.0)
TIME = np.arange(N) / 200.0


def shown(effects: fx.Effects, true: Truth | None = None, seed: int = 5) -> tuple[dict, dict]:
    return measure(true or truth(), QUIET, 100.0, np.random.default_rng(seed), effects, TIME)


def test_a_lag_and_a_delay_change_the_reading_of_the_output_torque_alone():
    ramp = Truth(np.zeros(N), np.zeros(N), np.zeros(N), 4.0 * TIME, np.full(N, 25.0))
    for term in (fx.term("torque-sensor-lag", time_constant=0.02), fx.term("channel-delay", delay=0.02)):
        measured, plain = shown(fx.Effects(others=(term,)), ramp)[0], shown(fx.Effects(), ramp)[0]
        assert (measured["output_torque"] - 4.0 * TIME)[200:] == pytest.approx(-0.08, abs=1e-9)
        assert all(np.array_equal(measured[name], plain[name]) for name in measured if name != "output_torque")


def test_errors_of_an_encoder_come_before_its_counts_and_belong_to_its_disc():
    bent = fx.Effects(others=(fx.term("encoder-subdivision-error", amplitude=8e-5, order=2048.0, phase=0.4),))
    (measured, zeros), (_, other_zeros) = shown(bent), shown(bent, seed=6)
    true = truth()
    count = 2 * np.pi / 524288
    in_counts = measured["output_position"] / count
    assert in_counts == pytest.approx(np.round(in_counts), abs=1e-6)
    on_disc = true.output_position + zeros["output_position"]
    behind = on_disc + 8e-5 * np.sin(2048.0 * on_disc + 0.4) - measured["output_position"]
    assert behind.min() >= -1e-12
    assert behind.max() <= count + 1e-12
    assert zeros["output_position"] != other_zeros["output_position"]


def test_missed_counts_are_whole_counts_at_other_times_in_every_run():
    missed = fx.Effects(
        others=(fx.term("encoder-missed-counts", amplitude=25.0, rate=0.1, seed=3.0, encoder_counts=16384.0),)
    )
    lost = []
    for seed in (1, 2):
        with_misses, without = shown(missed, seed=seed)[0], shown(fx.Effects(), seed=seed)[0]
        lost.append((with_misses["motor_position"] - without["motor_position"]) / (2 * np.pi / 16384))
        assert lost[-1] == pytest.approx(np.round(lost[-1]), abs=1e-6)
        assert set(np.round(np.abs(np.diff(lost[-1]))).tolist()) <= {0.0, 25.0, 50.0}
        assert lost[-1].any()
    assert not np.array_equal(*lost)


@pytest.mark.parametrize(
    "term",
    [
        fx.term("torque-constant-error", amplitude=0.08),
        fx.term("current-sensor-offset", amplitude=-0.01, torque_constant=0.321),
        fx.term("torque-constant-saturation", amplitude=0.4, torque_constant=0.321),
    ],
    ids=lambda term: term.id,
)
def test_a_commanded_torque_is_what_the_drive_reads(term: fx.Term):
    effects = fx.Effects(others=(term,))
    commanded = np.linspace(-0.17, 0.17, 101)
    true = true_motor_torque(commanded, effects, 0.321)
    assert np.max(np.abs(true - commanded)) > 2e-3
    assert shown_motor_torque(true, effects, 0.321) == pytest.approx(commanded, abs=1e-15)


def test_current_and_torque_stay_one_measurement_whatever_is_wrong_with_them():
    wrong = fx.Effects(
        others=(
            fx.term("torque-constant-error", amplitude=0.08),
            fx.term("current-sensor-offset", amplitude=-0.01, torque_constant=0.321),
            fx.term("torque-constant-saturation", amplitude=0.4, torque_constant=0.321),
        )
    )
    measured, _ = shown(wrong)
    assert measured["motor_current"] * 0.321 == pytest.approx(measured["motor_torque"], abs=1e-15)
    # 0.12 N*m: k_t (i + i0) with k_t i (1 - 0.4 i^2) = 1.08 * 0.12
    current = measured["motor_current"][0] + 0.01
    assert 0.321 * current * (1.0 - 0.4 * current**2) == pytest.approx(1.08 * 0.12, abs=1e-14)


def test_a_motor_that_saturates_before_its_torque_is_refused():
    with pytest.raises(ValueError, match="saturates"):
        shown_motor_torque(
            np.array([0.3]),
            fx.Effects(others=(fx.term("torque-constant-saturation", amplitude=0.4, torque_constant=0.321),)),
            0.321,
        )

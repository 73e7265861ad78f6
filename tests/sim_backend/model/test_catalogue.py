"""Single effects against closed forms and against the figures that come with them; SI, sense `opposed`."""

import itertools
import math

import numpy as np
import pytest

from sim_backend.model.arrays import evaluate
from sim_backend.model.compliance import flexspline_torsion, wave_generator_torsion
from sim_backend.model.effects import CATALOGUE
from sim_backend.model.friction import play

INSEPARABLE = (
    ("flexspline-compliance", "torque-sensor-gain", "fixture-compliance", "torque-constant-error"),
    ("torque-constant-error", "torque-sensor-gain", "load-dependent-friction"),
    ("kinematic-error", "stiffness-modulation", "flexspline-compliance", "soft-windup"),
    ("channel-delay", "torque-sensor-lag", "creep", "rate-dependent-hysteresis", "viscous-friction"),
    ("wave-generator-compliance", "maxwell-slip", "coulomb-friction", "backlash"),
    ("torque-sensor-drift", "thermal-expansion", "creep", "temperature-dependent-stiffness"),
    ("cogging", "position-dependent-friction", "gravity-load", "current-sensor-offset"),
    ("cogging", "torque-ripple"),
    ("kinematic-error", "motor-encoder-eccentricity"),
    ("kinematic-error", "output-encoder-eccentricity"),
    ("kinematic-error", "structural-resonance"),
    ("coulomb-friction", "viscous-friction", "stribeck-friction"),
    ("flexspline-compliance", "torque-constant-saturation", "load-dependent-friction"),
)
"""What the data of one kind of run cannot split: locked output and backdrive; the slope of a locked sweep; one start
angle; one rate; one loop amplitude; one warm-up; one direction; one current; encoders never re-clocked (two); one speed
(two); torque taken from the current."""

STEP = 1e-3
K_F0, C_F = 8335.98, 0.04494


def added(effect_id: str, values: tuple[float, ...], *, step: float = STEP, **signals: np.ndarray) -> np.ndarray:
    return evaluate(CATALOGUE[effect_id], signals, values, step=step)


def clock(duration: float, step: float = STEP) -> np.ndarray:
    return np.arange(round(duration / step) + 1) * step


def area(torque: np.ndarray, angle: np.ndarray) -> float:
    return float(np.trapezoid(torque, angle))


@pytest.mark.parametrize("group", INSEPARABLE, ids=lambda group: group[0])
def test_what_a_kind_of_run_cannot_split_is_stated_as_such(group):
    for one, other in itertools.permutations(group, 2):
        assert other in CATALOGUE[one].confusable, (one, other)


def test_the_base_terms_are_the_laws_of_the_fit():
    torque = np.linspace(-20.0, 20.0, 401)
    by_entry = added("flexspline-compliance", (K_F0, C_F), output_torque=torque)
    assert by_entry == pytest.approx(flexspline_torsion(torque, K_F0, C_F), rel=1e-15)
    by_entry = added("wave-generator-compliance", (1.333, 83.3, 100.0), motor_torque=torque / 100.0)
    assert by_entry == pytest.approx(wave_generator_torsion(torque / 100.0, 1.333, 83.3) / 100.0, rel=1e-15)
    swing = 0.17 * np.sin(np.linspace(0.0, 20.0, 4001))
    assert np.array_equal(
        added("coulomb-friction", (0.012, 100.0), motor_torque=swing), play(100.0 * swing, 100.0 * 0.012)
    )


def test_the_wave_generator_takes_half_the_hysteresis_loss_at_most():
    # 1/(C_w N K_w0) = Psi/2 = 9.0e-5 rad, Zhang (34), with C_w = 1/T_fs
    torsion = added("wave-generator-compliance", (4.0 / 3.0, 1.0 / 0.012, 100.0), motor_torque=np.array([-5.0, 5.0]))
    assert torsion == pytest.approx([-9.0e-5, 9.0e-5], rel=1e-9)


def test_the_soft_zone_ends():
    torsion = added("soft-windup", (3e-5, 0.8), output_torque=np.array([-16.0, -0.8, 0.0, 0.8, 16.0]))
    edge = 3e-5 * math.tanh(1.0)
    assert torsion == pytest.approx([-3e-5, -edge, 0.0, edge, 3e-5], rel=1e-12)


def test_the_gap_stands_on_the_side_that_the_torque_presses_on():
    torque = np.array([-0.1, -1e-3, -5e-4, 0.0, 2.5e-4, 1e-3, 0.1])
    torsion = added("backlash", (1e-3, 1e-3, 100.0), motor_torque=torque)
    assert torsion == pytest.approx(np.array([-1.0, -1.0, -0.5, 0.0, 0.25, 1.0, 1.0]) * 1e-5, rel=1e-12, abs=1e-18)


def test_creep_under_a_ramp_is_the_response_of_a_first_order_lag():
    t = clock(60.0, 0.5)
    torsion = added("creep", (0.03, 20.0, K_F0), step=0.5, output_torque=4.0 + 0.2 * t)
    lagging = 4.0 + 0.2 * (t - 20.0 * (1.0 - np.exp(-t / 20.0)))
    # exact for straight pieces, whatever the step
    assert torsion == pytest.approx(0.03 * lagging / K_F0, rel=1e-13)


def test_creep_goes_on_while_the_torque_stays():
    t = clock(100.0)
    torsion = added("creep", (0.03, 20.0, K_F0), output_torque=np.where(t < 1.0, 0.0, 16.0))
    held = t >= 1.0
    # the torque rises within the step before 1 s: half a step of it has passed by then
    expected = 0.03 * 16.0 / K_F0 * (1.0 - np.exp(-(t[held] - 1.0 + 0.5 * STEP) / 20.0))
    assert torsion[held] == pytest.approx(expected, abs=1e-6 * 0.03 * 16.0 / K_F0)


def test_the_loop_of_creep_has_the_area_of_a_lagging_sine():
    period, tau = 30.0, 20.0
    t = clock(20 * period, 0.01)
    torque = 16.0 * np.sin(2.0 * np.pi * t / period)
    torsion = added("creep", (0.03, tau, K_F0), step=0.01, output_torque=torque)
    last = slice(-round(period / 0.01) - 1, None)
    lag = 2.0 * np.pi * tau / period
    expected = math.pi * 16.0**2 * 0.03 / K_F0 * lag / (1.0 + lag**2)
    assert area(torque[last], torsion[last]) == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("period", [1.0, 100.0])
def test_the_maxwell_loop_dissipates_four_radii_times_the_travel_at_every_rate(period):
    t = np.linspace(0.0, 2.0 * period, 40001)
    torque = 16.0 * np.sin(2.0 * np.pi * t / period)
    torsion = added("maxwell-slip", (5e-6, 2.0), step=float(t[1]), output_torque=torque)
    last = slice(20000, None)
    assert area(torque[last], torsion[last]) == pytest.approx(4.0 * 5e-6 * 2.0 * (16.0 - 2.0), rel=1e-6)


def rate_dependent_area(radius: float, period: float) -> float:
    t = np.linspace(0.0, 3.0 * period, 60001)
    torque = 16.0 * np.sin(2.0 * np.pi * t / period)
    torsion = added("rate-dependent-hysteresis", (5e-6, radius, 0.5), step=float(t[1]), output_torque=torque)
    return area(torque[40000:], torsion[40000:])


def test_rate_dependent_hysteresis_opens_with_the_rate_from_the_rate_free_loop():
    rate_free = 4.0 * 5e-6 * 2.0 * (16.0 - 2.0)
    before = rate_free
    for period in (1000.0, 100.0, 10.0):
        lag = 2.0 * np.pi * 0.5 / period
        lagging = 5e-6 * math.pi * 16.0**2 * lag / (1.0 + lag**2)
        assert rate_dependent_area(0.0, period) == pytest.approx(lagging, rel=1e-5)
        # the lag's own loss comes on top, but only while the play slips
        opened = rate_dependent_area(2.0, period)
        assert before < opened < rate_free + lagging
        before = opened
    assert before > 2.0 * rate_free


def test_stiffness_modulation_has_no_say_without_torque():
    angle = np.linspace(0.0, 20.0, 101)
    torsion = added(
        "stiffness-modulation", (5e-6, 2.0, 0.3), output_torque=np.full_like(angle, 8.0), motor_position=angle
    )
    assert torsion == pytest.approx(4e-5 * np.sin(2.0 * angle + 0.3), abs=1e-18)
    nothing = np.zeros_like(angle)
    assert not added("stiffness-modulation", (5e-6, 2.0, 0.3), output_torque=nothing, motor_position=angle).any()


def test_fifteen_kelvin_soften_the_flexspline_by_seven_microradians():
    # reference: 7.5 urad at 16 N*m for 3e-4 1/K
    torsion = added(
        "temperature-dependent-stiffness",
        (3e-4, 25.0),
        temperature=np.array([40.0]),
        flexspline_torsion=flexspline_torsion(np.array([16.0]), K_F0, C_F),
    )
    assert torsion == pytest.approx(7.5e-6, rel=1e-2)


def test_a_soft_fixture_shows_while_it_holds_and_only_then():
    torque, locked = np.array([8.0, 8.0, -8.0]), np.array([0.0, 1.0, 1.0])
    torsion = added("fixture-compliance", (1.0 / 5e4,), output_torque=torque, locked=locked)
    assert torsion == pytest.approx([0.0, 1.6e-4, -1.6e-4])


def test_the_mount_follows_the_temperature_late():
    t = clock(900.0, 1.0)
    torsion = added("thermal-expansion", (3e-6, 300.0, 25.0), step=1.0, temperature=25.0 + 0.05 * t)
    assert torsion == pytest.approx(3e-6 * 0.05 * (t - 300.0 * (1.0 - np.exp(-t / 300.0))), abs=1e-17)


@pytest.mark.parametrize("step", [1e-4, 1e-3, 7e-3])
def test_a_jump_of_the_torques_rate_rings_as_the_closed_form_says(step):
    t = clock(1.0, step)
    ringing = added("structural-resonance", (1e-5, 12.0, 0.02), step=step, output_torque=3.0 + 2.0 * t)
    w, damping = 2.0 * math.pi * 12.0, 0.02
    w_d = w * math.sqrt(1.0 - damping**2)
    expected = 1e-5 * 2.0 * w / w_d * np.exp(-damping * w * t) * np.sin(w_d * t)
    # the torque's rate jumps at the first sample only: exact at every step
    assert ringing == pytest.approx(expected, abs=1e-16)


def test_stribeck_friction_falls_to_its_end():
    level = added("stribeck-friction", (6e-3, 5.0, 2.0), motor_velocity=np.array([-500.0, -5.0, 0.0, 5.0]))
    assert level == pytest.approx([0.0, 6e-3 / math.e, 6e-3, 6e-3 / math.e], rel=1e-12)


def test_load_adds_to_the_friction_whatever_its_sign():
    level = added("load-dependent-friction", (0.1, 100.0), output_torque=np.array([-16.0, 0.0, 8.0]))
    assert level == pytest.approx([0.016, 0.0, 0.008])


def test_a_warm_drive_rubs_less():
    cold_and_warm = np.array([5.0, 25.0, 50.0])
    base = np.full(3, 0.02)
    level = added("temperature-dependent-friction", (0.04, 25.0), temperature=cold_and_warm, base_friction=base)
    assert base + level == pytest.approx(0.02 * np.exp([0.8, 0.0, -1.0]), rel=1e-12)


def test_torque_ripple_grows_with_the_current():
    angle = np.linspace(0.0, 1.0, 50)
    one, two = (
        added("torque-ripple", (0.02, 42.0, 0.3), motor_torque=np.full_like(angle, M), motor_position=angle)
        for M in (0.05, 0.1)
    )
    assert two == pytest.approx(2.0 * one)
    assert np.max(np.abs(two)) == pytest.approx(2e-3, rel=1e-2)


def test_a_gain_error_of_the_transducer_is_absorbed_exactly_by_the_flexspline():
    torque, gain = np.linspace(-16.0, 16.0, 33), 0.02
    reading = torque + added("torque-sensor-gain", (gain,), output_torque=torque)
    absorbed = flexspline_torsion(reading, (1.0 + gain) * K_F0, C_F / (1.0 + gain))
    assert absorbed == pytest.approx(flexspline_torsion(torque, K_F0, C_F), rel=1e-12)


def test_an_error_of_the_torque_constant_is_absorbed_exactly_by_the_wave_generator():
    torque, error = np.linspace(-0.16, 0.16, 33), 0.05
    reading = torque + added("torque-constant-error", (error,), motor_torque=torque)
    absorbed = wave_generator_torsion(reading, (1.0 + error) * 1.333, 83.3 / (1.0 + error))
    assert absorbed == pytest.approx(wave_generator_torsion(torque, 1.333, 83.3), rel=1e-12)


def test_a_saturated_motor_reads_more_torque_than_there_is():
    current, constant, limit = np.linspace(-2.0, 2.0, 21), 0.321, 4.0
    true = constant * current * (1.0 - (current / limit) ** 2)
    reading = true + added("torque-constant-saturation", (1.0 / limit**2, constant), motor_current=current)
    assert reading == pytest.approx(constant * current, abs=1e-15)


def test_offsets_do_not_depend_on_what_is_measured():
    torque = np.linspace(-16.0, 16.0, 5)
    assert added("torque-sensor-offset", (0.1,), output_torque=torque) == pytest.approx(np.full(5, 0.1))
    offset = added("current-sensor-offset", (0.01, 0.321), motor_torque=torque / 100.0)
    assert offset == pytest.approx(np.full(5, 3.21e-3))


def test_the_zero_drifts_with_temperature_and_time():
    drift = added(
        "torque-sensor-drift", (0.0015, 1e-5, 25.0), temperature=np.array([25.0, 35.0]), time=np.array([0.0, 600.0])
    )
    assert drift == pytest.approx([0.0, 0.015 + 0.006])


def test_the_parts_of_the_nonlinearity_are_stated_at_full_scale():
    torque = np.array([-30.0, 15.0, 30.0])
    bent = added("torque-sensor-nonlinearity", (0.02, 0.05, 30.0), output_torque=torque)
    assert bent == pytest.approx([0.02 - 0.05, 0.02 / 4 + 0.05 / 8, 0.07])


def test_lag_and_delay_are_the_same_on_a_ramp_and_differ_on_a_chirp():
    t = clock(1.0, 1e-4)
    for effect_id in ("torque-sensor-lag", "channel-delay"):
        late = added(effect_id, (0.02,), step=1e-4, output_torque=5.0 + 4.0 * t)
        # a lag has settled to exp(-50) after 1 s
        assert late[-1] == pytest.approx(-0.02 * 4.0, rel=1e-9)
    fast = 2.0 * math.pi * 20.0
    torque = np.sin(fast * t)
    lagging = torque + added("torque-sensor-lag", (0.02,), step=1e-4, output_torque=torque)
    delayed = torque + added("channel-delay", (0.02,), step=1e-4, output_torque=torque)
    settled = t > 0.5
    assert np.ptp(lagging[settled]) == pytest.approx(2.0 / math.hypot(1.0, fast * 0.02), rel=1e-3)
    assert np.ptp(delayed[settled]) == pytest.approx(2.0, rel=1e-3)


def test_a_delay_of_50_ms_at_4_newton_metres_a_second_is_24_microradians():
    t = clock(1.0)
    late = added("channel-delay", (0.05,), output_torque=4.0 * t)
    assert -late[-1] / K_F0 == pytest.approx(24e-6, rel=2e-2)


@pytest.mark.parametrize(("delay", "step"), [(0.1, 1e-4), (0.1, 2e-5), (0.013, 1e-3), (4e-4, 1e-3), (0.0254, 1e-4)])
def test_a_delayed_sine_is_the_sine_of_before(delay, step):
    t = clock(3.0, step)
    w = 2.0 * math.pi * 2.0
    torque = 3.0 + 16.0 * np.sin(w * t)
    delayed = torque + added("channel-delay", (delay,), step=step, output_torque=torque)
    expected = 3.0 + 16.0 * np.sin(w * np.maximum(t - delay, 0.0))
    # straight lines between the places of the ring, which are a 254th of the delay apart, or a step
    spacing = max(step, math.ceil(delay / (254.0 * step)) * step)
    assert np.max(np.abs(delayed - expected)) <= 1.001 * 16.0 * (w * spacing) ** 2 / 8.0 + 1e-12


def test_missed_counts_are_those_of_the_seed_whatever_the_step():
    fine, coarse = (
        added("encoder-missed-counts", (4.0, 0.5, 7.0, 16384.0), step=step, time=clock(120.0, step))
        for step in (1e-3, 0.1)
    )
    assert np.array_equal(fine[::100], coarse)
    assert np.ptp(fine) > 0.0
    other = added("encoder-missed-counts", (4.0, 0.5, 8.0, 16384.0), step=0.1, time=clock(120.0, 0.1))
    assert not np.array_equal(other, coarse)


def test_missed_counts_come_at_the_stated_rate_with_either_sign():
    rate, duration, seeds = 0.3, 100.0, 400
    steps, last = [], []
    count = 2.0 * math.pi * 4.0 / 16384.0
    for seed in range(seeds):
        reading = added(
            "encoder-missed-counts", (4.0, rate, float(seed), 16384.0), step=0.01, time=clock(duration, 0.01)
        )
        events = np.diff(reading)
        steps.append(np.sum(np.abs(np.rint(events / count))))
        last.append(reading[-1] / count)
        assert reading[0] == 0.0
    # four standard errors; two events within 10 ms that cancel (0.07 %) are not seen
    expected = rate * duration
    assert np.mean(steps) == pytest.approx(expected, abs=4.0 * math.sqrt(expected / seeds) + 0.001 * expected)
    assert np.var(steps) == pytest.approx(expected, rel=4.0 * math.sqrt(2.0 / seeds))
    assert np.mean(last) == pytest.approx(0.0, abs=4.0 * math.sqrt(expected / seeds))
    assert np.var(last) == pytest.approx(expected, rel=4.0 * math.sqrt(2.0 / seeds))
    # reference: 4 counts of 4096 x 4 are 15 urad at the output
    assert count / 100.0 == pytest.approx(15e-6, rel=3e-2)


def test_without_a_rate_no_count_is_missed():
    assert not added("encoder-missed-counts", (4.0, 0.0, 7.0, 16384.0), step=0.1, time=clock(100.0, 0.1)).any()


def test_an_eccentric_disc_adds_its_eccentricity_over_its_radius():
    # 10 um on 25 mm: 4.0e-4 rad
    angle = np.linspace(0.0, 2.0 * math.pi, 721)
    for effect_id, signal in (
        ("motor-encoder-eccentricity", "motor_position"),
        ("output-encoder-eccentricity", "output_position"),
    ):
        reading = added(effect_id, (10e-6 / 25e-3, 1.0, 0.0), **{signal: angle})
        assert np.max(reading) == pytest.approx(4.0e-4)
        assert angle[np.argmax(reading)] == pytest.approx(math.pi / 2.0)

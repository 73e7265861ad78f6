"""Lag, delay and oscillator over whole records against closed forms and an integration of the differential equation."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.independent import memory

TIME = np.arange(4001) * 5e-3
TAU = 0.7


def test_a_lag_answers_a_ramp_with_the_closed_form():
    ramp = 4.0 * TIME
    assert memory.lagged(TIME, ramp, TAU) == pytest.approx(4.0 * (TIME - TAU * (1.0 - np.exp(-TIME / TAU))), abs=1e-12)


def test_a_lag_starts_at_rest_at_its_first_value_and_reaches_every_level():
    signal = np.interp(TIME, [0.0, 2.0, 2.005, 20.0], [3.0, 3.0, -5.0, -5.0])
    answer = memory.lagged(TIME, signal, TAU)
    assert answer[:401] == pytest.approx(3.0, abs=1e-12)
    assert answer[-1] == pytest.approx(-5.0, abs=1e-9)


def test_no_time_constant_is_no_lag():
    assert np.array_equal(memory.lagged(TIME, np.sin(TIME), 0.0), np.sin(TIME))


def test_a_sine_is_lagged_by_the_arctangent_and_rolls_off():
    w = 2.0 * np.pi * 0.5
    answer = memory.lagged(TIME, np.sin(w * TIME), TAU)
    settled = TIME > 12.0 * TAU
    gain, phase = 1.0 / np.hypot(1.0, w * TAU), -np.arctan(w * TAU)
    # straight pieces between samples miss a sine by (w h)^2/12 = 2e-5
    assert answer[settled] == pytest.approx(gain * np.sin(w * TIME[settled] + phase), abs=3e-5)


def test_a_delay_shifts_and_keeps_its_first_value():
    assert memory.delayed(TIME, 4.0 * TIME, 0.0123) == pytest.approx(4.0 * np.maximum(TIME - 0.0123, 0.0), abs=1e-12)
    assert memory.delayed(TIME, np.cos(TIME), 0.0)[1:] == pytest.approx(np.cos(TIME[1:]), abs=1e-12)


def test_a_second_order_filter_is_the_solution_of_its_equation():
    time = np.arange(1001) * 2e-3
    rng = np.random.default_rng(3)
    corners = rng.normal(size=21)

    def signal(t):
        return np.interp(t, np.linspace(0.0, 2.0, 21), corners)

    w, damping = 2.0 * np.pi * 7.0, 0.05
    # x = b (u - v), v the low-pass with the two numerators 2 D w s + w^2: no derivative of the signal is needed
    gain = 1e-3
    answer = memory.filtered(time, signal(time), [gain, 0.0, 0.0], [1.0, 2.0 * damping * w, w * w])

    def rate(t, state):
        lag = signal(t) - state[0]
        return [state[1] + 2.0 * damping * w * lag, w * w * lag]

    solved = solve_ivp(
        rate, (0.0, 2.0), [corners[0], 0.0], t_eval=time, method="DOP853", rtol=1e-9, atol=1e-12, max_step=2e-3
    )
    assert answer == pytest.approx(gain * (signal(time) - solved.y[0]), abs=1e-9)


def test_uneven_samples_are_refused():
    uneven = TIME.copy()
    uneven[7] += 1e-3
    with pytest.raises(ValueError, match="evenly"):
        memory.lagged(uneven, TIME, TAU)

"""The play operator: against the corrected (36) of Zhang, and its defining properties."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_backend.errors import ModelError
from sim_backend.model.friction import play


def backdrive_torque(output_torque: np.ndarray, ratio: float, T_fb: float) -> np.ndarray:
    """Equation (36) with sign and inequality corrected, branch by branch."""
    T_w, out = 0.0, []
    for T_F in output_torque:
        if T_F + ratio * T_w > T_fb:
            T_w = -(T_F - T_fb) / ratio
        elif T_F + ratio * T_w < -T_fb:
            T_w = -(T_F + T_fb) / ratio
        out.append(T_w)
    return np.array(out)


def test_backdriving_follows_the_corrected_equation_sample_by_sample():
    triangle = 14.0 * np.interp(np.linspace(0.0, 3.0, 4001) % 1.0, [0.0, 0.25, 0.75, 1.0], [0.0, 1.0, -1.0, 0.0])
    assert play(-triangle / 100.0, 0.02) == pytest.approx(backdrive_torque(triangle, 100.0, 2.0), abs=1e-15)


def test_a_locked_sweep_dissipates_four_radii_times_the_travel():
    motor = 0.17 * np.interp(np.linspace(0.0, 2.0, 20001) % 1.0, [0.0, 0.25, 0.75, 1.0], [0.0, 1.0, -1.0, 0.0])
    output = play(100.0 * motor, 1.2)
    last_cycle = slice(10000, None)
    area = abs(np.trapezoid(output[last_cycle], 100.0 * motor[last_cycle]))
    # width 2 r, height 2 (peak - r); corners are cut by less than one sample
    assert area == pytest.approx(2 * 1.2 * 2 * (17.0 - 1.2), rel=1e-3)


@given(st.lists(st.floats(-20.0, 20.0), min_size=1, max_size=50), st.floats(0.0, 5.0), st.floats(-20.0, 20.0))
def test_the_state_stays_within_reach_and_moves_only_when_pushed(inputs, radius, start):
    outputs = play(np.array(inputs), radius, start)
    slack = 1e-12  # rounding of input - radius
    assert np.all(np.abs(outputs - inputs) <= radius + slack)
    previous = np.concatenate([[start], outputs[:-1]])
    for u, p, q in zip(inputs, previous, outputs, strict=True):
        assert q == p or abs(abs(u - q) - radius) <= slack


def test_without_a_start_the_drive_comes_from_rest_without_torque():
    assert play(np.array([3.0, 3.0]), 1.2)[0] == pytest.approx(1.8)
    assert play(np.array([-0.5]), 1.2)[0] == 0.0
    assert play(np.array([-0.5]), 1.2, start=0.6)[0] == 0.6


@pytest.mark.parametrize("radius", [-1.0, float("nan"), float("inf")])
def test_a_radius_that_cannot_be_is_refused(radius):
    with pytest.raises(ModelError, match="radius"):
        play(np.zeros(3), radius)


def test_more_than_one_series_is_refused():
    with pytest.raises(ModelError, match="2 dimensions"):
        play(np.zeros((3, 2)), 1.0)

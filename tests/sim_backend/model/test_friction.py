"""The play operator: against the corrected (36) of Zhang, and its defining properties."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_backend.errors import ModelError
from sim_backend.model.friction import backdriving_torque, play

TRIANGLE = 14.0 * np.interp(np.linspace(0.0, 2.0, 4001) % 1.0, [0.0, 0.25, 0.75, 1.0], [0.0, 1.0, -1.0, 0.0])


def test_backdriving_follows_the_corrected_equation_sample_by_sample():
    T_w = backdriving_torque(TRIANGLE, 100.0, 2.0)
    assert play(-TRIANGLE / 100.0, 0.02) == pytest.approx(T_w, abs=1e-15)


@given(st.lists(st.floats(-20.0, 20.0), min_size=1, max_size=50), st.floats(0.0, 5.0), st.floats(-0.2, 0.2))
def test_the_logic_of_36_is_the_play_operator_for_every_history(torque, friction, start):
    T_F = np.array(torque)
    expected = play(-T_F / 100.0, friction / 100.0, start)
    assert backdriving_torque(T_F, 100.0, friction, start) == pytest.approx(expected, abs=1e-14)


def printed_36(output_torque, ratio, T_fb, *, sign, inequality):
    """Equation (36); `sign`, `inequality`: the second line corrected in that respect."""
    T_w, out = 0.0, []
    for T_F in output_torque:
        second = T_F + ratio * T_w if sign else T_F - ratio * T_w
        if T_F + ratio * T_w > T_fb:
            T_w = -(T_F - T_fb) / ratio
        elif second < -T_fb if inequality else second > -T_fb:
            T_w = -(T_F + T_fb) / ratio
        out.append(T_w)
    return np.array(out)


@pytest.mark.parametrize(
    ("sign", "inequality", "rms"), [(False, False, 0.059), (True, False, 0.174), (False, True, 0.141)]
)
def test_the_logic_of_36_as_printed_or_half_corrected_is_no_friction(sign, inequality, rms):
    # reference: rms in T_w over two triangles of 14 N*m
    wrong = printed_36(TRIANGLE, 100.0, 2.0, sign=sign, inequality=inequality)
    difference = wrong - backdriving_torque(TRIANGLE, 100.0, 2.0)
    assert np.sqrt(np.mean(difference**2)) == pytest.approx(rms, rel=0.01)
    assert np.array_equal(
        printed_36(TRIANGLE, 100.0, 2.0, sign=True, inequality=True), backdriving_torque(TRIANGLE, 100.0, 2.0)
    )


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


@pytest.mark.parametrize("friction", [-1.0, float("nan"), float("inf")])
def test_a_backdriving_torque_that_cannot_be_is_refused(friction):
    with pytest.raises(ModelError, match="friction"):
        backdriving_torque(np.zeros(3), 100.0, friction)


def test_a_sample_that_is_no_number_is_refused_with_its_place():
    with pytest.raises(ModelError, match=r"^inputs\[1\] = nan is not possible: it must be finite; p = min\(max"):
        play(np.array([0.0, np.nan, 1.0]), 0.5)
    with pytest.raises(
        ModelError, match=r"^output_torque\[2\] = inf N\*m is not possible: it must be finite; .*\(36\)"
    ):
        backdriving_torque(np.array([0.0, 1.0, np.inf]), 100.0, 2.0)
    with pytest.raises(ModelError, match=r"^start = nan"):
        play(np.zeros(3), 0.5, start=float("nan"))
    with pytest.raises(ModelError, match=r"^radius\[1\] = -1\.0 \(unit of the inputs\) is not possible: .* at least 0"):
        play(np.zeros(3), np.array([1.0, -1.0, 2.0]))


@pytest.mark.parametrize("ratio", [float("nan"), -100.0, 0.0, float("inf")])
def test_backdriving_through_a_ratio_that_cannot_be_is_refused(ratio):
    with pytest.raises(ModelError, match=r"^ratio = .* at least 1; T_w = -\(T_F -\+ T_fb\)/N, Zhang \(36\), needs it"):
        backdriving_torque(np.zeros(3), ratio, 2.0)


def test_more_than_one_series_is_refused():
    with pytest.raises(ModelError, match="2 dimensions"):
        play(np.zeros((3, 2)), 1.0)

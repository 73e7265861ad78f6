"""Fourier identification of the pure error: 15 coefficients back from records of every kind."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_backend.errors import ModelError
from sim_backend.model.error_in_plant import kinematic_effects, series_of_torsion
from sim_backend.model.fourier_error import FourierError, identify, pure_error, pure_error_slope, whole_turns

SERIES = FourierError(
    a0=3e-4,
    a=(2e-5, -9e-5, 4e-6, 1e-5, -2e-6, 3e-6, 1e-6),
    b=(-3e-5, 1.8e-4, 5e-6, -3e-5, 2e-6, 1e-6, -2e-6),
)
NEAR = {"rel": 0.0, "abs": 1e-12}


def test_even_samples_of_a_turn_give_the_fifteen_coefficients_back():
    angle = np.linspace(0.0, 2.0 * math.pi, 101)
    found = identify(angle, pure_error(angle, SERIES))
    assert len(found.coefficients) == 15
    assert found.coefficients == pytest.approx(SERIES.coefficients, **NEAR)


@given(st.floats(-50.0, 50.0), st.floats(1.0, 6.9), st.sampled_from([1.0, -1.0]))
def test_any_start_any_end_and_both_directions_give_the_same(start, turns, direction):
    angle = start + direction * np.linspace(0.0, 2.0 * math.pi * turns, 4000)
    found = identify(angle, pure_error(angle, SERIES))
    # uneven only at the end, where a sample is interpolated: h^2/8 of the curvature over one interval
    assert found.coefficients == pytest.approx(SERIES.coefficients, rel=0.0, abs=2e-8)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_record_is_cut_after_its_last_whole_turn_with_the_value_there(direction):
    angle = 1.0 + direction * np.linspace(0.0, 15.0, 301)
    cut, value, turns = whole_turns(angle, 3.0 * angle)
    assert turns == 2 * direction
    assert cut[-1] - cut[0] == pytest.approx(direction * 4.0 * math.pi)
    assert value == pytest.approx(3.0 * cut)
    assert np.all(np.diff(cut) * direction > 0.0)


def test_the_error_of_uneven_samples_falls_with_the_square_of_their_spacing():
    errors = []
    for count in (400, 1600):
        even = np.linspace(0.0, 6.0 * math.pi, count)
        angle = even + 0.4 * np.sin(1.7 * even) - 0.4 * math.sin(1.7 * 6.0 * math.pi) * even / (6.0 * math.pi)
        assert np.ptp(np.diff(angle)) > 0.5 * np.mean(np.diff(angle))
        found = identify(angle, pure_error(angle, SERIES))
        errors.append(np.max(np.abs(np.subtract(found.coefficients, SERIES.coefficients))))
    assert errors[0] < 1e-6
    assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.25)


def test_an_angle_that_jitters_counts_once():
    rng = np.random.default_rng(3)
    angle = np.linspace(0.0, 20.0 * math.pi, 20001) + rng.normal(0.0, 5e-3, 20001)
    assert np.mean(np.diff(angle) < 0.0) > 0.2
    found = identify(angle, pure_error(angle, SERIES))
    assert found.coefficients == pytest.approx(SERIES.coefficients, rel=0.0, abs=2e-7)


def test_noise_averages_out_over_the_turns():
    rng = np.random.default_rng(4)
    angle = np.linspace(0.0, 200.0 * math.pi, 40001)
    found = identify(angle, pure_error(angle, SERIES) + rng.normal(0.0, 1e-5, angle.size))
    # sigma sqrt(2/n) = 7e-8 rad for every coefficient
    assert found.coefficients == pytest.approx(SERIES.coefficients, rel=0.0, abs=4 * 7.1e-8)


def test_the_slope_is_the_derivative():
    angle = np.linspace(-3.0, 9.0, 50)
    numerical = (pure_error(angle + 1e-5, SERIES) - pure_error(angle - 1e-5, SERIES)) / 2e-5
    assert pure_error_slope(angle, SERIES) == pytest.approx(numerical, abs=1e-9)


def test_amplitudes_are_those_of_the_orders():
    assert SERIES.amplitudes[1] == pytest.approx(math.hypot(9e-5, 1.8e-4), rel=1e-15)


def test_as_effects_of_the_bench_the_series_adds_to_the_torsion_what_the_output_lacks():
    """Torsion = theta_o + theta_m/N of the opposed sense, whose motor angle is the other one with its sign changed."""
    for angle in (0.0, 0.7, 2.0, -4.0):
        added = sum(a.effect.function(-angle, *a.values) for a in kinematic_effects(SERIES))
        assert added == pytest.approx(-(float(pure_error(np.array(angle), SERIES)) - 1.5e-4), abs=1e-17)


def test_a_series_of_the_torsion_is_turned_into_that_of_the_error_and_back():
    angle = np.linspace(-8.0, 8.0, 500)
    torsion = sum(
        np.array([a.effect.function(x, *a.values) for x in angle.tolist()]) for a in kinematic_effects(SERIES)
    )
    found = series_of_torsion(identify(angle, torsion))
    assert found.coefficients[1:] == pytest.approx(SERIES.coefficients[1:], rel=0.0, abs=1e-7)
    assert series_of_torsion(series_of_torsion(SERIES)) == SERIES


@pytest.mark.parametrize(
    ("angle", "error", "message"),
    [
        (np.linspace(0.0, 6.0, 100), np.zeros(100), r"travel of 6 rad is less than a whole turn; \(18\) and \(19\)"),
        (np.array([]), np.array([]), "travel of 0 rad"),
        (np.linspace(0.0, 7.0, 20), np.zeros(20), "largest step is 0.368 rad.*at most 0.224 rad for order 7"),
        (np.linspace(0.0, 7.0, 100), np.zeros(99), r"\(100,\) and error \(99,\)"),
        (np.linspace(0.0, 7.0, 100), np.full(100, np.nan), "must be finite"),
    ],
)
def test_a_record_that_cannot_tell_is_refused(angle, error, message):
    with pytest.raises(ModelError, match=message):
        identify(angle, error)


def test_a_series_that_cannot_be_is_refused():
    with pytest.raises(ModelError, match="2 a_n and 1 b_n"):
        FourierError(0.0, (0.0, 0.0), (0.0,))
    with pytest.raises(ModelError, match="must be finite"):
        FourierError(math.inf, (), ())
    with pytest.raises(ModelError, match="orders = 0"):
        identify(np.linspace(0.0, 7.0, 100), np.zeros(100), orders=0)


@pytest.mark.parametrize("orders", [math.nan, math.inf, 7.5, -1, 10**400, None, "7", 1j, True])
def test_orders_that_are_no_count_are_refused_with_the_range(orders):
    angle = np.linspace(0.0, 7.0, 1000)
    with pytest.raises(ModelError, match=r"^orders = .* at least 1 and at most 100000; \(17\) needs it"):
        identify(angle, 0.0 * angle, orders=orders)


def test_a_whole_number_of_another_type_is_a_count_of_orders():
    angle = np.linspace(0.0, 7.0, 1000)
    assert (
        len(identify(angle, 0.0 * angle, orders=3.0).a) == len(identify(angle, 0.0 * angle, orders=np.int64(3)).a) == 3
    )


@pytest.mark.parametrize(
    ("coefficients", "message"),
    [
        ((0.0, 1.0, 2.0), r"^a = 1\.0 is not possible: it must be a tuple .*\(rad\) .*\(17\) needs it"),
        ((0.0, (1.0,), None), r"^b = None is not possible"),
        ((0.0, b"1", b"2"), r"^a = b'1' is not possible"),
        ((0.0, "1", "2"), r"^a = '1' is not possible"),
        ((None, (), ()), r"^a_0 = None is no number: .* at most 1e\+100 rad; \(17\) needs it"),
        ((0.0, (1.0, "1"), (1.0, 1.0)), r"^a_2 = '1' is no number"),
        ((0.0, (1.0,), (10**400,)), r"^b_1 = about 1e\+400 rad is not possible: .* at most 1e\+100 rad"),
        ((0.0, (1e308,), (1e308,)), r"^a_1 = 1e\+308 rad is not possible"),
    ],
)
def test_coefficients_that_no_series_has_are_refused_by_name(coefficients, message):
    with pytest.raises(ModelError, match=message):
        FourierError(*coefficients)


def test_coefficients_may_be_lists_or_arrays():
    series = FourierError(np.float32(0.0), np.array([1.0, 2.0]), [3.0, 4.0])
    assert {type(value) for value in series.coefficients} == {float}
    assert series == FourierError(0.0, (1.0, 2.0), (3.0, 4.0))
    assert hash(series) == hash(FourierError(0.0, (1.0, 2.0), (3.0, 4.0)))


@pytest.mark.parametrize("values", [None, "1", ["1"], [None], [1j], [10**400], [1e308], [math.inf]])
def test_a_record_that_is_no_series_of_numbers_is_refused_by_name(values):
    angle = np.linspace(0.0, 7.0, 100)
    with pytest.raises(ModelError, match=r"^error(\[0\])? = "):
        identify(angle, values)
    with pytest.raises(ModelError, match=r"^motor_position(\[0\])? = "):
        identify(values, angle)


def test_a_record_that_is_a_single_number_is_refused_with_both_shapes():
    angle = np.linspace(0.0, 7.0, 100)
    with pytest.raises(ModelError, match=r"^motor_position \(100,\) and error \(\) must be two series of one length"):
        identify(angle, 1.0)
    with pytest.raises(ModelError, match=r"^motor_position \(\) and error \(100,\) must be two series of one length"):
        identify(1.0, angle)


@pytest.mark.filterwarnings("error")
def test_the_largest_record_still_has_coefficients():
    angle = np.linspace(1e12 - 7.0, 1e12, 1000)
    assert all(map(math.isfinite, identify(angle, np.full(1000, 1e50)).coefficients))

"""Ideal kinematics and torques of every configuration, against the textbook's table."""

import itertools
import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_backend.errors import ModelError, shown
from sim_backend.model.kinematics import (
    Member,
    Members,
    motion,
    power_surplus,
    speed_ratio,
    torques,
    wave_generator_torque,
)

speeds = st.floats(-1e3, 1e3)
ratios = st.floats(1.0, 1e3)


def test_teeth_that_mesh_roll_on_each_other():
    # a flexspline of 200 teeth in a spline of 202: what the wave generator's ellipse sees of both passes tooth by tooth
    flexspline_teeth, spline_teeth = 200, 202
    ratio = flexspline_teeth / (spline_teeth - flexspline_teeth)
    for c, f in ((0.0, 1.0), (1.0, 0.0), (0.3, -2.0)):
        w = motion(ratio, circular_spline=c, flexspline=f).wave_generator
        assert spline_teeth * (c - w) == pytest.approx(flexspline_teeth * (f - w))


@pytest.mark.parametrize(
    ("held", "given", "inputs", "outputs", "expected"),
    [
        (Member.CIRCULAR_SPLINE, {"circular_spline": 0.0, "flexspline": 1.0}, "wave_generator", "flexspline", -100.0),
        (Member.FLEXSPLINE, {"flexspline": 0.0, "circular_spline": 1.0}, "wave_generator", "circular_spline", 101.0),
        (Member.WAVE_GENERATOR, {"wave_generator": 0.0, "circular_spline": 1.0}, "flexspline", "circular_spline", 1.01),
    ],
)
def test_each_member_can_be_the_one_that_is_held(held, given, inputs, outputs, expected):
    speed = motion(100.0, **given)
    assert getattr(speed, inputs) / getattr(speed, outputs) == pytest.approx(expected)
    assert speed_ratio(100.0, held) == pytest.approx(expected)


def test_with_the_circular_spline_held_it_is_equations_4_to_6():
    assert motion(100.0, circular_spline=0, flexspline=0.5) == Members(-50.0, 0, 0.5)
    torque = torques(100.0, flexspline=16.0)
    assert torque.wave_generator == pytest.approx(-0.16)
    assert wave_generator_torque(100.0, 16.0, 0.0) == pytest.approx(-0.16)
    assert wave_generator_torque(100.0, 16.0, 1.2) == pytest.approx(-0.148)


@given(ratios, speeds, speeds, speeds)
def test_the_power_that_enters_leaves_whatever_moves(ratio, c, f, T_w):
    speed = motion(ratio, circular_spline=c, flexspline=f)
    torque = torques(ratio, wave_generator=T_w)
    size = 1.0 + abs(T_w) * (ratio + 1.0) * (abs(c) + abs(f))
    assert abs(power_surplus(torque, speed)) <= 1e-12 * size


def test_a_wrong_sign_of_a_torque_shows_in_the_power():
    speed = motion(100.0, circular_spline=0.0, flexspline=1.0)
    right = torques(100.0, flexspline=16.0)
    assert power_surplus(right, speed) == 0.0
    assert power_surplus(right._replace(wave_generator=0.16), speed) == pytest.approx(-32.0)


@given(ratios, speeds, speeds)
def test_the_third_member_follows_from_any_two(ratio, c, f):
    all_three = motion(ratio, circular_spline=c, flexspline=f)
    slack = 1e-9 * (1 + ratio) * (1 + abs(c) + abs(f))
    for left_out in Members._fields:
        two = {name: value for name, value in all_three._asdict().items() if name != left_out}
        assert tuple(motion(ratio, **two)) == pytest.approx(tuple(all_three), abs=slack)


@given(ratios, speeds)
def test_all_torques_follow_from_any_one(ratio, T_w):
    all_three = torques(ratio, wave_generator=T_w)
    assert sum(all_three) == pytest.approx(2.0 * T_w, abs=1e-9 * (1 + ratio) * (1 + abs(T_w)))
    for name, value in all_three._asdict().items():
        again = torques(ratio, **{name: value})
        assert tuple(again) == pytest.approx(tuple(all_three), rel=1e-12)


@pytest.mark.parametrize("given", [{}, {"flexspline": 1.0}, dict.fromkeys(Members._fields, 1.0)])
def test_a_motion_needs_exactly_two_members(given):
    with pytest.raises(ModelError, match="exactly two"):
        motion(100.0, **given)


@pytest.mark.parametrize("given", [{}, {"flexspline": 1.0, "wave_generator": 1.0}])
def test_torques_need_exactly_one_member(given):
    with pytest.raises(ModelError, match="exactly one"):
        torques(100.0, **given)


@pytest.mark.parametrize("ratio", [0.5, -100.0, math.nan, math.inf, 1e7, 10**400, None, "100", 1j, [100.0]])
def test_a_ratio_that_cannot_be_is_refused(ratio):
    with pytest.raises(ModelError, match=r"ratio = .* at least 1 and at most 1e\+06; equation \(1\)"):
        motion(ratio, circular_spline=0.0, flexspline=1.0)


def test_a_motion_or_torque_that_is_no_number_is_refused():
    with pytest.raises(
        ModelError, match=r"^wave_generator = nan rad or rad/s is not possible: .*finite, .*; equation \(1\)"
    ):
        motion(100.0, wave_generator=math.nan, circular_spline=0.0)
    with pytest.raises(ModelError, match=r"^flexspline = inf N\*m is not possible: .*equation \(3\)"):
        torques(100.0, flexspline=math.inf)
    with pytest.raises(ModelError, match=r"^friction = nan N\*m"):
        wave_generator_torque(100.0, 1.0, math.nan)


@pytest.mark.parametrize("value", ["1", 1j, True, [1.0], 10**400, 1e308, -1e101])
def test_what_no_member_can_have_is_refused_by_name_with_its_range(value):
    says = rf"^%s = {re.escape(shown(value))} .* at least -1e\+100 and at most 1e\+100 %s; equation \(%s\) needs it"
    with pytest.raises(ModelError, match=says % ("circular_spline", "rad or rad/s", "1")):
        motion(100.0, wave_generator=1.0, circular_spline=value)
    with pytest.raises(ModelError, match=says % ("flexspline", r"N\*m", "3")):
        torques(100.0, flexspline=value)
    with pytest.raises(ModelError, match=says % ("friction", r"N\*m", "9")):
        wave_generator_torque(100.0, 1.0, value)


@pytest.mark.parametrize("value", ["1", 1j, True, [1.0], 10**400, 1e308, -3.1e106, math.nan])
def test_what_no_member_can_come_to_is_refused_by_name_with_its_range(value):
    says = rf"^%s = {re.escape(shown(value))} .* at least -3e\+106 and at most 3e\+106 %s; equation \(3\) needs it"
    one = Members(1.0, 1.0, 1.0)
    with pytest.raises(ModelError, match=says % (r"torque\.wave_generator", r"N\*m")):
        power_surplus(one._replace(wave_generator=value), one)
    with pytest.raises(ModelError, match=says % (r"speed\.flexspline", "rad/s")):
        power_surplus(one, one._replace(flexspline=value))


@pytest.mark.parametrize("ratio", [1.0, 1e6])
def test_from_the_largest_values_every_member_and_the_power_are_finite(ratio):
    for names in itertools.combinations(Members._fields, 2):
        for signs in itertools.product((1e100, -1e100), repeat=2):
            speed = motion(ratio, **dict(zip(names, signs, strict=True)))
            assert all(map(math.isfinite, speed))
            for name in Members._fields:
                torque = torques(ratio, **{name: 1e100})
                assert all(map(math.isfinite, torque))
                assert math.isfinite(power_surplus(torque, speed))


def test_numbers_of_numpy_are_numbers():
    assert motion(100.0, circular_spline=np.int64(0), flexspline=np.float32(0.5)) == Members(-50.0, 0.0, 0.5)


@pytest.mark.parametrize("held", ["nonsense", None, 1, [], ["flexspline"]])
def test_what_is_no_member_is_refused_with_those_that_are(held):
    with pytest.raises(ModelError, match=r"^held = .* is no member .* wave-generator, circular-spline, flexspline"):
        speed_ratio(100.0, held)


def test_a_member_may_be_given_by_its_name():
    assert speed_ratio(100.0, "flexspline") == 101.0


def test_a_power_is_that_of_members_only():
    with pytest.raises(
        ModelError, match=r"^torque = \(1\.0, 2\.0, 3\.0\) .* Members with a number \(N\*m\) for each of"
    ):
        power_surplus((1.0, 2.0, 3.0), Members(1.0, 1.0, 1.0))

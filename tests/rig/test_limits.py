"""The limit check of every cycle."""

import math

import pytest

from drivers.errors import LimitError
from drivers.types import Axis, Limits, Mode, Sample, Setpoint
from rig.limits import LimitWatch

LIMITS = Limits(motor_torque=0.25, motor_velocity=200.0, output_torque=30.0)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("mode", Mode)
@pytest.mark.parametrize("axis", Axis)
def test_a_setpoint_that_is_not_a_finite_number_is_refused_in_every_mode(axis: Axis, mode: Mode, value: float) -> None:
    with pytest.raises(LimitError, match=f"{axis}_{mode}_command"):
        LimitWatch(LIMITS).check_setpoint(axis, Setpoint(mode, value), 7)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_setpoint_at_its_limit_passes_and_one_above_does_not(sign: int) -> None:
    watch = LimitWatch(LIMITS)
    watch.check_setpoint(Axis.MOTOR, Setpoint(Mode.TORQUE, sign * 0.25), 0)
    watch.check_setpoint(Axis.LOAD, Setpoint(Mode.TORQUE, sign * 1e6), 0)  # no limit declared
    with pytest.raises(LimitError) as caught:
        watch.check_setpoint(Axis.MOTOR, Setpoint(Mode.VELOCITY, sign * 200.1), 3)
    assert (caught.value.value, caught.value.limit, caught.value.cycle) == (sign * 200.1, 200.0, 3)


def test_a_sample_is_judged_by_itself_and_not_by_an_earlier_one() -> None:
    watch = LimitWatch(LIMITS)
    high = Sample(0.0, 0, output_torque=-31.0, motor_torque=0.1)
    watch.observe(high)
    with pytest.raises(LimitError, match="output_torque"):
        watch.check(high)
    low = Sample(0.001, 1, output_torque=-29.0, motor_torque=0.1)
    watch.observe(low)
    watch.check(low)
    assert watch.extremes == {"motor_torque": 0.1, "output_torque": 31.0}


def test_the_speed_is_the_mean_over_ten_cycles() -> None:
    watch = LimitWatch(LIMITS)
    for k in range(10):
        watch.observe(Sample(k * 1e-3, k, motor_position=0.3 * k))
    assert "motor_velocity" not in watch.extremes
    last = Sample(0.010, 10, motor_position=3.0)
    watch.observe(last)
    assert watch.extremes["motor_velocity"] == pytest.approx(300.0)
    with pytest.raises(LimitError, match="motor_velocity"):
        watch.check(last)

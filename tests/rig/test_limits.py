"""The limit check of every cycle."""

import math

import pytest

from drivers.errors import LimitError
from drivers.types import Axis, Limits, Mode, Sample, Setpoint
from rig.limits import LimitWatch

LIMITS = Limits(
    motor_torque=0.25, motor_velocity=200.0, output_torque=30.0, load_velocity=5.0, load_travel=2.0, output_travel=1.0
)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("mode", Mode)
@pytest.mark.parametrize("axis", Axis)
def test_a_setpoint_that_is_not_a_finite_number_is_refused_in_every_mode(axis: Axis, mode: Mode, value: float) -> None:
    with pytest.raises(LimitError, match=f"{axis}_{mode}_command"):
        LimitWatch(LIMITS, 1e-3).check_setpoint(axis, Setpoint(mode, value), 7)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_setpoint_at_its_limit_passes_and_one_above_does_not(sign: int) -> None:
    watch = LimitWatch(LIMITS, 1e-3)
    watch.check_setpoint(Axis.MOTOR, Setpoint(Mode.TORQUE, sign * 0.25), 0)
    watch.check_setpoint(Axis.LOAD, Setpoint(Mode.TORQUE, sign * 1e6), 0)  # no limit declared
    with pytest.raises(LimitError) as caught:
        watch.check_setpoint(Axis.MOTOR, Setpoint(Mode.VELOCITY, sign * 200.1), 3)
    assert (caught.value.value, caught.value.limit, caught.value.cycle) == (sign * 200.1, 200.0, 3)


def test_a_sample_is_judged_by_itself_and_not_by_an_earlier_one() -> None:
    watch = LimitWatch(LIMITS, 1e-3)
    high = Sample(0.0, 0, output_torque=-31.0, motor_torque=0.1)
    watch.observe(high)
    with pytest.raises(LimitError, match="output_torque"):
        watch.check(high)
    low = Sample(0.001, 1, output_torque=-29.0, motor_torque=0.1)
    watch.observe(low)
    watch.check(low)
    assert watch.extremes == {"motor_torque": 0.1, "output_torque": 31.0}


def test_the_speed_is_the_mean_over_ten_cycles() -> None:
    watch = LimitWatch(LIMITS, 1e-3)
    for k in range(10):
        watch.observe(Sample(k * 1e-3, k, motor_position=0.3 * k))
    assert "motor_velocity" not in watch.extremes
    last = Sample(0.010, 10, motor_position=3.0)
    watch.observe(last)
    assert watch.extremes["motor_velocity"] == pytest.approx(300.0)
    with pytest.raises(LimitError, match="motor_velocity"):
        watch.check(last)


def test_the_load_drive_has_a_speed_limit_of_its_own() -> None:
    watch = LimitWatch(LIMITS, 1e-3)
    with pytest.raises(LimitError, match="load_velocity_command"):
        watch.check_setpoint(Axis.LOAD, Setpoint(Mode.VELOCITY, -5.1), 0)
    for k in range(11):
        last = Sample(k * 1e-3, k, motor_position=0.0, load_position=-0.006 * k)
        watch.observe(last)
    with pytest.raises(LimitError) as caught:
        watch.check(last)
    assert (caught.value.signal, caught.value.unit) == ("load_velocity", "rad/s")
    assert caught.value.value == pytest.approx(-6.0)
    assert watch.extremes["load_velocity"] == pytest.approx(6.0)


@pytest.mark.parametrize(("signal", "travel"), [("load_position", 2.0), ("output_position", 1.0)])
def test_travel_is_counted_from_the_first_sample_of_the_shaft_concerned(signal: str, travel: float) -> None:
    watch = LimitWatch(LIMITS, 1e-3)
    watch.observe(Sample(0.0, 0, **{signal: 10.0}))
    for cycle, there in enumerate((10.0 + travel, 10.0 - travel), start=1):
        sample = Sample(1e-3 * cycle, cycle, **{signal: there})
        watch.observe(sample)
        watch.check(sample)
    beyond = Sample(3e-3, 3, **{signal: 10.1 + travel})
    watch.observe(beyond)
    with pytest.raises(LimitError, match=f"{signal} travelled"):
        watch.check(beyond)


@pytest.mark.parametrize(("axis", "step"), [(Axis.MOTOR, 0.2), (Axis.LOAD, 5e-3)])
def test_a_position_setpoint_steps_no_further_than_the_speed_limit_allows(axis: Axis, step: float) -> None:
    watch = LimitWatch(LIMITS, 1e-3)
    watch.observe(Sample(0.0, 0, motor_position=7.0, load_position=7.0))
    held = Setpoint(Mode.POSITION, 8.0)
    watch.check_step(axis, 7.0 - 0.99 * step, None, 1)
    watch.check_step(axis, 8.0 + 0.99 * step, held, 1)
    for target, present in ((7.0 + 1.01 * step, Setpoint(Mode.TORQUE, 0.0)), (8.0 - 1.01 * step, held)):
        with pytest.raises(LimitError, match=f"{axis}_position_command steps by"):
            watch.check_step(axis, target, present, 1)

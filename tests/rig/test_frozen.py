"""Frozen readings: what must be noticed and what must not, sample by sample."""

import contextlib
import math
from collections.abc import Iterator

import pytest

from drivers.errors import ReadingError
from drivers.types import Axis, Limits, Mode, Sample, Setpoint
from rig.frozen import CHECK_TIME, FrozenWatch

LIMITS = Limits(motor_torque=0.25, motor_velocity=220.0, output_torque=30.0, load_torque=30.0)
STILL = Sample(
    0.0,
    0,
    motor_position=1.0,
    motor_torque=0.0,
    output_position=0.5,
    output_torque=0.0,
    load_position=0.5,
    load_torque=0.0,
    status_word=0x1237,
    load_status_word=0x1237,
)
RELEASED = {Axis.MOTOR: None, Axis.LOAD: None}


def looks(count: int, **rates: float) -> Iterator[Sample]:
    """Samples of a bench at rest in which the named signals change at `rates` (unit/s)."""
    for k in range(count):
        time = k * CHECK_TIME
        yield STILL._replace(
            time=time, cycle=k, **{name: getattr(STILL, name) + rate * time for name, rate in rates.items()}
        )


def hold(motor: Setpoint | None = None, load: Setpoint | None = None) -> dict[Axis, Setpoint | None]:
    return {Axis.MOTOR: motor, Axis.LOAD: load}


def test_a_quiet_bench_may_repeat_its_readings_for_a_minute() -> None:
    watch = FrozenWatch(LIMITS, {})
    for sample in looks(6000):
        watch.look(sample, hold(Setpoint(Mode.TORQUE, 0.01), Setpoint(Mode.POSITION, 0.5)))


def test_a_drive_at_its_own_torque_limit_is_not_frozen() -> None:
    watch = FrozenWatch(LIMITS, {})
    for k in range(100):
        sample = STILL._replace(time=k * CHECK_TIME, cycle=k, motor_torque=0.15, status_word=0x1237 | 1 << 11)
        watch.look(sample, hold(Setpoint(Mode.TORQUE, 0.15 + 1e-3 * k)))


def test_a_released_drive_need_not_follow_a_shaft_that_somebody_turns() -> None:
    watch = FrozenWatch(LIMITS, {})
    for sample in looks(500, output_position=0.5):
        watch.look(sample, RELEASED)


def test_a_drive_that_follows_its_setpoint_in_torque_alone_is_not_frozen() -> None:
    """A locked shaft: the position repeats for ever, the torque follows with the drive's resolution."""
    watch = FrozenWatch(LIMITS, {})
    for k in range(1000):
        torque = 0.1 * math.sin(0.01 * k)
        sample = STILL._replace(time=k * CHECK_TIME, cycle=k, motor_torque=round(torque, 3), output_torque=80 * torque)
        watch.look(sample, hold(Setpoint(Mode.TORQUE, torque)))


@pytest.mark.parametrize(("step", "noticed"), [(0.03, False), (0.001, True)])
def test_a_drive_much_larger_than_the_limit_may_keep_one_step_of_torque(step: float, noticed: bool) -> None:
    """Per mille of 30 N*m: 20 mN*m more are no step, though the limit of 0.25 N*m alone asks for 5 mN*m to be seen."""
    watch = FrozenWatch(LIMITS, {Axis.MOTOR: step})
    with pytest.raises(ReadingError) if noticed else contextlib.nullcontext():
        for k in range(100):
            sample = STILL._replace(time=k * CHECK_TIME, cycle=k)
            watch.look(sample, hold(Setpoint(Mode.TORQUE, 0.0 if k < 10 else 0.02)))


@pytest.mark.parametrize(("step", "noticed"), [(0.03, False), (0.001, True)])
def test_one_step_of_a_large_drive_need_not_reach_the_torque_sensor(step: float, noticed: bool) -> None:
    watch = FrozenWatch(LIMITS, {Axis.MOTOR: step})
    with pytest.raises(ReadingError) if noticed else contextlib.nullcontext():
        for k in range(100):
            sample = STILL._replace(time=k * CHECK_TIME, cycle=k, motor_torque=0.0 if k < 10 else 0.08)
            watch.look(sample, RELEASED)


def test_a_step_of_torque_is_given_two_looks_to_be_seen() -> None:
    watch = FrozenWatch(LIMITS, {})
    for k in range(20):
        seen = 0.0 if k < 12 else 0.1
        sample = STILL._replace(time=k * CHECK_TIME, cycle=k, motor_torque=seen)
        watch.look(sample, hold(Setpoint(Mode.TORQUE, 0.0 if k < 10 else 0.1)))


def test_a_change_of_mode_is_no_change_of_the_setpoint() -> None:
    watch = FrozenWatch(LIMITS, {})
    for k, sample in enumerate(looks(100)):
        watch.look(sample, hold(Setpoint(Mode.TORQUE, 0.0) if k < 50 else Setpoint(Mode.POSITION, 1.0)))


def test_a_locked_output_need_not_show_the_motor_that_winds_it_up() -> None:
    watch = FrozenWatch(LIMITS, {})
    for sample in looks(100, motor_position=0.5, output_torque=10.0):  # half a rad in all
        watch.look(sample, RELEASED)


def test_a_torque_that_turns_the_motor_need_not_reach_the_torque_sensor() -> None:
    watch = FrozenWatch(LIMITS, {})
    for k, sample in enumerate(looks(300, motor_position=100.0, output_position=-1.0, load_position=-1.0)):
        watch.look(sample._replace(motor_torque=0.1 * math.sin(0.1 * k)), RELEASED)


def test_a_device_that_the_bench_has_not_is_not_frozen() -> None:
    watch = FrozenWatch(LIMITS, {})
    for sample in looks(300, motor_position=100.0, motor_torque=0.1):
        alone = sample._replace(output_position=None, output_torque=None, load_position=None, load_torque=None)
        watch.look(alone, RELEASED)


@pytest.mark.parametrize(
    ("device", "setpoints", "rates"),
    [
        ("motor", hold(Setpoint(Mode.TORQUE, 0.1)), {"output_position": -0.5}),
        ("motor", hold(Setpoint(Mode.VELOCITY, 2.0)), {}),
        ("load", hold(load=Setpoint(Mode.POSITION, 0.5)), {"motor_position": 50.0, "output_position": -0.5}),
        ("output_encoder", RELEASED, {"motor_position": 50.0, "load_position": -0.5}),
        ("torque_sensor", RELEASED, {"motor_torque": 0.1, "motor_position": 0.1}),
        ("torque_sensor", RELEASED, {"load_torque": 5.0, "load_position": 0.001}),
    ],
)
def test_a_reading_that_repeats_while_something_acts_on_it_is_frozen(
    device: str, setpoints: dict[Axis, Setpoint | None], rates: dict[str, float]
) -> None:
    watch = FrozenWatch(LIMITS, {})

    def look_on() -> None:
        for sample in looks(300, **rates):
            watch.look(sample, setpoints)

    with pytest.raises(ReadingError, match=f"'{device}' has repeated one reading for .* although") as caught:
        look_on()
    assert caught.value.device == device

"""Motions: small generators of commands, used by procedures with `yield from`. One command is one control cycle.

What varies over a motion is one number; a *shaper* turns it into the command of both axes, so that the same ramp
serves a motor torque, a load torque beside a held motor, or a speed. Each motion returns the last sample.
"""

import itertools
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence

from drivers.types import Mode, Sample, Setpoint
from procedures.intents import Command, Intent, Mark
from procedures.recording import Recording, measured
from procedures.waveforms import cycles, line, nearest_turn, path_length, smooth_step

Motion = Generator[Intent, Sample, Sample]
"""Yields commands (and marks), receives samples, returns the last one."""

Shaper = Callable[[float], Command]
"""Turns one number into the command of both axes."""

RELEASED = Command()
"""Both axes without torque."""


def motor_torque(load: Setpoint | None = None) -> Shaper:
    """Command the motor's torque, N*m, with the load axis as given."""
    return lambda value: Command(Setpoint(Mode.TORQUE, value), load)


def motor_velocity(load: Setpoint | None = None) -> Shaper:
    """Command the motor's speed, rad/s, with the load axis as given."""
    return lambda value: Command(Setpoint(Mode.VELOCITY, value), load)


def motor_position() -> Shaper:
    """Command the motor's angle, rad, with the load axis released."""
    return lambda value: Command(Setpoint(Mode.POSITION, value))


def load_torque(motor: Setpoint | None = None) -> Shaper:
    """Command the load's torque, N*m, with the motor axis as given."""
    return lambda value: Command(motor, Setpoint(Mode.TORQUE, value))


def follow(values: Iterable[float], shape: Shaper) -> Motion:
    """Command one value per cycle. `values` must not be empty."""
    steps = iter(values)
    sample = yield shape(next(steps))
    for value in steps:
        sample = yield shape(value)
    return sample


def dwell(duration: float, command: Command, cycle_time: float) -> Motion:
    """Repeat one command for `duration` (s), at least one cycle."""
    sample = yield command
    for _ in range(cycles(duration, cycle_time) - 1):
        sample = yield command
    return sample


def ramp(start: float, end: float, rate: float, shape: Shaper, cycle_time: float) -> Motion:
    """Go from `start` to `end` at `rate` (unit of the value per second)."""
    return (yield from follow(line(start, end, rate, cycle_time), shape))


def triangle(
    points: Sequence[float],
    rate: float,
    hold: float,
    shape: Shaper,
    cycle_time: float,
    legs: Mapping[int, Recording],
) -> Motion:
    """Go through all turning points at `rate`, each leg marked, and wait `hold` (s) at every one but the last.

    The samples of leg k, from points[k] to points[k + 1] without the wait, are added to `legs[k]` where it exists.
    """
    for index, (start, end) in enumerate(itertools.pairwise(points)):
        yield Mark(f"sweep {'up' if end > start else 'down'} to {end:.6g} N*m", abs(end - start) / rate)
        leg = ramp(start, end, rate, shape, cycle_time)
        recording = legs.get(index)
        sample = yield from (leg if recording is None else observed(leg, recording.add))
        if hold > 0.0 and index < len(points) - 2:
            yield Mark(f"hold at {end:.6g} N*m", hold)
            sample = yield from dwell(hold, shape(end), cycle_time)
    return sample


def triangle_time(points: Sequence[float], rate: float, hold: float) -> float:
    """Give how long `triangle` takes, s."""
    return path_length(points) / rate + hold * (len(points) - 2)


def move_to(angle: float, duration: float, cycle_time: float) -> Motion:
    """Turn the free motor to the wave-generator angle `angle` (rad) the short way, in `duration` (s)."""
    sample = yield RELEASED
    start = measured(sample.motor_position, "motor_position")
    path = smooth_step(start, nearest_turn(angle, start), duration, cycle_time)
    return (yield from follow(path, motor_position()))


def observed(motion: Motion, see: Callable[[Sample], None]) -> Motion:
    """Carry out `motion` and show `see` the sample of every cycle; what `see` raises ends the motion."""
    intent = next(motion)
    while True:
        sample = yield intent
        if isinstance(intent, Command):
            see(sample)
        try:
            intent = motion.send(sample)
        except StopIteration as end:
            last: Sample = end.value
            return last

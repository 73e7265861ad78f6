"""Runs that bring the bench into position between measuring runs: unlock, zero the sensor, turn the motor, lock."""

import math

from drivers.types import Limits
from procedures.checks import Checks
from procedures.intents import Mark, Result, SetLock, Steps, Tare
from procedures.motions import RELEASED, dwell, move_to
from procedures.plan import BenchFacts, PlannedRun

MOVE_SPEED = 5.0
"""Largest speed of a set-up move, rad/s, unless the bench allows less."""

SETTLE = 0.5
"""Wait with released axes, s: the wave generator's spring swings out."""


def set_up_run(
    name: str, facts: BenchFacts, *, angle: float | None = None, locked: bool = False, tare: bool = False
) -> PlannedRun:
    """Plan one set-up run: unlock where there is a lock, zero the torque sensor, turn to `angle` (rad), lock.

    Every move takes the time of the longest one, half a turn, so that its length is known beforehand.
    """
    move = move_time(facts.limits)

    def steps() -> Steps:
        yield Mark("set-up")
        yield from dwell(SETTLE, RELEASED, facts.cycle_time)
        if facts.has_lock:
            yield SetLock(False)
        if tare:
            yield from dwell(SETTLE, RELEASED, facts.cycle_time)
            yield Tare()
        if angle is not None:
            yield from move_to(angle, move, facts.cycle_time)
            yield from dwell(SETTLE, RELEASED, facts.cycle_time)
        if locked:
            yield SetLock(True)
        return Result

    duration = SETTLE + (SETTLE if tare else 0.0)
    if angle is not None:
        duration += move + SETTLE
    return PlannedRun(name, steps, duration, start_angle=angle, set_up=True)


def move_time(limits: Limits) -> float:
    """Give the time (s) of a half-cosine move over half a motor turn."""
    return math.pi**2 / (2.0 * min(MOVE_SPEED, 0.5 * limits.motor_velocity))


def check_set_up(check: Checks, facts: BenchFacts, *, tare: bool) -> None:
    """Refuse what the set-up runs cannot do on this bench: half a turn of the motor, a tare without a sensor."""
    check.at_most("start_angles", math.pi, facts.limits.motor_travel, "rad", "the bench limit motor_travel")
    check.at_most(
        "start_angles", math.pi / facts.ratio, facts.limits.output_travel, "rad", "the bench limit output_travel"
    )
    check.demand(facts.has_torque_sensor or not tare, "tare", tare, "the bench has no torque sensor to zero")

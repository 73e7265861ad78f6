"""A torque ramp from rest that ends as soon as the motor has broken away."""

import math
from collections.abc import Generator
from dataclasses import dataclass

from drivers.errors import ConfigError, Mistake
from drivers.types import Sample
from procedures.breakaway import FEWEST_CROSSINGS, Breakaway, find_breakaway
from procedures.checks import Checks
from procedures.errors import NoMotionError
from procedures.intents import Intent, Mark, Measurement
from procedures.motions import Motion, Shaper, dwell, observed
from procedures.plan import BenchFacts
from procedures.recording import Recording, measured
from procedures.speed import MotorSpeed
from procedures.waveforms import TURN, line

RUN_AWAY_TIME = 0.2
"""Typical time from breakaway to the stop, s; only the expected duration depends on it."""


DEFAULT_MOTION = 0.1
"""Motor travel that is a run-away, rad: ten times what the wave generator's spring can wind up."""

COUNTS_OF_MOTION = 16.0
"""The same in encoder counts, for coarse encoders: enough to see the path bend."""

FEWEST_COUNTS = FEWEST_CROSSINGS + 2
"""Motion in encoder counts below which no breakaway is found: the ends of the path may lie inside a count."""

WOUND_UP = 25.0
"""Least time of winding up in radians of the rotor's swinging. The estimate holds down to 12 (see `breakaway`); the
drive may break away at half of what the catalogue says."""

FEWEST_CYCLES = 50
"""Least time of winding up in control cycles."""


@dataclass(frozen=True, slots=True)
class BreakawayRamp:
    """How a ramp is driven and when it ends.

    `signal` is the torque channel (name of a sample field) that is evaluated, `torque_max` N*m and `rate` N*m/s
    are magnitudes; `motion` rad and `speed_max` rad/s of the motor end the ramp, whichever comes first.
    """

    signal: str
    torque_max: float
    rate: float
    motion: float
    speed_max: float


def least_motion(motion: float | None, motor_counts: int) -> float:
    """Give the motor travel that ends a ramp, rad: `motion`, or a default that spans enough encoder counts."""
    return max(DEFAULT_MOTION, COUNTS_OF_MOTION * TURN / motor_counts) if motion is None else motion


@dataclass(frozen=True, slots=True)
class RecordedRamp:
    """One ramp as it went: direction (+1 or -1), the positions at rest before it, (time, torque, motor_position)."""

    direction: float
    rest: Recording
    motion: Recording

    @property
    def name(self) -> str:
        """The direction in words."""
        return "forward" if self.direction > 0.0 else "backward"


def check_ramp(check: Checks, ramp: BreakawayRamp, expected: float, facts: BenchFacts) -> None:
    """Refuse a ramp whose breakaway (`expected`, N*m) could not be found: too fast a rate, too few encoder counts."""
    least_time = max(FEWEST_CYCLES * facts.cycle_time, WOUND_UP / facts.rotor_swing)
    if ramp.rate * least_time > expected * (1.0 + 1e-9):
        check.refuse(
            "torque_rate",
            f"{ramp.rate:.6g} N*m/s",
            f"is too fast, at most {expected / least_time:.4g} N*m/s: the torque would reach the expected "
            f"{expected:.4g} N*m in {expected / ramp.rate:.3g} s, before the rotor can follow; winding up must last "
            f"{FEWEST_CYCLES} cycles and {WOUND_UP:g} rad of the rotor's swinging at "
            f"{facts.rotor_swing / math.tau:.3g} Hz, so {least_time:.3g} s",
        )
    least = FEWEST_COUNTS * TURN / facts.motor_counts
    if ramp.motion < least:
        check.refuse(
            "motion",
            f"{ramp.motion:.6g} rad",
            f"must be at least {least:.4g} rad, {FEWEST_COUNTS} counts of the motor encoder: fewer do not show where "
            "the path bends",
        )


def ramp_to_motion(
    ramp: BreakawayRamp, direction: float, shape: Shaper, rest: Sample, cycle_time: float, recording: Recording
) -> Motion:
    """Raise the torque from zero in `direction` (+1 or -1) until the motor runs away; return that cycle's sample.

    The samples are added to `recording`. Raises NoMotionError if `torque_max` is reached first.
    """
    start = measured(rest.motor_position, "motor_position")
    speed = MotorSpeed(cycle_time)
    speed.see(rest)
    travel = 0.0
    sample = rest
    for torque in line(0.0, direction * ramp.torque_max, ramp.rate, cycle_time):
        sample = yield shape(torque)
        recording.add(sample)
        speed.see(sample)
        travel = measured(sample.motor_position, "motor_position") - start
        if abs(travel) >= ramp.motion or abs(speed.value or 0.0) >= ramp.speed_max:
            return sample
    raise NoMotionError(
        ramp.signal,
        torque=direction * ramp.torque_max,
        limit=ramp.torque_max,
        travel=travel,
        motion=ramp.motion,
        cycle=sample.cycle,
    )


def both_directions(
    ramp: BreakawayRamp, dwell_time: float, settle: float, expected: float, shape: Shaper, cycle_time: float
) -> Generator[Intent, Sample, tuple[RecordedRamp, ...]]:
    """Dwell, ramp forward until the motor runs away, take the torque away, settle, and the same backward.

    `expected` (N*m) is the torque at which that is likely; only the phases' expected lengths depend on it.
    """
    done = []
    wait = dwell_time
    for direction in (1.0, -1.0):
        recorded = RecordedRamp(
            direction, Recording("motor_position"), Recording("time", ramp.signal, "motor_position")
        )
        yield Mark("dwell", wait)
        rest = yield from observed(dwell(wait, shape(0.0), cycle_time), recorded.rest.add)
        yield Mark(f"ramp {recorded.name}", expected / ramp.rate + RUN_AWAY_TIME)
        yield from ramp_to_motion(ramp, direction, shape, rest, cycle_time, recorded.motion)
        done.append(recorded)
        wait = settle
    yield Mark("settle", settle)
    yield from dwell(settle, shape(0.0), cycle_time)
    return tuple(done)


def expected_time(ramp: BreakawayRamp, dwell_time: float, settle: float, expected: float) -> float:
    """Give how long `both_directions` takes if the motor breaks away at `expected` (N*m), s."""
    one_way = min(expected, ramp.torque_max) / ramp.rate + RUN_AWAY_TIME + settle
    return dwell_time + 2.0 * one_way


def breakaway_measurements(found: Breakaway, direction: str, what: str) -> tuple[Measurement, ...]:
    """Name the two torques of one direction ("forward" or "backward"); `what` says which torque on what."""
    return (
        Measurement(
            f"breakaway_torque_{direction}",
            found.torque,
            "N*m",
            found.uncertainty,
            f"{what} at which the motor runs away, {direction}",
        ),
        Measurement(
            f"first_pulse_torque_{direction}",
            found.first_pulse,
            "N*m",
            found.first_pulse_uncertainty,
            f"{what} at the first encoder pulse, {direction} (set by the encoder's resolution)",
        ),
    )


def evaluate_ramp(ramp: RecordedRamp, facts: BenchFacts, motor_sense: float) -> Breakaway:
    """Evaluate one ramp.

    `motor_sense` is +1 if a positive torque must turn the motor forward, -1 if backward. Raises ConfigError if the
    motor went the other way: then a channel's sign is wrong, and no result of this bench would be right.
    """
    time, torque, position = ramp.motion.columns()
    (rest,) = ramp.rest.columns()
    travel = float(position[-1] - position[0])
    if travel * ramp.direction * motor_sense < 0.0:
        raise ConfigError(
            "signs of the bench file",
            [
                Mistake(
                    "motor_position.sign",
                    f"{travel:.4g} rad",
                    f"the motor turned against what a torque of sign {ramp.direction:+.0f} must do",
                )
            ],
            hint="Turn the sign of the torque or of the position channel in the bench file.",
        )
    return find_breakaway(time, torque, position, rest[rest.size // 2 :], TURN / facts.motor_counts, facts.rotor_swing)

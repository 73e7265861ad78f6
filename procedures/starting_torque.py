"""starting-torque: motor torque at which the free drive breaks away, in both directions.

From rest, with the output free, the motor torque is ramped until the rotor runs away, then taken away at once. The
torque at the first encoder pulse is reported beside the breakaway torque: the first measures the resolution of the
encoder, because the wave generator's spring winds up from the first torque on (Zhang, Ahmad & Liu 2014, section V).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

from procedures.checks import Checks
from procedures.intents import Measurement, Result, Steps
from procedures.motions import motor_torque
from procedures.plan import BenchFacts, PlannedRun, Procedure, parameter
from procedures.ramp_to_motion import (
    BreakawayRamp,
    RecordedRamp,
    both_directions,
    breakaway_measurements,
    check_ramp,
    evaluate_ramp,
    expected_time,
    least_motion,
)
from procedures.results import mean, mean_over_runs
from procedures.set_up import check_set_up, set_up_run
from procedures.waveforms import start_angles

RAMP_TIME = 6.0
"""Time from zero to the expected starting torque where no rate is given, s: slow against the rotor's swinging."""

MARGIN = 4.0
"""Largest torque in expected starting torques where none is given: cold grease and other makers' seals."""


@dataclass(frozen=True, slots=True)
class StartingTorque:
    """Parameters of starting-torque; None stands for a value from the dut."""

    dwell: float = parameter(5.0, "s", 0.5, 600.0, "quiet dwell at zero torque before each run")
    torque_rate: float | None = parameter(
        None, "N*m/s", 1e-6, 100.0, "rate of the motor torque; from dut: the starting torque in 6 s"
    )
    torque_max: float | None = parameter(
        None, "N*m", 1e-6, 1e3, "motor torque at which to give up; from dut: 4 starting torques, at most the limit"
    )
    motion: float | None = parameter(
        None, "rad", 0.01, 3.0, "motor travel that ends the ramp; from dut: 0.1 rad, at least 16 encoder counts"
    )
    speed_max: float = parameter(10.0, "rad/s", 0.1, 100.0, "motor speed that ends the ramp as well")
    settle: float = parameter(1.0, "s", 0.1, 60.0, "wait at zero torque after each ramp")
    start_angles: int = parameter(3, "1", 1, 64, "wave-generator angles at which to start, spread over a turn")
    repeats: int = parameter(3, "1", 1, 100, "runs at every start angle, replicates of each other")
    tare: bool = parameter(False, "1", 0, 1, "zero the unloaded torque sensor first")


def plan(parameters: StartingTorque, facts: BenchFacts) -> tuple[PlannedRun, ...]:
    """Plan a set-up move and a measuring run for every start angle and repeat. Raises ConfigError on limits."""
    p = parameters
    ramp = BreakawayRamp(
        signal="motor_torque",
        torque_max=min(MARGIN * facts.starting_torque, facts.limits.motor_torque)
        if p.torque_max is None
        else p.torque_max,
        rate=facts.starting_torque / RAMP_TIME if p.torque_rate is None else p.torque_rate,
        motion=least_motion(p.motion, facts.motor_counts),
        speed_max=p.speed_max,
    )
    check = Checks("starting-torque")
    check_ramp(check, ramp, facts.starting_torque, facts)
    check.at_most("torque_max", ramp.torque_max, facts.limits.motor_torque, "N*m", "the bench limit motor_torque")
    check.at_most("speed_max", p.speed_max, facts.limits.motor_velocity, "rad/s", "the bench limit motor_velocity")
    check.at_most("motion", 2.0 * ramp.motion, facts.limits.motor_travel, "rad", "half the bench limit motor_travel")
    check_set_up(check, facts, tare=p.tare)
    check.raise_if_any()
    return tuple(_runs(p, ramp, facts))


def summarise(results: tuple[Result, ...]) -> Result:
    """Give the means over all runs per direction, and the mean of both directions as the starting torque."""
    joined = mean_over_runs(results)
    both = [m for m in joined.measurements if m.name.startswith("breakaway_torque_")]
    total = (mean(both, "starting_torque", "motor torque at breakaway, mean of both directions"),) if both else ()
    return Result(total + joined.measurements)


def _runs(p: StartingTorque, ramp: BreakawayRamp, facts: BenchFacts) -> Iterator[PlannedRun]:
    for index, angle in enumerate(start_angles(p.start_angles), start=1):
        for repeat in range(1, p.repeats + 1):
            name = f"angle-{index}-repeat-{repeat}"
            first = index == repeat == 1
            yield set_up_run(f"set-up-{name}", facts, angle=angle, tare=p.tare and first)
            yield PlannedRun(
                name=name,
                steps=partial(_steps, p, ramp, facts),
                duration=expected_time(ramp, p.dwell, p.settle, facts.starting_torque),
                replicate=f"starting-torque-angle-{index}" if p.repeats > 1 else None,
                start_angle=angle,
            )


def _steps(p: StartingTorque, ramp: BreakawayRamp, facts: BenchFacts) -> Steps:
    shape = motor_torque()
    ramps = yield from both_directions(ramp, p.dwell, p.settle, facts.starting_torque, shape, facts.cycle_time)
    return partial(_evaluate, ramps, facts)


def _evaluate(ramps: tuple[RecordedRamp, ...], facts: BenchFacts) -> Result:
    found: list[Measurement] = []
    for done in ramps:
        breakaway = evaluate_ramp(done, facts, 1.0)
        found += breakaway_measurements(breakaway, done.name, "motor torque")
    return Result(tuple(found))


PROCEDURE = Procedure(
    name="starting-torque",
    summary="motor torque at which the free drive breaks away, both directions, several start angles",
    parameters=StartingTorque,
    plan=plan,
    summarise=summarise,
    needs=("motor_position", "motor_torque"),
    on_abort="The motor torque goes to zero; the rotor, at most at speed_max, stops by its own friction.",
)

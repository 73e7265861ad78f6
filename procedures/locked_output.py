"""locked-output: the motor twists the drive against a locked output, in nested triangles of torque.

After a quiet dwell the motor torque runs through a full triangle and smaller ones nested inside it, from several
wave-generator angles: one sweep turns the motor by 0.17 rad only, within which an error that is periodic in the
motor angle cannot be told from stiffness. Some start angles are measured twice (replicates tell missing physics
from noise), the first one at every rate of the ladder as well. Between start angles the output is unlocked.
Source: Zhang, Ahmad & Liu 2014, section V.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import partial

from drivers.types import Mode, Setpoint
from procedures.checks import HEADROOM, Checks
from procedures.guards import travel_guard
from procedures.intents import Mark, Result, Steps
from procedures.loop_run import Driven, Friction, check_loop, evaluate_loop, loop_recordings
from procedures.motions import RELEASED, dwell, motor_torque, observed, triangle, triangle_time
from procedures.plan import BenchFacts, PlannedRun, Procedure, parameter
from procedures.recording import measured
from procedures.results import mean_over_runs
from procedures.set_up import check_set_up, set_up_run
from procedures.waveforms import nested_triangles, start_angles

RATE_TIMES = (3.0, 9.0)
"""Times from zero to the peak where no rates are given, s: the second tells delay and creep from hysteresis."""


class Lock(StrEnum):
    """What holds the output."""

    FIXTURE = "fixture"
    LOAD_DRIVE = "load-drive"


@dataclass(frozen=True, slots=True)
class LockedOutput:
    """Parameters of locked-output; None stands for a value from the dut, () for what the meaning says."""

    dwell: float = parameter(5.0, "s", 0.5, 600.0, "quiet dwell at zero torque before each run")
    peak_torque: float | None = parameter(
        None,
        "N*m",
        1e-6,
        1e3,
        "largest motor torque; from dut: rated torque / ratio + starting torque, at most 95 % of what the limits allow",
    )
    amplitudes: tuple[float, ...] = parameter((1.0, 0.5, 0.25), "1", 0.01, 1.0, "nested triangles, shares of the peak")
    bias_torque: float = parameter(0.0, "N*m", -1e3, 1e3, "motor torque about which the nested triangles lie")
    rates: tuple[float, ...] = parameter(
        (),
        "N*m/s",
        1e-6,
        1e3,
        "rates of the motor torque: the first at all start angles, each further one once at the first angle; "
        "empty: the peak in 3 s and in 9 s",
    )
    hold: float = parameter(0.0, "s", 0.0, 600.0, "wait at every turning point (creep)")
    start_angles: int = parameter(8, "1", 1, 64, "wave-generator angles at which to start, spread over a turn")
    replicate_pairs: int = parameter(2, "1", 0, 64, "start angles that are measured twice in succession")
    lock: str = parameter("fixture", "1", 0, 0, "what holds the output: fixture or load-drive")
    travel_max: float = parameter(0.5, "rad", 0.01, 6.0, "motor travel beyond which the output is not held")
    tare: bool = parameter(False, "1", 0, 1, "zero the unloaded torque sensor first")


@dataclass(frozen=True, slots=True)
class Sweep:
    """One measuring run: turning points N*m and rate N*m/s of the motor torque."""

    points: tuple[float, ...]
    rate: float


def plan(parameters: LockedOutput, facts: BenchFacts) -> tuple[PlannedRun, ...]:
    """Plan unlock-move-lock and the sweeps for every start angle. Raises ConfigError on limits and equipment."""
    p = parameters
    limits, ratio, friction = facts.limits, facts.ratio, facts.starting_torque
    held = min(limits.output_torque, limits.load_torque) if p.lock == Lock.LOAD_DRIVE else limits.output_torque
    allowed = HEADROOM * min(limits.motor_torque, held / ratio + friction)
    peak = min(facts.rated_torque / ratio + friction, allowed) if p.peak_torque is None else p.peak_torque
    rates = p.rates or tuple(peak / time for time in RATE_TIMES)
    check = Checks("locked-output")
    check.within("peak_torque", peak, limits.motor_torque, "N*m", "the bench limit motor_torque")
    check.within(
        "peak_torque",
        ratio * (peak - friction),
        held,
        "N*m at the output",
        "the bench limit output_torque or load_torque",
    )
    check.demand(bool(p.amplitudes), "amplitudes", "()", "at least one share of the peak is needed")
    nested = max(sorted(p.amplitudes)[:-1], default=0.0) * peak
    check.at_most("bias_torque", abs(p.bias_torque) + nested, peak, "N*m with the nested triangle", "peak_torque")
    check_loop(check, peak, p.amplitudes, rates, Friction(friction, "gear.starting_torque", friction), facts)
    check.demand(
        p.replicate_pairs <= p.start_angles, "replicate_pairs", p.replicate_pairs, "more than there are start_angles"
    )
    check.at_most("travel_max", p.travel_max, limits.motor_travel, "rad", "the bench limit motor_travel")
    check.demand(p.lock in list(Lock), "lock", p.lock, "must be fixture or load-drive")
    check.demand(p.lock != Lock.FIXTURE or facts.has_lock, "lock", p.lock, "the bench has no lock")
    check.demand(p.lock != Lock.LOAD_DRIVE or facts.has_load_drive, "lock", p.lock, "the bench has no load drive")
    check_set_up(check, facts, tare=p.tare)
    check.raise_if_any()
    points = nested_triangles(peak, p.amplitudes, p.bias_torque, min(friction, peak))
    return tuple(_runs(p, [Sweep(points, rate) for rate in rates], facts))


def summarise(results: tuple[Result, ...]) -> Result:
    """Give the means over all runs."""
    return mean_over_runs(results)


def _runs(p: LockedOutput, sweeps: list[Sweep], facts: BenchFacts) -> Iterator[PlannedRun]:
    fixture = p.lock == Lock.FIXTURE
    for index, angle in enumerate(start_angles(p.start_angles), start=1):
        yield set_up_run(f"set-up-angle-{index}", facts, angle=angle, locked=fixture, tare=p.tare and index == 1)
        base = _run(p, f"angle-{index}", sweeps[0], facts, angle)
        if index <= p.replicate_pairs:
            base = replace(base, replicate=f"locked-output-angle-{index}")
            yield base
            yield replace(base, name=f"{base.name}-again")
        else:
            yield base
        if index == 1:
            for number, sweep in enumerate(sweeps[1:], start=2):
                yield _run(p, f"angle-{index}-rate-{number}", sweep, facts, angle)
    if fixture:
        yield set_up_run("set-up-unlock", facts)


def _run(p: LockedOutput, name: str, sweep: Sweep, facts: BenchFacts, angle: float) -> PlannedRun:
    return PlannedRun(
        name=name,
        steps=partial(_steps, p, sweep, facts),
        duration=p.dwell + triangle_time(sweep.points, sweep.rate, p.hold),
        start_angle=angle,
    )


def _steps(p: LockedOutput, sweep: Sweep, facts: BenchFacts) -> Steps:
    yield Mark("dwell", p.dwell)
    first = yield RELEASED
    hold = None
    if p.lock == Lock.LOAD_DRIVE:
        hold = Setpoint(Mode.POSITION, measured(first.load_position, "load_position"))
    shape = motor_torque(hold)
    rest = yield from dwell(p.dwell, shape(0.0), facts.cycle_time)
    legs = loop_recordings()
    sweeps = triangle(sweep.points, sweep.rate, p.hold, shape, facts.cycle_time, legs)
    yield from observed(sweeps, travel_guard(rest, p.travel_max, "the output is not held"))
    # where the output turns with the wave generator, its torque falls as the motor torque rises
    order = 1.0 if facts.opposed else -1.0
    meaning = "half width of the loop in motor torque at zero output torque"
    driven = Driven(order, "friction_torque", 1.0, meaning, output_held=True)
    return partial(evaluate_loop, legs, driven, facts)


PROCEDURE = Procedure(
    name="locked-output",
    summary="torsion and hysteresis under motor torque with the output locked, several start angles",
    parameters=LockedOutput,
    plan=plan,
    summarise=summarise,
    needs=("motor_position", "motor_torque"),
    on_abort="The motor torque is ramped to zero and the motor released; the output stays locked.",
)

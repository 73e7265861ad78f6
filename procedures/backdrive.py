"""backdrive: the load drive twists the drive from its output, with the input held or free.

*held*: the motor drive holds the wave generator where it stands, the load torque runs through nested triangles of
both signs. Compliance and hysteresis come from other friction than in locked-output: an independent measurement.
*free*: the motor is released and the load torque ramped until the motor first moves, then taken away at once. Only
this measures the backdriving torque. Source: Zhang, Ahmad & Liu 2014, section V and equation (36).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from functools import partial

from drivers.types import Mode, Setpoint
from procedures.checks import HEADROOM, Checks
from procedures.guards import travel_guard
from procedures.intents import Mark, Measurement, Result, Steps
from procedures.loop_run import Driven, Friction, check_loop, evaluate_loop, loop_recordings
from procedures.motions import RELEASED, dwell, load_torque, observed, triangle, triangle_time
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
from procedures.recording import measured
from procedures.results import mean, mean_over_runs
from procedures.set_up import check_set_up, set_up_run
from procedures.waveforms import nested_triangles, start_angles

TRIANGLE_TIME = 3.0
"""Time from zero to the peak where no rates are given, s."""

RAMP_TIME = 6.0
"""Time from zero to the expected backdriving torque where no rate is given, s."""

MARGIN = 3.0
"""Largest torque with a free input in expected backdriving torques where none is given."""


class Input(StrEnum):
    """What the motor does while the load drive twists."""

    HELD = "held"
    FREE = "free"


@dataclass(frozen=True, slots=True)
class Backdrive:
    """Parameters of backdrive; None stands for a value from the dut, () for what the meaning says."""

    input: str = parameter("held", "1", 0, 0, "held: the motor holds its angle; free: it is released")
    dwell: float = parameter(5.0, "s", 0.5, 600.0, "quiet dwell without load torque before each run")
    start_angles: int = parameter(2, "1", 1, 64, "wave-generator angles at which to start, spread over a turn")
    repeats: int = parameter(2, "1", 1, 100, "runs at every start angle, replicates of each other")
    peak_torque: float | None = parameter(
        None,
        "N*m",
        1e-3,
        1e5,
        "held: largest load torque; from dut: rated torque, at most 95 % of what the limits allow",
    )
    amplitudes: tuple[float, ...] = parameter(
        (1.0, 0.5, 0.25), "1", 0.01, 1.0, "held: nested triangles, shares of the peak"
    )
    bias_torque: float = parameter(0.0, "N*m", -1e5, 1e5, "held: load torque about which the nested triangles lie")
    rates: tuple[float, ...] = parameter(
        (),
        "N*m/s",
        1e-4,
        1e5,
        "held: rates of the load torque: the first at all start angles, each further one once at the first angle; "
        "empty: the peak in 3 s",
    )
    hold: float = parameter(0.0, "s", 0.0, 600.0, "held: wait at every turning point (creep)")
    travel_max: float = parameter(0.5, "rad", 0.01, 6.0, "held: motor travel beyond which it does not hold")
    torque_rate: float | None = parameter(
        None, "N*m/s", 1e-4, 1e4, "free: rate of the load torque; from dut: the backdriving torque in 6 s"
    )
    torque_max: float | None = parameter(
        None,
        "N*m",
        1e-3,
        1e5,
        "free: load torque at which to give up; from dut: 3 backdriving torques, at most the limit",
    )
    motion: float | None = parameter(
        None,
        "rad",
        0.01,
        3.0,
        "free: motor travel that ends the ramp; from dut: 0.1 rad, at least 16 encoder counts",
    )
    speed_max: float = parameter(10.0, "rad/s", 0.1, 100.0, "free: motor speed that ends the ramp as well")
    settle: float = parameter(1.0, "s", 0.1, 60.0, "free: wait without load torque after each ramp")
    tare: bool = parameter(False, "1", 0, 1, "zero the unloaded torque sensor first")


def plan(parameters: Backdrive, facts: BenchFacts) -> tuple[PlannedRun, ...]:
    """Plan a set-up move and the runs for every start angle. Raises ConfigError on limits and equipment."""
    p = parameters
    check = Checks("backdrive")
    check.demand(p.input in list(Input), "input", p.input, "must be held or free")
    check.demand(facts.has_load_drive, "input", p.input, "the bench has no load drive")
    check_set_up(check, facts, tare=p.tare)
    allowed = min(facts.limits.load_torque, facts.limits.output_torque)
    runs = _plan_free(p, facts, allowed, check) if p.input == Input.FREE else _plan_held(p, facts, allowed, check)
    check.raise_if_any()
    return tuple(runs)


def summarise(results: tuple[Result, ...]) -> Result:
    """Give the means over all runs; with a free input also the mean of both directions as backdriving torque."""
    joined = mean_over_runs(results)
    both = [m for m in joined.measurements if m.name.startswith("breakaway_torque_")]
    total = (mean(both, "backdriving_torque", "load torque at breakaway, mean of both directions"),) if both else ()
    return Result(total + joined.measurements)


def _plan_held(p: Backdrive, facts: BenchFacts, allowed: float, check: Checks) -> Iterator[PlannedRun]:
    holds = facts.ratio * facts.limits.motor_torque
    peak = min(facts.rated_torque, HEADROOM * allowed, HEADROOM * holds) if p.peak_torque is None else p.peak_torque
    check.within("peak_torque", peak, allowed, "N*m", "the bench limit load_torque or output_torque")
    # Friction of the gear helps the motor to hold once the teeth slide; how much is what is to be measured.
    check.within(
        "peak_torque",
        peak / facts.ratio,
        facts.limits.motor_torque,
        "N*m",
        "the bench limit motor_torque (a held motor carries peak_torque / ratio)",
    )
    check.demand(bool(p.amplitudes), "amplitudes", "()", "at least one share of the peak is needed")
    nested = max(sorted(p.amplitudes)[:-1], default=0.0) * peak
    check.at_most("bias_torque", abs(p.bias_torque) + nested, peak, "N*m with the nested triangle", "peak_torque")
    check.at_most("travel_max", p.travel_max, facts.limits.motor_travel, "rad", "the bench limit motor_travel")
    rates = p.rates or (peak / TRIANGLE_TIME,)
    friction = Friction(facts.backdriving_torque, "gear.backdriving_torque", 0.0)
    check_loop(check, peak, p.amplitudes, rates, friction, facts)
    points = nested_triangles(peak, p.amplitudes, p.bias_torque, min(facts.backdriving_torque, peak))
    return _held_runs(p, points, rates, facts)


def _held_runs(
    p: Backdrive, points: tuple[float, ...], rates: tuple[float, ...], facts: BenchFacts
) -> Iterator[PlannedRun]:
    def run(name: str, rate: float, angle: float, replicate: str | None) -> PlannedRun:
        duration = p.dwell + triangle_time(points, rate, p.hold)
        return PlannedRun(name, partial(_held_steps, p, points, rate, facts), duration, replicate, angle)

    for index, angle in enumerate(start_angles(p.start_angles), start=1):
        yield set_up_run(f"set-up-angle-{index}", facts, angle=angle, tare=p.tare and index == 1)
        group = f"backdrive-held-angle-{index}" if p.repeats > 1 else None
        for repeat in range(1, p.repeats + 1):
            yield run(f"held-angle-{index}-repeat-{repeat}", rates[0], angle, group)
        if index == 1:
            for number, rate in enumerate(rates[1:], start=2):
                yield run(f"held-angle-{index}-rate-{number}", rate, angle, None)


def _held_steps(p: Backdrive, points: tuple[float, ...], rate: float, facts: BenchFacts) -> Steps:
    yield Mark("dwell", p.dwell)
    first = yield RELEASED
    shape = load_torque(Setpoint(Mode.POSITION, measured(first.motor_position, "motor_position")))
    rest = yield from dwell(p.dwell, shape(0.0), facts.cycle_time)
    legs = loop_recordings()
    sweeps = triangle(points, rate, p.hold, shape, facts.cycle_time, legs)
    yield from observed(sweeps, travel_guard(rest, p.travel_max, "the motor does not hold its angle"))
    meaning = "half width of the loop in motor torque at zero output torque, times the ratio"
    driven = Driven(-1.0, "friction_level", facts.ratio, meaning, output_held=False)
    return partial(evaluate_loop, legs, driven, facts)


def _plan_free(p: Backdrive, facts: BenchFacts, allowed: float, check: Checks) -> Iterator[PlannedRun]:
    expected = facts.backdriving_torque
    ramp = BreakawayRamp(
        signal="output_torque" if facts.has_torque_sensor else "load_torque",
        torque_max=min(MARGIN * expected, allowed) if p.torque_max is None else p.torque_max,
        rate=expected / RAMP_TIME if p.torque_rate is None else p.torque_rate,
        motion=least_motion(p.motion, facts.motor_counts),
        speed_max=p.speed_max,
    )
    check_ramp(check, ramp, expected, facts)
    check.at_most("torque_max", ramp.torque_max, allowed, "N*m", "the bench limit load_torque or output_torque")
    check.at_most("speed_max", p.speed_max, facts.limits.motor_velocity, "rad/s", "the bench limit motor_velocity")
    check.at_most("motion", 2.0 * ramp.motion, facts.limits.motor_travel, "rad", "half the bench limit motor_travel")
    return _free_runs(p, ramp, facts)


def _free_runs(p: Backdrive, ramp: BreakawayRamp, facts: BenchFacts) -> Iterator[PlannedRun]:
    for index, angle in enumerate(start_angles(p.start_angles), start=1):
        for repeat in range(1, p.repeats + 1):
            name = f"free-angle-{index}-repeat-{repeat}"
            yield set_up_run(f"set-up-{name}", facts, angle=angle, tare=p.tare and index == repeat == 1)
            yield PlannedRun(
                name=name,
                steps=partial(_free_steps, p, ramp, facts),
                duration=expected_time(ramp, p.dwell, p.settle, facts.backdriving_torque),
                replicate=f"backdrive-free-angle-{index}" if p.repeats > 1 else None,
                start_angle=angle,
            )


def _free_steps(p: Backdrive, ramp: BreakawayRamp, facts: BenchFacts) -> Steps:
    shape = load_torque()
    ramps = yield from both_directions(ramp, p.dwell, p.settle, facts.backdriving_torque, shape, facts.cycle_time)
    return partial(_evaluate_free, ramps, facts)


def _evaluate_free(ramps: tuple[RecordedRamp, ...], facts: BenchFacts) -> Result:
    found: list[Measurement] = []
    for done in ramps:
        # Pushed at the output, an opposed drive turns its wave generator backward.
        breakaway = evaluate_ramp(done, facts, -1.0 if facts.opposed else 1.0)
        found += breakaway_measurements(breakaway, done.name, "load torque")
    return Result(tuple(found))


PROCEDURE = Procedure(
    name="backdrive",
    summary="load torque at the output with the input held (torsion, hysteresis) or free (backdriving torque)",
    parameters=Backdrive,
    plan=plan,
    summarise=summarise,
    needs=("motor_position", "motor_torque"),
    on_abort="The load torque is ramped to zero first, then the motor lets go of its angle; both are released.",
    needs_load_drive=True,
)

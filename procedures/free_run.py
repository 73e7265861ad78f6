"""free-run: constant speeds in both directions with the output free or loaded, slow and fast.

One run is one speed: ramp, a leg of whole output turns forward, gentle reversal, the same leg backward. Over whole
turns cogging and kinematic error average out, and half the difference of the two directions is friction at that
speed; the ladder of speeds splits it into Coulomb and viscous friction. Slow legs of two output turns show every
angle-periodic error. A ladder of load torques, held by the load drive while the motor turns, repeats the speeds at
other motor currents: torque ripple and load-dependent friction change with them, cogging does not.
Source: Zhang, Ahmad & Liu 2014, section V; Castejon et al. 2009, section 4.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

from drivers.errors import RigTimeoutError
from drivers.types import Mode, Setpoint
from procedures.checks import Checks
from procedures.friction import friction_line, leg_mean
from procedures.hysteresis import Value
from procedures.intents import Mark, Measurement, Result, Steps
from procedures.motions import RELEASED, Motion, Shaper, dwell, follow, load_torque, motor_velocity, observed, ramp
from procedures.plan import BenchFacts, PlannedRun, Procedure, parameter
from procedures.recording import Recording
from procedures.results import mean_over_runs
from procedures.set_up import set_up_run
from procedures.speed import MotorSpeed, resolvable
from procedures.waveforms import TURN, cycles

TOP_SPEED = 200.0
"""Fastest leg where no speeds are given, rad/s: 1900 rpm, where makers state running torque."""

SPEED_SHARE = 0.8
"""Share of the bench's speed limit that a speed may use where none are given."""

LADDER = (0.125, 0.235, 0.485, 1.0)
"""Speeds where none are given, in shares of the fastest; no multiples of each other, whose aliases are shared."""

LOAD_TIME = 1.0
"""Time in which a load torque is put on and taken off again, s."""

STILL = 0.02
"""Share of the leg's speed below which the motor has coasted to rest."""


@dataclass(frozen=True, slots=True)
class FreeRun:
    """Parameters of free-run; () stands for what the meaning says."""

    dwell: float = parameter(5.0, "s", 0.5, 600.0, "quiet dwell with released motor before each run")
    speeds: tuple[float, ...] = parameter(
        (),
        "rad/s",
        0.01,
        2000.0,
        "motor speeds, both ways; empty: 0.125, 0.235, 0.485 and 1 of 200 rad/s, at most of 80 % of the limit",
    )
    turns: int = parameter(2, "1", 1, 1000, "whole output turns per leg")
    acceleration: float = parameter(100.0, "rad/s^2", 0.1, 1e5, "speed ramps of the motor")
    settle: float = parameter(0.5, "s", 0.0, 60.0, "time at speed before each leg")
    coast_down: float = parameter(
        0.0, "s", 0.0, 600.0, "after each leg the motor is released for so long instead of braked; 0: braked"
    )
    load_torques: tuple[float, ...] = parameter(
        (),
        "N*m",
        -1e5,
        1e5,
        "torques at the output, held by the load drive; every speed is run at each; empty: load drive released",
    )
    repeats: int = parameter(2, "1", 1, 100, "runs at every speed and load, replicates of each other")
    tare: bool = parameter(False, "1", 0, 1, "zero the unloaded torque sensor first")


def plan(parameters: FreeRun, facts: BenchFacts) -> tuple[PlannedRun, ...]:
    """Plan one run per speed and repeat. Raises ConfigError if speed or travel exceed the bench's limits."""
    p = parameters
    limits = facts.limits
    top = min(TOP_SPEED, SPEED_SHARE * limits.motor_velocity)
    speeds = p.speeds or tuple(share * top for share in LADDER)
    check = Checks("free-run")
    for speed in speeds:
        check.within("speeds", speed, limits.motor_velocity, "rad/s", "the bench limit motor_velocity")
    travel = max(TURN * facts.ratio * p.turns + speed * p.settle + speed * speed / p.acceleration for speed in speeds)
    check.at_most("turns", travel, limits.motor_travel, "rad of motor travel", "the bench limit motor_travel")
    check.at_most(
        "turns", travel / facts.ratio, limits.output_travel, "rad of output travel", "the bench limit output_travel"
    )
    _check_torques(check, p, facts)
    check.demand(facts.has_torque_sensor or not p.tare, "tare", p.tare, "the bench has no torque sensor to zero")
    check.raise_if_any()
    return tuple(_runs(p, speeds, facts))


def _check_torques(check: Checks, p: FreeRun, facts: BenchFacts) -> None:
    """Refuse loads and accelerations that load drive or motor cannot give, and loads on a motor that lets go."""
    limits = facts.limits
    ramp = facts.motor_inertia * p.acceleration + facts.starting_torque
    check.within("acceleration", ramp, limits.motor_torque, "N*m with friction", "the bench limit motor_torque")
    if not p.load_torques:
        return
    check.demand(facts.has_load_drive, "load_torques", p.load_torques, "the bench has no load drive")
    check.demand(
        p.coast_down == 0.0,
        "coast_down",
        f"{p.coast_down:g} s",
        "must be 0 with load_torques: the load would drive the released motor",
    )
    largest = max(map(abs, p.load_torques))
    allowed = min(limits.load_torque, limits.output_torque)
    check.within("load_torques", largest, allowed, "N*m", "the bench limit load_torque or output_torque")
    check.within(
        "load_torques",
        largest / facts.ratio + ramp,
        limits.motor_torque,
        "N*m at the motor (load / ratio, friction and acceleration)",
        "the bench limit motor_torque",
    )


def summarise(results: tuple[Result, ...]) -> Result:
    """Give Coulomb and viscous friction from all runs, and friction and offset at every speed; per load torque."""
    loads: dict[float | None, list[dict[str, Measurement]]] = {}
    for result in results:
        named = {m.name: m for m in result.measurements}
        loads.setdefault(named["load_torque"].value if "load_torque" in named else None, []).append(named)
    return Result(tuple(m for load, runs in loads.items() for m in _summary_at(load, runs)))


def _summary_at(load: float | None, runs: list[dict[str, Measurement]]) -> Iterator[Measurement]:
    at_load = "" if load is None else f"_at_{load:g}_N_m"
    speeds = [names["speed"].value for names in runs]
    friction = [Value(n["friction"].value, n["friction"].uncertainty or 0.0) for n in runs]
    fitted = friction_line(speeds, friction)
    if fitted is not None:
        yield Measurement(
            f"coulomb_friction{at_load}",
            fitted.coulomb.value,
            "N*m",
            fitted.coulomb.uncertainty,
            "friction torque at the motor, extrapolated to zero speed",
        )
        yield Measurement(
            f"viscous_friction{at_load}",
            fitted.viscous.value,
            "N*m*s",
            fitted.viscous.uncertainty,
            "rise of the friction torque with motor speed",
        )
    for speed in sorted(set(speeds)):
        same = [Result(tuple(n.values())) for n, s in zip(runs, speeds, strict=True) if s == speed]
        for m in mean_over_runs(same).measurements:
            if m.name not in ("speed", "load_torque"):
                name = f"{m.name}_at_{speed:g}_rad_s{at_load.replace('_at_', '_and_')}"
                yield Measurement(name, m.value, m.unit, m.uncertainty, m.meaning)


def _runs(p: FreeRun, speeds: tuple[float, ...], facts: BenchFacts) -> Iterator[PlannedRun]:
    if facts.has_lock or p.tare:
        yield set_up_run("set-up-unlock", facts, tare=p.tare)
    loads: tuple[tuple[str, float | None], ...] = (("", None),)
    if p.load_torques:
        loads = tuple((f"-load-{number}", torque) for number, torque in enumerate(p.load_torques, start=1))
    for repeat in range(1, p.repeats + 1):
        for suffix, load in loads:
            for index, speed in enumerate(speeds, start=1):
                yield PlannedRun(
                    name=f"speed-{index}{suffix}-repeat-{repeat}",
                    steps=partial(_steps, p, speed, load, facts),
                    duration=_duration(p, speed, facts),
                    replicate=f"free-run-speed-{index}{suffix}" if p.repeats > 1 else None,
                )


def _leg_time(p: FreeRun, speed: float, facts: BenchFacts) -> float:
    return TURN * facts.ratio * p.turns / speed


def _duration(p: FreeRun, speed: float, facts: BenchFacts) -> float:
    """Give the run's length: four speed ramps, two of which a coast-down replaces."""
    stops = 2.0 * (p.coast_down if p.coast_down > 0.0 else speed / p.acceleration)
    legs = 2.0 * (speed / p.acceleration + p.settle + _leg_time(p, speed, facts))
    return p.dwell + legs + stops + (2.0 * LOAD_TIME if p.load_torques else 0.0)


def _steps(p: FreeRun, speed: float, load: float | None, facts: BenchFacts) -> Steps:
    legs: list[Recording] = []
    yield Mark("dwell", p.dwell)
    yield from dwell(p.dwell, RELEASED, facts.cycle_time)
    if load is not None:
        yield from _change_load(0.0, load, facts)
    shape = motor_velocity(None if load is None else Setpoint(Mode.TORQUE, load))
    for direction, sign in (("forward", 1.0), ("backward", -1.0)):
        recording = Recording("motor_torque")
        yield from _leg(p, direction, sign * speed, shape, facts, recording)
        legs.append(recording)
    if load is not None:
        yield from _change_load(load, 0.0, facts)
    return partial(_evaluate, p, speed, load, legs, facts)


def _change_load(start: float, end: float, facts: BenchFacts) -> Motion:
    """Change the load torque (N*m) while the motor holds speed zero."""
    yield Mark(f"load to {end:.6g} N*m", LOAD_TIME)
    shape = load_torque(Setpoint(Mode.VELOCITY, 0.0))
    count = cycles(LOAD_TIME, facts.cycle_time)
    return (yield from follow((start + (end - start) * k / count for k in range(1, count + 1)), shape))


def _evaluate(p: FreeRun, speed: float, load: float | None, legs: list[Recording], facts: BenchFacts) -> Result:
    turns = max(1, round(p.turns * facts.ratio))
    forward, backward = (leg_mean(leg.columns()[0], turns) for leg in legs)
    error = 0.5 * math.hypot(forward.uncertainty, backward.uncertainty)
    condition = () if load is None else (Measurement("load_torque", load, "N*m", None, "held at the output"),)
    return Result(
        (
            *condition,
            Measurement("speed", speed, "rad/s", None, "motor speed of both legs"),
            Measurement(
                "friction",
                0.5 * (forward.value - backward.value),
                "N*m",
                error,
                "half difference of the mean motor torques of both directions",
            ),
            Measurement(
                "torque_offset",
                0.5 * (forward.value + backward.value),
                "N*m",
                error,
                "half sum of the mean motor torques of both directions: load / ratio and what else keeps its sign",
            ),
        )
    )


def _leg(p: FreeRun, direction: str, speed: float, shape: Shaper, facts: BenchFacts, recording: Recording) -> Motion:
    """Speed up from rest, run whole turns, and come to rest, braked or coasting."""
    cycle_time = facts.cycle_time
    ramp_time = abs(speed) / p.acceleration
    yield Mark(f"speed up {direction}", ramp_time + p.settle)
    yield from ramp(0.0, speed, p.acceleration, shape, cycle_time)
    if p.settle > 0.0:
        yield from dwell(p.settle, shape(speed), cycle_time)
    leg_time = _leg_time(p, abs(speed), facts)
    yield Mark(f"leg {direction} at {abs(speed):g} rad/s", leg_time)
    leg = observed(dwell(leg_time, shape(speed), cycle_time), recording.add)
    if p.coast_down > 0.0:
        return (yield from _coast_down(p, leg, speed, facts))
    yield from leg
    yield Mark("slow down", ramp_time)
    return (yield from ramp(speed, 0.0, p.acceleration, shape, cycle_time))


def _coast_down(p: FreeRun, leg: Motion, speed: float, facts: BenchFacts) -> Motion:
    """Run the leg, release the motor and wait. Raises RigTimeoutError if the motor still turns then.

    A drive need not report a velocity: the speed is then taken from the angle, over 10 ms that may reach back into
    the leg.
    """
    from_angle = MotorSpeed(facts.cycle_time)
    yield from observed(leg, from_angle.see)
    yield Mark("coast-down", p.coast_down)
    sample = yield from observed(dwell(p.coast_down, RELEASED, facts.cycle_time), from_angle.see)
    seen = from_angle.value if sample.motor_velocity is None else sample.motor_velocity
    if seen is not None and abs(seen) > max(STILL * abs(speed), resolvable(facts.motor_counts)):
        raise RigTimeoutError(
            "the motor to coast to rest",
            p.coast_down,
            last_seen=f"{seen:.4g} rad/s",
            hint="Both axes are released. Raise coast_down.",
        )
    return sample


PROCEDURE = Procedure(
    name="free-run",
    summary="constant speeds both ways with the output free or loaded: friction, kinematic error, cogging",
    parameters=FreeRun,
    plan=plan,
    summarise=summarise,
    needs=("motor_position", "motor_torque"),
    on_abort="Speed and load torque are ramped to zero within the bench's ramp time, then both drives are released.",
)

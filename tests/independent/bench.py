"""The four procedures as quasi-static benches: command in, true signals out. Contract signs, sense `opposed`.

    torsion   output_position + motor_position/N = f(T) + g(M_w)/N + sum e
    motor     motor_torque M = M_w + T_cog(motor_position) + ripple(M, motor_position) - T * slope(e)
    mesh      |T - N M_w| <= N * level: the gear side of the flexspline, at output_position - f(T) - sum of the e that
              lie behind the mesh, stands still while the sign is < and slides where it is =
    output    output_torque = T + hold, hold = the torque that would hold the arm against gravity

T is the torque in the flexspline and M_w the torque in the wave generator. All friction lies at the gear, between
the two springs, as in the base laws; effects in the friction add to its level. The torque cell sits outside the arm.
Masses have no inertia, but for the rotor's where the effect `inertia` is present.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from tests.independent import effects as fx
from tests.independent import laws
from tests.independent.laws import Drive

Floats = NDArray[np.float64]
Numbers = NDArray[np.float64] | float
Signals = tuple[Floats, Floats, Floats, Floats]
"""motor_position, output_position (rad), motor_torque, output_torque (N*m), each of shape (n,)."""
Gaps = tuple[tuple[float, float], ...]
"""Half width (rad at the motor) and the torque that closes the contact (N*m at the motor) of each gap."""

ITERATIONS = 400
SETTLED = 1e-11
"""rad at the motor, far below anything an encoder sees."""
FOLLOWED = 5
"""Rounds after which the speed of a locked motor no longer follows the angle: it is small, its noise is not."""

SUBSTEPS = 4
"""Steps per sample of the starting torque: keeps the viscous term steeper than the cogging."""

AT_WAVE_GENERATOR = ("backlash",)
BEHIND_MESH = tuple(name for name in fx.TORSION if name not in AT_WAVE_GENERATOR)
"""On which side of the mesh an effect in the torsion lies: which spring it is in series with."""

ROOM = 25.0
"""degC where nothing is said."""


@dataclass(frozen=True, slots=True)
class Conditions:
    """Time (s, evenly spaced) and the gear's temperature (degC) at every sample, shape (n,)."""

    time: Floats
    temperature: Floats


def locked_output(
    motor_torque: Floats, start_angle: float, drive: Drive, effects: fx.Effects, conditions: Conditions | None = None
) -> Signals:
    """Sweep the motor torque with the output locked rigidly; the lock closed on an unloaded drive.

    Raises ValueError where the cogging is so steep that the shaft would snap between stable angles.
    """
    around = _conditions(motor_torque, conditions)
    output_angle = -start_angle / drive.ratio
    hold = float(fx.gravity_load(output_angle, effects.gravity_load))
    angle = np.full(motor_torque.shape, start_angle)
    T = np.full(motor_torque.shape, -hold)
    velocity = np.zeros(motor_torque.shape)
    share = 1.0 / (1.0 + _softness(T, motor_torque, drive, effects))
    for k in range(ITERATIONS):
        through = _through_wave_generator(motor_torque, angle, T, effects)
        error = _torsion_effects(BEHIND_MESH, T, through, angle, around, 1.0, drive, effects)
        gap = _torsion_effects(AT_WAVE_GENERATOR, T, through, angle, around, 1.0, drive, effects)
        radius = drive.ratio * _level(drive.T_fs, T, angle, velocity, around, drive, effects)
        lowest = _flexspline(drive.ratio * through - radius, drive) + error
        highest = _flexspline(drive.ratio * through + radius, drive) + error
        wound = _slide(lowest, highest, float(_flexspline(-hold, drive) + error[0]))
        T = T + share * (_flexspline_torque(wound - error, drive) - T)
        moved = drive.ratio * (wound + gap - output_angle) + _wave_generator(through, drive)
        settled = np.max(np.abs(moved - angle)) < SETTLED
        angle = moved
        if k < FOLLOWED:
            velocity = np.gradient(angle, around.time)
        if settled:
            return angle, np.full(angle.shape, output_angle), motor_torque, T + hold
    raise ValueError("the shaft snaps between cogging positions: a quasi-static bench cannot follow it")


def backdrive(
    output_torque: Floats, start_angle: float, drive: Drive, effects: fx.Effects, conditions: Conditions | None = None
) -> Signals:
    """Sweep the torque on the output with the wave generator held at one angle."""
    around = _conditions(output_torque, conditions)
    angle = np.full(output_torque.shape, start_angle)
    at_rest = np.zeros(output_torque.shape)
    output_angle = np.full(output_torque.shape, -start_angle / drive.ratio)
    for _ in range(ITERATIONS):
        T = output_torque - fx.gravity_load(output_angle, effects.gravity_load)
        level = _level(drive.T_fb / drive.ratio, T, angle, at_rest, around, drive, effects)
        through = _slide(T / drive.ratio - level, T / drive.ratio + level, 0.0)
        torsion = _torsion(T, through, angle, around, 0.0, drive, effects)
        moved = torsion - start_angle / drive.ratio
        settled = np.max(np.abs(moved - output_angle)) < SETTLED / drive.ratio
        output_angle = moved
        if settled:
            return angle, output_angle, _motor_torque(through, angle, T, effects), output_torque
    raise ValueError("the arm is too heavy for the stiffness of the drive: the held angle does not settle")


def free_run(
    motor_position: Floats,
    motor_velocity: Floats,
    drive: Drive,
    effects: fx.Effects,
    conditions: Conditions | None = None,
    load: Floats | None = None,
) -> Signals:
    """Turn the drive along a path, against the torque `load` (N*m, from outside) on the output, or against none.

    At a reversal the wave generator winds up before the gear slips.
    """
    around = _conditions(motor_position, conditions)
    outside = np.zeros(motor_position.shape) if load is None else load
    output_angle = -motor_position / drive.ratio
    through = outside
    for _ in range(4):  # the arm's moment changes by less than 1e-3 of itself with the torsion: four rounds are exact
        T = outside - fx.gravity_load(output_angle, effects.gravity_load)
        level = _level(drive.T_c, T, motor_position, motor_velocity, around, drive, effects)
        friction = _friction_while_turning(motor_position, T / drive.ratio, level, drive, _gaps(effects))
        through = T / drive.ratio + friction + _viscous(motor_velocity, around, drive, effects)
        torsion = _torsion(T, through, motor_position, around, 0.0, drive, effects)
        output_angle = torsion - motor_position / drive.ratio
    for parameters in effects.of("inertia"):
        through = through + parameters["J"] * np.gradient(motor_velocity, around.time)
    return motor_position, output_angle, _motor_torque(through, motor_position, T, effects), outside


def starting_torque(
    motor_torque: Floats,
    period: float,
    start_angle: float,
    slip: float,
    drive: Drive,
    effects: fx.Effects,
    temperature: float = ROOM,
) -> Signals:
    """Raise the motor torque with the output free until the gear has slipped by `slip` (rad at the motor).

    The wave generator winds up first; beyond T_fs the speed is what the viscous friction allows. Ends at the first
    sample at which the slip is reached, so that the result may be shorter than `motor_torque`. The friction is that
    of the speed one step before: where it falls with the speed the shaft jumps to where it rises again.
    """
    T = -float(fx.gravity_load(-start_angle / drive.ratio, effects.gravity_load))
    step = period / SUBSTEPS

    def limits(at: float, speed: float) -> tuple[float, float]:
        around = Conditions(np.zeros(1), np.full(1, temperature))
        place, rate = np.full(1, at), np.full(1, speed)
        level = float(_level(drive.T_fs, np.full(1, T), place, rate, around, drive, effects)[0])
        return T / drive.ratio - level, T / drive.ratio + level

    gaps = _gaps(effects)
    low, high = limits(start_angle, 0.0)
    at_rest = float(_through_wave_generator(motor_torque[0], start_angle, T, effects))
    first_gear_angle = start_angle - _wound(min(max(at_rest, low), high), drive, gaps)
    angle, gear_angle, before, speed = start_angle, first_gear_angle, float(motor_torque[0]), 0.0
    angles: list[float] = []
    for command in motor_torque.tolist():
        for _ in range(SUBSTEPS if command != before else 0):
            low, high = limits(angle, speed)
            following = _next_angle(command, angle, gear_angle, T, (low, high), step, drive, effects)
            angle, speed = following, (following - angle) / step
            gear_angle = angle - _wound(_spring_torque(angle - gear_angle, low, high, drive, gaps), drive, gaps)
        before = command
        angles.append(angle)
        if abs(gear_angle - first_gear_angle) >= slip:
            break
    position = np.array(angles)
    driving = motor_torque[: position.size]
    loaded = np.full(position.shape, T)
    around = Conditions(np.asarray(period * np.arange(position.size)), np.full(position.shape, temperature))
    through = _through_wave_generator(driving, position, loaded, effects)
    torsion = _torsion(loaded, through, position, around, 0.0, drive, effects)
    return position, torsion - position / drive.ratio, driving, np.zeros(position.shape)


def _conditions(signal: Floats, conditions: Conditions | None) -> Conditions:
    """Give the conditions, or 200 samples a second in a room."""
    if conditions is not None:
        return conditions
    return Conditions(np.arange(signal.size) / 200.0, np.full(signal.shape, ROOM))


def _torsion(
    T: Floats, through: Floats, angle: Floats, around: Conditions, locked: float, drive: Drive, effects: fx.Effects
) -> Floats:
    errors = _torsion_effects(fx.TORSION, T, through, angle, around, locked, drive, effects)
    return laws.total_torsion(T, through, drive) + errors


def _torsion_effects(
    ids: Iterable[str],
    T: Floats,
    through: Floats,
    angle: Floats,
    around: Conditions,
    locked: float,
    drive: Drive,
    effects: fx.Effects,
) -> Floats:
    """Sum e of the effects `ids`: what they add to the torsion, rad."""
    signals = {
        "time": around.time,
        "motor_position": angle,
        "motor_torque": through,
        "output_torque": T,
        "temperature": around.temperature,
        "flexspline_torsion": _flexspline(T, drive),
        "locked": np.full(T.shape, locked),
    }
    return fx.total(ids, effects, signals, T.shape)


def _level(
    base: float,
    T: Floats,
    angle: Floats,
    velocity: Floats,
    around: Conditions,
    drive: Drive,
    effects: fx.Effects,
) -> Floats:
    """Give the level of the dry friction at the motor, N*m: `base` and what the effects add, never below zero.

    What warmth takes off the viscous friction is in `_viscous`: it may be more than the dry level.
    """
    signals = {
        "motor_position": angle,
        "motor_velocity": velocity,
        "output_torque": T,
        "temperature": around.temperature,
        "base_friction": np.full(T.shape, base),
    }
    return np.maximum(0.0, base + fx.total(fx.FRICTION, effects, signals, T.shape))


def _viscous(velocity: Floats, around: Conditions, drive: Drive, effects: fx.Effects) -> Floats:
    """Give the viscous friction of turning, N*m at the motor; warmth thins the oil as it eases the dry friction."""
    cold = drive.b * np.abs(velocity)
    signals = {"temperature": around.temperature, "base_friction": cold}
    thinner = fx.total(["temperature-dependent-friction"], effects, signals, velocity.shape)
    return np.sign(velocity) * (cold + thinner)


def _slide(lowest: Floats, highest: Floats, start: float) -> Floats:
    """Follow two walls that move on their own: rest between them, else be pushed."""
    followed = np.empty(lowest.shape)
    follower = start
    for k, (lower, upper) in enumerate(zip(lowest.tolist(), highest.tolist(), strict=True)):
        if lower > follower:
            follower = lower
        elif upper < follower:
            follower = upper
        followed[k] = follower
    return followed


def _softness(T: Floats, motor_torque: Floats, drive: Drive, effects: fx.Effects) -> float:
    """Bound how much the torsion effects yield with T, relative to the flexspline: sizes a step that converges."""
    yielding = {
        "soft-windup": lambda p: p["amplitude"] / p["zone"],
        "creep": lambda p: p["amplitude"] / p["stiffness"],
        "maxwell-slip": lambda p: p["amplitude"],
        "rate-dependent-hysteresis": lambda p: p["amplitude"],
        "stiffness-modulation": lambda p: p["amplitude"],
        "fixture-compliance": lambda p: p["amplitude"],
    }
    compliance = sum(of_one(p) for name, of_one in yielding.items() for p in effects.of(name))
    largest = float(np.max(np.abs(T)) + drive.ratio * np.max(np.abs(motor_torque)))
    return compliance * drive.K_F0 * (1.0 + (drive.C_F * largest) ** 2)


def _flexspline(T: Numbers, drive: Drive) -> Floats:
    """Give (24) in closed form; `laws` integrates it, a test compares them."""
    return np.asarray(np.arctan(drive.C_F * np.asarray(T)) / (drive.C_F * drive.K_F0))


def _flexspline_torque(torsion: Floats, drive: Drive) -> Floats:
    """Invert (24); an iterate beyond the quarter period is taken back to its edge."""
    turned = np.clip(drive.C_F * drive.K_F0 * torsion, -1.5, 1.5)
    return np.asarray(np.tan(turned) / drive.C_F)


def _wave_generator(torque: Floats, drive: Drive) -> Floats:
    """Give (27) in closed form, rad at the motor."""
    return np.sign(torque) * -np.expm1(-drive.C_w * np.abs(torque)) / (drive.C_w * drive.K_w0)


def _gaps(effects: fx.Effects) -> Gaps:
    return tuple((parameters["amplitude"], parameters["contact"]) for parameters in effects.of("backlash"))


def _next_angle(
    command: float,
    angle: float,
    gear_angle: float,
    T: float,
    limits: tuple[float, float],
    step: float,
    drive: Drive,
    effects: fx.Effects,
) -> float:
    """Find the angle at which motor torque, spring and viscous friction balance at the end of the step."""
    gaps = _gaps(effects)

    def surplus(trial: float) -> float:
        through = float(_through_wave_generator(command, trial, T, effects))
        return through - _spring_torque(trial - gear_angle, *limits, drive, gaps) - drive.b * (trial - angle) / step

    reach = 1e-4
    while surplus(angle - reach) < 0.0 or surplus(angle + reach) > 0.0:
        reach *= 2.0
    return float(brentq(surplus, angle - reach, angle + reach, xtol=1e-12))


def _wound(torque: float, drive: Drive, gaps: Gaps) -> float:
    """Give (27) and the way through the gaps: how far the wave generator is wound up, rad at the motor."""
    spring = math.copysign(-math.expm1(-drive.C_w * abs(torque)) / (drive.C_w * drive.K_w0), torque)
    return spring + sum(half * min(max(torque / contact, -1.0), 1.0) for half, contact in gaps)


def _spring_torque(wound: float, low: float, high: float, drive: Drive, gaps: Gaps) -> float:
    """Give the spring's torque when wound up so far, N*m; the gear slips at `low` and `high`."""
    if wound >= _wound(high, drive, gaps):
        return high
    if wound <= _wound(low, drive, gaps):
        return low
    if gaps:
        return float(brentq(lambda torque: _wound(torque, drive, gaps) - wound, low, high, xtol=1e-14))
    return math.copysign(-math.log1p(-drive.C_w * drive.K_w0 * abs(wound)) / drive.C_w, wound)


def _through_wave_generator(motor_torque: Numbers, angle: Numbers, T: Numbers, effects: fx.Effects) -> Floats:
    """Give M_w from M: less cogging and ripple, and with what the torsion effects push back."""
    angles = np.asarray(angle, dtype=float)
    taken = fx.cogging(angles, effects.cogging) + motor_torque * _ripple(angles, effects)
    return np.asarray(motor_torque - taken + T * _reaction(angles, T, effects))


def _motor_torque(through: Floats, angle: Floats, T: Floats, effects: fx.Effects) -> Floats:
    """Give M from M_w; the ripple takes a share of M itself."""
    needed = through + fx.cogging(angle, effects.cogging) - T * _reaction(angle, T, effects)
    return np.asarray(needed / (1.0 - _ripple(angle, effects)))


def _ripple(angle: Floats, effects: fx.Effects) -> Floats:
    """Give the share of the motor's torque that is missing at these angles."""
    signals = {"motor_torque": np.ones(angle.shape), "motor_position": angle}
    return fx.total(["torque-ripple"], effects, signals, angle.shape)


def _reaction(angle: Floats, T: Numbers, effects: fx.Effects) -> Floats:
    """Give the torque on the motor per N*m in the flexspline."""
    signals = {"motor_position": angle, "output_torque": np.broadcast_to(T, angle.shape)}
    return fx.total_slope(effects, signals, angle.shape)


def _friction_while_turning(path: Floats, from_load: Floats, level: Floats, drive: Drive, gaps: Gaps) -> Floats:
    """Give the gear's friction at the motor, N*m: wound up over the wave generator's spring, then +-`level`.

    The motor starts without torque, or with the least that holds the arm.
    """
    friction = np.empty(path.shape)
    moved = np.diff(path, prepend=path[0]).tolist()
    wound = 0.0
    for k, (turn, load, most) in enumerate(zip(moved, from_load.tolist(), level.tolist(), strict=True)):
        torque = _spring_torque(wound + turn, load - most, load + most, drive, gaps)
        wound = _wound(torque, drive, gaps)
        friction[k] = torque - load
    return friction

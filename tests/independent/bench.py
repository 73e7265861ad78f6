"""The four procedures as quasi-static benches: command in, true signals out. Contract signs, sense `opposed`.

    torsion   output_position + motor_position/N = f(T) + g(M_w)/N + e(motor_position)
    motor     motor_torque M = M_w + T_cog(motor_position) - T e'(motor_position)
    output    output_torque = T + hold, hold = the torque that would hold the arm against gravity

T is the torque in the flexspline and M_w the torque in the wave generator. All friction lies at the gear, between
the two springs, as in the base laws. The torque cell sits outside the arm. Masses have no inertia.
"""

import math

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

ITERATIONS = 100
SETTLED = 1e-11
"""rad at the motor, far below anything an encoder sees."""

SUBSTEPS = 4
"""Steps per sample of the starting torque: keeps the viscous term steeper than the cogging."""


def locked_output(motor_torque: Floats, start_angle: float, drive: Drive, effects: fx.Effects) -> Signals:
    """Sweep the motor torque with the output locked rigidly; the lock closed on an unloaded drive.

    Raises ValueError where the cogging is so steep that the shaft would snap between stable angles.
    """
    output_angle = -start_angle / drive.ratio
    hold = float(fx.gravity_load(output_angle, effects.gravity_load))
    angle = np.full(motor_torque.shape, start_angle)
    T = np.full(motor_torque.shape, -hold)
    for _ in range(ITERATIONS):
        through = _through_wave_generator(motor_torque, angle, T, effects)
        T = laws.play(drive.ratio * through, drive.ratio * drive.T_fs, start=-hold)
        torsion = laws.total_torsion(T, through, drive) + fx.kinematic_error(angle, effects.kinematic_error)
        moved = drive.ratio * (torsion - output_angle)
        settled = np.max(np.abs(moved - angle)) < SETTLED
        angle = moved
        if settled:
            return angle, np.full(angle.shape, output_angle), motor_torque, T + hold
    raise ValueError("the shaft snaps between cogging positions: a quasi-static bench cannot follow it")


def backdrive(output_torque: Floats, start_angle: float, drive: Drive, effects: fx.Effects) -> Signals:
    """Sweep the torque on the output with the wave generator held at one angle."""
    angle = np.full(output_torque.shape, start_angle)
    error = fx.kinematic_error(angle, effects.kinematic_error)
    output_angle = np.full(output_torque.shape, -start_angle / drive.ratio)
    for _ in range(ITERATIONS):
        T = output_torque - fx.gravity_load(output_angle, effects.gravity_load)
        through = laws.backdrive_torque(T, drive.ratio, drive.T_fb)
        moved = laws.total_torsion(T, through, drive) + error - start_angle / drive.ratio
        settled = np.max(np.abs(moved - output_angle)) < SETTLED / drive.ratio
        output_angle = moved
        if settled:
            return angle, output_angle, _motor_torque(through, angle, T, effects), output_torque
    raise ValueError("the arm is too heavy for the stiffness of the drive: the held angle does not settle")


def free_run(motor_position: Floats, motor_velocity: Floats, drive: Drive, effects: fx.Effects) -> Signals:
    """Turn the unloaded drive along a path. At a reversal the wave generator winds up before the gear slips."""
    no_torque = np.zeros(motor_position.shape)
    error = fx.kinematic_error(motor_position, effects.kinematic_error)
    output_angle = error - motor_position / drive.ratio
    through = no_torque
    for _ in range(3):  # the arm's moment changes by less than 1e-3 of itself with the torsion: three rounds are exact
        T = no_torque - fx.gravity_load(output_angle, effects.gravity_load)
        friction = _friction_while_turning(motor_position, T / drive.ratio, drive)
        through = T / drive.ratio + friction + drive.b * motor_velocity
        output_angle = laws.total_torsion(T, through, drive) + error - motor_position / drive.ratio
    return motor_position, output_angle, _motor_torque(through, motor_position, T, effects), no_torque


def starting_torque(
    motor_torque: Floats, period: float, start_angle: float, slip: float, drive: Drive, effects: fx.Effects
) -> Signals:
    """Raise the motor torque with the output free until the gear has slipped by `slip` (rad at the motor).

    The wave generator winds up first; beyond T_fs the speed is what the viscous friction allows. Ends at the first
    sample at which the slip is reached, so that the result may be shorter than `motor_torque`.
    """
    T = -float(fx.gravity_load(-start_angle / drive.ratio, effects.gravity_load))
    low, high = T / drive.ratio - drive.T_fs, T / drive.ratio + drive.T_fs
    at_rest = float(_through_wave_generator(motor_torque[0], start_angle, T, effects))
    first_gear_angle = start_angle - _wound(min(max(at_rest, low), high), drive)
    angle, gear_angle, before = start_angle, first_gear_angle, float(motor_torque[0])
    angles: list[float] = []
    for command in motor_torque.tolist():
        for _ in range(SUBSTEPS if command != before else 0):
            angle = _next_angle(command, angle, gear_angle, T, (low, high), period / SUBSTEPS, drive, effects)
            gear_angle = angle - _wound(_spring_torque(angle - gear_angle, low, high, drive), drive)
        before = command
        angles.append(angle)
        if abs(gear_angle - first_gear_angle) >= slip:
            break
    position = np.array(angles)
    driving = motor_torque[: position.size]
    through = _through_wave_generator(driving, position, np.full(position.shape, T), effects)
    error = fx.kinematic_error(position, effects.kinematic_error)
    output_angle = laws.total_torsion(np.full(position.shape, T), through, drive) + error - position / drive.ratio
    return position, output_angle, driving, np.zeros(position.shape)


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

    def surplus(trial: float) -> float:
        through = float(_through_wave_generator(command, trial, T, effects))
        return through - _spring_torque(trial - gear_angle, *limits, drive) - drive.b * (trial - angle) / step

    reach = 1e-4
    while surplus(angle - reach) < 0.0 or surplus(angle + reach) > 0.0:
        reach *= 2.0
    return float(brentq(surplus, angle - reach, angle + reach, xtol=1e-12))


def _wound(torque: float, drive: Drive) -> float:
    """Give (27): how far the wave generator is wound up, rad at the motor."""
    return math.copysign(-math.expm1(-drive.C_w * abs(torque)) / (drive.C_w * drive.K_w0), torque)


def _spring_torque(wound: float, low: float, high: float, drive: Drive) -> float:
    """Give the spring's torque when wound up so far, N*m; the gear slips at `low` and `high`."""
    if wound >= _wound(high, drive):
        return high
    if wound <= _wound(low, drive):
        return low
    return math.copysign(-math.log1p(-drive.C_w * drive.K_w0 * abs(wound)) / drive.C_w, wound)


def _through_wave_generator(motor_torque: Numbers, angle: Numbers, T: Numbers, effects: fx.Effects) -> Floats:
    return (
        motor_torque - fx.cogging(angle, effects.cogging) + T * fx.kinematic_error_slope(angle, effects.kinematic_error)
    )


def _motor_torque(through: Floats, angle: Floats, T: Floats, effects: fx.Effects) -> Floats:
    return through + fx.cogging(angle, effects.cogging) - T * fx.kinematic_error_slope(angle, effects.kinematic_error)


def _friction_while_turning(path: Floats, from_load: Floats, drive: Drive) -> Floats:
    """Give the gear's friction at the motor, N*m: wound up over the wave generator's spring, then +-T_c.

    The motor starts without torque, or with the least that holds the arm.
    """
    friction = np.empty(path.shape)
    moved = np.diff(path, prepend=path[0]).tolist()
    wound = 0.0
    for k, (turn, load) in enumerate(zip(moved, from_load.tolist(), strict=True)):
        torque = _spring_torque(wound + turn, load - drive.T_c, load + drive.T_c, drive)
        wound = _wound(torque, drive)
        friction[k] = torque - load
    return friction

"""A transmission turned by its DC motor at a constant voltage: right-hand side, steady start, and runs.

The equations are those of `lagrange` and `dc_motor`. Source: Castejon, Garcia-Prada & Lara 2009, figure 6.
"""

import math
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim_backend.errors import ModelError
from sim_backend.model import driven_loop, lagrange
from sim_backend.model.checks import require
from sim_backend.model.compiler import load
from sim_backend.model.dc_motor import DcMotor, steady_speed
from sim_backend.model.fourier_error import FourierError, pure_error, pure_error_slope
from sim_backend.model.lagrange import Laws
from sim_backend.model.source import definitions
from sim_backend.model.transmission import Transmission

Floats = NDArray[np.float64]

STEP = 2e-5
"""s; 1/83 of a period of the mode at 602 Hz, whose amplitude then falls by 1e-4 of itself a second too much."""

PHASE_A_STEP = 0.15
"""rad; what the fastest mode may turn in a step (a Runge-Kutta method of fourth order is stable below 2.8)."""


class DrivenRun(NamedTuple):
    """A run: s, rad, rad/s, A, N*m; shape (n,). `transmitted_torque` is what the drive gives to the load."""

    time: Floats
    motor_position: Floats
    motor_velocity: Floats
    load_position: Floats
    load_velocity: Floats
    current: Floats
    motor_torque: Floats
    transmitted_torque: Floats


def laws(transmission: Transmission) -> Laws:
    """Give the constants of the equations of motion."""
    t = transmission
    return Laws(
        J=t.shaft_inertia,
        J_l=t.load_inertia,
        B_m=t.motor_damping,
        B_ml=t.bearing_damping,
        B_sp=t.mesh_damping,
        B_l=t.load_damping,
        K=t.stiffness,
        N=t.ratio,
        s=t.bearing_sense,
    )


def torque_driven(
    transmission: Transmission,
    series: FourierError,
    motor_torque: Callable[[float], float],
    load_torque: Callable[[float], float],
) -> Callable[[float, Sequence[float]], list[float]]:
    """Give the right-hand side f(t, y) of (15) and (16) for an integrator such as scipy's solve_ivp.

    y: theta_m, theta_m', theta_l, theta_l'; both torques as functions of the time, N*m.
    """
    c, coefficients = laws(transmission), series.coefficients

    def rates(t: float, y: Sequence[float]) -> list[float]:
        theta_m, omega_m, theta_l, omega_l = y
        alpha_m, alpha_l = lagrange.accelerations(
            theta_m, omega_m, theta_l, omega_l, motor_torque(t), load_torque(t), coefficients, c
        )
        return [omega_m, alpha_m, omega_l, alpha_l]

    return rates


def steady_start(
    transmission: Transmission, series: FourierError, motor: DcMotor, voltage: float, angle: float = 0.0
) -> Floats:
    """Give a state that turns steadily from the start: rad, rad/s, rad, rad/s, A; shape (5,).

    The load is put where the steady error of a motor at constant speed has it, order by order, so that its mode, which
    takes seconds to die out, is hardly struck.
    """
    t = transmission
    speed = steady_speed(motor, voltage, t.drag)
    flexible = flexible_series(t, series, speed)
    windup = (
        t.load_damping / t.ratio + t.bearing_sense * t.bearing_damping * (1.0 + t.bearing_sense / t.ratio)
    ) * speed
    at = np.array(angle)
    position = angle / t.ratio - windup / t.stiffness - float(pure_error(at, series) + pure_error(at, flexible))
    slope = 1.0 / t.ratio - float(pure_error_slope(at, series) + pure_error_slope(at, flexible))
    return np.array([angle, speed, position, slope * speed, t.drag * speed / motor.constant])


def flexible_series(transmission: Transmission, series: FourierError, speed: float) -> FourierError:
    """Give the flexible part theta_s at a constant motor speed (rad/s), without its constant.

    Order n turns at w = n speed, where (16) without torque is, with B = B_l + B_ml,
    (K - J_l w^2 + i (B + B_sp) w) theta_s = (J_l w^2 - i B w) theta_p.
    """
    t = transmission
    w = np.arange(1, len(series.a) + 1) * speed
    damping = t.load_damping + t.bearing_damping
    inertia = t.load_inertia * w**2
    gain = (inertia - 1j * damping * w) / (t.stiffness - inertia + 1j * (damping + t.mesh_damping) * w)
    flexible = gain * (np.array(series.a) - 1j * np.array(series.b))
    return FourierError(0.0, tuple(flexible.real.tolist()), tuple((-flexible.imag).tolist()))


def run_driven(
    transmission: Transmission,
    series: FourierError,
    motor: DcMotor,
    voltage: float,
    duration: float,
    *,
    load_torque: float = 0.0,
    period: float = 1e-3,
    step: float = STEP,
    start: Floats | None = None,
    compiled: bool = True,
) -> DrivenRun:
    """Turn the transmission at `voltage` for `duration` (s) and record it every `period` (s).

    start: state as of `steady_start`, which is the default. Fourth order in `step` (s).
    Raises ModelError if `period` is no multiple of `step`, or the step too long for the fastest mode.
    """
    require("duration", duration, "s", "the run", above=0.0)
    require("step", step, "s", "the Runge-Kutta method", above=0.0, high=PHASE_A_STEP / _fastest(transmission))
    steps = round(period / step)
    if steps < 1 or not math.isclose(steps * step, period, rel_tol=1e-9):
        raise ModelError(f"period = {period!r} s must be a whole multiple of step = {step!r} s.")
    rows = np.zeros((round(duration / period) + 1, 6))
    rows[0, :5] = steady_start(transmission, series, motor, voltage) if start is None else start
    module = _module(compiled)
    module.advance(
        rows,
        steps,
        step,
        voltage,
        load_torque,
        motor.resistance,
        motor.inductance,
        motor.constant,
        np.array(series.coefficients),
        module.Laws(*laws(transmission)),
    )
    time = period * np.arange(len(rows), dtype=np.float64)
    theta_m, omega_m, theta_l, omega_l, current, transmitted = np.ascontiguousarray(rows.T)
    return DrivenRun(time, theta_m, omega_m, theta_l, omega_l, current, motor.constant * current, transmitted)


def _fastest(t: Transmission) -> float:
    """Give the angular frequency of the mode of both masses on the spring, rad/s."""
    return math.sqrt(t.stiffness * (1.0 / t.load_inertia + 1.0 / (t.ratio**2 * t.shaft_inertia)))


@cache
def _module(compiled: bool) -> Any:
    body = f"{definitions(lagrange)}\n\n{definitions(driven_loop)}"
    return load("A transmission driven by its motor", body, compiled=compiled)

"""The moving bench as differential equations, integrated by scipy's Radau to ten digits: no step, no solver of ours.

    J_m dw_m/dt = M(t) + T_w + T_F e'(theta_m)
    J_o dw_o/dt = L(t) - T_F - m g r sin(theta_o + phi) - B_o w_o
    T_F = tan(C_F K_F0 x)/C_F + c_F d(theta_o - y - e)/dt,   theta_o - y - e = x + kappa z / K_F0
    T_w = g^-1(s) - c_w (w_m + N v),   g^-1(s) = -sgn(s) log(1 - C_w K_w0 |s|)/C_w
    -theta_m - N y = s + b clip(g^-1(s) / M_b, -1, 1)                (b: half a gap at the motor, closed by M_b)
    tau dz/dt = T_spring - z                        (creep)
    T_F + N T_w = N^2 b v                           (massless rim y without dry friction, v = dy/dt)

Smooth: the rim never sticks, and no spring reaches the stiffness at which the plant goes on in a straight line.
Sense `opposed`, SI.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

Floats = NDArray[np.float64]

SCALES = np.array([1e-2, 1.0, 1e-4, 1e-2, 1e-4, 1e-1])
"""Sizes of theta_m, w_m, theta_o, w_o, y (rad, rad/s) and z (N*m) below which ten digits are not asked for."""


@dataclass(frozen=True, slots=True)
class MovingBench:
    """Parameters as in the equations: SI; e = error * sin(order * theta_m + phase); the dampings are c_F and c_w,
    gap b and contact M_b."""

    ratio: float
    K_F0: float
    C_F: float
    K_w0: float
    C_w: float
    b: float
    J_m: float
    J_o: float
    B_o: float
    flexspline_damping: float
    wave_generator_damping: float
    error: float = 0.0
    order: float = 2.0
    phase: float = 0.0
    weight: float = 0.0
    weight_phase: float = 0.0
    creep: float = 0.0
    creep_time: float = 1.0
    gap: float = 0.0
    contact: float = 1.0


def trajectory(
    bench: MovingBench, times: Floats, motor_torque: Callable[[float], float], load_torque: Callable[[float], float]
) -> dict[str, Floats]:
    """Give the motion from rest without torque at the `times` (s, from 0), shape (n,), by name; torques T_F and T_w.

    Raises ArithmeticError if the integration fails or leaves the smooth range.
    """
    start = np.zeros(6)
    start[2] = bench.error * math.sin(bench.phase)

    def rates(t: float, state: Floats) -> list[float]:
        theta_m, w_m, theta_o, w_o, _, z = state.tolist()
        spring, T_F, T_w, v = _torques(bench, state.tolist())
        slope = bench.error * bench.order * math.cos(bench.order * theta_m + bench.phase)
        return [
            w_m,
            (motor_torque(t) + T_w + T_F * slope) / bench.J_m,
            w_o,
            (load_torque(t) - T_F - bench.weight * math.sin(theta_o + bench.weight_phase) - bench.B_o * w_o)
            / bench.J_o,
            v,
            (spring - z) / bench.creep_time,
        ]

    solution = solve_ivp(rates, (0.0, float(times[-1])), start, "Radau", t_eval=times, rtol=1e-10, atol=1e-10 * SCALES)
    if not solution.success:
        raise ArithmeticError(solution.message)
    torques = np.array([_torques(bench, state)[1:3] for state in solution.y.T.tolist()])
    names = ("motor_position", "motor_velocity", "output_position", "output_velocity", "rim_position")
    return {
        **dict(zip(names, solution.y, strict=False)),
        "flexspline_torque": torques[:, 0],
        "wave_generator_torque": torques[:, 1],
    }


def _torques(bench: MovingBench, state: list[float]) -> tuple[float, float, float, float]:
    """Give the torque in the flexspline's spring, T_F, T_w (N*m) and the rim's speed (rad/s)."""
    theta_m, w_m, theta_o, w_o, y, z = state
    N = bench.ratio
    angle = bench.order * theta_m + bench.phase
    error, error_rate = bench.error * math.sin(angle), bench.error * bench.order * math.cos(angle) * w_m
    x = theta_o - y - error - bench.creep * z / bench.K_F0
    s = _own_windup(bench, -theta_m - N * y)
    if not bench.C_w * bench.K_w0 * abs(s) < 0.9:
        raise ArithmeticError("the wave generator is wound up so far that its law ends")
    spring = math.tan(bench.C_F * bench.K_F0 * x) / bench.C_F
    wave_generator = math.copysign(-math.log(1.0 - bench.C_w * bench.K_w0 * abs(s)) / bench.C_w, s)
    pull = (
        spring
        + bench.flexspline_damping * (w_o - error_rate)
        + N * (wave_generator - bench.wave_generator_damping * w_m)
    )
    v = pull / (N**2 * bench.b + bench.flexspline_damping + N**2 * bench.wave_generator_damping)
    T_F = spring + bench.flexspline_damping * (w_o - error_rate - v)
    return spring, T_F, wave_generator - bench.wave_generator_damping * (w_m + N * v), v


def _own_windup(bench: MovingBench, windup: float) -> float:
    """Give the part of the windup (rad) that the wave generator's spring takes; inside the gap by Brent's method."""
    size = abs(windup)
    closed = -math.expm1(-bench.C_w * bench.contact) / (bench.C_w * bench.K_w0)
    if bench.gap == 0.0 or size >= closed + bench.gap:
        return math.copysign(size - bench.gap, windup)

    def missing(own: float) -> float:
        torque = -math.log1p(-bench.C_w * bench.K_w0 * own) / bench.C_w
        return own + bench.gap * torque / bench.contact - size

    return math.copysign(float(brentq(missing, 0.0, closed, xtol=1e-16, rtol=1e-14)), windup)


def torsional_mode(bench: MovingBench) -> complex:
    """Give the eigenvalue (1/s) of the torsional mode of the bench linearised at rest, with positive frequency.

    State: theta_m, w_m, theta_o, w_o, y; both springs have the stiffness they have without torque. One damper at
    least must act on the massless rim.
    """
    N, K_F, K_w = bench.ratio, bench.K_F0, bench.K_w0
    c_F, c_w = bench.flexspline_damping, bench.wave_generator_damping
    theta_m, w_m, theta_o, w_o, y = np.eye(5)
    spring_F, spring_w = K_F * (theta_o - y), K_w * (-theta_m - N * y)
    v = (spring_F + c_F * w_o + N * (spring_w - c_w * w_m)) / (N**2 * bench.b + c_F + N**2 * c_w)
    T_F, T_w = spring_F + c_F * (w_o - v), spring_w - c_w * (w_m + N * v)
    matrix = np.array([w_m, T_w / bench.J_m, w_o, (-T_F - bench.B_o * w_o) / bench.J_o, v])
    values = np.linalg.eigvals(matrix)
    return complex(values[np.argmax(values.imag)])

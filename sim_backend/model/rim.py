"""The rim: massless gear side of the flexspline between the two springs, held by dry and viscous friction.

    T_F + N T_w - rim_damping * v = level * sgn(v) while it slides;  |T_F + N T_w| <= level while it sticks (v = 0)

The left side falls monotonically with the rim's angle, so the new angle is unique: the return mapping of plasticity.
It is found by Newton steps inside a bracket. The speed while sliding is the second-order backward difference.
Source: the two-spring analogue of Zhang, Ahmad & Liu 2014, figures 4 to 6. Scalar code for the compiled kernel.
"""

import math

from sim_backend.model.constants import Constants
from sim_backend.model.springs import flexspline_torque, wave_generator_torque


def slide(
    direction: float,
    guess: float,
    rate_weight: float,
    rate_offset: float,
    rim: float,
    flexspline_base: float,
    flexspline_rate: float,
    motor_position: float,
    motor_velocity: float,
    level: float,
    c: Constants,
) -> tuple[float, float, float, float]:
    """Solve the sliding law in `direction` (+1, -1) for the slip over one step, from a first `guess` (rad).

    The rim's speed is rate_weight * slip - rate_offset. A residual below `c.near` is removed by one linear step.
    Gives (slip rad, rim speed rad/s, T_F, T_w).
    """
    slip = guess
    low, high = -math.inf, math.inf
    rate = T_F = T_w = 0.0
    for _ in range(100):
        rate = rate_weight * slip - rate_offset
        T_F, K_F = flexspline_torque(flexspline_base - rim - slip, c)
        T_w, K_w = wave_generator_torque(-motor_position - c.ratio * (rim + slip), c)
        T_F += c.flexspline_damping * (flexspline_rate - rate)
        T_w -= c.wave_generator_damping * (motor_velocity + c.ratio * rate)
        residual = T_F + c.ratio * T_w - c.rim_damping * rate - direction * level
        fall_F = K_F + c.flexspline_damping * rate_weight
        fall_w = c.ratio * (K_w + c.wave_generator_damping * rate_weight)
        correction = residual / (fall_F + c.ratio * fall_w + c.rim_damping * rate_weight)
        if abs(residual) <= c.near:
            T_F -= fall_F * correction
            return slip + correction, rate + rate_weight * correction, T_F, T_w - fall_w * correction
        if residual > 0.0:
            low = slip
        else:
            high = slip
        following = slip + correction
        if not low < following < high:
            following = 0.5 * (low + high)
        if following == slip:
            break
        slip = following
    return slip, rate, T_F, T_w


def move_rim(
    last_slip: float,
    rim: float,
    flexspline_base: float,
    flexspline_rate: float,
    motor_position: float,
    motor_velocity: float,
    level: float,
    c: Constants,
) -> tuple[float, float, float, float]:
    """Move the rim by one step; `last_slip` (rad) is what it slid in the step before.

    flexspline_base: output angle less the transmission error, rad; flexspline_rate: its speed, rad/s;
    level: of dry friction in this step, N*m.
    Gives (slip rad, speed rad/s, T_F, T_w) of the rim; a slip of exactly zero means that it sticks.
    """
    if last_slip != 0.0:
        direction = math.copysign(1.0, last_slip)
        slip, rate, T_F, T_w = slide(
            direction,
            last_slip,
            1.5 / c.step,
            0.5 * last_slip / c.step,
            rim,
            flexspline_base,
            flexspline_rate,
            motor_position,
            motor_velocity,
            level,
            c,
        )
        if slip * direction > 0.0 and rate * direction >= 0.0:
            return slip, rate, T_F, T_w
    T_F, _ = flexspline_torque(flexspline_base - rim, c)
    T_w, _ = wave_generator_torque(-motor_position - c.ratio * rim, c)
    T_F += c.flexspline_damping * flexspline_rate
    T_w -= c.wave_generator_damping * motor_velocity
    force = T_F + c.ratio * T_w
    if abs(force) <= level:
        return 0.0, 0.0, T_F, T_w
    return slide(
        math.copysign(1.0, force),
        0.0,
        1.0 / c.step,
        0.0,
        rim,
        flexspline_base,
        flexspline_rate,
        motor_position,
        motor_velocity,
        level,
        c,
    )

"""The rim where effects lie in series with the flexspline: springs, gaps and creep that its torque goes through too.

    windup = x + sum e(T, x; memory),  T = f^-1(x)        x: the flexspline's own torsion, rad

Torque, windup and with it the rim's slip follow from x, and the law of the rim (see `rim`) rises monotonically with
it. It is solved for x by Newton steps inside a bracket; by how much the effects yield is taken from the last two
trials. The flexspline's damper lies across the whole windup. Scalar code for the compiled kernel.
"""

import math
from typing import NamedTuple

from sim_backend.model.constants import Constants
from sim_backend.model.effect_sums import Array, Signals, series_effects
from sim_backend.model.springs import flexspline_torque, wave_generator_torque

ACCURACY = 1e-7
"""N*m in the flexspline: a trial that misses by less is corrected by one linear step and not repeated."""

TRIALS = 60


class Series(NamedTuple):
    """The flexspline's own torsion (rad), the torque in its spring (N*m), and the angle of the effects in series (rad).

    `compliance`: of these effects, rad/(N*m). `share`: of a small windup that the flexspline takes, 1.
    """

    torsion: float
    torque: float
    angle: float
    compliance: float
    share: float


def settle(
    direction: float,
    torsion: float,
    last: Series,
    rate_weight: float,
    rate_offset: float,
    rim: float,
    flexspline_base: float,
    flexspline_rate: float,
    motor_position: float,
    motor_velocity: float,
    level: float,
    now: Signals,
    state: Array,
    effect_parameters: Array,
    c: Constants,
) -> tuple[float, float, float, float, Series]:
    """Solve the law of the rim from a first guess `torsion` (rad): sliding in `direction` (+1, -1) or sticking (0).

    While it slides its speed is rate_weight * slip - rate_offset. Gives (slip rad, rim speed rad/s, T_F, T_w, series).
    """
    compliance = last.compliance
    low, high = -math.inf, math.inf
    last_T = last_angle = 0.0
    slip = rate = T = T_F = T_w = angle = share = 0.0
    for trial in range(TRIALS):
        T, K = flexspline_torque(torsion, c)
        angle = series_effects(now, T, torsion, c.step, state, effect_parameters)
        if trial > 0 and abs(T - last_T) > 1e-3 * ACCURACY:
            compliance = (angle - last_angle) / (T - last_T)
        last_T, last_angle = T, angle
        share = 1.0 / max(1.0 + compliance * K, 0.1)
        slip = flexspline_base - rim - torsion - angle
        rate = K_w = 0.0
        if direction != 0.0:
            rate = rate_weight * slip - rate_offset
            T_w, K_w = wave_generator_torque(-motor_position - c.ratio * (rim + slip), c)
            T_w -= c.wave_generator_damping * (motor_velocity + c.ratio * rate)
            K_w = c.ratio * (K_w + c.wave_generator_damping * rate_weight)
            T_F = T + c.flexspline_damping * (flexspline_rate - rate)
            residual = T_F + c.ratio * T_w - c.rim_damping * rate - direction * level
            fall = (c.flexspline_damping + c.rim_damping) * rate_weight + c.ratio * K_w
            correction = -residual / (K + fall / share)
        else:
            T_F = T + c.flexspline_damping * flexspline_rate
            residual = -slip
            correction = slip * share
        if abs(correction) * K <= ACCURACY:
            moved = correction / share
            T += K * correction
            T_F += K * correction
            if direction != 0.0:
                T_F += c.flexspline_damping * rate_weight * moved
                T_w += K_w * moved
            return (
                slip - moved,
                rate - rate_weight * moved,
                T_F,
                T_w,
                Series(torsion + correction, T, angle + (moved - correction), compliance, share),
            )
        if residual > 0.0:
            high = torsion
        else:
            low = torsion
        following = torsion + correction
        if not low < following < high:
            following = 0.5 * (low + high)
        if following == torsion:
            break
        torsion = following
    return slip, rate, T_F, T_w, Series(torsion, T, angle, compliance, share)


def move_rim_in_series(
    last_slip: float,
    last: Series,
    rim: float,
    flexspline_base: float,
    flexspline_rate: float,
    motor_position: float,
    motor_velocity: float,
    level: float,
    now: Signals,
    state: Array,
    effect_parameters: Array,
    c: Constants,
) -> tuple[float, float, float, Series]:
    """Move the rim by one step as `rim.move_rim` does; `last` is the series at the end of the step before.

    flexspline_base: output angle less what adds to the torsion whatever the torque, rad.
    Gives (slip rad, T_F, T_w, series).
    """
    ahead = flexspline_base - rim - last.torsion - last.angle
    if last_slip != 0.0:
        direction = math.copysign(1.0, last_slip)
        slip, rate, T_F, T_w, series = settle(
            direction,
            last.torsion + last.share * (ahead - last_slip),
            last,
            1.5 / c.step,
            0.5 * last_slip / c.step,
            rim,
            flexspline_base,
            flexspline_rate,
            motor_position,
            motor_velocity,
            level,
            now,
            state,
            effect_parameters,
            c,
        )
        if slip * direction > 0.0 and rate * direction >= 0.0:
            return slip, T_F, T_w, series
    _, _, T_F, _, series = settle(
        0.0,
        last.torsion + last.share * ahead,
        last,
        0.0,
        0.0,
        rim,
        flexspline_base,
        flexspline_rate,
        motor_position,
        motor_velocity,
        level,
        now,
        state,
        effect_parameters,
        c,
    )
    T_w, _ = wave_generator_torque(-motor_position - c.ratio * rim, c)
    T_w -= c.wave_generator_damping * motor_velocity
    force = T_F + c.ratio * T_w
    if abs(force) <= level:
        return 0.0, T_F, T_w, series
    slip, _, T_F, T_w, series = settle(
        math.copysign(1.0, force),
        series.torsion,
        series,
        1.0 / c.step,
        0.0,
        rim,
        flexspline_base,
        flexspline_rate,
        motor_position,
        motor_velocity,
        level,
        now,
        state,
        effect_parameters,
        c,
    )
    return slip, T_F, T_w, series

"""The rim where effects lie in series with one of its springs: springs, gaps and creep that its torque goes through.

    windup = x + sum e(T, x; memory),  T = f^-1(x)        x: the flexspline's own torsion, rad

The rim's law is solved as in `rim`, and within it this equation for x: both rise monotonically, so that Newton steps
inside a bracket find the one solution. By how much the effects yield is taken from the last two trials. The damper of
the flexspline lies across the whole windup. What lies in series with the wave generator is in `coupling`. Effects that
add nothing change nothing, to the last bit. Scalar code for the compiled kernel.
"""

import math
from typing import NamedTuple

from sim_backend.model.constants import Constants
from sim_backend.model.coupling import coupled_torque
from sim_backend.model.effect_sums import Array, Signals, series_effects
from sim_backend.model.springs import flexspline_torque

ACCURACY = 1e-6
"""N*m in the flexspline: a trial that misses by less is good, because a linear step removes all but 1 % of the miss."""

COARSE = 1e-4
"""N*m: a miss that does for a slip which is on trial itself."""

TRIALS = 60

LEAST_COMPLIANCE = 0.1
"""Part of the flexspline's own compliance that it must have together with the effects in series: a trial takes no less,
and at the flexspline's largest stiffness the bounds of effects (`effect_bounds`) see to it."""


class Series(NamedTuple):
    """The flexspline's own torsion (rad), the torque in its spring (N*m), and the angle of the effects in series (rad).

    `stiffness`: of flexspline and effects together, N*m/rad; `compliance`: of the effects alone, rad/(N*m).
    """

    torsion: float
    torque: float
    angle: float
    stiffness: float
    compliance: float


def wind(
    windup: float, accuracy: float, last: Series, now: Signals, state: Array, effect_parameters: Array, c: Constants
) -> tuple[Series, float]:
    """Give the series at a windup (rad), found from a `last` one nearby, and by how much it missed it (N*m)."""
    compliance = last.compliance
    angle = last.angle + compliance * last.stiffness * (windup - last.torsion - last.angle)
    torsion = windup - angle
    low, high = -math.inf, math.inf
    last_T = last_angle = T = stiffness = 0.0
    for trial in range(TRIALS):
        T, K = flexspline_torque(torsion, c)
        angle = series_effects(now, T, torsion, c.step, state, effect_parameters)
        if trial > 0 and abs(T - last_T) > 1e-3 * ACCURACY:
            compliance = (angle - last_angle) / (T - last_T)
        last_T, last_angle = T, angle
        stiffness = K / max(1.0 + compliance * K, LEAST_COMPLIANCE)
        residual = torsion + angle - windup
        correction = residual * stiffness
        if abs(correction) <= accuracy:
            T -= correction
            torsion -= correction / K
            return Series(torsion, T, windup - torsion, stiffness, compliance), abs(correction)
        if residual > 0.0:
            high = torsion
        else:
            low = torsion
        following = torsion - correction / K
        if not low < following < high:
            following = 0.5 * (low + high)
        if following == torsion:
            break
        torsion = following
    return Series(torsion, T, angle, stiffness, compliance), 0.0


def slide_in_series(
    direction: float,
    guess: float,
    rate_weight: float,
    rate_offset: float,
    series: Series,
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
    """Do what `rim.slide` does. Gives (slip rad, rim speed rad/s, T_F, T_w, series)."""
    slip, accuracy = guess, COARSE
    low, high = -math.inf, math.inf
    rate = T_F = T_w = 0.0
    for _ in range(100):
        rate = rate_weight * slip - rate_offset
        series, miss = wind(flexspline_base - rim - slip, accuracy, series, now, state, effect_parameters, c)
        T_w, K_w = coupled_torque(-motor_position - c.ratio * (rim + slip), effect_parameters, c)
        T_F = series.torque + c.flexspline_damping * (flexspline_rate - rate)
        T_w -= c.wave_generator_damping * (motor_velocity + c.ratio * rate)
        residual = T_F + c.ratio * T_w - c.rim_damping * rate - direction * level
        fall_F = series.stiffness + c.flexspline_damping * rate_weight
        fall_w = c.ratio * (K_w + c.wave_generator_damping * rate_weight)
        correction = residual / (fall_F + c.ratio * fall_w + c.rim_damping * rate_weight)
        if abs(residual) <= c.near and miss > ACCURACY:
            # wind the series finer at this slip; a bracket would end the search if the correction cannot move the slip
            slip, accuracy = slip + correction, ACCURACY
            continue
        if abs(residual) <= c.near:
            T_F -= fall_F * correction
            fall = series.stiffness * correction
            give = series.compliance * fall
            series = Series(
                series.torsion - (correction - give),
                series.torque - fall,
                series.angle - give,
                series.stiffness,
                series.compliance,
            )
            return slip + correction, rate + rate_weight * correction, T_F, T_w - fall_w * correction, series
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
    return slip, rate, T_F, T_w, series


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
) -> tuple[float, float, float, float, Series]:
    """Do what `rim.move_rim` does; `last` is the series at the end of the step before.

    flexspline_base: output angle less what adds to the torsion whatever the torque, rad.
    Gives (slip rad, rim speed rad/s, T_F, T_w, series).
    """
    if last_slip != 0.0:
        direction = math.copysign(1.0, last_slip)
        slip, rate, T_F, T_w, series = slide_in_series(
            direction,
            last_slip,
            1.5 / c.step,
            0.5 * last_slip / c.step,
            last,
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
            return slip, rate, T_F, T_w, series
    series, _ = wind(flexspline_base - rim, ACCURACY, last, now, state, effect_parameters, c)
    T_w, _ = coupled_torque(-motor_position - c.ratio * rim, effect_parameters, c)
    T_F = series.torque + c.flexspline_damping * flexspline_rate
    T_w -= c.wave_generator_damping * motor_velocity
    force = T_F + c.ratio * T_w
    if abs(force) <= level:
        return 0.0, 0.0, T_F, T_w, series
    return slide_in_series(
        math.copysign(1.0, force),
        0.0,
        1.0 / c.step,
        0.0,
        series,
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

"""The wave generator where effects lie in series with it: gaps and springs between the motor shaft and the rim.

    windup = x + gap(T),  T = g^-1(x),  gap(T) = -ratio * sum e(motor_torque = -T)        x: its own windup, rad

All at the motor; -T is the torque that presses on the gap from the motor's side. Both terms rise with x, so that Newton
steps inside a bracket find the one solution. A gap is closed nearly always: the first trial takes it to be, and where
the angle is then the same, nothing in between yields and it is the solution. The damper of the wave generator lies
across the whole windup. Effects that add nothing change nothing, to the last bit. Scalar code for the compiled kernel.
"""

import math

from sim_backend.model.constants import Constants
from sim_backend.model.effect_sums import COUPLED, Array, coupling_effects
from sim_backend.model.springs import wave_generator_torque

COUPLING_ACCURACY = 1e-12
"""N*m at the motor: the accuracy to which the rim's law is solved, 1e-10 N*m at the output, at a ratio of 100."""

COUPLING_TRIALS = 60

PROBE = 1e-7
"""N*m at the motor: difference over which the yielding of the effects, rad/(N*m), is taken."""


def coupling_angle(torque: float, effect_parameters: Array, c: Constants) -> float:
    """Give the angle of what lies in series with the wave generator, rad at the motor, for the torque in it (N*m)."""
    return -c.ratio * coupling_effects(-torque, effect_parameters)


def coupled_torque(windup: float, effect_parameters: Array, c: Constants) -> tuple[float, float]:
    """Give (torque N*m, stiffness N*m/rad) of the wave generator and what lies in series with it for their windup."""
    if not COUPLED:
        return wave_generator_torque(windup, c)
    closed = coupling_angle(math.copysign(1.0 / c.C_w, windup), effect_parameters, c)
    own = windup - closed
    if own * windup > 0.0:
        T, K = wave_generator_torque(own, c)
        if coupling_angle(T, effect_parameters, c) == closed:
            return T, K
    else:
        yielding = (coupling_angle(PROBE, effect_parameters, c) - coupling_angle(0.0, effect_parameters, c)) / PROBE
        own = windup / (1.0 + c.K_w0 * max(yielding, 0.0))
    low, high = -math.inf, math.inf
    T = stiffness = 0.0
    for _ in range(COUPLING_TRIALS):
        T, K = wave_generator_torque(own, c)
        angle = coupling_angle(T, effect_parameters, c)
        yielding = (coupling_angle(T + PROBE, effect_parameters, c) - angle) / PROBE
        stiffness = K / (1.0 + K * max(yielding, 0.0))
        residual = own + angle - windup
        if abs(residual) * stiffness <= COUPLING_ACCURACY:
            break
        if residual > 0.0:
            high = own
        else:
            low = own
        following = own - residual * stiffness / K
        if not low < following < high:
            following = 0.5 * (low + high)
        if following == own:
            break
        own = following
    return T, stiffness

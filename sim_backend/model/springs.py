"""Torque and stiffness of the two springs for a given windup: the inverses of Zhang (24) and (27), per sample.

Above its knee each spring goes on in a straight line with the stiffness it has there: the inverse of (27) diverges at
|windup| = 1/(C_w K_w0), and a rotor on an ever stiffer spring would need an ever smaller step.
Scalar code for the compiled kernel; the forward laws over arrays are in `compliance`.
"""

import math

from sim_backend.model.constants import Constants


def flexspline_torque(windup: float, c: Constants) -> tuple[float, float]:
    """Give (torque N*m, stiffness N*m/rad) of the flexspline for a windup in rad at the output."""
    size = abs(windup)
    if size < c.flexspline_knee:
        tangent = math.tan(c.C_F * c.K_F0 * windup)
        return tangent / c.C_F, c.K_F0 * (1.0 + tangent * tangent)
    torque = c.flexspline_knee_torque + c.flexspline_cap * (size - c.flexspline_knee)
    return math.copysign(torque, windup), c.flexspline_cap


def wave_generator_torque(windup: float, c: Constants) -> tuple[float, float]:
    """Give (torque N*m, stiffness N*m/rad) of the wave generator for a windup in rad, all at the motor."""
    size = abs(windup)
    if size < c.wave_generator_knee:
        rest = 1.0 - c.C_w * c.K_w0 * size
        return math.copysign(-math.log(rest) / c.C_w, windup), c.K_w0 / rest
    torque = c.wave_generator_knee_torque + c.wave_generator_cap * (size - c.wave_generator_knee)
    return math.copysign(torque, windup), c.wave_generator_cap

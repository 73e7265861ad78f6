"""Torque and stiffness of the two springs for a given windup, per sample, and the energy in them.

The flexspline follows Zhang (24), or in its place the cubic law (10) or the piecewise linear one (11) as an odd law;
the wave generator follows (27). These laws give torque over windup: (24) and (27) inverted.
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


def cubic_flexspline_torque(windup: float, c: Constants) -> tuple[float, float]:
    """Give what `flexspline_torque` gives after the cubic law (10)."""
    size = abs(windup)
    if size < c.flexspline_knee:
        square = c.a3 * windup * windup
        return windup * (c.a1 + square), c.a1 + 3.0 * square
    torque = c.flexspline_knee_torque + c.flexspline_cap * (size - c.flexspline_knee)
    return math.copysign(torque, windup), c.flexspline_cap


def piecewise_flexspline_torque(windup: float, c: Constants) -> tuple[float, float]:
    """Give what `flexspline_torque` gives after the piecewise linear law (11)."""
    size = abs(windup)
    if size <= c.torsion_1:
        return c.K1 * windup, c.K1
    if size < c.torsion_2:
        return math.copysign(c.T1 + c.K2 * (size - c.torsion_1), windup), c.K2
    return math.copysign(c.T2 + c.K3 * (size - c.torsion_2), windup), c.K3


def wave_generator_torque(windup: float, c: Constants) -> tuple[float, float]:
    """Give (torque N*m, stiffness N*m/rad) of the wave generator for a windup in rad, all at the motor."""
    size = abs(windup)
    if size < c.wave_generator_knee:
        rest = 1.0 - c.C_w * c.K_w0 * size
        return math.copysign(-math.log(rest) / c.C_w, windup), c.K_w0 / rest
    torque = c.wave_generator_knee_torque + c.wave_generator_cap * (size - c.wave_generator_knee)
    return math.copysign(torque, windup), c.wave_generator_cap


def flexspline_energy(windup: float, c: Constants) -> float:
    """Give the energy (J) in the flexspline at a windup in rad at the output, after (24)."""
    bent, straight = _bent_and_straight(windup, c.flexspline_knee)
    # the form of -log(cos(x)) that keeps its digits at small C_F as well as near x = pi/2
    energy = 0.5 * math.log1p(math.tan(c.C_F * c.K_F0 * bent) ** 2) / (c.C_F**2 * c.K_F0)
    return energy + straight * (c.flexspline_knee_torque + 0.5 * c.flexspline_cap * straight)


def cubic_flexspline_energy(windup: float, c: Constants) -> float:
    """Give the energy (J) in the flexspline at a windup in rad at the output, after (10)."""
    bent, straight = _bent_and_straight(windup, c.flexspline_knee)
    energy = bent**2 * (0.5 * c.a1 + 0.25 * c.a3 * bent**2)
    if straight > 0.0:
        energy += straight * (c.flexspline_knee_torque + 0.5 * c.flexspline_cap * straight)
    return energy


def piecewise_flexspline_energy(windup: float, c: Constants) -> float:
    """Give the energy (J) in the flexspline at a windup in rad at the output, after (11)."""
    first, further = _bent_and_straight(windup, c.torsion_1)
    second, third = _bent_and_straight(further, c.torsion_2 - c.torsion_1)
    energy = 0.5 * c.K1 * first**2 + second * (c.T1 + 0.5 * c.K2 * second)
    return energy + third * (c.T2 + 0.5 * c.K3 * third)


def wave_generator_energy(windup: float, c: Constants) -> float:
    """Give the energy (J) in the wave generator at a windup in rad at the motor."""
    bent, straight = _bent_and_straight(windup, c.wave_generator_knee)
    share = c.C_w * c.K_w0 * bent
    if share < 1e-3:  # four terms leave 1e-13 of it; the closed form takes the difference of nearly equal numbers
        energy = c.K_w0 * bent**2 * (0.5 + share * (1.0 / 6.0 + share * (1.0 / 12.0 + share / 20.0)))
    else:
        energy = ((1.0 - share) * math.log1p(-share) + share) / (c.C_w**2 * c.K_w0)
    return energy + straight * (c.wave_generator_knee_torque + 0.5 * c.wave_generator_cap * straight)


def _bent_and_straight(windup: float, knee: float) -> tuple[float, float]:
    size = abs(windup)
    bent = min(size, knee)
    return bent, size - bent

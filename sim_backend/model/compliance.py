"""Quasi-static elastic laws of the harmonic drive.

    torsion = f(T_F) - g(T_w)/N                                            (28)
    f(T) = arctan(C_F T) / (C_F K_F0)                                      (24)
    g(T) = sgn(T) (1 - exp(-C_w |T|)) / (C_w K_w0), motor-side rad         (27)

T_F acts on the flexspline output from outside, T_w is what the wave generator exerts back on the motor shaft, so
that T_w = -motor_torque at rest and torsion = f(output_torque) + g(motor_torque)/N in logged signals.

Both laws are those of the catalogue's base terms. Source: Zhang, Ahmad & Liu, "Modeling of Torsional Compliance and
Hysteresis Behaviors in Harmonic Drives".
"""

import numpy as np
from numpy.typing import NDArray

from sim_backend.model.effects.flexspline_compliance import flexspline_compliance as flexspline_torsion
from sim_backend.model.effects.wave_generator_compliance import wave_generator_compliance

__all__ = ["flexspline_stiffness", "flexspline_torsion", "wave_generator_stiffness", "wave_generator_torsion"]

Floats = NDArray[np.float64]


def flexspline_stiffness(torque: Floats, K_F0: float, C_F: float) -> Floats:
    """Local stiffness of the flexspline, N*m/rad, at an output torque in N*m. Equation (22)."""
    return K_F0 * (1.0 + (C_F * torque) ** 2)


def wave_generator_torsion(torque: Floats, K_w0: float, C_w: float) -> Floats:
    """Torsion of the wave generator, rad at the motor, for a motor-side torque in N*m. Equation (27).

    K_w0: stiffness at zero torque, N*m/rad at the motor. C_w: 1/(N*m); positive.
    """
    return wave_generator_compliance(torque, K_w0, C_w, 1.0)


def wave_generator_stiffness(torque: Floats, K_w0: float, C_w: float) -> Floats:
    """Local stiffness of the wave generator, N*m/rad at the motor. Equation (25)."""
    return K_w0 * np.exp(C_w * np.abs(torque))

"""Kinematic error: output angle error periodic in the wave-generator angle.

    e = amplitude * sin(order * motor_position + phase)        rad at the output, added to the torsion

It reacts on the motor through T_F de/dtheta_m. Source: Ghorbel et al., J. Mech. Des. 123 (2001) 90-97;
Castejon, Garcia-Prada & Lara 2009, equations (5), (17)-(19).
"""

import math

from sim_backend.model.effects.effect import Effect, Energy, Enters, Parameter, Shape


def kinematic_error(motor_position: float, amplitude: float, order: float, phase: float) -> float:
    """Angle added to the torsion, rad."""
    return amplitude * math.sin(order * motor_position + phase)


def kinematic_error_slope(motor_position: float, amplitude: float, order: float, phase: float) -> float:
    """Give the derivative with respect to the wave-generator angle, rad/rad."""
    return amplitude * order * math.cos(order * motor_position + phase)


EFFECT = Effect(
    id="kinematic-error",
    summary="output angle error periodic in the wave-generator angle",
    equation="torsion += amplitude * sin(order * motor_position + phase)",
    source="Ghorbel et al. 2001; Castejon et al. 2009 (5), (17)-(19)",
    enters=Enters.TORSION,
    variable="motor_position",
    shape=Shape.PERIODIC,
    unit="rad",
    parameters=(
        Parameter("amplitude", "rad", 0.0, 1e-1, 1e-4, (3e-5, 2e-4), "half of the peak-to-peak error"),
        Parameter("order", "1/rev", 0.0, 1e4, 2.0, (1.0, 4.0), "cycles per wave-generator turn"),
        Parameter("phase", "rad", -2 * math.pi, 2 * math.pi, 0.0, (-math.pi, math.pi), "phase at motor_position = 0"),
    ),
    amplitudes=("amplitude",),
    function=kinematic_error,
    slope=kinematic_error_slope,
    energy=Energy.CONSERVATIVE,
    shows=("free-run", "locked-output"),
    confusable=(
        "motor-encoder-eccentricity",
        "stiffness-modulation",
        "flexspline-compliance",
        "soft-windup",
        "cogging",
        "output-encoder-eccentricity",
        "encoder-subdivision-error",
        "structural-resonance",
        "inertia",
    ),
    separated_by="8 to 16 start angles, or a slow free run in both directions; re-clock the encoder for order 1",
)

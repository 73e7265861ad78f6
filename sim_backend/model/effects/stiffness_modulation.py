"""Stiffness modulation: the compliance depends on where mesh zone and ellipse stand.

    torsion += amplitude * output_torque * sin(order * motor_position + phase)        rad at the output

Its coenergy is amplitude T^2/2 sin(...), so that it helps to drive the motor with T times
amplitude/2 * order * T * cos(...). Source: the mesh's stiffness over the wave-generator angle.
"""

import math

from sim_backend.model.effects.effect import Effect, Energy, Enters, Parameter, Shape


def stiffness_modulation(
    output_torque: float, motor_position: float, amplitude: float, order: float, phase: float
) -> float:
    """Angle added to the torsion, rad."""
    return amplitude * output_torque * math.sin(order * motor_position + phase)


def stiffness_modulation_slope(
    output_torque: float, motor_position: float, amplitude: float, order: float, phase: float
) -> float:
    """Give the derivative of the coenergy by the wave-generator angle, per N*m of output torque, rad/rad."""
    return 0.5 * amplitude * order * output_torque * math.cos(order * motor_position + phase)


EFFECT = Effect(
    id="stiffness-modulation",
    summary="compliance periodic in the wave-generator angle",
    equation="torsion += amplitude * output_torque * sin(order * motor_position + phase)",
    source="mesh stiffness over the wave-generator angle",
    enters=Enters.TORSION,
    variable="motor_position",
    shape=Shape.PRODUCT,
    unit="rad",
    parameters=(
        Parameter("amplitude", "rad/(N*m)", 0.0, 1e-1, 5e-6, (1e-6, 1e-5), "half of the peak-to-peak compliance"),
        Parameter("order", "1/rev", 0.0, 1e4, 2.0, (1.0, 4.0), "cycles per wave-generator turn"),
        Parameter("phase", "rad", -2 * math.pi, 2 * math.pi, 0.0, (-math.pi, math.pi), "phase at motor_position = 0"),
    ),
    amplitudes=("amplitude",),
    function=stiffness_modulation,
    slope=stiffness_modulation_slope,
    energy=Energy.CONSERVATIVE,
    shows=("locked-output", "backdrive"),
    confusable=("kinematic-error", "flexspline-compliance", "soft-windup"),
    separated_by="sweeps at 2 * order + 1 or more start angles, with two torque amplitudes",
)

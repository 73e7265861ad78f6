"""Soft windup: a zone of low stiffness around zero torque.

    torsion += amplitude * tanh(output_torque / zone)        rad at the output

Odd in the torque, single-valued, the same at every rate. Source: the soft zone that catalogues of harmonic drives show
near zero torque; the shape is a choice. In the plant a zone that is crossed within a step makes energy; within these
ranges it is at most 2e-4 of what the springs hold.
"""

import math

from sim_backend.model.effects.effect import Effect, Energy, Enters, Parameter, Shape


def soft_windup(output_torque: float, amplitude: float, zone: float) -> float:
    """Angle added to the torsion, rad."""
    return amplitude * math.tanh(output_torque / zone)


EFFECT = Effect(
    id="soft-windup",
    summary="zone of low stiffness around zero torque",
    equation="torsion += amplitude * tanh(output_torque / zone)",
    source="makers' torsion curves; the shape is a choice",
    enters=Enters.TORSION,
    variable="output_torque",
    shape=Shape.STATIC,
    unit="rad",
    parameters=(
        Parameter("amplitude", "rad", 0.0, 1e-2, 3e-5, (1e-5, 5e-5), "angle added on either side of zero torque"),
        Parameter("zone", "N*m", 1e-2, 1e5, 1.0, (0.3, 3.0), "torque over which it is taken up"),
    ),
    amplitudes=("amplitude",),
    function=soft_windup,
    energy=Energy.CONSERVATIVE,
    shows=("locked-output", "backdrive"),
    confusable=(
        "backlash",
        "wave-generator-compliance",
        "flexspline-compliance",
        "kinematic-error",
        "stiffness-modulation",
        "torque-sensor-nonlinearity",
    ),
    separated_by="sweeps of 1 N*m about zero and about a bias torque; several start angles",
)

"""Position-dependent friction: the mesh rubs harder at some angles of the wave generator.

    friction += amplitude * sin(order * motor_position + phase)        N*m at the motor

It flips with the direction, unlike cogging. Source: friction maps of geared drives.
Left out: orders of the output angle.
"""

import math

from sim_backend.model.effects.effect import Effect, Energy, Enters, Parameter, Shape


def position_dependent_friction(motor_position: float, amplitude: float, order: float, phase: float) -> float:
    """Give what is added to the friction level, N*m at the motor."""
    return amplitude * math.sin(order * motor_position + phase)


EFFECT = Effect(
    id="position-dependent-friction",
    summary="friction periodic in the motor angle",
    equation="friction += amplitude * sin(order * motor_position + phase)",
    source="friction maps of geared drives",
    enters=Enters.FRICTION,
    variable="motor_position",
    shape=Shape.PRODUCT,
    unit="N*m",
    parameters=(
        Parameter("amplitude", "N*m", 0.0, 1e3, 4e-3, (1e-3, 2e-2), "half of the peak-to-peak friction"),
        Parameter("order", "1/rev", 0.0, 1e4, 1.0, (1.0, 3.0), "cycles per motor turn"),
        Parameter("phase", "rad", -2 * math.pi, 2 * math.pi, 0.0, (-math.pi, math.pi), "phase at motor_position = 0"),
    ),
    amplitudes=("amplitude",),
    function=position_dependent_friction,
    energy=Energy.DISSIPATIVE,
    shows=("free-run",),
    confusable=("cogging", "gravity-load", "current-sensor-offset"),
    separated_by="half-sum and half-difference of both directions at several speeds, as a torque whose angle is "
    "read late flips too, the more the faster; coast-down",
)

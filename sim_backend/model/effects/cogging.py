"""Cogging: magnets against slots; a torque periodic in the rotor angle that does not flip with direction.

    motor balance += amplitude * sin(order * motor_position + phase)        N*m at the motor

Orders are lcm(slots, poles) and multiples; slots and poles themselves where the parts are uneven. Conservative.
Source: permanent-magnet motor literature.
"""

import math

from sim_backend.model.effects.effect import Effect, Energy, Enters, Parameter, Shape


def cogging(motor_position: float, amplitude: float, order: float, phase: float) -> float:
    """Torque which the motor must overcome, N*m."""
    return amplitude * math.sin(order * motor_position + phase)


EFFECT = Effect(
    id="cogging",
    summary="motor torque periodic in the rotor angle, the same in both directions",
    equation="motor balance += amplitude * sin(order * motor_position + phase)",
    source="permanent-magnet motor literature; "
    "usual values derived: 0.3 to 5 % of a rated 0.19 N*m; 10 poles to their multiple with 24 slots",
    enters=Enters.MOTOR_BALANCE,
    variable="motor_position",
    shape=Shape.PERIODIC,
    unit="N*m",
    parameters=(
        Parameter("amplitude", "N*m", 0.0, 1e3, 3e-3, (5e-4, 1e-2), "half of the peak-to-peak torque"),
        Parameter("order", "1/rev", 0.0, 1e4, 84.0, (10.0, 200.0), "cycles per motor turn"),
        Parameter("phase", "rad", -2 * math.pi, 2 * math.pi, 0.0, (-math.pi, math.pi), "phase at motor_position = 0"),
    ),
    amplitudes=("amplitude",),
    function=cogging,
    energy=Energy.CONSERVATIVE,
    shows=("free-run", "starting-torque"),
    confusable=(
        "position-dependent-friction",
        "torque-ripple",
        "kinematic-error",
        "stribeck-friction",
        "current-sensor-offset",
        "gravity-load",
    ),
    separated_by="both directions (half-sum and half-difference); a ladder of loads at the same angles; "
    "a coast-down, or the motor turned from outside with open circuit",
)

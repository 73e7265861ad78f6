"""Torque ripple: the torque constant varies with the rotor angle.

    motor balance += amplitude * motor_torque * sin(order * motor_position + phase)        N*m at the motor

order: 6 x pole pairs and multiples, or the commutator segments of a brushed motor. It comes from the current, so that
it can put energy in. Source: permanent-magnet motor literature.
"""

import math

from sim_backend.model.effects.effect import Effect, Energy, Enters, Parameter, Shape


def torque_ripple(motor_torque: float, motor_position: float, amplitude: float, order: float, phase: float) -> float:
    """Torque which the motor must overcome, N*m."""
    return amplitude * motor_torque * math.sin(order * motor_position + phase)


EFFECT = Effect(
    id="torque-ripple",
    summary="torque constant periodic in the rotor angle",
    equation="motor balance += amplitude * motor_torque * sin(order * motor_position + phase)",
    source="permanent-magnet motor literature; usual order derived: 1 to 14 pole pairs, twice",
    enters=Enters.MOTOR_BALANCE,
    variable="motor_position",
    shape=Shape.PRODUCT,
    unit="N*m",
    parameters=(
        Parameter("amplitude", "1", 0.0, 1.0, 0.02, (0.005, 0.05), "half of the peak-to-peak change, relative"),
        Parameter("order", "1/rev", 0.0, 1e4, 42.0, (6.0, 168.0), "cycles per motor turn"),
        Parameter("phase", "rad", -2 * math.pi, 2 * math.pi, 0.0, (-math.pi, math.pi), "phase at motor_position = 0"),
    ),
    amplitudes=("amplitude",),
    function=torque_ripple,
    energy=Energy.ACTIVE,
    shows=("free-run (loaded)", "locked-output"),
    confusable=("cogging",),
    separated_by="a ladder of loads, and so of currents, at the same angles",
)

"""Motor-encoder eccentricity: the code disc runs off centre, or is no circle.

    motor_position reads amplitude * sin(order * motor_position + phase) more        rad at the motor

order 1: eccentricity over radius; order 2: ellipse. At the output it counts 1/ratio. Source: geometry.
"""

import math

from sim_backend.model.effects.effect import Effect, Energy, Enters, Parameter, Shape


def motor_encoder_eccentricity(motor_position: float, amplitude: float, order: float, phase: float) -> float:
    """Angle added to the reading, rad at the motor."""
    return amplitude * math.sin(order * motor_position + phase)


EFFECT = Effect(
    id="motor-encoder-eccentricity",
    summary="code disc of the motor encoder off centre",
    equation="motor_position reads amplitude * sin(order * motor_position + phase) more",
    source="geometry: eccentricity over radius; usual amplitude derived: 5 to 50 um on a radius of 25 mm",
    enters=Enters.READING,
    variable="motor_position",
    shape=Shape.PERIODIC,
    unit="rad",
    parameters=(
        Parameter("amplitude", "rad", 0.0, 1.0, 4e-4, (2e-4, 2e-3), "eccentricity over radius of the code disc"),
        Parameter("order", "1/rev", 0.0, 1e2, 1.0, (1.0, 2.0), "cycles per motor turn; 2 for an ellipse"),
        Parameter("phase", "rad", -2 * math.pi, 2 * math.pi, 0.0, (-math.pi, math.pi), "phase at motor_position = 0"),
    ),
    amplitudes=("amplitude",),
    function=motor_encoder_eccentricity,
    energy=Energy.NONE,
    shows=("free-run",),
    confusable=("kinematic-error",),
    separated_by="two opposite read heads; re-clock the encoder against the wave generator",
    reads="motor_position",
)

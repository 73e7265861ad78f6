"""Output-encoder eccentricity: the code disc runs off centre, or is no circle.

    output_position reads amplitude * sin(order * output_position + phase) more        rad at the output

order 1: eccentricity over radius; order 2: ellipse. Not divided by the ratio, so that it is as large as the whole
kinematic error. Source: geometry.
"""

import math

from sim_backend.model.effects.effect import Effect, Energy, Enters, Parameter, Shape


def output_encoder_eccentricity(output_position: float, amplitude: float, order: float, phase: float) -> float:
    """Angle added to the reading, rad at the output."""
    return amplitude * math.sin(order * output_position + phase)


EFFECT = Effect(
    id="output-encoder-eccentricity",
    summary="code disc of the output encoder off centre",
    equation="output_position reads amplitude * sin(order * output_position + phase) more",
    source="geometry: eccentricity over radius; usual amplitude derived: 5 to 50 um on a radius of 25 mm",
    enters=Enters.READING,
    variable="output_position",
    shape=Shape.PERIODIC,
    unit="rad",
    parameters=(
        Parameter("amplitude", "rad", 0.0, 1.0, 4e-4, (2e-4, 2e-3), "eccentricity over radius of the code disc"),
        Parameter("order", "1/rev", 0.0, 1e2, 1.0, (1.0, 2.0), "cycles per output turn; 2 for an ellipse"),
        Parameter("phase", "rad", -2 * math.pi, 2 * math.pi, 0.0, (-math.pi, math.pi), "phase at output_position = 0"),
    ),
    amplitudes=("amplitude",),
    function=output_encoder_eccentricity,
    energy=Energy.NONE,
    shows=("free-run",),
    confusable=("gravity-load", "kinematic-error"),
    separated_by="index the encoder against the output, or a second read head; at least one output turn",
    reads="output_position",
)

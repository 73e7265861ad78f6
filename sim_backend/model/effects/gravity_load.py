"""Gravity on a horizontal output axis.

    output balance += amplitude * sin(output_position + phase)        N*m at the output, amplitude = m g r

Source: statics.
"""

import math

from sim_backend.model.effects.effect import Effect, Energy, Enters, Parameter, Shape


def gravity_load(output_position: float, amplitude: float, phase: float) -> float:
    """Torque which the output must overcome, N*m."""
    return amplitude * math.sin(output_position + phase)


EFFECT = Effect(
    id="gravity-load",
    summary="weight on a horizontal output axis",
    equation="output balance += amplitude * sin(output_position + phase)",
    source="statics",
    enters=Enters.OUTPUT_BALANCE,
    variable="output_position",
    shape=Shape.PERIODIC,
    unit="N*m",
    parameters=(
        Parameter("amplitude", "N*m", 0.0, 1e4, 0.5, (0.1, 2.0), "mass times gravity times lever"),
        Parameter("phase", "rad", -2 * math.pi, 2 * math.pi, 0.0, (-math.pi, math.pi), "phase at output_position = 0"),
    ),
    amplitudes=("amplitude",),
    function=gravity_load,
    energy=Energy.CONSERVATIVE,
    shows=("free-run", "backdrive"),
    confusable=(
        "output-encoder-eccentricity",
        "torque-sensor-offset",
        "current-sensor-offset",
        "position-dependent-friction",
        "cogging",
    ),
    separated_by="turn the bench about the axis, or fit a counterweight",
)

"""Encoder subdivision error: the sine and cosine of one line are not quite what the interpolation takes them for.

    output_position reads amplitude * sin(order * output_position + phase) more        rad at the output

order: the line count for an offset of sine or cosine, twice it for unequal gain or phase. Source: Heydemann, Appl. Opt.
20 (1981) 3382-3384.
Left out: the motor encoder.
"""

import math

from sim_backend.model.effects.effect import Effect, Energy, Enters, Parameter, Shape


def encoder_subdivision_error(output_position: float, amplitude: float, order: float, phase: float) -> float:
    """Angle added to the reading, rad at the output."""
    return amplitude * math.sin(order * output_position + phase)


EFFECT = Effect(
    id="encoder-subdivision-error",
    summary="interpolation within one line of the output encoder is off",
    equation="output_position reads amplitude * sin(order * output_position + phase) more",
    source="Heydemann 1981; usual order derived: 1000 to 20000 lines",
    enters=Enters.READING,
    variable="output_position",
    shape=Shape.PERIODIC,
    unit="rad",
    parameters=(
        Parameter("amplitude", "rad", 0.0, 1e-1, 1e-5, (1e-6, 1e-4), "half of the peak-to-peak error"),
        Parameter("order", "1/rev", 0.0, 1e7, 2048.0, (1e3, 4e4), "line count; twice it for gain or phase"),
        Parameter("phase", "rad", -2 * math.pi, 2 * math.pi, 0.0, (-math.pi, math.pi), "phase at output_position = 0"),
    ),
    amplitudes=("amplitude",),
    function=encoder_subdivision_error,
    energy=Energy.NONE,
    shows=("backdrive", "free-run"),
    confusable=("kinematic-error",),
    separated_by="samples finer than a line; other lines of the same encoder",
    reads="output_position",
)

"""Torque-sensor gain: the transducer's sensitivity is off.

    output_torque reads amplitude * output_torque more        N*m at the output

The fit absorbs it exactly: K_F0' = (1 + amplitude) K_F0, C_F' = C_F / (1 + amplitude). Source: transducer data sheets.
Left out: a sensitivity that moves with the temperature.
"""

from sim_backend.model.effects.effect import Effect, Energy, Enters, Parameter, Shape


def torque_sensor_gain(output_torque: float, amplitude: float) -> float:
    """Torque added to the reading, N*m."""
    return amplitude * output_torque


EFFECT = Effect(
    id="torque-sensor-gain",
    summary="sensitivity of the torque transducer is off",
    equation="output_torque reads amplitude * output_torque more",
    source="transducer data sheets",
    enters=Enters.READING,
    variable="output_torque",
    shape=Shape.STATIC,
    unit="N*m",
    parameters=(Parameter("amplitude", "1", -1.0, 10.0, 0.01, (-0.03, 0.03), "relative error of the sensitivity"),),
    amplitudes=("amplitude",),
    function=torque_sensor_gain,
    energy=Energy.NONE,
    shows=("locked-output", "backdrive"),
    confusable=(
        "flexspline-compliance",
        "fixture-compliance",
        "torque-constant-error",
        "load-dependent-friction",
        "temperature-dependent-stiffness",
    ),
    separated_by="dead weights on a lever of known length",
    reads="output_torque",
)

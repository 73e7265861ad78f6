"""Torque-sensor nonlinearity: a smooth static deviation of the transducer's reading.

    output_torque reads even * x^2 + odd * x^3 more,  x = output_torque / full_scale        N*m at the output

Source: transducer data sheets (0.05 to 0.1 % of full scale).
Left out: a loop of the transducer.
"""

from sim_backend.model.effects.effect import Effect, Energy, Enters, Parameter, Shape


def torque_sensor_nonlinearity(output_torque: float, even: float, odd: float, full_scale: float) -> float:
    """Torque added to the reading, N*m."""
    x = output_torque / full_scale
    return (even + odd * x) * x * x


EFFECT = Effect(
    id="torque-sensor-nonlinearity",
    summary="reading of the torque transducer bends",
    equation="output_torque reads even * x^2 + odd * x^3 more, x = output_torque / full_scale",
    source="transducer data sheets; usual even, odd derived: 0.1 % of a full scale of 30 N*m",
    enters=Enters.READING,
    variable="output_torque",
    shape=Shape.STATIC,
    unit="N*m",
    parameters=(
        Parameter("even", "N*m", -1e4, 1e4, 0.02, (-0.03, 0.03), "even part at full scale"),
        Parameter("odd", "N*m", -1e4, 1e4, 0.02, (-0.03, 0.03), "odd part at full scale"),
        Parameter("full_scale", "N*m", 1e-3, 1e6, 30.0, (10.0, 100.0), "full scale of the transducer", known=True),
    ),
    amplitudes=("even", "odd"),
    function=torque_sensor_nonlinearity,
    energy=Energy.NONE,
    shows=("locked-output", "backdrive"),
    confusable=("flexspline-compliance", "soft-windup", "maxwell-slip", "torque-sensor-offset"),
    separated_by="a loop of dead weights on the torque sensor alone",
    reads="output_torque",
)

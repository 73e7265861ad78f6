"""Torque-sensor offset: the transducer's zero is off.

    output_torque reads amplitude more        N*m at the output

It reaches the torsion as a wrong input of the model. Source: transducer data sheets.
"""

from sim_backend.model.effects.effect import Effect, Energy, Enters, Parameter, Shape


def torque_sensor_offset(output_torque: float, amplitude: float) -> float:
    """Torque added to the reading, N*m; the same at every torque."""
    return amplitude


EFFECT = Effect(
    id="torque-sensor-offset",
    summary="zero of the torque transducer is off",
    equation="output_torque reads amplitude more",
    source="transducer data sheets",
    enters=Enters.READING,
    variable="output_torque",
    shape=Shape.STATIC,
    unit="N*m",
    parameters=(Parameter("amplitude", "N*m", -1e4, 1e4, 0.1, (-0.5, 0.5), "reading at zero torque"),),
    amplitudes=("amplitude",),
    function=torque_sensor_offset,
    energy=Energy.NONE,
    shows=("locked-output", "backdrive"),
    confusable=("gravity-load", "torque-sensor-nonlinearity", "torque-sensor-drift", "current-sensor-offset"),
    separated_by="the unloaded zero before and after each run",
    reads="output_torque",
)

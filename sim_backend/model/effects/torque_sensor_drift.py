"""Torque-sensor drift: the transducer's zero moves with temperature and time.

    output_torque reads per_kelvin * (temperature - reference) + per_second * time more        N*m at the output

Source: transducer data sheets (0.05 % of full scale per 10 K for a good flange).
"""

from sim_backend.model.effects.effect import Effect, Energy, Enters, Parameter, Shape


def torque_sensor_drift(
    temperature: float, time: float, per_kelvin: float, per_second: float, reference: float
) -> float:
    """Torque added to the reading, N*m."""
    return per_kelvin * (temperature - reference) + per_second * time


EFFECT = Effect(
    id="torque-sensor-drift",
    summary="zero of the torque transducer moves with temperature and time",
    equation="output_torque reads per_kelvin * (temperature - reference) + per_second * time more",
    source="transducer data sheets; usual per_kelvin derived: 100 times that of a good flange of 30 N*m",
    enters=Enters.READING,
    variable="temperature",
    shape=Shape.STATIC,
    unit="N*m",
    parameters=(
        Parameter("per_kelvin", "N*m/K", -1e2, 1e2, 0.01, (-0.15, 0.15), "zero per kelvin"),
        Parameter("per_second", "N*m/s", -1e2, 1e2, 1e-5, (-1e-4, 1e-4), "zero per second"),
        Parameter("reference", "degC", -273.15, 1e3, 25.0, (15.0, 30.0), "temperature at the tare", known=True),
    ),
    amplitudes=("per_kelvin", "per_second"),
    function=torque_sensor_drift,
    energy=Energy.NONE,
    shows=("locked-output", "backdrive"),
    confusable=("creep", "thermal-expansion", "temperature-dependent-stiffness", "torque-sensor-offset"),
    separated_by="log the unloaded zero while the bench warms up",
    reads="output_torque",
)

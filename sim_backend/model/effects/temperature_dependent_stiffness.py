"""Temperature-dependent stiffness: the elastic modulus falls as the drive warms up.

    torsion += amplitude * (temperature - reference) * f(output_torque)        rad at the output

f: the flexspline's torsion of the base model. Positive: softer when warm. Source: elastic modulus of steel.
"""

from sim_backend.model.effects.effect import Effect, Energy, Enters, Parameter, Shape


def temperature_dependent_stiffness(
    temperature: float, flexspline_torsion: float, amplitude: float, reference: float
) -> float:
    """Angle added to the torsion, rad."""
    return amplitude * (temperature - reference) * flexspline_torsion


EFFECT = Effect(
    id="temperature-dependent-stiffness",
    summary="flexspline is softer when warm",
    equation="torsion += amplitude * (temperature - reference) * flexspline_torsion",
    source="elastic modulus of steel; usual amplitude derived: half to twice 3e-4 1/K",
    enters=Enters.TORSION,
    variable="temperature",
    shape=Shape.PRODUCT,
    unit="rad",
    parameters=(
        Parameter("amplitude", "1/K", -0.1, 0.1, 3e-4, (1.5e-4, 6e-4), "change of compliance per kelvin"),
        Parameter("reference", "degC", -273.15, 1e3, 25.0, (15.0, 30.0), "temperature of the base model", known=True),
    ),
    amplitudes=("amplitude",),
    function=temperature_dependent_stiffness,
    energy=Energy.ACTIVE,
    shows=("locked-output", "backdrive"),
    confusable=("torque-sensor-gain", "torque-sensor-drift", "thermal-expansion", "creep"),
    separated_by="the same sweep cold and warm, and a dead weight on the torque sensor cold and warm",
)

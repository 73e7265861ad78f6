"""Fixture compliance: the lock yields, and the reading of the output does not see it.

    torsion += amplitude * output_torque        rad at the output, while the fixture holds it; amplitude = 1/K_fix

Odd and linear in the torque: the fit takes it for a softer flexspline. Source: statics.
"""

from sim_backend.model.effects.effect import Effect, Energy, Enters, Parameter, Shape


def fixture_compliance(output_torque: float, locked: float, amplitude: float) -> float:
    """Angle added to the torsion, rad."""
    return amplitude * output_torque * locked


EFFECT = Effect(
    id="fixture-compliance",
    summary="lock yields, and the reading of the output does not see it",
    equation="torsion += amplitude * output_torque * locked",
    source="statics",
    enters=Enters.TORSION,
    variable="output_torque",
    shape=Shape.STATIC,
    unit="rad",
    parameters=(
        Parameter(
            "amplitude", "rad/(N*m)", 0.0, 1.0, 2e-5, (5e-6, 5e-5), "1/K_fix: yielding per torque, at the output"
        ),
    ),
    amplitudes=("amplitude",),
    function=fixture_compliance,
    energy=Energy.CONSERVATIVE,
    shows=("locked-output",),
    confusable=("flexspline-compliance", "torque-sensor-gain", "torque-constant-error"),
    separated_by="encoder or dial gauge on the fixture; stiffness of locked output against backdrive",
)

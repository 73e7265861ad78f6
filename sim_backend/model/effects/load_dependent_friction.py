"""Load-dependent friction: the mesh rubs harder under load.

    friction += amplitude * |output_torque| / ratio        N*m at the motor

The play's radius at the output grows by amplitude per N*m. Source: Bittencourt et al., IROS 2010.
"""

from sim_backend.model.effects.effect import Effect, Energy, Enters, Parameter, Shape


def load_dependent_friction(output_torque: float, amplitude: float, ratio: float) -> float:
    """Give what is added to the friction level, N*m at the motor."""
    return amplitude * abs(output_torque) / ratio


EFFECT = Effect(
    id="load-dependent-friction",
    summary="friction grows with the load",
    equation="friction += amplitude * |output_torque| / ratio",
    source="Bittencourt et al. 2010",
    enters=Enters.FRICTION,
    variable="output_torque",
    shape=Shape.PRODUCT,
    unit="N*m",
    parameters=(
        Parameter("amplitude", "1", 0.0, 1.0, 0.1, (0.02, 0.3), "friction per load"),
        Parameter("ratio", "1", 1.0, 1e4, 100.0, (30.0, 320.0), "gear ratio", known=True),
    ),
    amplitudes=("amplitude",),
    function=load_dependent_friction,
    energy=Energy.DISSIPATIVE,
    shows=("free-run (loaded)", "backdrive", "locked-output"),
    confusable=(
        "torque-constant-error",
        "torque-sensor-gain",
        "torque-constant-saturation",
        "coulomb-friction",
        "flexspline-compliance",
    ),
    separated_by="a ladder of loads at one speed, in both directions",
)

"""Torque-constant error: the drive takes its current for more torque than there is.

    motor_torque reads amplitude * motor_torque more        N*m at the motor

The fit absorbs it: K_w0' = (1 + amplitude) K_w0, C_w' = C_w / (1 + amplitude), and T_fs, T_c, b scale alike. Magnets
that warm up lower the true constant. Source: motor data sheets (tolerance of k_t).
Left out: magnets that warm up.
"""

from sim_backend.model.effects.effect import Effect, Energy, Enters, Parameter, Shape


def torque_constant_error(motor_torque: float, amplitude: float) -> float:
    """Torque added to the reading, N*m."""
    return amplitude * motor_torque


EFFECT = Effect(
    id="torque-constant-error",
    summary="torque constant is not what the drive assumes",
    equation="motor_torque reads amplitude * motor_torque more",
    source="motor data sheets",
    enters=Enters.READING,
    variable="motor_torque",
    shape=Shape.STATIC,
    unit="N*m",
    parameters=(Parameter("amplitude", "1", -1.0, 10.0, 0.03, (-0.1, 0.1), "relative error of the torque constant"),),
    amplitudes=("amplitude",),
    function=torque_constant_error,
    energy=Energy.NONE,
    shows=("locked-output", "free-run"),
    confusable=(
        "torque-sensor-gain",
        "load-dependent-friction",
        "flexspline-compliance",
        "fixture-compliance",
        "wave-generator-compliance",
        "temperature-dependent-friction",
    ),
    separated_by="lever and dead weight; back-EMF constant of the motor, cold and warm",
    reads="motor_torque",
)

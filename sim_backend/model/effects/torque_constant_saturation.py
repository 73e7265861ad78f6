"""Torque-constant saturation: iron saturates, so that the torque falls behind the current.

    motor_torque reads amplitude * torque_constant * motor_current^3 more        N*m at the motor; amplitude = 1/i_s^2

True is k_t0 i (1 - (i/i_s)^2); what is read is k_t0 i. Source: magnetic saturation, first odd term.
"""

from sim_backend.model.effects.effect import Effect, Energy, Enters, Parameter, Shape


def torque_constant_saturation(motor_current: float, amplitude: float, torque_constant: float) -> float:
    """Torque added to the reading, N*m."""
    return amplitude * torque_constant * motor_current * motor_current * motor_current


EFFECT = Effect(
    id="torque-constant-saturation",
    summary="torque falls behind the current at high current",
    equation="motor_torque reads amplitude * torque_constant * motor_current^3 more",
    source="magnetic saturation, first odd term; usual amplitude derived: i_s of 2 to 10 times a rated 0.59 A",
    enters=Enters.READING,
    variable="motor_current",
    shape=Shape.STATIC,
    unit="N*m",
    parameters=(
        Parameter(
            "amplitude", "1/A^2", 0.0, 1e6, 0.1, (0.029, 0.73), "1/i_s^2, i_s: current at which no torque were left"
        ),
        Parameter(
            "torque_constant", "N*m/A", 1e-6, 1e3, 0.321, (0.01, 1.0), "torque per current at low current", known=True
        ),
    ),
    amplitudes=("amplitude",),
    function=torque_constant_saturation,
    energy=Energy.NONE,
    shows=("locked-output", "free-run (loaded)"),
    confusable=("flexspline-compliance", "load-dependent-friction"),
    separated_by="torque sensor and a ladder of loads, and so of currents",
    reads="motor_torque",
)

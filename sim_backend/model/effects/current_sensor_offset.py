"""Current-sensor offset: the drive's current measurement has a zero of its own.

    motor_torque reads torque_constant * amplitude more        N*m at the motor; amplitude in A

Source: current-sensor data sheets.
Left out: ripple of offsets and unequal gains of the phases.
"""

from sim_backend.model.effects.effect import Effect, Energy, Enters, Parameter, Shape


def current_sensor_offset(motor_torque: float, amplitude: float, torque_constant: float) -> float:
    """Torque added to the reading, N*m; the same at every torque."""
    return torque_constant * amplitude


EFFECT = Effect(
    id="current-sensor-offset",
    summary="zero of the drive's current sensor is off",
    equation="motor_torque reads torque_constant * amplitude more",
    source="current-sensor data sheets; usual amplitude derived: 2 % of a rated 0.59 A",
    enters=Enters.READING,
    variable="motor_torque",
    shape=Shape.STATIC,
    unit="N*m",
    parameters=(
        Parameter("amplitude", "A", -1e3, 1e3, 0.01, (-0.012, 0.012), "reading at zero current"),
        Parameter("torque_constant", "N*m/A", 1e-6, 1e3, 0.321, (0.01, 1.0), "torque per current", known=True),
    ),
    amplitudes=("amplitude",),
    function=current_sensor_offset,
    energy=Energy.NONE,
    shows=("free-run", "locked-output"),
    confusable=("gravity-load", "torque-sensor-offset", "cogging", "position-dependent-friction"),
    separated_by="a log at zero current; both directions; swapped phases",
    reads="motor_torque",
)

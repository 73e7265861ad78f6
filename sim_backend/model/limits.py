"""What the plant's numbers may be: unit, lowest and highest value, and the equation that needs each.

Far wider than any drive or bench, and narrow enough that no formula of the plant divides by zero or overflows.
"""

from collections.abc import Mapping
from typing import NamedTuple

from sim_backend.model.checks import require


class Limit(NamedTuple):
    """Unit (empty: none), lowest and highest value, and the equation that needs the number."""

    unit: str
    low: float
    high: float
    equation: str


_FLEXSPLINE = "f(T_F) = arctan(C_F T_F)/(C_F K_F0), Zhang (24),"
_WAVE_GENERATOR = "g(T_w) = (1 - exp(-C_w |T_w|))/(C_w K_w0), Zhang (27),"
_RIM = "|T_F + N T_w| = friction_torque + N^2 viscous_friction |v| of the sliding rim"
_CUBIC = "T = a1 f + a3 f^3, Zhang (10),"
_PIECEWISE = "f = T/K1 up to T1, T1/K1 + (T - T1)/K2 up to T2, Zhang (11),"
_MOTOR = "(J_m + J_wg) dw/dt = sum of torques"
_OUTPUT = "J_l dw/dt = sum of torques"
_FIXTURE = "the fixture's torque K_fix theta + damping"
_LOOPS = "the simulated drive"
_THERMAL = "C dtheta/dt = power - (theta - ambient)/R"
_NOISE = "the white noise of a reading"

RATIO = Limit("", 1.0, 1e6, "theta_w = -N theta_F, Zhang (4),")

DRIVE: Mapping[str, Limit] = {
    "ratio": RATIO,
    "K_F0": Limit("N*m/rad", 1e-3, 1e9, "K_FL = K_F0 (1 + (C_F T_F)^2), Zhang (22),"),
    "C_F": Limit("1/(N*m)", 1e-9, 1e6, _FLEXSPLINE),
    "K_w0": Limit("N*m/rad", 1e-6, 1e9, "K_wL = K_w0 exp(C_w |T_w|), Zhang (25),"),
    "C_w": Limit("1/(N*m)", 1e-9, 1e6, _WAVE_GENERATOR),
    "friction_torque": Limit("N*m", 0.0, 1e9, _RIM),
    "viscous_friction": Limit("N*m*s", 0.0, 1e6, _RIM),
}
"""A harmonic drive."""

CATALOGUE: Mapping[str, Limit] = {
    "ratio": RATIO,
    "K1": Limit("N*m/rad", 1e-3, 1e9, "the catalogue's local stiffness below T1, Zhang (29),"),
    "K2": Limit("N*m/rad", 1e-3, 1e9, "the catalogue's local stiffness between T1 and T2, Zhang (30),"),
    "T1": Limit("N*m", 1e-6, 1e9, "the catalogue's local stiffness below T1, Zhang (29),"),
    "T2": Limit("N*m", 1e-6, 1e9, "the catalogue's local stiffness between T1 and T2, Zhang (30),"),
    "hysteresis_loss": Limit("rad", 1e-9, 10.0, "K_w0 = 2 T_fs/(N Psi), Zhang (33),"),
    "starting_torque": Limit("N*m", 1e-6, 1e9, "K_w0 = 2 T_fs/(N Psi), Zhang (33),"),
}
"""Values that a drive is estimated from."""

CUBIC: Mapping[str, Limit] = {
    "a1": Limit("N*m/rad", 1e-3, 1e9, _CUBIC),
    "a3": Limit("N*m/rad^3", 0.0, 1e18, f"{_CUBIC} which must not fall,"),
}
PIECEWISE: Mapping[str, Limit] = {
    **{name: Limit("N*m/rad", 1e-3, 1e9, _PIECEWISE) for name in ("K1", "K2", "K3")},
    **{name: Limit("N*m", 1e-9, 1e9, _PIECEWISE) for name in ("T1", "T2")},
}

BENCH: Mapping[str, Limit] = {
    "rotor_inertia": Limit("kg*m^2", 1e-12, 1e3, _MOTOR),
    "wave_generator_inertia": Limit("kg*m^2", 0.0, 1e3, _MOTOR),
    "output_inertia": Limit("kg*m^2", 1e-9, 1e6, _OUTPUT),
    "rotor_friction": Limit("N*m", 0.0, 1e6, _MOTOR),
    "rotor_viscous_friction": Limit("N*m*s", 0.0, 1e6, _MOTOR),
    "output_viscous_friction": Limit("N*m*s", 0.0, 1e9, _OUTPUT),
    "wave_generator_damping": Limit("N*m*s/rad", 0.0, 1e6, "T_w = g^-1(theta) + damping"),
    "flexspline_damping": Limit("N*m*s/rad", 0.0, 1e9, "T_F = f^-1(theta) + damping"),
    "wave_generator_stiffness_cap": Limit("N*m/rad", 1e-6, 1e12, "Zhang (25)"),
    "flexspline_stiffness_cap": Limit("N*m/rad", 1e-3, 1e12, "Zhang (22)"),
    "fixture_stiffness": Limit("N*m/rad", 1e-3, 1e12, _FIXTURE),
    "fixture_damping": Limit("N*m*s/rad", 0.0, 1e9, _FIXTURE),
    "torque_constant": Limit("N*m/A", 1e-6, 1e6, "motor_torque = k_t i"),
    "encoder_counts": Limit("1/rev", 1.0, 1e9, "motor_position = 2 pi counts / encoder_counts"),
    "motor_rated_torque": Limit("N*m", 1e-6, 1e9, _LOOPS),
    "load_rated_torque": Limit("N*m", 1e-6, 2e9, _LOOPS),
    "motor_speed_limit": Limit("rad/s", 1e-6, 1e6, _LOOPS),
    "load_speed_limit": Limit("rad/s", 1e-6, 1e6, _LOOPS),
    "current_loop_time": Limit("s", 1e-8, 10.0, _LOOPS),
    "loop_period": Limit("s", 1e-8, 1.0, _LOOPS),
    "step": Limit("s", 1e-8, 1e-2, "the integration"),
    "output_torque_noise": Limit("N*m", 0.0, 1e6, _NOISE),
    "motor_torque_noise": Limit("N*m", 0.0, 1e6, _NOISE),
    "load_torque_noise": Limit("N*m", 0.0, 1e6, _NOISE),
    "motor_angle_noise": Limit("rad", 0.0, 1e3, _NOISE),
    "output_angle_noise": Limit("rad", 0.0, 1e3, _NOISE),
    "motor_velocity_noise": Limit("rad/s", 0.0, 1e6, _NOISE),
    "load_velocity_noise": Limit("rad/s", 0.0, 1e6, _NOISE),
    "temperature": Limit("degC", -273.15, 1e3, _THERMAL),
    "motor_temperature": Limit("degC", -273.15, 1e3, _THERMAL),
    "ambient_temperature": Limit("degC", -273.15, 1e3, _THERMAL),
    "gear_heat_capacity": Limit("J/K", 1e-3, 1e9, _THERMAL),
    "gear_thermal_resistance": Limit("K/W", 1e-6, 1e6, _THERMAL),
    "motor_heat_capacity": Limit("J/K", 1e-3, 1e9, _THERMAL),
    "motor_thermal_resistance": Limit("K/W", 1e-6, 1e6, _THERMAL),
    "winding_resistance": Limit("ohm", 0.0, 1e6, "the heat R i^2 of the motor"),
}
"""The rest of a bench."""


def require_limit(name: str, value: object, limit: Limit) -> None:
    """Raise ModelError unless `value` is a number within the limit; `name` is what the message calls it."""
    require(name, value, limit.unit, limit.equation, low=limit.low, high=limit.high)


def require_within(limits: Mapping[str, Limit], values: Mapping[str, object]) -> None:
    """Raise ModelError unless every value is a number within the limit of its name."""
    for name, value in values.items():
        require_limit(name, value, limits[name])

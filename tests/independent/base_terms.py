"""Second formulas of the base terms by catalogue id: the laws of `laws.py` with the catalogue's parameters."""

from tests.independent.laws import Floats, flexspline_torsion, play, wave_generator_torsion


def flexspline_compliance(output_torque: Floats, K_F0: float, C_F: float) -> Floats:
    """Give f(T) (24), rad at the output."""
    return flexspline_torsion(output_torque, K_F0, C_F)


def wave_generator_compliance(motor_torque: Floats, K_w0: float, C_w: float, ratio: float) -> Floats:
    """Give g(M)/N (27), (28), rad at the output."""
    return wave_generator_torsion(motor_torque, K_w0, C_w) / ratio


def coulomb_friction(motor_torque: Floats, T_fs: float, ratio: float) -> Floats:
    """Give the output torque that gets through the friction when the output is locked, N*m; starts at zero."""
    return ratio * play(motor_torque, T_fs)


def viscous_friction(motor_velocity: Floats, b: float) -> Floats:
    """Give the motor torque that slips through an oil film, N*m: half of d(lost power)/d(speed)."""
    step = 1e-3
    lost_faster, lost_slower = b * (motor_velocity + step) ** 2, b * (motor_velocity - step) ** 2
    return (lost_faster - lost_slower) / (4.0 * step)


def inertia(motor_acceleration: Floats, J: float) -> Floats:
    """Give the motor torque that speeds the rotor up, N*m."""
    return J * motor_acceleration

"""The drive's inner loops: position (P) over velocity (PI) over torque, with a torque limit and anti-windup.

Scalar code for the compiled kernel. Modes are the numbers of `sim_backend.ports.AxisMode`.
"""

OFF, TORQUE, VELOCITY, POSITION = 0.0, 1.0, 2.0, 3.0


def drive_loop(
    mode: float,
    target: float,
    limit: float,
    position: float,
    velocity: float,
    integral: float,
    position_gain: float,
    velocity_gain: float,
    integral_gain: float,
    speed_limit: float,
    period: float,
) -> tuple[float, float, float]:
    """Run the loops of one axis once. Gives (torque command N*m, integral N*m, 1.0 if the limit acted).

    The integral stands still while the limit acts and the error would drive it further in.
    """
    if mode == OFF:
        return 0.0, 0.0, 0.0
    if mode == TORQUE:
        torque = min(max(target, -limit), limit)
        return torque, torque, 1.0 if torque != target else 0.0
    if mode == POSITION:
        target = min(max(position_gain * (target - position), -speed_limit), speed_limit)
    error = target - velocity
    wanted = velocity_gain * error + integral
    torque = min(max(wanted, -limit), limit)
    if torque == wanted or (wanted - torque) * error < 0.0:
        integral = min(max(integral + integral_gain * period * error, -limit), limit)
    return torque, integral, 1.0 if torque != wanted else 0.0

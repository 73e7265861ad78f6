"""What the plant's step can carry of an angle that goes with the motor: kinematic error and stiffness modulation.

An error e = A sin(k theta_m) (A rad at the output, k 1/rev) passes at the frequency W = k w_m (rad/s, w_m the motor's
speed). It shakes the flexspline, whose damper d (N*m*s/rad) takes the mean power (W)

    P_e = A^2/2 W Im Z(W),    Im Z = d W (J_l W^2)^2 / ((K - J_l W^2)^2 + (d W)^2)       Z: N*m/rad

of it; the output J_l (kg*m^2) on the stiffness K (N*m/rad) is in resonance at W = sqrt(K/J_l). The motor gives that
power by T_F de/dtheta_m at both ends of a step h (s), the trapezoidal rule, which misses (W h)^2/12 of it, the first
term of 1 - (W h/2) cot(W h/2). What is missed, as part of all the power that goes in, must stay below what the energy
account promises; beside P_e that is at least

    P = w_m (T_c + b w_m) + J_m w_m^2/2 per second       friction, and bringing the motor up to speed

T_c (N*m), b (N*m*s) and J_m (kg*m^2) at the motor. Of an order that passes with more than half a period in a step, the
step sees another order.

Source: derived here from the driven oscillator and the trapezoidal rule; tests hold it against simulated accounts.
"""

import math

from sim_backend.model.parameters import PlantConfig

MOST_MISSED = 3e-5
"""1; part of the power put in that a step may miss: a third of the 1e-4 that the energy account promises
(`plant.PlantTruth`). An error with a slope of several times 1/N swings the motor beyond its speed limit and needs the
rest."""

LEAST_DAMPING = 0.01
"""1; damping ratio of the output on the flexspline that mesh and bearings are good for at least. A working value."""


def highest_order(config: PlantConfig) -> float:
    """Give the order (1/rev) that passes half a period in a step at the motor's speed limit."""
    return math.pi / (config.motor_speed_limit * config.step)


def most_amplitude(order: float, config: PlantConfig) -> float:
    """Give the largest amplitude A (rad at the output) of a kinematic error of this order k (1/rev); may be infinite.

    The smaller of those at the motor's speed limit and, where the error reaches it, in the output's resonance.
    """
    if order <= 0.0:
        return math.inf
    fastest = order * config.motor_speed_limit
    resonance = math.sqrt(config.stiffness_at_rest / config.output_inertia)
    return min(_most_at(frequency, order, config) for frequency in (fastest, min(resonance, fastest)))


def _most_at(frequency: float, order: float, config: PlantConfig) -> float:
    """Give the largest amplitude A (rad at the output) of order k (1/rev) that passes at the frequency W (rad/s)."""
    missed = (frequency * config.step) ** 2 / 12.0
    if missed <= MOST_MISSED:
        return math.inf
    speed = frequency / order
    drive, inertia, stiffness = config.drive, config.output_inertia, config.stiffness_at_rest
    friction = drive.friction_torque / drive.ratio + config.rotor_friction
    friction += (drive.viscous_friction + config.rotor_viscous_friction) * speed
    power = friction * speed + 0.5 * config.motor_inertia * speed**2
    damping = max(config.flexspline_damping, 2.0 * LEAST_DAMPING * math.sqrt(stiffness * inertia))
    swing = inertia * frequency**2
    resistance = damping * frequency * swing**2 / ((stiffness - swing) ** 2 + (damping * frequency) ** 2)
    return math.sqrt(MOST_MISSED * power / ((missed - MOST_MISSED) * 0.5 * frequency * resistance))

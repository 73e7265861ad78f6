"""One bench over many steps: rotor and output by velocity Verlet, the rim by return mapping, drive loops inside.

    (J_m + J_wg) dw_m/dt = motor_torque + T_w + T_F de/dtheta_m - rotor friction - motor effects
    J_l dw_o/dt = load_torque - fixture - T_F - output effects
    T_F = f^-1(theta_o - rim - e(theta_m)),  T_w = g^-1(-N rim - theta_m), each with its spring's damper

One evaluation of the springs per step, second order. Velocities inside forces are extrapolated to the end of the
step. Dry rotor friction brakes each half kick and never reverses it. T_F acts on the flexspline from outside, T_w on
the motor shaft; at rest T_w = -motor_torque. Sense `opposed`. Scalar code that numba compiles.
"""

import math

import numpy as np
from numpy.typing import NDArray

from sim_backend.model.constants import unpack
from sim_backend.model.drive_loop import drive_loop
from sim_backend.model.effect_sums import motor_effects, output_effects, torsion_effects
from sim_backend.model.rim import move_rim

(
    STEPS,
    MOTOR_POSITION,
    MOTOR_VELOCITY,
    OUTPUT_POSITION,
    OUTPUT_VELOCITY,
    RIM,
    SLIP,
    MOTOR_TORQUE,
    LOAD_TORQUE,
    T_F_NOW,
    T_W_NOW,
    FIXTURE_TORQUE,
    OUTPUT_TORQUE,
    MOTOR_FORCE,
    OUTPUT_FORCE,
    MOTOR_EFFECTS,
    OUTPUT_EFFECTS,
    LEVEL,
    ERROR,
    LOOP_WAIT,
    MOTOR_COMMAND,
    LOAD_COMMAND,
    MOTOR_INTEGRAL,
    LOAD_INTEGRAL,
    MOTOR_LIMITED,
    LOAD_LIMITED,
    WORK,
    DISSIPATED,
    EFFECT_WORK,
    STATE_SIZE,
) = range(30)
"""Places in the state array. The last three are the energy account, J: work of both drives, heat, work on effects."""

(
    MOTOR_MODE,
    MOTOR_TARGET,
    MOTOR_LIMIT,
    LOAD_MODE,
    LOAD_TARGET,
    LOAD_LIMIT,
    LOCKED,
    LOCK_POSITION,
    TEMPERATURE,
    MOTOR_TEMPERATURE,
    INPUT_SIZE,
) = range(11)
"""Places in the array of inputs."""


def brake(velocity: float, loss: float) -> float:
    """Take `loss` off the speed without reversing it."""
    if loss == 0.0:
        return velocity
    return math.copysign(max(abs(velocity) - loss, 0.0), velocity)


def advance(
    steps: int,
    s: NDArray[np.float64],
    inputs: NDArray[np.float64],
    constants: NDArray[np.float64],
    effect_parameters: NDArray[np.float64],
) -> None:
    """Advance the state `s` by `steps`; the arrays are laid out by the names above and by `Constants`."""
    c = unpack(constants)
    theta_m, omega_m = s[MOTOR_POSITION], s[MOTOR_VELOCITY]
    theta_o, omega_o = s[OUTPUT_POSITION], s[OUTPUT_VELOCITY]
    rim, slip, level, error = s[RIM], s[SLIP], s[LEVEL], s[ERROR]
    motor_torque, load_torque = s[MOTOR_TORQUE], s[LOAD_TORQUE]
    T_F, T_w, fixture = s[T_F_NOW], s[T_W_NOW], s[FIXTURE_TORQUE]
    motor_force, output_force = s[MOTOR_FORCE], s[OUTPUT_FORCE]
    motor_extra, output_extra = s[MOTOR_EFFECTS], s[OUTPUT_EFFECTS]
    wait, motor_command, load_command = s[LOOP_WAIT], s[MOTOR_COMMAND], s[LOAD_COMMAND]
    motor_integral, load_integral = s[MOTOR_INTEGRAL], s[LOAD_INTEGRAL]
    work, dissipated, effect_work = s[WORK], s[DISSIPATED], s[EFFECT_WORK]
    locked, lock_position = inputs[LOCKED], inputs[LOCK_POSITION]
    h = c.step
    half_m, half_o = 0.5 * h / c.motor_inertia, 0.5 * h / c.output_inertia
    rotor_loss = half_m * c.rotor_friction

    for i in range(steps):
        if wait <= 0.0:
            wait = c.loop_steps
            motor_command, motor_integral, limited = drive_loop(
                inputs[MOTOR_MODE], inputs[MOTOR_TARGET], inputs[MOTOR_LIMIT], theta_m, omega_m, motor_integral,
                c.motor_position_gain, c.motor_velocity_gain, c.motor_integral_gain, c.motor_speed_limit, c.loop_period,
            )  # fmt: skip
            s[MOTOR_LIMITED] = max(s[MOTOR_LIMITED], limited)
            load_command, load_integral, limited = drive_loop(
                inputs[LOAD_MODE], inputs[LOAD_TARGET], inputs[LOAD_LIMIT], theta_o, omega_o, load_integral,
                c.load_position_gain, c.load_velocity_gain, c.load_integral_gain, c.load_speed_limit, c.loop_period,
            )  # fmt: skip
            s[LOAD_LIMITED] = max(s[LOAD_LIMITED], limited)
        wait -= 1.0
        motor_lag, load_lag = motor_torque - motor_command, load_torque - load_command
        motor_drive, load_drive = motor_command + motor_lag * c.current_mean, load_command + load_lag * c.current_mean
        motor_torque, load_torque = (
            motor_command + motor_lag * c.current_decay,
            load_command + load_lag * c.current_decay,
        )

        middle_m = brake(omega_m + half_m * (motor_drive + motor_force), rotor_loss)
        middle_o = omega_o + half_o * (load_drive + fixture + output_force)
        next_m, next_o = 2.0 * middle_m - omega_m, 2.0 * middle_o - omega_o
        theta_m += h * middle_m
        theta_o += h * middle_o

        time = (s[STEPS] + (i + 1)) * h
        output_torque = load_torque + fixture
        last_error, last_level = error, level
        error, slope = torsion_effects(
            time, theta_m, next_m, motor_torque, theta_o, next_o, output_torque,
            inputs[TEMPERATURE], inputs[MOTOR_TEMPERATURE], effect_parameters,
        )  # fmt: skip
        slip, T_F, T_w, level = move_rim(slip, rim, theta_o - error, next_o - slope * next_m, theta_m, next_m, c)
        rim += slip

        last_motor_extra, last_output_extra = motor_extra, output_extra
        motor_extra = motor_effects(
            time, theta_m, next_m, motor_torque, theta_o, next_o, output_torque,
            inputs[TEMPERATURE], inputs[MOTOR_TEMPERATURE], effect_parameters,
        )  # fmt: skip
        output_extra = output_effects(
            time, theta_m, next_m, motor_torque, theta_o, next_o, output_torque,
            inputs[TEMPERATURE], inputs[MOTOR_TEMPERATURE], effect_parameters,
        )  # fmt: skip
        motor_force = T_w + T_F * slope - motor_extra - c.rotor_viscous_friction * next_m
        output_force = -T_F - output_extra
        fixture = -locked * (c.fixture_stiffness * (theta_o - lock_position) + c.fixture_damping * next_o)
        omega_m = brake(middle_m + half_m * (motor_drive + motor_force), rotor_loss)
        omega_o = middle_o + half_o * (load_drive + fixture + output_force)

        motor_travel, output_travel = h * middle_m, h * middle_o
        flexspline_travel = output_travel - (error - last_error) - slip
        wave_generator_travel = motor_travel + c.ratio * slip
        work += motor_drive * motor_travel + load_drive * output_travel
        effect_work += 0.5 * (
            (motor_extra + last_motor_extra) * motor_travel + (output_extra + last_output_extra) * output_travel
        )
        dissipated += (
            0.5 * (level + last_level) * abs(slip)
            + c.rotor_friction * abs(motor_travel)
            + (
                c.rim_damping * slip * slip
                + c.flexspline_damping * flexspline_travel * flexspline_travel
                + c.wave_generator_damping * wave_generator_travel * wave_generator_travel
                + c.rotor_viscous_friction * motor_travel * motor_travel
                + locked * c.fixture_damping * output_travel * output_travel
            )
            / h
        )

    s[STEPS] += steps
    s[MOTOR_POSITION], s[MOTOR_VELOCITY] = theta_m, omega_m
    s[OUTPUT_POSITION], s[OUTPUT_VELOCITY] = theta_o, omega_o
    s[RIM], s[SLIP], s[LEVEL], s[ERROR] = rim, slip, level, error
    s[MOTOR_TORQUE], s[LOAD_TORQUE] = motor_torque, load_torque
    s[T_F_NOW], s[T_W_NOW], s[FIXTURE_TORQUE] = T_F, T_w, fixture
    s[OUTPUT_TORQUE] = load_torque + fixture
    s[MOTOR_FORCE], s[OUTPUT_FORCE] = motor_force, output_force
    s[MOTOR_EFFECTS], s[OUTPUT_EFFECTS] = motor_extra, output_extra
    s[LOOP_WAIT], s[MOTOR_COMMAND], s[LOAD_COMMAND] = wait, motor_command, load_command
    s[MOTOR_INTEGRAL], s[LOAD_INTEGRAL] = motor_integral, load_integral
    s[WORK], s[DISSIPATED], s[EFFECT_WORK] = work, dissipated, effect_work

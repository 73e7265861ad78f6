"""One bench over many steps: rotor and output by velocity Verlet, the rim by return mapping, drive loops inside.

    (J_m + J_wg) dw_m/dt = motor_torque + T_w + T_F de/dtheta_m - rotor friction - motor effects
    J_l dw_o/dt = load_torque - fixture - T_F - output friction - output effects
    T_F = f^-1(theta_o - rim - e),  T_w = g^-1(-N rim - theta_m), each with its spring's damper

One evaluation of the springs per step, second order. Velocities inside forces are extrapolated to the end of the step,
and so is the T_F on which the friction level depends; what lies in series with a spring is solved for with it. Dry
rotor friction brakes each half kick and never reverses it. T_F acts on the flexspline from outside, T_w on the motor
shaft; at rest T_w = -motor_torque. The motor's drive regulates what it reads: its current loop the torque that it
believes in, which differs from the shaft's by the error of the reading. Errors of readings are those of the last tick
of the drive loops. Sense `opposed`. Scalar code that numba compiles.

Over a step the two ends of a bent spring's torque do not do the work that it stores. Where a torque changes fast
(`STEEP`) the difference is owed, and both bodies pay it with one factor on their speeds, so that a jolt neither makes
nor loses energy, whatever the springs are bent over in a step. The energy account takes every force at both ends of a
step times the travel between them, as the step itself does, and the drives' torque times the mean of both speeds.
"""

import math

import numpy as np
from numpy.typing import NDArray

from sim_backend.model.constants import Constants, unpack
from sim_backend.model.coupling import coupling_angle
from sim_backend.model.drive_loop import OFF, drive_loop
from sim_backend.model.effect_sums import (
    COUPLED,
    FRICTION,
    READINGS,
    SERIES,
    Signals,
    coupling_effects,
    friction_effects,
    keep_series,
    motor_effects,
    output_effects,
    reading_errors,
    series_effects,
    series_slope,
    torsion_effects,
)
from sim_backend.model.rim import move_rim
from sim_backend.model.series import Series, move_rim_in_series
from sim_backend.model.springs import flexspline_energy, wave_generator_energy

(
    STEPS,
    MOTOR_POSITION,
    MOTOR_VELOCITY,
    OUTPUT_POSITION,
    OUTPUT_VELOCITY,
    RIM,
    SLIP,
    MOTOR_TORQUE,
    SHOWN_TORQUE,
    LOAD_TORQUE,
    T_F_NOW,
    T_F_BEFORE,
    T_W_NOW,
    FIXTURE_TORQUE,
    OUTPUT_TORQUE,
    MOTOR_FORCE,
    OUTPUT_FORCE,
    MOTOR_EFFECTS,
    OUTPUT_EFFECTS,
    RIM_FORCE,
    FLEXSPLINE_DAMPER,
    WAVE_GENERATOR_DAMPER,
    MOTOR_DAMPER,
    OUTPUT_DAMPER,
    FIXTURE_DAMPER,
    ERROR,
    ERROR_OPEN,
    SERIES_TORSION,
    SERIES_TORQUE,
    SERIES_ANGLE,
    SERIES_STIFFNESS,
    SERIES_COMPLIANCE,
    COUPLING_ANGLE,
    PULL,
    MOTOR_POSITION_ERROR,
    MOTOR_VELOCITY_ERROR,
    MOTOR_TORQUE_ERROR,
    OUTPUT_POSITION_ERROR,
    OUTPUT_VELOCITY_ERROR,
    OUTPUT_TORQUE_ERROR,
    LOOP_WAIT,
    MOTOR_COMMAND,
    LOAD_COMMAND,
    MOTOR_INTEGRAL,
    LOAD_INTEGRAL,
    MOTOR_LIMITED,
    LOAD_LIMITED,
    GEAR_TEMPERATURE,
    WINDING_TEMPERATURE,
    HEAT_BEFORE,
    OWED,
    WORK,
    DISSIPATED,
    EFFECT_WORK,
    STATE_SIZE,
) = range(55)
"""Places in the state array, SI, each at its own shaft; the effects' memory follows.

STEPS: since the start. SLIP: travel (rad) of the rim in the last step. SHOWN_TORQUE (N*m): what the motor's drive
believes in. T_F_BEFORE (N*m): T_F a step ago. Names with FORCE, EFFECTS and DAMPER: torques (N*m). ERROR (rad): what
effects add to the torsion whatever the torque; ERROR_OPEN (rad): that of those with memory. SERIES_: a `series.Series`.
PULL (N*m): how open errors and series drive the motor. LOOP_WAIT: steps to the next tick of the drive loops. LIMITED: 1
once a torque limit acted. HEAT_BEFORE (J): DISSIPATED at the last tick. OWED (J): what springs stored beyond the work
done on them in steep steps, not yet paid by the bodies.
The last three are the energy account, J: work of both drives, heat, work on effects.
"""

(
    MOTOR_MODE,
    MOTOR_TARGET,
    MOTOR_LIMIT,
    LOAD_MODE,
    LOAD_TARGET,
    LOAD_LIMIT,
    LOCKED,
    LOCK_POSITION,
    INPUT_SIZE,
) = range(9)
"""Places in the array of inputs. Targets are N*m, rad/s or rad by their mode (`drive_loop`), limits N*m.

LOCKED: 1 while the fixture holds the output, at LOCK_POSITION (rad), else 0.
"""


STEEP = 1500.0
"""1/s: rate of a spring's torque, times its largest d(ln K)/dT, beyond which it bends too much within a step.

That is C_w of the wave generator, and of the flexspline what its own law has (`Constants.flexspline_stiffening`).
"""

PAYABLE = 0.5
"""1; part of the kinetic energy that may be paid at once; what is owed beyond it waits until the bodies are faster."""


def brake(velocity: float, loss: float) -> float:
    """Take `loss` (rad/s, at least 0) off the `velocity` (rad/s) without reversing it."""
    if loss == 0.0:
        return velocity
    return math.copysign(max(abs(velocity) - loss, 0.0), velocity)


def missed(stored: float, travel: float, first: float, last: float) -> float:
    """Give the energy (J) that a spring stored beyond the work of its torques at both ends over its travel.

    stored: J; travel: rad; first, last: N*m.
    """
    return stored - 0.5 * (first + last) * travel


def speed_factor(owed: float, motor_velocity: float, output_velocity: float, c: Constants) -> float:
    """Give the factor (1) on both speeds (rad/s) that takes the `owed` energy (J) out of the bodies; 1 if they cannot.

    They can while it is less than PAYABLE of what they have; what is owed to them, below 0, makes them faster.
    """
    kinetic = 0.5 * (
        c.motor_inertia * motor_velocity * motor_velocity + c.output_inertia * output_velocity * output_velocity
    )
    return math.sqrt(1.0 - owed / kinetic) if abs(owed) < PAYABLE * kinetic else 1.0


def signals_at(
    time: float,
    motor_position: float,
    motor_velocity: float,
    motor_torque: float,
    shown_torque: float,
    output_position: float,
    output_velocity: float,
    locked: float,
    s: NDArray[np.float64],
    c: Constants,
) -> Signals:
    """Give the signals that effects take, SI; the current (A) is the one that the motor's drive believes in.

    time: s; positions: rad, velocities: rad/s, torques: N*m, each at its own shaft; locked: 1 or 0.
    """
    return Signals(
        time,
        motor_position,
        motor_velocity,
        motor_torque,
        shown_torque / c.torque_constant,
        output_position,
        output_velocity,
        s[GEAR_TEMPERATURE],
        s[WINDING_TEMPERATURE],
        locked,
        c.running_friction + c.running_viscous_friction * abs(motor_velocity),
    )


def friction_level(
    now: Signals,
    flexspline_torque: float,
    slip: float,
    s: NDArray[np.float64],
    effect_parameters: NDArray[np.float64],
    c: Constants,
) -> float:
    """Give the level of dry friction at the rim, N*m at the output.

    flexspline_torque: N*m. slip: rad in the last step; while the rim slides, effects may take as much of the viscous
    friction as there is, but dry and viscous friction together never drive.
    """
    if not FRICTION:
        return c.friction_torque
    added = c.ratio * friction_effects(now, flexspline_torque, 0.0, c.step, s, effect_parameters)
    return max(c.friction_torque + added, -c.rim_damping * abs(slip) / c.step)


def read_errors(
    now: Signals,
    output_torque: float,
    flexspline_torsion: float,
    period: float,
    s: NDArray[np.float64],
    effect_parameters: NDArray[np.float64],
) -> None:
    """Put the errors of the readings at the end of a tick into the state; a speed's is the change of its angle's.

    output_torque: N*m; flexspline_torsion: rad; period: s between ticks.
    """
    motor_angle, motor_torque, output_angle, output_torque_error = reading_errors(
        now, output_torque, flexspline_torsion, period, s, effect_parameters
    )
    s[MOTOR_VELOCITY_ERROR] = (motor_angle - s[MOTOR_POSITION_ERROR]) / period
    s[OUTPUT_VELOCITY_ERROR] = (output_angle - s[OUTPUT_POSITION_ERROR]) / period
    s[MOTOR_POSITION_ERROR], s[OUTPUT_POSITION_ERROR] = motor_angle, output_angle
    s[MOTOR_TORQUE_ERROR], s[OUTPUT_TORQUE_ERROR] = motor_torque, output_torque_error


def warm_up(current: float, dissipated: float, s: NDArray[np.float64], c: Constants) -> None:
    """Bring the temperatures (degC) up to date: the heat since the last tick warms the gear, the current the motor.

    current: A; dissipated: J since the start.
    """
    friction_power = (dissipated - s[HEAT_BEFORE]) / c.loop_period
    s[HEAT_BEFORE] = dissipated
    gear_end = c.ambient_temperature + c.gear_thermal_resistance * friction_power
    s[GEAR_TEMPERATURE] += c.gear_settling * (gear_end - s[GEAR_TEMPERATURE])
    winding_end = c.ambient_temperature + c.motor_thermal_resistance * c.winding_resistance * current * current
    s[WINDING_TEMPERATURE] += c.motor_settling * (winding_end - s[WINDING_TEMPERATURE])


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
    rim, slip, rim_force, error, open_error = s[RIM], s[SLIP], s[RIM_FORCE], s[ERROR], s[ERROR_OPEN]
    damper_F, damper_w = s[FLEXSPLINE_DAMPER], s[WAVE_GENERATOR_DAMPER]
    damper_m, damper_o, damper_l = s[MOTOR_DAMPER], s[OUTPUT_DAMPER], s[FIXTURE_DAMPER]
    motor_torque, shown_torque, load_torque = s[MOTOR_TORQUE], s[SHOWN_TORQUE], s[LOAD_TORQUE]
    torque_error = s[MOTOR_TORQUE_ERROR]
    T_F, last_T_F, T_w, fixture = s[T_F_NOW], s[T_F_BEFORE], s[T_W_NOW], s[FIXTURE_TORQUE]
    elastic = T_w + damper_w
    motor_force, output_force = s[MOTOR_FORCE], s[OUTPUT_FORCE]
    motor_extra, output_extra = s[MOTOR_EFFECTS], s[OUTPUT_EFFECTS]
    series = Series(s[SERIES_TORSION], s[SERIES_TORQUE], s[SERIES_ANGLE], s[SERIES_STIFFNESS], s[SERIES_COMPLIANCE])
    gap, pull = s[COUPLING_ANGLE], s[PULL]
    torsion, wound = theta_o - error - rim - series.angle, theta_m + c.ratio * rim + gap
    wait, motor_command, load_command = s[LOOP_WAIT], s[MOTOR_COMMAND], s[LOAD_COMMAND]
    motor_integral, load_integral = s[MOTOR_INTEGRAL], s[LOAD_INTEGRAL]
    owed, work, dissipated, effect_work = s[OWED], s[WORK], s[DISSIPATED], s[EFFECT_WORK]
    locked, lock_position = inputs[LOCKED], inputs[LOCK_POSITION]
    h = c.step
    half_m, half_o = 0.5 * h / c.motor_inertia, 0.5 * h / c.output_inertia
    rotor_loss = half_m * c.rotor_friction
    steep = STEEP * h

    for i in range(steps):
        if wait <= 0.0:
            wait = c.loop_steps
            current = 0.0 if inputs[MOTOR_MODE] == OFF else shown_torque / c.torque_constant
            warm_up(current, dissipated, s, c)
            motor_command, motor_integral, limited = drive_loop(
                inputs[MOTOR_MODE], inputs[MOTOR_TARGET], inputs[MOTOR_LIMIT],
                theta_m + s[MOTOR_POSITION_ERROR], omega_m + s[MOTOR_VELOCITY_ERROR], motor_integral,
                c.motor_position_gain, c.motor_velocity_gain, c.motor_integral_gain, c.motor_speed_limit, c.loop_period,
            )  # fmt: skip
            s[MOTOR_LIMITED] = max(s[MOTOR_LIMITED], limited)
            if inputs[MOTOR_MODE] == OFF:
                motor_command = torque_error  # without current the drive reads its error
            load_command, load_integral, limited = drive_loop(
                inputs[LOAD_MODE], inputs[LOAD_TARGET], inputs[LOAD_LIMIT], theta_o, omega_o, load_integral,
                c.load_position_gain, c.load_velocity_gain, c.load_integral_gain, c.load_speed_limit, c.loop_period,
            )  # fmt: skip
            s[LOAD_LIMITED] = max(s[LOAD_LIMITED], limited)
        wait -= 1.0
        motor_lag, load_lag = shown_torque - motor_command, load_torque - load_command
        motor_drive = motor_command + motor_lag * c.current_mean - torque_error
        load_drive = load_command + load_lag * c.current_mean
        shown_torque = motor_command + motor_lag * c.current_decay
        load_torque = load_command + load_lag * c.current_decay
        motor_torque = shown_torque - torque_error

        middle_m = brake(omega_m + half_m * (motor_drive + motor_force), rotor_loss)
        middle_o = omega_o + half_o * (load_drive + fixture + output_force)
        next_m, next_o = 2.0 * middle_m - omega_m, 2.0 * middle_o - omega_o
        theta_m += h * middle_m
        theta_o += h * middle_o

        fixture = -locked * (c.fixture_stiffness * (theta_o - lock_position) + c.fixture_damping * next_o)
        output_torque = load_torque + fixture
        time = (s[STEPS] + (i + 1)) * h
        now = signals_at(time, theta_m, next_m, motor_torque, shown_torque, theta_o, next_o, locked, s, c)
        level = friction_level(now, 2.0 * T_F - last_T_F, slip, s, effect_parameters, c)
        last_T_F, last_error, last_open = T_F, error, open_error
        error, slope, open_error, open_slope = torsion_effects(now, 0.0, 0.0, h, s, effect_parameters)
        open_change = open_error - last_open
        base, base_rate = theta_o - error, next_o - (slope - open_slope) * next_m
        if SERIES or COUPLED:
            last_series = series
            slip, rim_rate, T_F, T_w, series = move_rim_in_series(
                slip, series, rim, base, base_rate, theta_m, next_m, level, now, s, effect_parameters, c
            )
            keep_series(s)
        else:
            slip, rim_rate, T_F, T_w = move_rim(slip, rim, base, base_rate, theta_m, next_m, level, c)
        rim += slip
        last_torsion, torsion = torsion, base - rim - series.angle
        last_damper_F, damper_F = damper_F, c.flexspline_damping * (base_rate - rim_rate)
        last_damper_w, damper_w = damper_w, c.wave_generator_damping * (next_m + c.ratio * rim_rate)
        last_elastic, elastic = elastic, T_w + damper_w
        last_gap = gap
        if COUPLED:
            gap = coupling_angle(elastic, effect_parameters, c)
        last_wound, wound = wound, theta_m + c.ratio * rim + gap
        if abs(elastic - last_elastic) * c.C_w > steep or abs(T_F - last_T_F) * c.flexspline_stiffening > steep:
            stored = flexspline_energy(torsion, c) - flexspline_energy(last_torsion, c)
            owed += missed(stored, torsion - last_torsion, last_T_F - last_damper_F, T_F - damper_F)
            stored = wave_generator_energy(wound, c) - wave_generator_energy(last_wound, c)
            owed += missed(stored, wound - last_wound, -last_elastic, -elastic)
        last_pull, pull = pull, T_F * open_slope
        motor_force = T_w + T_F * slope
        if SERIES:
            series_pull = series.torque * series_slope(now, series.torque, series.torsion, h, s, effect_parameters)
            pull += series_pull
            motor_force += series_pull

        last_motor_extra, last_output_extra = motor_extra, output_extra
        motor_extra = motor_effects(now, output_torque, torsion, h, s, effect_parameters)
        output_extra = output_effects(now, output_torque, torsion, h, s, effect_parameters)
        motor_force = motor_force - motor_extra - c.rotor_viscous_friction * next_m
        output_force = -T_F - output_extra - c.output_viscous_friction * next_o
        last_m, last_o = omega_m, omega_o
        omega_m = brake(middle_m + half_m * (motor_drive + motor_force), rotor_loss)
        omega_o = middle_o + half_o * (load_drive + fixture + output_force)

        motor_travel, output_travel = h * middle_m, h * middle_o
        flexspline_travel = output_travel - (error - last_error) - slip
        wave_generator_travel = motor_travel + c.ratio * slip
        work += 0.5 * h * (motor_drive * (last_m + omega_m) + load_drive * (last_o + omega_o))
        effect_work += 0.5 * (
            (motor_extra + last_motor_extra) * motor_travel + (output_extra + last_output_extra) * output_travel
        )
        effect_work += 0.5 * ((T_F + last_T_F) * open_change - (pull + last_pull) * motor_travel)
        if SERIES:
            effect_work += 0.5 * (series.torque + last_series.torque) * (series.angle - last_series.angle)
        if COUPLED:
            effect_work += 0.5 * (elastic + last_elastic) * (gap - last_gap)
        last_rim_force, rim_force = rim_force, T_F + c.ratio * T_w
        if slip != 0.0:
            rim_force = level * math.copysign(1.0, slip) + c.rim_damping * rim_rate
        last_damper_m, last_damper_o, last_l = damper_m, damper_o, damper_l
        damper_m = c.rotor_viscous_friction * next_m
        damper_o = c.output_viscous_friction * next_o
        damper_l = locked * c.fixture_damping * next_o
        dissipated += 0.5 * (
            (last_rim_force + rim_force) * slip
            + (last_damper_F + damper_F) * flexspline_travel
            + (last_damper_w + damper_w) * wave_generator_travel
            + (last_damper_m + damper_m) * motor_travel
            + (last_damper_o + damper_o + last_l + damper_l) * output_travel
            + c.rotor_friction * h * abs(last_m + omega_m)
        )
        if owed != 0.0:
            factor = speed_factor(owed, omega_m, omega_o, c)
            if factor != 1.0:
                omega_m, omega_o, owed = factor * omega_m, factor * omega_o, 0.0
        if READINGS and wait <= 0.0:
            now = signals_at(time, theta_m, omega_m, motor_torque, shown_torque, theta_o, omega_o, locked, s, c)
            read_errors(now, output_torque, torsion, c.loop_period, s, effect_parameters)
            torque_error = s[MOTOR_TORQUE_ERROR]
            motor_torque = shown_torque - torque_error

    s[STEPS] += steps
    s[MOTOR_POSITION], s[MOTOR_VELOCITY] = theta_m, omega_m
    s[OUTPUT_POSITION], s[OUTPUT_VELOCITY] = theta_o, omega_o
    s[RIM], s[SLIP], s[RIM_FORCE], s[ERROR], s[ERROR_OPEN] = rim, slip, rim_force, error, open_error
    s[FLEXSPLINE_DAMPER], s[WAVE_GENERATOR_DAMPER] = damper_F, damper_w
    s[MOTOR_DAMPER], s[OUTPUT_DAMPER], s[FIXTURE_DAMPER] = damper_m, damper_o, damper_l
    s[SERIES_TORSION], s[SERIES_TORQUE], s[SERIES_ANGLE] = series.torsion, series.torque, series.angle
    s[SERIES_STIFFNESS], s[SERIES_COMPLIANCE] = series.stiffness, series.compliance
    s[COUPLING_ANGLE], s[PULL] = gap, pull
    s[MOTOR_TORQUE], s[SHOWN_TORQUE], s[LOAD_TORQUE] = motor_torque, shown_torque, load_torque
    s[T_F_NOW], s[T_F_BEFORE], s[T_W_NOW], s[FIXTURE_TORQUE] = T_F, last_T_F, T_w, fixture
    s[OUTPUT_TORQUE] = load_torque + fixture
    s[MOTOR_FORCE], s[OUTPUT_FORCE] = motor_force, output_force
    s[MOTOR_EFFECTS], s[OUTPUT_EFFECTS] = motor_extra, output_extra
    s[LOOP_WAIT], s[MOTOR_COMMAND], s[LOAD_COMMAND] = wait, motor_command, load_command
    s[MOTOR_INTEGRAL], s[LOAD_INTEGRAL] = motor_integral, load_integral
    s[OWED], s[WORK], s[DISSIPATED], s[EFFECT_WORK] = owed, work, dissipated, effect_work


def change_lock(
    locked: float,
    s: NDArray[np.float64],
    inputs: NDArray[np.float64],
    constants: NDArray[np.float64],
    effect_parameters: NDArray[np.float64],
) -> None:
    """Let the output's reading jump by what a fixture that opens or closes yields under the torque in the flexspline.

    The flange itself, the springs and their torques stay where they are.
    """
    c = unpack(constants)
    if not SERIES:
        return
    change = 0.0
    for sign, holds in ((1.0, locked), (-1.0, inputs[LOCKED])):
        now = signals_at(
            s[STEPS] * c.step, s[MOTOR_POSITION], s[MOTOR_VELOCITY], s[MOTOR_TORQUE], s[SHOWN_TORQUE],
            s[OUTPUT_POSITION], s[OUTPUT_VELOCITY], holds, s, c,
        )  # fmt: skip
        change += sign * series_effects(now, s[SERIES_TORQUE], s[SERIES_TORSION], c.step, s, effect_parameters)
    s[SERIES_ANGLE] += change
    s[OUTPUT_POSITION] += change


def start(
    s: NDArray[np.float64],
    inputs: NDArray[np.float64],
    constants: NDArray[np.float64],
    effect_parameters: NDArray[np.float64],
) -> None:
    """Put the state, zero but for its temperatures, at rest without torque, and take up what the effects do there."""
    c = unpack(constants)
    h = c.step
    now = signals_at(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, inputs[LOCKED], s, c)
    error, _, open_error, _ = torsion_effects(now, 0.0, 0.0, h, s, effect_parameters)
    angle = series_effects(now, 0.0, 0.0, h, s, effect_parameters)
    keep_series(s)
    s[ERROR], s[ERROR_OPEN], s[SERIES_ANGLE] = error, open_error, angle
    if COUPLED:
        s[RIM] = coupling_effects(0.0, effect_parameters)
        s[COUPLING_ANGLE] = coupling_angle(0.0, effect_parameters, c)
    s[OUTPUT_POSITION] = s[RIM] + error + angle
    now = signals_at(0.0, 0.0, 0.0, 0.0, 0.0, s[OUTPUT_POSITION], 0.0, inputs[LOCKED], s, c)
    friction_level(now, 0.0, 0.0, s, effect_parameters, c)
    s[MOTOR_EFFECTS] = motor_effects(now, 0.0, 0.0, h, s, effect_parameters)
    s[OUTPUT_EFFECTS] = output_effects(now, 0.0, 0.0, h, s, effect_parameters)
    s[MOTOR_FORCE] = -s[MOTOR_EFFECTS]
    s[OUTPUT_FORCE] = -s[OUTPUT_EFFECTS]
    read_errors(now, 0.0, 0.0, c.loop_period, s, effect_parameters)
    s[SHOWN_TORQUE] = s[MOTOR_TORQUE_ERROR]
    s[MOTOR_VELOCITY_ERROR] = s[OUTPUT_VELOCITY_ERROR] = 0.0

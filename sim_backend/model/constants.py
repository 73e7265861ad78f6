"""The numbers which the compiled plant works with, derived once from a PlantConfig. SI, each at its own shaft."""

import math
from collections.abc import Iterable
from typing import NamedTuple

from sim_backend.model.parameters import Cubic, Piecewise, PlantConfig


class Constants(NamedTuple):
    """Constants of one plant. A knee is where a spring goes on in a straight line: windup, torque, stiffness.

    A settling is the part of the way to its final temperature that a thermal node goes in one tick of the drive loops.
    a1, a3: of the cubic law (10); K1 to torsion_2: of the piecewise linear law (11) with the torsions at T1 and T2; 0
    where the flexspline has another law. flexspline_stiffening: largest d(ln K)/dT of the law it follows, 1/(N*m).
    """

    step: float
    ratio: float
    K_F0: float
    C_F: float
    flexspline_stiffening: float
    flexspline_knee: float
    flexspline_knee_torque: float
    flexspline_cap: float
    flexspline_damping: float
    K_w0: float
    C_w: float
    wave_generator_knee: float
    wave_generator_knee_torque: float
    wave_generator_cap: float
    wave_generator_damping: float
    friction_torque: float
    rim_damping: float
    near: float
    motor_inertia: float
    output_inertia: float
    output_viscous_friction: float
    rotor_friction: float
    rotor_viscous_friction: float
    running_friction: float
    running_viscous_friction: float
    torque_constant: float
    winding_resistance: float
    ambient_temperature: float
    gear_thermal_resistance: float
    gear_settling: float
    motor_thermal_resistance: float
    motor_settling: float
    fixture_stiffness: float
    fixture_damping: float
    current_decay: float
    current_mean: float
    loop_steps: float
    loop_period: float
    motor_position_gain: float
    motor_velocity_gain: float
    motor_integral_gain: float
    motor_speed_limit: float
    load_position_gain: float
    load_velocity_gain: float
    load_integral_gain: float
    load_speed_limit: float
    a1: float
    a3: float
    K1: float
    K2: float
    K3: float
    T1: float
    T2: float
    torsion_1: float
    torsion_2: float


def unpack(values: Iterable[float]) -> Constants:
    """Give the constants from their flat array; the compiled kernel has its own version of this."""
    return Constants(*values)


def derive(config: PlantConfig) -> Constants:
    """Give the constants of a plant.

    Loop gains follow from the inertias. Motor: velocity loop of 300 Hz, its integral and the position loop at a
    quarter of that; softer, a held motor would yield under a load by more than the wave generator's spring. Load: the
    velocity gain is as large as its own small inertia allows, 4000 rad/s; integral and position gain suit the inertia
    which it drags when the mesh slides, hundreds of times larger, and stay stable by Routh's criterion,
    P (I + Q P) > Q I J with velocity P, integral I and position gain Q: 3.25 P^3/J against 2.25 P^3/J.
    """
    drive = config.drive
    wave_generator_knee_torque = math.log(config.wave_generator_stiffness_cap / drive.K_w0) / drive.C_w
    flexspline = _flexspline(config)
    decay = math.exp(-config.step / config.current_loop_time)
    motor_bandwidth = 2.0 * math.pi * 300.0
    motor_velocity_gain = motor_bandwidth * config.motor_inertia
    load_velocity_gain = 4000.0 * config.output_inertia
    dragged_inertia = config.output_inertia + drive.ratio**2 * config.motor_inertia
    load_position_gain = load_velocity_gain / dragged_inertia
    return Constants(
        step=config.step,
        ratio=drive.ratio,
        K_F0=drive.K_F0,
        C_F=drive.C_F,
        flexspline_stiffening=flexspline.stiffening,
        flexspline_knee=flexspline.knee,
        flexspline_knee_torque=flexspline.knee_torque,
        flexspline_cap=config.flexspline_stiffness_cap,
        flexspline_damping=config.flexspline_damping,
        K_w0=drive.K_w0,
        C_w=drive.C_w,
        wave_generator_knee=(1.0 - drive.K_w0 / config.wave_generator_stiffness_cap) / (drive.C_w * drive.K_w0),
        wave_generator_knee_torque=wave_generator_knee_torque,
        wave_generator_cap=config.wave_generator_stiffness_cap,
        wave_generator_damping=config.wave_generator_damping,
        friction_torque=drive.friction_torque,
        rim_damping=drive.viscous_friction * drive.ratio**2,
        near=math.sqrt(_TORQUE_ACCURACY / (0.5 * drive.C_w / drive.ratio + flexspline.curvature)),
        motor_inertia=config.motor_inertia,
        output_inertia=config.output_inertia,
        output_viscous_friction=config.output_viscous_friction,
        rotor_friction=config.rotor_friction,
        rotor_viscous_friction=config.rotor_viscous_friction,
        running_friction=drive.friction_torque / drive.ratio + config.rotor_friction,
        running_viscous_friction=drive.viscous_friction + config.rotor_viscous_friction,
        torque_constant=config.torque_constant,
        winding_resistance=_winding_resistance(config),
        ambient_temperature=config.ambient_temperature,
        gear_thermal_resistance=config.gear_thermal_resistance,
        gear_settling=_settling(config.loop_period, config.gear_thermal_resistance * config.gear_heat_capacity),
        motor_thermal_resistance=config.motor_thermal_resistance,
        motor_settling=_settling(config.loop_period, config.motor_thermal_resistance * config.motor_heat_capacity),
        fixture_stiffness=config.fixture_stiffness,
        fixture_damping=config.fixture_damping,
        current_decay=decay,
        current_mean=(1.0 - decay) * config.current_loop_time / config.step,
        loop_steps=float(round(config.loop_period / config.step)),
        loop_period=config.loop_period,
        motor_position_gain=motor_bandwidth / 4.0,
        motor_velocity_gain=motor_velocity_gain,
        motor_integral_gain=motor_velocity_gain * motor_bandwidth / 4.0,
        motor_speed_limit=config.motor_speed_limit,
        load_position_gain=load_position_gain,
        load_velocity_gain=load_velocity_gain,
        load_integral_gain=2.25 * load_velocity_gain * load_position_gain,
        load_speed_limit=config.load_speed_limit,
        a1=flexspline.a1,
        a3=flexspline.a3,
        K1=flexspline.K1,
        K2=flexspline.K2,
        K3=flexspline.K3,
        T1=flexspline.T1,
        T2=flexspline.T2,
        torsion_1=flexspline.torsion_1,
        torsion_2=flexspline.torsion_2,
    )


class _Flexspline(NamedTuple):
    """What the chosen law needs. `curvature`: largest error of a linear step, N*m per (N*m)^2 of its residual.

    `stiffening`: 1/(N*m), largest d(ln K)/dT of its stiffness K over its torque T.
    """

    knee: float
    knee_torque: float
    curvature: float
    stiffening: float
    a1: float = 0.0
    a3: float = 0.0
    K1: float = 0.0
    K2: float = 0.0
    K3: float = 0.0
    T1: float = 0.0
    T2: float = 0.0
    torsion_1: float = 0.0
    torsion_2: float = 0.0


def _flexspline(config: PlantConfig) -> _Flexspline:
    drive, cap = config.drive, config.flexspline_stiffness_cap
    match config.flexspline:
        case None:
            slope = math.sqrt(cap / drive.K_F0 - 1.0)
            knee_torque = slope / drive.C_F
            curvature = drive.C_F**2 * knee_torque
            # 2 C_F^2 T / (1 + (C_F T)^2) is largest at T = 1/C_F
            return _Flexspline(math.atan(slope) / (drive.C_F * drive.K_F0), knee_torque, curvature, drive.C_F)
        case Cubic(a1, a3):
            knee = math.sqrt((cap - a1) / (3.0 * a3)) if a3 > 0.0 else math.inf
            knee_torque = knee * (a1 + a3 * knee**2) if a3 > 0.0 else math.inf
            # 3 a3 f / (a1 + 3 a3 f^2)^2 is largest at f = sqrt(a1 / (9 a3)), and d(ln K)/dT is twice that
            curvature = 9.0 / 16.0 * math.sqrt(a3 / a1**3)
            return _Flexspline(knee, knee_torque, curvature, 2.0 * curvature, a1, a3)
        case Piecewise(K1, K2, K3, T1, T2):
            first = T1 / K1
            second = first + (T2 - T1) / K2
            # K jumps at T1 and T2, where d(ln K)/dT has no bound: the jump is taken as spread over T1
            stiffening = max(abs(K2 / K1 - 1.0), abs(K3 / K2 - 1.0)) / T1
            return _Flexspline(
                knee=math.inf,
                knee_torque=math.inf,
                curvature=0.0,
                stiffening=stiffening,
                K1=K1,
                K2=K2,
                K3=K3,
                T1=T1,
                T2=T2,
                torsion_1=first,
                torsion_2=second,
            )


def _winding_resistance(config: PlantConfig) -> float:
    """Give the resistance of the winding, ohm; where it is not stated, that of a motor which the rating describes."""
    if config.winding_resistance is not None:
        return config.winding_resistance
    rated_current = config.motor_rated_torque / config.torque_constant
    return _RATED_WARMING / (config.motor_thermal_resistance * rated_current**2)


def _settling(period: float, time_constant: float) -> float:
    """Give the part of the way to its final temperature which a node goes in one period."""
    return -math.expm1(-period / time_constant)


_RATED_WARMING = 75.0
"""K above ambient of a motor at its rated torque for hours: from 25 degC to the 100 degC of an ordinary winding."""

_TORQUE_ACCURACY = 1e-10
"""N*m at the output: largest error of the linear last step of the rim's solution, from the springs' curvature."""

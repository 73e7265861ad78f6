"""Small effects of every kind that the plant's kernel takes, for its tests; they are in no catalogue."""

import dataclasses
import math

from sim_backend.model.effects import CATALOGUE, ActiveEffect, Effect, Energy, Enters, Parameter


def make(function, enters: Enters, *values: float, **changes) -> ActiveEffect:
    """Make an active effect of a function whose parameters take `values`."""
    memory = changes.get("memory", 0)
    names = function.__code__.co_varnames[: function.__code__.co_argcount]
    parameters = tuple(
        Parameter(name, "", -1e9, 1e9, value, (value, value), "of a test")
        for name, value in zip(names[len(names) - len(values) :], values, strict=True)
    )
    effect = dataclasses.replace(
        CATALOGUE["cogging"],
        id=function.__name__.replace("_", "-"),
        enters=enters,
        parameters=parameters,
        function=function,
        **{"energy": Energy.CONSERVATIVE, "memory": memory, **changes},
    )
    return ActiveEffect(effect, tuple(values))


def of_kind(effect: ActiveEffect, **changes) -> Effect:
    return dataclasses.replace(effect.effect, **changes)


# ---- in series with the flexspline


def spring(output_torque, compliance):
    return compliance * output_torque


def soft_spring(output_torque, amplitude, zone):
    return amplitude * math.tanh(output_torque / zone)


def slider(output_torque, step, memory, compliance, radius):
    memory[0] = min(max(memory[0], output_torque - radius), output_torque + radius)
    return compliance * memory[0]


def creeping(output_torque, step, memory, compliance, time_constant):
    """First-order lag, by the trapezoidal rule."""
    if memory[2] == 0.0:
        memory[0], memory[1], memory[2] = output_torque, output_torque, 1.0
    share = step / (2.0 * time_constant + step)
    memory[0] += share * (output_torque + memory[1] - 2.0 * memory[0])
    memory[1] = output_torque
    return compliance * memory[0]


def warm_spring(temperature, flexspline_torsion, amplitude, reference):
    return amplitude * (temperature - reference) * flexspline_torsion


def yielding_fixture(output_torque, locked, compliance):
    return compliance * output_torque * locked


def modulated_spring(output_torque, motor_position, amplitude, order):
    return amplitude * output_torque * math.sin(order * motor_position)


def modulated_spring_slope(output_torque, motor_position, amplitude, order):
    return 0.5 * amplitude * order * math.cos(order * motor_position) * output_torque


SERIES = {
    "spring": make(spring, Enters.TORSION, 5e-5),
    "soft-spring": make(soft_spring, Enters.TORSION, 3e-5, 0.8),
    "slider": make(slider, Enters.TORSION, 1e-5, 2.0, memory=1),
    "creeping": make(creeping, Enters.TORSION, 1e-5, 5e-3, memory=3),
    "warm-spring": make(warm_spring, Enters.TORSION, 0.02, 20.0),
    "yielding-fixture": make(yielding_fixture, Enters.TORSION, 2e-5),
    "modulated-spring": make(modulated_spring, Enters.TORSION, 2e-5, 3.0, slope=modulated_spring_slope),
}

# ---- in the torsion, whatever the torque


def gap(motor_position, step, memory, amplitude, ratio):
    memory[0] = min(max(memory[0], motor_position - amplitude), motor_position + amplitude)
    return (motor_position - memory[0]) / ratio


def gap_slope(motor_position, step, memory, amplitude, ratio):
    return 1.0 / ratio if abs(motor_position - memory[0]) < (1.0 - 1e-9) * amplitude else 0.0


def swelling(time, amplitude, rate):
    return amplitude * math.sin(rate * time)


GAP = make(gap, Enters.TORSION, 2e-3, 100.0, memory=1, slope=gap_slope)
SWELLING = make(swelling, Enters.TORSION, 1e-5, 30.0)

# ---- in the friction and in the balances


def friction_with_load(output_torque, amplitude, ratio):
    return amplitude * abs(output_torque) / ratio


def friction_at_rest(motor_velocity, amplitude, velocity):
    return amplitude * math.exp(-abs(motor_velocity) / velocity)


def friction_share(base_friction, amplitude):
    return amplitude * base_friction


def ripple(motor_torque, motor_position, amplitude, order):
    return amplitude * motor_torque * math.sin(order * motor_position)


def slow_pull(output_torque, step, memory, amplitude, time_constant):
    memory[0] += step / time_constant * (output_torque - memory[0])
    return amplitude * memory[0]


LOAD_FRICTION = make(friction_with_load, Enters.FRICTION, 0.1, 100.0, energy=Energy.DISSIPATIVE)
REST_FRICTION = make(friction_at_rest, Enters.FRICTION, 8e-3, 5.0, energy=Energy.DISSIPATIVE)
FRICTION_SHARE = make(friction_share, Enters.FRICTION, -0.5, energy=Energy.DISSIPATIVE)
RIPPLE = make(ripple, Enters.MOTOR_BALANCE, 0.02, 12.0, energy=Energy.ACTIVE)
SLOW_PULL = make(slow_pull, Enters.OUTPUT_BALANCE, 0.05, 0.1, memory=1, energy=Energy.ACTIVE)

# ---- in the readings


def eccentricity(motor_position, amplitude, order):
    return amplitude * math.sin(order * motor_position)


def output_eccentricity(output_position, amplitude):
    return amplitude * math.cos(output_position)


def shift(time, amplitude):
    return amplitude


def gain(output_torque, amplitude):
    return amplitude * output_torque


def lagging(output_torque, step, memory, time_constant):
    if memory[1] == 0.0:
        memory[0], memory[1] = output_torque, 1.0
    memory[0] += step / (time_constant + step) * (output_torque - memory[0])
    return memory[0] - output_torque


def wrong_constant(motor_torque, amplitude):
    return amplitude * motor_torque


def saturation(motor_current, amplitude, torque_constant):
    return amplitude * torque_constant * motor_current**3


def reading(function, reads: str, *values: float, **changes) -> ActiveEffect:
    return make(function, Enters.READING, *values, reads=reads, energy=Energy.NONE, **changes)


ECCENTRICITY = reading(eccentricity, "motor_position", 4e-4, 1.0)
OUTPUT_ECCENTRICITY = reading(output_eccentricity, "output_position", 4e-4)
TORQUE_OFFSET = reading(shift, "output_torque", 0.1)
TORQUE_GAIN = reading(gain, "output_torque", 0.02)
TORQUE_LAG = reading(lagging, "output_torque", 5e-3, memory=2)
CURRENT_OFFSET = reading(shift, "motor_torque", 2e-3)
WRONG_CONSTANT = reading(wrong_constant, "motor_torque", 0.1)
SATURATION = reading(saturation, "motor_torque", 1.0, 0.321)

"""Second formulas of the effects by catalogue id, in SI and contract signs, and what is present on a bench.

The formulas stand by place of action in `base_terms.py`, `transmission.py`, `balance.py` and `readings.py`. Each takes
its signals and parameters by name, over whole records of shape (n,); those that remember also take `time`.
The bench (`bench.py`) and the instruments (`instruments.py`) let them act where they act.
"""

import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tests.independent import balance, base_terms, readings, transmission
from tests.independent.draws import draw
from tests.independent.terms import Arm, Effects, Line, Term, term
from tests.independent.waves import rotating_vectors

__all__ = ["SECOND_FORMULAS", "SECOND_SLOPES", "Arm", "Effects", "Line", "Term", "draw", "term", "total", "total_slope"]

Floats = NDArray[np.float64]

KINEMATIC_ERROR = "kinematic-error"
COGGING = "cogging"
GRAVITY_LOAD = "gravity-load"

BASE: Mapping[str, Callable[..., Floats]] = MappingProxyType(
    {
        "flexspline-compliance": base_terms.flexspline_compliance,
        "wave-generator-compliance": base_terms.wave_generator_compliance,
        "coulomb-friction": base_terms.coulomb_friction,
        "viscous-friction": base_terms.viscous_friction,
        "inertia": base_terms.inertia,
    }
)

TORSION: Mapping[str, Callable[..., Floats]] = MappingProxyType(
    {
        KINEMATIC_ERROR: transmission.kinematic_error,
        "soft-windup": transmission.soft_windup,
        "backlash": transmission.backlash,
        "creep": transmission.creep,
        "maxwell-slip": transmission.maxwell_slip,
        "rate-dependent-hysteresis": transmission.rate_dependent_hysteresis,
        "stiffness-modulation": transmission.stiffness_modulation,
        "temperature-dependent-stiffness": transmission.temperature_dependent_stiffness,
        "fixture-compliance": transmission.fixture_compliance,
        "thermal-expansion": transmission.thermal_expansion,
    }
)

FRICTION: Mapping[str, Callable[..., Floats]] = MappingProxyType(
    {
        "stribeck-friction": balance.stribeck_friction,
        "load-dependent-friction": balance.load_dependent_friction,
        "position-dependent-friction": balance.position_dependent_friction,
        "temperature-dependent-friction": balance.temperature_dependent_friction,
    }
)

TORQUE: Mapping[str, Callable[..., Floats]] = MappingProxyType(
    {COGGING: balance.cogging, GRAVITY_LOAD: balance.gravity_load, "torque-ripple": balance.torque_ripple}
)

MOTOR_ANGLE: Mapping[str, Callable[..., Floats]] = MappingProxyType(
    {
        "motor-encoder-eccentricity": readings.motor_encoder_eccentricity,
        "encoder-missed-counts": readings.encoder_missed_counts,
    }
)

OUTPUT_ANGLE: Mapping[str, Callable[..., Floats]] = MappingProxyType(
    {
        "output-encoder-eccentricity": readings.output_encoder_eccentricity,
        "encoder-subdivision-error": readings.encoder_subdivision_error,
        "structural-resonance": transmission.structural_resonance,
    }
)

OUTPUT_TORQUE: Mapping[str, Callable[..., Floats]] = MappingProxyType(
    {
        "torque-sensor-offset": readings.torque_sensor_offset,
        "torque-sensor-drift": readings.torque_sensor_drift,
        "torque-sensor-gain": readings.torque_sensor_gain,
        "torque-sensor-nonlinearity": readings.torque_sensor_nonlinearity,
        "torque-sensor-lag": readings.torque_sensor_lag,
        "channel-delay": readings.channel_delay,
    }
)

MOTOR_TORQUE: Mapping[str, Callable[..., Floats]] = MappingProxyType(
    {
        "current-sensor-offset": readings.current_sensor_offset,
        "torque-constant-error": readings.torque_constant_error,
        "torque-constant-saturation": readings.torque_constant_saturation,
    }
)

SECOND_FORMULAS: Mapping[str, Callable[..., Floats]] = MappingProxyType(
    {**BASE, **TORSION, **FRICTION, **TORQUE, **MOTOR_ANGLE, **OUTPUT_ANGLE, **OUTPUT_TORQUE, **MOTOR_TORQUE}
)
"""By catalogue id: the effect as a function of its signals and parameters, by name."""

SECOND_SLOPES: Mapping[str, Callable[..., Floats]] = MappingProxyType(transmission.SLOPES)
"""By catalogue id: the torque with which an effect in the torsion helps to drive the motor, per N*m at the output."""


def total(ids: Iterable[str], effects: Effects, signals: Mapping[str, ArrayLike], shape: tuple[int, ...]) -> Floats:
    """Sum all instances of the effects `ids` that are present; each picks the signals that it names."""
    return _sum(SECOND_FORMULAS, ids, effects, signals, shape)


def total_slope(effects: Effects, signals: Mapping[str, ArrayLike], shape: tuple[int, ...]) -> Floats:
    """Sum the slopes of everything that is present."""
    return _sum(SECOND_SLOPES, SECOND_SLOPES, effects, signals, shape)


def kinematic_error(motor_position: ArrayLike, lines: Sequence[Line]) -> Floats:
    """Give the error that adds to the torsion, rad at the output."""
    return rotating_vectors(motor_position, lines)


def kinematic_error_slope(motor_position: ArrayLike, lines: Sequence[Line]) -> Floats:
    """Give d(error)/d(motor_position): the output torque times this helps to drive the motor."""
    return rotating_vectors(motor_position, lines, turned_ahead=True)


def cogging(motor_position: ArrayLike, lines: Sequence[Line]) -> Floats:
    """Give the motor torque needed to hold the rotor against its magnets, N*m, whatever current or direction."""
    return rotating_vectors(motor_position, lines)


def gravity_load(output_position: ArrayLike, arm: Arm) -> Floats:
    """Give the outside torque that would hold the arm, N*m."""
    return balance.gravity_load(output_position, arm.moment, arm.phase)


def _sum(
    formulas: Mapping[str, Callable[..., Floats]],
    ids: Iterable[str],
    effects: Effects,
    signals: Mapping[str, ArrayLike],
    shape: tuple[int, ...],
) -> Floats:
    added = np.zeros(shape)
    for effect_id in ids:
        for parameters in effects.of(effect_id):
            wanted = {name: signals[name] for name in _arguments(formulas[effect_id]) if name not in parameters}
            added = added + formulas[effect_id](**wanted, **parameters)
    return added


@cache
def _arguments(formula: Callable[..., Floats]) -> tuple[str, ...]:
    return tuple(inspect.signature(formula).parameters)

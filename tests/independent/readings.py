"""Second formulas of the instruments' errors: reading less truth, in the unit of the reading.

Functions take the true signals over whole records; those that remember take `time` (s, evenly spaced) first.
"""

import math

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import ArrayLike, NDArray

from tests.independent.memory import delayed, lagged
from tests.independent.waves import wave

Floats = NDArray[np.float64]


def motor_encoder_eccentricity(motor_position: ArrayLike, amplitude: float, order: float, phase: float) -> Floats:
    """Give the error of a disc beside its axis (order 1) or bent to an ellipse (order 2), rad at the motor."""
    return wave(motor_position, amplitude, order, phase)


def output_encoder_eccentricity(output_position: ArrayLike, amplitude: float, order: float, phase: float) -> Floats:
    """Give the same at the output, rad at the output."""
    return wave(output_position, amplitude, order, phase)


def encoder_subdivision_error(output_position: ArrayLike, amplitude: float, order: float, phase: float) -> Floats:
    """Give the error of interpolating between lines: `order` is the number of lines, or twice it; rad."""
    return wave(output_position, amplitude, order, phase)


def encoder_missed_counts(time: ArrayLike, amplitude: float, rate: float, seed: float, encoder_counts: float) -> Floats:
    """Give steps of +-`amplitude` counts at exponential intervals, `rate` a second; rad at the motor.

    The same seed gives the same events, by another generator than the model's: compare distributions, not times.
    """
    t = np.asarray(time, dtype=float)
    rng = np.random.default_rng(int(seed))
    duration = float(t[-1] - t[0]) if t.size else 0.0
    events = int(rng.poisson(rate * duration))
    at = np.sort(rng.uniform(0.0, duration, events)) + (float(t[0]) if t.size else 0.0)
    counts = np.concatenate([[0.0], np.cumsum(amplitude * rng.choice([-1.0, 1.0], events))])
    return counts[np.searchsorted(at, t, side="right")] * 2.0 * math.pi / encoder_counts


def torque_sensor_offset(output_torque: ArrayLike, amplitude: float) -> Floats:
    """Give what the unloaded transducer shows, N*m."""
    return np.full(np.shape(output_torque), amplitude)


def torque_sensor_drift(
    temperature: ArrayLike, time: ArrayLike, per_kelvin: float, per_second: float, reference: float
) -> Floats:
    """Give the zero's way since t = 0 at the reference temperature, N*m."""
    ways = np.stack([np.asarray(temperature, dtype=float) - reference, np.asarray(time, dtype=float)])
    return np.asarray(np.array([per_kelvin, per_second]) @ ways)


def torque_sensor_gain(output_torque: ArrayLike, amplitude: float) -> Floats:
    """Give what a transducer of sensitivity 1 + amplitude shows too much, N*m."""
    true = np.asarray(output_torque, dtype=float)
    return np.asarray((1.0 + amplitude) * true - true)


def torque_sensor_nonlinearity(output_torque: ArrayLike, even: float, odd: float, full_scale: float) -> Floats:
    """Give the deviation from the straight line, N*m; `even` and `odd` are its parts at full scale."""
    return np.asarray(
        Polynomial([0.0, 0.0, even, odd], domain=[-full_scale, full_scale])(np.asarray(output_torque, dtype=float))
    )


def torque_sensor_lag(time: ArrayLike, output_torque: ArrayLike, time_constant: float) -> Floats:
    """Give how far a first-order transducer stays behind, N*m."""
    return lagged(time, output_torque, time_constant) - np.asarray(output_torque, dtype=float)


def channel_delay(time: ArrayLike, output_torque: ArrayLike, delay: float) -> Floats:
    """Give what the torque was `delay` seconds ago less what it is, N*m."""
    return delayed(time, output_torque, delay) - np.asarray(output_torque, dtype=float)


def current_sensor_offset(motor_torque: ArrayLike, amplitude: float, torque_constant: float) -> Floats:
    """Give the torque which an offset of `amplitude` (A) feigns, N*m."""
    return np.full(np.shape(motor_torque), amplitude * torque_constant)


def torque_constant_error(motor_torque: ArrayLike, amplitude: float) -> Floats:
    """Give the error when k_t in the drive is 1 + amplitude times the true one: k_nominal i - k_true i, N*m."""
    true = np.asarray(motor_torque, dtype=float)
    nominal_over_true = 1.0 + amplitude
    return np.asarray(nominal_over_true * true - true)


def torque_constant_saturation(motor_current: ArrayLike, amplitude: float, torque_constant: float) -> Floats:
    """Give what the drive takes for torque but the saturated iron does not give: k_t0 i - k_t(i) i, N*m."""
    current = np.asarray(motor_current, dtype=float)
    saturated = torque_constant * (1.0 - amplitude * current**2)
    return np.asarray((torque_constant - saturated) * current)

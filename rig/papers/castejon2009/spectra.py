"""Lines of a kinematic error: over time, as the paper looks for them, and over the motor's angle."""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from sim_backend.model.fourier_error import whole_turns

Floats = NDArray[np.float64]

HIGHEST_ORDER = 10.0
"""Cycles per motor turn up to which a line is looked for."""


def amplitude_spectrum(values: Floats, period: float) -> tuple[Floats, Floats]:
    """Give frequencies (Hz) and amplitudes of a record sampled every `period` (s), without its mean or a window."""
    count = len(values)
    amplitude = np.abs(np.fft.rfft(values - np.mean(values))) * 2.0 / count
    return np.fft.rfftfreq(count, period).astype(np.float64), np.asarray(amplitude)


def highest_bin(values: Floats, period: float) -> float:
    """Give the frequency of the highest bin, Hz."""
    frequency, amplitude = amplitude_spectrum(values, period)
    return float(frequency[np.argmax(amplitude)])


def order_spectrum(motor_position: Floats, values: Floats, orders: Floats) -> Floats:
    """Give the amplitude at any `orders` (cycles per motor turn) over the record's whole turns.

    Samples count by the angle they stand for, under a Hann window, so that neither the ends nor the speed matter.
    """
    angle, value, _ = whole_turns(motor_position, values)
    share = (angle - angle[0]) / (angle[-1] - angle[0])
    window = (1.0 - np.cos(2.0 * math.pi * share)) * np.abs(np.gradient(angle))
    level = np.sum(window * value) / np.sum(window)
    waves = np.exp(-1j * np.multiply.outer(orders, angle))
    return np.asarray(2.0 * np.abs(waves @ (window * (value - level))) / np.sum(window))


def line_order(motor_position: Floats, values: Floats) -> float:
    """Give the order of the highest line, cycles per motor turn: between bins as well as on them."""
    turns = abs(float(motor_position[-1] - motor_position[0])) / (2.0 * math.pi)
    spacing = 0.5 / turns
    orders = np.arange(1.0 / turns, HIGHEST_ORDER, spacing)
    near = float(orders[np.argmax(order_spectrum(motor_position, values, orders))])
    found = minimize_scalar(
        lambda order: -float(order_spectrum(motor_position, values, np.array([order]))[0]),
        bounds=(near - spacing, near + spacing),
        method="bounded",
        options={"xatol": 1e-7},
    )
    return float(found.x)

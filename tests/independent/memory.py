"""What remembers, over whole records: lag, delay, oscillator. Signals are straight between their samples.

Every record starts at rest at its first value. Linear systems are turned into digital filters that are exact for
signals made of straight pieces (first-order hold); a delay is an interpolation.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.signal import cont2discrete, lfilter

Floats = NDArray[np.float64]

EVEN = 1e-6
"""Largest relative deviation of a period from the mean one; more would not be a digital filter's record."""


def lagged(time: ArrayLike, signal: ArrayLike, time_constant: float) -> Floats:
    """Give y with time_constant * dy/dt + y = signal, y(0) = signal(0). Time constant in s; 0 is no lag."""
    if time_constant == 0.0:
        return np.array(signal, dtype=float)
    return filtered(time, signal, [1.0], [time_constant, 1.0])


def delayed(time: ArrayLike, signal: ArrayLike, delay: float) -> Floats:
    """Give signal(t - delay); before the first sample the signal was at its first value. Delay in s."""
    t, u = np.asarray(time, dtype=float), np.asarray(signal, dtype=float)
    return np.interp(t - delay, t, u, left=float(u[0]))


def filtered(time: ArrayLike, signal: ArrayLike, numerator: Sequence[float], denominator: Sequence[float]) -> Floats:
    """Give the response of numerator(s)/denominator(s), in rest at the first value.

    Raises ValueError if the samples are not evenly spaced.
    """
    t, u = np.asarray(time, dtype=float), np.asarray(signal, dtype=float)
    if u.size < 2:
        return u * (numerator[-1] / denominator[-1])
    period = float(t[-1] - t[0]) / (t.size - 1)
    if np.max(np.abs(np.diff(t) - period)) > EVEN * period:
        raise ValueError("a lag needs evenly spaced samples")
    up, down, _ = cont2discrete((list(numerator), list(denominator)), period, method="foh")
    up = np.atleast_1d(np.squeeze(up))
    rest = numerator[-1] / denominator[-1]
    change = lfilter(np.atleast_1d(np.squeeze(up)), down, u - u[0])
    return np.asarray(rest * u[0] + change)

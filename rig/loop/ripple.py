"""Speed ripple of a free run: how the rotor moves about its constant speed where the motor torque has lines.

A drive holds its speed only as stiffly as its loop allows. A torque that repeats with the angle is then seen in the
motor torque less what the rotor takes up by moving,

    motor torque = disturbance + inertia * acceleration

Without it a torque that does not flip with direction seems to flip in part, because the loop's lag does.
The acceleration is taken from the motor position at the frequencies at which the motor torque has lines; elsewhere an
encoder shows its own counts beating with the sample rate. The position does not contain the torque to be predicted.
Damping and the springs behind the rotor also answer, by a few per cent of the inertia at 50 Hz and less above.
"""

import itertools

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

FEWEST_SAMPLES = 512
"""A shorter leg resolves no line."""

STANDS_OUT = 5.0
"""Times the median amplitude of the spectrum above which a line counts; noise reaches it once in 3e7 bins."""

MOST_LINES = 8

SLOWEST = 3
"""Bins from zero frequency below which a line is not told from a trend."""


def speed_ripple(time: Floats, position: Floats, torque: Floats, leg_speed: Floats) -> Floats:
    """Give the rotor's acceleration in the ripple, rad/s^2, shape (n,), zero without a line and outside legs.

    `time` s, `position` rad, `torque` N*m (or any measure of it), `leg_speed` rad/s, constant within a leg; all (n,).
    """
    found = np.zeros(time.size)
    edges = np.flatnonzero(np.diff(leg_speed, prepend=np.nan, append=np.nan) != 0)
    for start, stop in itertools.pairwise(edges.tolist()):
        if leg_speed[start] != 0.0 and stop - start >= FEWEST_SAMPLES:
            leg = slice(start, stop)
            found[leg] = _of_leg(time[leg] - time[start], position[leg], torque[leg])
    return found


def _of_leg(time: Floats, position: Floats, torque: Floats) -> Floats:
    still = np.zeros(time.size)
    steps = np.diff(time)
    period = float(np.median(steps))
    if np.any(np.abs(steps - period) > 0.01 * period):
        return still
    frequencies = _lines(torque, period)
    if not frequencies:
        return still
    scaled = 2.0 * time / time[-1] - 1.0
    trend = [np.ones_like(time), scaled, scaled**2]
    waves = [wave(2.0 * np.pi * f * time) for f in frequencies for wave in (np.sin, np.cos)]
    columns = np.stack([*trend, *waves], axis=1)
    amplitudes = np.linalg.lstsq(columns, position, rcond=None)[0][len(trend) :]
    for number, frequency in enumerate(frequencies):
        omega = 2.0 * np.pi * frequency
        pair = slice(2 * number, 2 * number + 2)
        still -= omega**2 * (np.stack(waves[pair], axis=1) @ amplitudes[pair])
    return still


def _lines(values: Floats, period: float) -> list[float]:
    """Give the frequencies (Hz) of the lines that stand out, strongest first."""
    window = np.hanning(values.size)
    offset = values - np.polyval(np.polyfit(np.arange(values.size), values, 1), np.arange(values.size))
    size = np.abs(np.fft.rfft(offset * window))
    level = STANDS_OUT * float(np.median(size))
    inner = np.arange(SLOWEST, size.size - 1)
    peak = inner[(size[inner] > level) & (size[inner] >= size[inner - 1]) & (size[inner] > size[inner + 1])]
    strongest = peak[np.argsort(size[peak])[::-1][:MOST_LINES]]
    found = []
    for k in strongest.tolist():
        a, b, c = np.log(size[k - 1 : k + 2] + 1e-300)
        found.append((k + 0.5 * (a - c) / (a - 2.0 * b + c)) / (values.size * period))
    return found

"""Speed ripple of a free run: how the rotor moves about its constant speed where the motor torque has lines.

A drive holds its speed only as stiffly as its loop allows. A torque that repeats with the angle is then seen in the
motor torque less what the rotor takes up by moving,

    motor torque = disturbance + inertia * acceleration + stiffness * position

(stiffness: of the springs behind the rotor). Without it a torque that does not flip with direction seems to flip in
part, because the loop's lag does. The motion is taken from the motor position at the frequencies at which the motor
torque has lines; elsewhere an encoder shows its own counts beating with the sample rate. The position does not contain
the torque to be predicted. A ripple is often a tenth of a count, so that how well it is known belongs to the result.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

FEWEST_SAMPLES = 512
"""A shorter leg resolves no line."""

STANDS_OUT = 5.0
"""Times the median amplitude of the spectrum above which a line counts; noise reaches it once in 3e7 bins."""

RESOLVED = 4.0
"""Times its own noise above which a line in the position counts as motion; noise reaches it once in 3000."""

MOST_LINES = 8

SLOWEST = 3
"""Bins from zero frequency below which a line is not told from a trend."""


@dataclass(frozen=True, slots=True)
class Ripple:
    """Motion of the rotor about its constant speed, each of shape (n,): zero without a line and outside legs.

    `acceleration` rad/s^2, `position` rad; `noise`: standard deviation (rad) of the sine and of the cosine amplitude of
    a line in the position, the same throughout a leg.
    """

    acceleration: Floats
    position: Floats
    noise: Floats

    def __getitem__(self, rows: NDArray[np.intp]) -> "Ripple":
        """Keep the samples `rows` (m,)."""
        return Ripple(self.acceleration[rows], self.position[rows], self.noise[rows])


def speed_ripple(time: Floats, position: Floats, torque: Floats, leg_speed: Floats) -> Ripple:
    """Give the rotor's ripple.

    `time` s, `position` rad, `torque` N*m (or any measure of it), `leg_speed` rad/s, constant within a leg; all (n,).
    """
    found = Ripple(np.zeros(time.size), np.zeros(time.size), np.zeros(time.size))
    edges = np.flatnonzero(np.diff(leg_speed, prepend=np.nan, append=np.nan) != 0)
    for start, stop in itertools.pairwise(edges.tolist()):
        if leg_speed[start] != 0.0 and stop - start >= FEWEST_SAMPLES:
            leg = slice(start, stop)
            of_leg = _of_leg(time[leg] - time[start], position[leg], torque[leg])
            if of_leg is not None:
                found.acceleration[leg], found.position[leg], found.noise[leg] = of_leg
    return found


def _of_leg(time: Floats, position: Floats, torque: Floats) -> tuple[Floats, Floats, float] | None:
    """Give acceleration and position (n,) of the ripple, and its noise; None where the torque has no line."""
    steps = np.diff(time)
    period = float(np.median(steps))
    if np.any(np.abs(steps - period) > 0.01 * period):
        return None
    frequencies = _lines(torque, period)
    if not frequencies:
        return None
    scaled = 2.0 * time / time[-1] - 1.0
    trend = [np.ones_like(time), scaled, scaled**2]
    waves = [wave(2.0 * np.pi * f * time) for f in frequencies for wave in (np.sin, np.cos)]
    columns = np.stack([*trend, *waves], axis=1)
    amplitudes = np.linalg.lstsq(columns, position, rcond=None)[0]
    left = position - columns @ amplitudes
    noise = float(np.sqrt(2.0 * np.mean(left**2) / time.size))
    acceleration, ripple = np.zeros(time.size), np.zeros(time.size)
    for number, frequency in enumerate(frequencies):
        pair = slice(len(trend) + 2 * number, len(trend) + 2 * number + 2)
        if float(np.hypot(*amplitudes[pair])) < RESOLVED * noise:
            continue
        wave = columns[:, pair] @ amplitudes[pair]
        ripple += wave
        acceleration -= (2.0 * np.pi * frequency) ** 2 * wave
    return acceleration, ripple, noise


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

"""Hums that do not start in step with the logs: a line over the time, in Hz, with a phase of its own in every run.

A fan, the mains or a neighbour's machine goes on between the runs. No term predicts it, and replicates take it for
noise. In a torque its power stands out of the spectrum at one frequency in most legs, whatever their speed: a line of
an angle would move with the speed. Angles are not looked at, because counts beat with the samples there.
"""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import gamma

from rig.loop.search.conditions import SPEED_STEP
from rig.loop.statements.residuals import Residual

Floats = NDArray[np.float64]

SURE = 1e-4
"""False-alarm probability of all frequencies of one equation and procedure together."""

LOWEST, FEWEST_PERIODS = 0.5, 10.0
"""Hz from which on a hum is looked for, and its periods in the shortest leg at least."""

FEWEST_LEGS, SHORTEST_LEG = 4, 4.0
"""Legs that are needed, and s of each at least."""

CLEAR, MOST = 3.0, 0.6
"""Times the spectrum around it by which it stands out of a leg, one in twenty by chance; and share of the legs."""

AROUND = 4.0
"""Hz of the pieces of the spectrum whose medians tell its noise."""

MATERIAL = 1.1**2 - 1.0
"""Share of the rest's squares that a hum has at least: what is smaller is no statement."""

OVERSAMPLED = 2
"""Frequencies per resolution of the longest leg."""


@dataclass(frozen=True, slots=True)
class Hum:
    """A hum of `frequency` (Hz) and rms amplitude over `legs` legs, in the equation's unit; `p_value` of all tests."""

    equation: str
    procedure: str
    frequency: float
    amplitude: float
    legs: int
    p_value: float


@dataclass(frozen=True, slots=True)
class _Leg:
    """The residual (m,) at places `rows` (m,) of its even grid, from the leg's start; `speed` rad/s, 0 of a sweep."""

    values: Floats
    rows: NDArray[np.intp]
    speed: float
    period: float

    @property
    def duration(self) -> float:
        return float(self.rows[-1]) * self.period


def hum_of(residuals: Sequence[Residual]) -> Hum | None:
    """Give the hum in what is left of one equation and procedure; None where none is sure.

    The power of every leg, over that of its noise, is summed: of noise alone that is a gamma variable with as many
    degrees of freedom as there are legs.
    """
    if not residuals or residuals[0].piece.demeaned:
        return None
    legs = [leg for residual in residuals for _, leg in _legs(residual) if leg.duration >= SHORTEST_LEG]
    moving = [abs(leg.speed) for leg in legs if leg.speed]
    if len(legs) < FEWEST_LEGS or (moving and not _several(moving)):
        return None
    power, noise, frequencies = _spectra(legs)
    if not frequencies.size:
        return None
    ratio = power / noise
    clear = ratio > CLEAR
    total = ratio.sum(axis=0)
    total[clear.mean(axis=0) < MOST] = 0.0
    best = int(np.argmax(total))
    tests = frequencies.size / OVERSAMPLED
    p_value = min(1.0, tests * float(gamma.sf(total[best], len(legs))))
    if p_value > SURE or (
        moving and not _several([abs(x.speed) for x, y in zip(legs, clear[:, best], strict=True) if y])
    ):
        return None
    sizes = np.array([leg.values.size for leg in legs], dtype=float)
    square = max(float(np.sum(power[:, best] - noise[:, best]) / np.sum(sizes)), 0.0) * 2.0
    rest = float(np.mean(np.concatenate([leg.values for leg in legs]) ** 2)) - square
    if square < MATERIAL * rest:
        return None
    piece = residuals[0].piece
    return Hum(
        equation=piece.equation.value,
        procedure=piece.track.procedure.value,
        frequency=_refined(legs, float(frequencies[best])),
        amplitude=math.sqrt(2.0 * square),
        legs=int(clear[:, best].sum()),
        p_value=p_value,
    )


def without_hum(residual: Residual, hum: Hum) -> Residual:
    """Take a hum from a residual, with a phase and a size of its own in every leg."""
    values = residual.values.copy()
    for place, leg in _legs(residual):
        angle = 2.0 * math.pi * hum.frequency * leg.period * leg.rows
        sines = np.column_stack([np.sin(angle), np.cos(angle)])
        if leg.duration * hum.frequency >= FEWEST_PERIODS:
            values[place] -= sines @ np.linalg.lstsq(sines, values[place] - values[place].mean(), rcond=None)[0]
    return replace(residual, values=values)


def _several(speeds: Sequence[float]) -> bool:
    """Whether speeds (rad/s) differ, so that a line of an angle would be at several frequencies."""
    return len(speeds) > 1 and max(speeds) > (1.0 + SPEED_STEP) * min(speeds)


def _legs(residual: Residual) -> Iterator[tuple[slice, _Leg]]:
    """Give the places in the residual of stretches of one speed, and what is left in them."""
    if residual.values.size < 2:
        return
    track = residual.piece.track
    rows = np.searchsorted(track.time, residual.time - 0.5 * track.period)
    speed = track.speed[np.minimum(rows, track.size - 1)]
    edges = np.flatnonzero(np.diff(speed, prepend=np.nan, append=np.nan) != 0.0)
    for start, stop in itertools.pairwise(edges.tolist()):
        place, own = slice(start, stop), rows[start:stop]
        yield place, _Leg(residual.values[place], own - own[0], float(speed[start]), track.period)


def _spectra(legs: Sequence[_Leg]) -> tuple[Floats, Floats, Floats]:
    """Give power and noise of every leg, (legs, f), of white noise the variance of a sample; frequencies (f,), Hz."""
    longest = OVERSAMPLED * max(leg.duration for leg in legs)
    highest = 0.5 / max(leg.period for leg in legs)
    lowest = max(LOWEST, FEWEST_PERIODS / min(leg.duration for leg in legs))
    frequencies = np.arange(math.ceil(lowest * longest), math.floor(0.98 * highest * longest)) / longest
    power, noise = np.zeros((len(legs), frequencies.size)), np.zeros((len(legs), frequencies.size))
    if not frequencies.size:
        return power, noise, frequencies
    edges = np.linspace(0, frequencies.size, max(1, round(float(np.ptp(frequencies)) / AROUND)) + 1).astype(int)
    middles = 0.5 * (edges[1:] + edges[:-1])
    for k, leg in enumerate(legs):
        grid = np.zeros(round(longest / leg.period))
        grid[leg.rows] = leg.values - leg.values.mean()
        spectrum = np.abs(np.fft.rfft(grid)) ** 2 / leg.values.size
        power[k] = spectrum[np.round(frequencies * leg.period * grid.size).astype(int)]
        medians = [np.median(power[k, start:stop]) for start, stop in itertools.pairwise(edges.tolist())]
        level = np.interp(np.arange(frequencies.size), middles, medians)
        noise[k] = np.maximum(level / math.log(2.0), 1e-300)
    return power, noise, frequencies


def _refined(legs: Sequence[_Leg], frequency: float) -> float:
    """Give the frequency (Hz) near another at which the legs have most power, to a twentieth of their resolution."""
    width = 1.0 / max(leg.duration for leg in legs)
    near = frequency + width * np.linspace(-0.5, 0.5, 21)
    power = np.zeros(near.size)
    for leg in legs:
        waves = np.exp(-2j * math.pi * leg.period * np.outer(near, leg.rows))
        power += np.abs(waves @ (leg.values - leg.values.mean())) ** 2 / leg.values.size
    return float(near[int(np.argmax(power))])

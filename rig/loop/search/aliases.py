"""Which orders a campaign cannot tell apart, because every leg samples them alike.

A leg at constant speed, or sampled at constant steps of the angle, takes S samples a revolution: orders k and m S +- k
look the same in it. At several speeds most of these differ from leg to leg; what remains in all of them is an alias.
It happens where all legs have one speed, where speeds are multiples of each other, and where the angle triggers the
samples.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.log.run import ProcedureName
from rig.loop.fitting.normal import LinearPiece
from rig.loop.model.equations import Equation
from rig.loop.signals.counts import count_of
from rig.loop.workers.held import Held

Floats = NDArray[np.float64]

FEWEST_SAMPLES = 50

WHOLE = 3.0
"""Resolutions within which an order counts as whole; teeth, poles and slots are whole."""

SPEED_ERROR = 2e-6
"""Relative error to which a leg's samples a revolution are known: about one count over a leg."""

MOST_STEPS = 20_000
"""Samples of a run by which its counts are told."""

HARMONICS = 3
"""Harmonics of an encoder's sawtooth that are looked at."""

HIGHEST_HARMONIC = 8
"""The highest of those that are looked at where a line is small enough to be one."""

SAWTOOTH = 1.3
"""How much larger than the line of a sawtooth one may come out, with noise, and still be its."""

LEAST_PASSING = 0.1
"""Counts a second below which a shaft is held."""

ALIKE_RATE, NOTICEABLE = 0.1, 0.05
"""Relative difference within which a rate of counts is a frequency, and the share of a sweep from which it is seen."""

DRIFT = 0.2
"""Cycles by which two orders may part over a leg and still look alike in it."""


@dataclass(frozen=True, slots=True)
class Sampling:
    """One leg: samples a revolution of the angle, the revolutions it covers, and samples a second."""

    per_turn: float
    turns: float
    rate: float


def samplings(items: Held[LinearPiece], variable: str) -> tuple[Sampling, ...]:
    """Give the sampling of every turning leg that has this angle; of the time none."""
    if variable == "time":
        return ()
    return tuple(leg for legs in items.map(_samplings, variable) for leg in legs)


def _samplings(item: LinearPiece, variable: str) -> list[Sampling]:
    position = item.evaluation.positions.get(variable)
    if position is None or not item.piece.track.moves:
        return []
    found: list[Sampling] = []
    speed = item.piece.track.speed[item.piece.index]
    for leg in np.unique(speed):
        angle = position[item.piece.index][speed == leg]
        step = float(np.abs(np.median(np.diff(angle)))) if angle.size >= FEWEST_SAMPLES else 0.0
        if step > 0.0:
            # the mean step is known far better than one count, as long as no gap lies between
            whole = np.abs(np.diff(angle)) < 2.0 * step
            mean = float(np.abs(np.mean(np.diff(angle)[whole])))
            found.append(
                Sampling(2.0 * np.pi / mean, float(np.ptp(angle)) / (2.0 * np.pi), 1.0 / item.piece.track.period)
            )
    return found


def alike(one: float, other: float, legs: Sequence[Sampling]) -> bool:
    """Whether no leg can tell two orders apart."""
    unsure = SPEED_ERROR * max(one, other)
    return bool(legs) and all(
        min(_away(one - other, leg), _away(one + other, leg)) < DRIFT / leg.turns + unsure for leg in legs
    )


def stands_still(order: float, legs: Sequence[Sampling]) -> bool:
    """Whether a line has the same phase at every sample of some leg, and so is no more than an offset of that leg."""
    return any(
        order > 0.5 * leg.per_turn and _away(order, leg) < DRIFT / leg.turns + SPEED_ERROR * order for leg in legs
    )


def aliases(order: float, highest: float, legs: Sequence[Sampling]) -> tuple[float, ...]:
    """Give the orders up to `highest` that look like `order` in every leg, lowest first, without itself."""
    if not legs:
        return ()
    finest = max(legs, key=lambda leg: leg.turns)
    most = int((highest + order) / finest.per_turn) + 1
    folded = {abs(sign * order + m * finest.per_turn) for m in range(-most, most + 1) for sign in (1.0, -1.0)}
    apart = 1.0 / finest.turns
    found = [k for k in sorted(folded) if 0.5 * apart < k <= highest and abs(k - order) > apart]
    return tuple(k for k in found if alike(k, order, legs))


def likeliest(order: float, others: Sequence[float], legs: Sequence[Sampling]) -> float:
    """Choose among orders that look alike: the lowest whole one, or the lowest of all where none is whole."""
    if not legs:
        return order
    width = WHOLE / max(leg.turns for leg in legs)
    every = sorted((order, *others))
    whole = [k for k in every if abs(k - round(k)) < min(width, 0.05) and round(k) > 0]
    return (whole or every)[0]


def beats(order: float, items: Held[LinearPiece], variable: str, legs: Sequence[Sampling]) -> bool:
    """Whether a line is an encoder's counts beating with the samples: a sawtooth of the angle, not a cause."""
    counts = _counts(items, variable)
    return counts is not None and any(alike(order, m * counts, legs) for m in range(1, HARMONICS + 1))


def small_beats(order: float, amplitude: float, items: Held[LinearPiece], variable: str, ratio: float) -> bool:
    """Whether a line of the torsion is no larger than a count makes it, and beats with the samples of any leg.

    order: of `variable`, in Hz of the time. amplitude: rad at the output. The sawtooth of a step q has lines of
    q / (m pi). Either encoder counts, also along the other's angle and the time; each leg folds the counts to another
    order. `ratio`: of the gear.
    """
    at_output = {"motor_position": 1.0 / ratio, "output_position": 1.0}
    for signal, share in at_output.items():
        counts = _counts(items, signal)
        if counts is None:
            continue
        along = signal if variable == "time" else variable
        per_turn = counts * at_output[along] / share
        first = SAWTOOTH * 2.0 * share / counts
        harmonics = [m for m in range(1, HIGHEST_HARMONIC + 1) if amplitude < first / m]
        for leg in samplings(items, along):
            seen = order * leg.per_turn / leg.rate if variable == "time" else order
            if any(alike(seen, m * per_turn, (leg,)) for m in harmonics):
                return True
    return False


def counts_pass(
    frequencies: Sequence[float], size: float, items: Held[LinearPiece], encoders: Mapping[str, tuple[float, float]]
) -> bool:
    """Whether an encoder's counts pass by at one of these (Hz) for a noticeable part of the sweeps.

    A slow sweep at a constant rate makes a sawtooth in time of the count, which is no resonance; what rings by more
    than a count is. `size`: rad at the output at most. `encoders`: counts per revolution, and what one of them is at
    the output (rad), by the signal of the angle.
    """
    for signal, (per_turn, count) in encoders.items():
        if size > count:
            continue
        seen = items.map(_passing, signal, per_turn, frequencies)
        passing, total = sum(near for near, _ in seen), sum(swept for _, swept in seen)
        if total and np.any(passing > NOTICEABLE * total):
            return True
    return False


def _passing(
    item: LinearPiece, signal: str, per_turn: float, frequencies: Sequence[float]
) -> tuple[NDArray[np.int_], int]:
    """Give at how many samples of a locked sweep counts pass at each frequency and harmonic, and at how many at all."""
    wanted = np.outer(frequencies, 1.0 / np.arange(1, HARMONICS + 1)).ravel()
    track, angle = item.piece.track, item.evaluation.signals.get(signal)
    swept = item.piece.equation is Equation.TORSION and track.procedure is ProcedureName.LOCKED_OUTPUT
    if not swept or angle is None or track.size <= 2:
        return np.zeros(wanted.size, dtype=np.int_), 0
    passing = np.abs(np.gradient(angle, track.time)) * per_turn / (2.0 * math.pi)
    passing = passing[passing > LEAST_PASSING]
    return np.array([np.sum(np.abs(passing / one - 1.0) < ALIKE_RATE) for one in wanted]), passing.size


def _counts(items: Held[LinearPiece], variable: str) -> float | None:
    """Give the counts per revolution that an angle comes in, None where no steps are seen."""
    count = count_of([steps for steps in items.map(_turned, variable) if steps is not None])
    return None if count is None else float(round(2.0 * math.pi / count))


def _turned(item: LinearPiece, variable: str) -> Floats | None:
    """Give the angle of a turning run, as many samples as tell its counts."""
    if not item.piece.track.moves or variable not in item.evaluation.positions:
        return None
    return item.evaluation.positions[variable][item.piece.index][:MOST_STEPS]


def _away(order: float, leg: Sampling) -> float:
    """Give how far an order is from a multiple of the samples a revolution."""
    return abs(order - leg.per_turn * round(order / leg.per_turn))

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

from rig.loop.fitting.normal import LinearPiece
from rig.loop.signals.counts import count_of

FEWEST_SAMPLES = 50

WHOLE = 3.0
"""Resolutions within which an order counts as whole; teeth, poles and slots are whole."""

SPEED_ERROR = 2e-6
"""Relative error to which a leg's samples a revolution are known: about one count over a leg."""

HARMONICS = 3
"""Harmonics of an encoder's sawtooth that are looked at."""

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
    """One leg: samples a revolution of the angle, and the revolutions it covers."""

    per_turn: float
    turns: float


def samplings(items: Sequence[LinearPiece], variable: str) -> tuple[Sampling, ...]:
    """Give the sampling of every turning leg that has this angle; of the time none."""
    found: list[Sampling] = []
    if variable == "time":
        return ()
    for item in items:
        position = item.evaluation.positions.get(variable)
        if position is None or not item.piece.track.moves:
            continue
        speed = item.piece.track.speed[item.piece.index]
        for leg in np.unique(speed):
            angle = position[item.piece.index][speed == leg]
            step = float(np.abs(np.median(np.diff(angle)))) if angle.size >= FEWEST_SAMPLES else 0.0
            if step > 0.0:
                # the mean step is known far better than one count, as long as no gap lies between
                whole = np.abs(np.diff(angle)) < 2.0 * step
                mean = float(np.abs(np.mean(np.diff(angle)[whole])))
                found.append(Sampling(2.0 * np.pi / mean, float(np.ptp(angle)) / (2.0 * np.pi)))
    return tuple(found)


def alike(one: float, other: float, legs: Sequence[Sampling]) -> bool:
    """Whether no leg can tell two orders apart."""
    unsure = SPEED_ERROR * max(one, other)
    return bool(legs) and all(
        min(_away(one - other, leg), _away(one + other, leg)) < DRIFT / leg.turns + unsure for leg in legs
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


def beats(order: float, items: Sequence[LinearPiece], variable: str, legs: Sequence[Sampling]) -> bool:
    """Whether a line is an encoder's counts beating with the samples: a sawtooth of the angle, not a cause."""
    counts = _counts(items, variable)
    return counts is not None and any(alike(order, m * counts, legs) for m in range(1, HARMONICS + 1))


def small_beats(
    order: float, amplitude: float, items: Sequence[LinearPiece], variable: str, legs: Sequence[Sampling]
) -> bool:
    """Whether a line of the torsion is no larger than a count makes it, and beats with the samples of the longest leg.

    amplitude: rad at the output. The sawtooth of a step q has lines of q / (m pi). Either encoder counts, also along
    the other's angle; other legs need not show it, as each folds the counts to another order.
    """
    if not legs or not items:
        return False
    longest = max(legs, key=lambda leg: leg.turns)
    at_output = {"motor_position": 1.0 / items[0].evaluation.ratio, "output_position": 1.0}
    for signal, share in at_output.items():
        counts = _counts(items, signal)
        if counts is None:
            continue
        step, per_turn = 2.0 * math.pi * share / counts, counts * at_output[variable] / share
        for m in range(1, HARMONICS + 1):
            if amplitude < SAWTOOTH * step / (m * math.pi) and alike(order, m * per_turn, (longest,)):
                return True
    return False


def counts_pass(frequency: float, items: Sequence[LinearPiece], counts: Mapping[str, float]) -> bool:
    """Whether an encoder's counts pass by at this frequency (Hz) for a noticeable part of the sweeps.

    A slow sweep at a constant rate makes a sawtooth in time of the count, which is no resonance. `counts`: per
    revolution, by the signal of the angle.
    """
    for signal, per_turn in counts.items():
        rates = [
            np.abs(np.gradient(item.evaluation.signals[signal], item.piece.track.time))
            for item in items
            if not item.piece.track.moves and signal in item.evaluation.signals and item.piece.track.size > 2
        ]
        passing = np.concatenate(rates or [np.zeros(0)]) * per_turn / (2.0 * math.pi)
        passing = passing[passing > LEAST_PASSING]
        for harmonic in range(1, HARMONICS + 1):
            if passing.size and np.mean(np.abs(harmonic * passing / frequency - 1.0) < ALIKE_RATE) > NOTICEABLE:
                return True
    return False


def _counts(items: Sequence[LinearPiece], variable: str) -> float | None:
    """Give the counts per revolution that an angle comes in, None where no steps are seen."""
    turning = [item for item in items if item.piece.track.moves and variable in item.evaluation.positions]
    count = count_of([item.evaluation.positions[variable][item.piece.index] for item in turning])
    return None if count is None else float(round(2.0 * math.pi / count))


def _away(order: float, leg: Sampling) -> float:
    """Give how far an order is from a multiple of the samples a revolution."""
    return abs(order - leg.per_turn * round(order / leg.per_turn))

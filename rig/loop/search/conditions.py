"""Whether a fitted term shows under every condition: in every equation and procedure, and at every speed.

What explains much in one procedure and nothing in another is not what it is called.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.log.run import ProcedureName
from rig.loop.fitting.fit import Fit
from rig.loop.fitting.normal import LinearPiece
from rig.loop.model.equations import Equation
from rig.loop.model.terms import Line

Floats = NDArray[np.float64]

SPEED_STEP = 0.05
"""Relative difference of speeds that are told apart."""

LEAST_EXPECTED = 10.0
"""Weighted squares that a term must be expected to explain under a condition before that condition has a say."""

UNSURE = 2.0
"""Standard deviations by which a term may explain less than half of what it should."""

PHASES, MOST_PHASES = 8, 6
"""Parts into which a line's period is divided, and how many of them a condition must have seen to have a say."""

_Condition = tuple[Equation, ProcedureName, int | None]
"""Equation, procedure and, where the run turns, the band of its speed."""


def consistent(fit: Fit, number: int) -> bool:
    """Tell whether a fitted line explains at least half of what it should under every condition that should show it.

    A condition is an equation, a procedure and, where the run turns, a speed. It has a say if it has seen most phases
    of the line: at a few held angles any other line may add to it or take from it. The scatter between its blocks of
    time tells by how much noise, also such that remembers, may hide the term there.
    """
    return all(_line_shows(fit, number).values())


def followed_up_to(fit: Fit, number: int) -> float | None:
    """Give the speed (rad/s at the motor) up to which a fitted torque line shows in free runs.

    None unless it shows everywhere but in the free runs that are faster than all those in which it shows.
    """
    shows = _line_shows(fit, number)
    free = {
        band: shown
        for (equation, procedure, band), shown in shows.items()
        if procedure is ProcedureName.FREE_RUN and equation is not Equation.TORSION and band is not None
    }
    seen, missed = [band for band, shown in free.items() if shown], [band for band, shown in free.items() if not shown]
    if not seen or not missed or max(seen) > min(missed) or sum(not shown for shown in shows.values()) > len(missed):
        return None
    return math.exp(SPEED_STEP * max(seen))


def _line_shows(fit: Fit, number: int) -> dict[_Condition, bool]:
    line = fit.model.lines[number]
    found = fit.linear.map(_line_says, line, fit.columns.of_line(number))
    phases: dict[_Condition, set[int]] = {}
    for said in found:
        for condition, share in said.items():
            phases.setdefault(condition, set()).update(share.phases)
    return _shows(found, {condition for condition, seen in phases.items() if len(seen) >= MOST_PHASES})


def consistent_shape(fit: Fit, number: int) -> bool:
    """Tell the same of a fitted effect that is no line; every condition has a say."""
    term, place = fit.model.shapes[number], fit.columns.of_shape(number)
    weights = np.array([0.0 if term.is_logarithmic(k) else term.values[k] for k in term.free])
    return all(_shows(fit.linear.map(_shape_says, place, weights), None).values())


@dataclass(frozen=True, slots=True)
class _Share:
    """Squares that a term should explain and does explain under a condition, and the phases of a line that were seen.

    `variance`: of what it does explain, from its blocks of time.
    """

    expected: float
    actual: float
    variance: float
    phases: frozenset[int]


_Said = dict[_Condition, _Share]


def _line_says(item: LinearPiece, line: Line, place: slice) -> _Said:
    column = line.sine * item.jacobian[:, place.start] + line.cosine * item.jacobian[:, place.start + 1]
    position = item.evaluation.positions.get(line.kind.variable)
    phases = None
    if position is not None:
        turns = line.order * position[item.piece.index] / (2.0 * math.pi)
        phases = np.floor(PHASES * (turns % 1.0)).astype(int)
    return _says(item, column, phases)


def _shape_says(item: LinearPiece, place: slice, weights: Floats) -> _Said:
    return _says(item, item.jacobian[:, place] @ weights, None)


def _says(item: LinearPiece, column: Floats, phases: NDArray[np.int_] | None) -> _Said:
    expected = item.weight * column**2
    more = 2.0 * item.weight * column * item.residual
    return {
        condition: _Share(
            float(expected[mine].sum()),
            float(more[mine].sum() + expected[mine].sum()),
            float(np.sum(item.block_sums(np.where(mine, more, 0.0)) ** 2)),
            frozenset() if phases is None else frozenset(np.unique(phases[mine]).tolist()),
        )
        for condition, mine in _conditions(item)
    }


def _shows(found: Sequence[_Said], judged: set[_Condition] | None) -> dict[_Condition, bool]:
    """Tell whether a term explains half of what it should wherever it should show, as far as noise lets one tell.

    `judged`: conditions that have a say, None for all.
    """
    sums: dict[_Condition, Floats] = {}
    for said in found:
        for condition, share in said.items():
            sums.setdefault(condition, np.zeros(3))
            sums[condition] += (share.expected, share.actual, share.variance)
    total = sum(float(expected) for expected, _, _ in sums.values())
    return {
        condition: bool(actual + _unsure(condition, judged) * math.sqrt(variance) >= 0.5 * expected)
        for condition, (expected, actual, variance) in sums.items()
        if expected > max(LEAST_EXPECTED, 0.02 * total) and (judged is None or condition in judged)
    }


def _unsure(condition: _Condition, judged: set[_Condition] | None) -> float:
    """Give the standard deviations that a term may miss: a line none where a speed tells it from beating counts."""
    return 0.0 if judged is not None and condition[2] is not None else UNSURE


def _conditions(item: LinearPiece) -> Iterator[tuple[_Condition, NDArray[np.bool_]]]:
    """Give the conditions of a piece, equation with procedure and speed of the leg, and the samples (m,) taken in each.

    Counting an angle at constant speed beats with the sampling and leaves lines that no other speed shows.
    """
    track, equation = item.piece.track, item.piece.equation
    if not track.moves:
        yield (equation, track.procedure, None), np.ones(item.residual.size, dtype=bool)
        return
    speed = np.abs(track.speed[item.piece.index])
    band = np.round(np.log(np.maximum(speed, 1e-9)) / SPEED_STEP).astype(int)
    for number in np.unique(band).tolist():
        yield (equation, track.procedure, number), band == number

"""How much a further term would explain: gain, its significance whatever the noise, and leave-one-run-out.

The test statistic is Hotelling's T**2 of the term's scores summed over blocks of time, the base model projected out.
If the blocks' noise is symmetric about zero and independent between blocks (colour inside a block, heavy tails and
noise that grows with load are all allowed), then for any number of blocks

    P(T**2 > x) <= 2 e**3 / 9 * P(chi2_d > x)

so that no bootstrap is needed and a p-value may be as small as the number of tests demands.
Source: Pinelis, "Extremal probabilistic problems and Hotelling's T2 test under a symmetry condition", Ann. Statist.
22 (1994) 357-368.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from rig.log.run import ProcedureName
from rig.loop.fitting.fit import Fit
from rig.loop.fitting.normal import LinearPiece, solve
from rig.loop.model.equations import Equation
from rig.loop.model.terms import Entry, TermClass, line_derivatives

Floats = NDArray[np.float64]

PINELIS = 2.0 * math.e**3 / 9.0
"""Constant of the bound on the tail."""

ABSORBED = 1e-6
"""A term of which the base leaves less than this share of its squares is not a term of its own."""

SPEED_STEP = 0.05
"""Relative difference of speeds that are told apart."""

LEAST_EXPECTED = 10.0
"""Weighted squares that a term must be expected to explain under a condition before that condition has a say."""


PHASES, MOST_PHASES = 8, 6
"""Parts into which a line's period is divided, and how many of them a condition must have seen to have a say."""

_Condition = tuple[Equation, str]


@dataclass(frozen=True, slots=True)
class Trial:
    """One candidate on top of a fit.

    `gain`: reduction of the weighted squares. `statistic`: T**2 with `columns` degrees of freedom. `amplitudes` (k,).
    `shares`: relative reduction of the squares of every equation, in the procedure where it is largest. `improved`:
    share of the runs that carry the term which are better predicted from the others with it; `pays`: relative reduction
    of the squares left out.
    """

    label: str
    gain: float
    statistic: float
    columns: int
    amplitudes: Floats
    shares: Mapping[Equation, float]
    improved: float
    pays: float

    @property
    def share(self) -> float:
        """Largest relative reduction of the squares of one equation."""
        return max(self.shares.values(), default=0.0)

    def share_of(self, equation: Equation) -> float:
        """Give the relative reduction in one equation; of the best one where that equation is not there."""
        return self.shares.get(equation, self.share)

    @property
    def single_p(self) -> float:
        """Bound on the p-value of this candidate alone."""
        return min(1.0, PINELIS * float(chi2.sf(self.statistic, self.columns)))


@dataclass(frozen=True, slots=True)
class Ground:
    """What all trials on one fit share: inverse of the normal matrix, block sums of the base's scores, base folds."""

    fit: Fit
    inverse: Floats
    base_scores: tuple[Floats, ...]
    block_count: int


def prepare(fit: Fit) -> Ground:
    """Compute what all trials on `fit` share."""
    A = fit.normal.A.sum(axis=0) + np.diag(fit.prior)
    scores = tuple(item.block_sums(item.jacobian * (item.weight * item.residual)[:, None]) for item in fit.linear)
    count = 1 + max((int(item.blocks.max()) for item in fit.linear), default=0)
    return Ground(fit, solve(A, np.eye(A.shape[0])), scores, count)


def line_columns(item: LinearPiece, kind: TermClass, order: float) -> Floats | None:
    """Give sine and cosine column (m, 2) of a line in one piece, centred; None if the line does not act there."""
    position = item.evaluation.positions.get(kind.variable)
    if position is None or not acts(item, kind):
        return None
    columns = item.evaluation.columns(kind, line_derivatives(order, position), item.piece.index)
    return item.centred(np.column_stack(columns))


def acts(item: LinearPiece, kind: TermClass) -> bool:
    """Whether a term of this kind has a column in the piece."""
    entry, evaluation = kind.entry, item.evaluation
    if entry.is_angle:
        reacts = entry in (Entry.TORSION, Entry.TORSION_TIMES_TORQUE) and evaluation.motor is not None
        return evaluation.angle or (reacts and bool(np.any(evaluation.torque)))
    if entry is Entry.MOTOR_AGAINST_MOTION:
        return evaluation.friction is not None
    return (evaluation.load if entry.equation is Equation.OUTPUT_TORQUE else evaluation.motor) is not None


def try_columns(ground: Ground, label: str, columns: Sequence[Floats | None], *, ridge: float = 0.0) -> Trial:
    """Score a candidate given by its columns (m, k) in every piece of the fit (None: it does not act there).

    `ridge`: share of its own information that each column has as a prior at zero when runs are left out: the run that
    is left out may be the only one to hold a part of a curve.
    """
    fit = ground.fit
    size = next((c.shape[1] for c in columns if c is not None), 0)
    if size == 0:
        return _nothing(label, 1)
    runs = len(fit.normal.runs)
    cross = np.zeros((runs, size, fit.columns.size))
    own, pull = np.zeros((runs, size, size)), np.zeros((runs, size))
    blocks = np.zeros((ground.block_count, size))
    for item, column in zip(fit.linear, columns, strict=True):
        if column is None:
            continue
        row = fit.normal.runs.index(item.piece.track.name)
        weighted = item.weight * column
        cross[row] += weighted.T @ item.jacobian
        own[row] += weighted.T @ column
        scores = weighted * item.residual[:, None]
        pull[row] += scores.sum(axis=0)
        np.add.at(blocks, item.blocks, item.block_sums(scores))
    total_cross = cross.sum(axis=0)
    projector = total_cross @ ground.inverse
    for item, base in zip(fit.linear, ground.base_scores, strict=True):
        np.add.at(blocks, item.blocks, -base @ projector.T)
    schur = own.sum(axis=0) - projector @ total_cross.T
    score = pull.sum(axis=0) - projector @ (fit.normal.g.sum(axis=0) + fit.pull)
    if np.any(np.diag(schur) <= ABSORBED * np.diag(own.sum(axis=0))):
        return _nothing(label, size)
    amplitudes = solve(schur, score)
    summed = blocks.sum(axis=0)
    statistic = float(summed @ solve(blocks.T @ blocks, summed))
    shares, carrying = _where(ground, columns, projector, amplitudes)
    left, without = _leave_out(fit, cross, own, pull, ridge * np.diag(own.sum(axis=0)))
    total = float(without[carrying].sum())
    return Trial(
        label=label,
        gain=float(score @ amplitudes),
        statistic=statistic,
        columns=size,
        amplitudes=amplitudes,
        shares=shares,
        improved=float(np.mean(left[carrying] < without[carrying])) if carrying.any() else 0.0,
        pays=1.0 - float(left[carrying].sum()) / total if total > 0 else 0.0,
    )


def _nothing(label: str, size: int) -> Trial:
    return Trial(label, 0.0, 0.0, size, np.zeros(size), {}, 0.0, 0.0)


def _where(
    ground: Ground, columns: Sequence[Floats | None], projector: Floats, amplitudes: Floats
) -> tuple[dict[Equation, float], NDArray[np.bool_]]:
    """Give the share of every equation's squares that is explained, and which runs carry the term.

    The share is that of the procedure in which it is largest: what acts in one need not hide behind the others.
    """
    fit = ground.fit
    expected_run = np.zeros(len(fit.normal.runs))
    by_procedure: dict[tuple[Equation, ProcedureName], list[float]] = {}
    for item, column in zip(fit.linear, columns, strict=True):
        explained = -(item.jacobian @ (projector.T @ amplitudes))
        if column is not None:
            explained = explained + column @ amplitudes
        expected = item.weight * float(explained @ explained)
        expected_run[fit.normal.runs.index(item.piece.track.name)] += expected
        sums = by_procedure.setdefault((item.piece.equation, item.piece.track.procedure), [0.0, 0.0])
        sums[0] += 2.0 * item.weight * float(explained @ item.residual) - expected
        sums[1] += item.weight * float(item.residual @ item.residual)
    total = float(expected_run.sum())
    shares: dict[Equation, float] = {}
    for (equation, _), (actual, squares) in by_procedure.items():
        if squares > 0:
            shares[equation] = max(shares.get(equation, -math.inf), actual / squares)
    return shares, expected_run >= 0.2 * total / expected_run.size


def consistent(fit: Fit, number: int) -> bool:
    """Tell whether a fitted line explains at least half of what it should under every condition that should show it.

    A condition is an equation, a procedure and, where the run turns, a speed. It has a say if it has seen most phases
    of the line: at a few held angles any other line may add to it or take from it.
    """
    line, place = fit.model.lines[number], fit.columns.of_line(number)
    columns = [
        line.sine * x.jacobian[:, place.start] + line.cosine * x.jacobian[:, place.start + 1] for x in fit.linear
    ]
    phases: dict[_Condition, set[int]] = {}
    for item in fit.linear:
        position = item.evaluation.positions.get(line.kind.variable)
        if position is None:
            continue
        turns = line.order * position[item.piece.index] / (2.0 * math.pi)
        seen = np.floor(PHASES * (turns % 1.0)).astype(int)
        for condition, mine in _conditions(item):
            phases.setdefault(condition, set()).update(np.unique(seen[mine]).tolist())
    judged = {condition for condition, seen_there in phases.items() if len(seen_there) >= MOST_PHASES}
    return _explains(fit, columns, judged)


def consistent_shape(fit: Fit, number: int) -> bool:
    """Tell the same of a fitted effect that is no line; every condition has a say."""
    term, place = fit.model.shapes[number], fit.columns.of_shape(number)
    weights = np.array([0.0 if term.is_logarithmic(k) else term.values[k] for k in term.free])
    return _explains(fit, [item.jacobian[:, place] @ weights for item in fit.linear], None)


def _explains(fit: Fit, columns: Sequence[Floats], judged: set[_Condition] | None) -> bool:
    """Whether `columns`, one (m,) for every piece, explain half of what they should under every condition `judged`."""
    found: dict[_Condition, list[float]] = {}
    for item, column in zip(fit.linear, columns, strict=True):
        expected = item.weight * column**2
        actual = 2.0 * item.weight * column * item.residual + expected
        for condition, mine in _conditions(item):
            sums = found.setdefault(condition, [0.0, 0.0])
            sums[0] += float(expected[mine].sum())
            sums[1] += float(actual[mine].sum())
    total = sum(expected for expected, _ in found.values())
    return all(
        actual >= 0.5 * expected
        for condition, (expected, actual) in found.items()
        if expected > max(LEAST_EXPECTED, 0.02 * total) and (judged is None or condition in judged)
    )


def _conditions(item: LinearPiece) -> Iterator[tuple[_Condition, NDArray[np.bool_]]]:
    """Give the conditions of a piece, equation with procedure and speed of the leg, and the samples (m,) taken in each.

    Counting an angle at constant speed beats with the sampling and leaves lines that no other speed shows.
    """
    track, equation = item.piece.track, item.piece.equation
    if not track.moves:
        yield (equation, track.procedure.value), np.ones(item.residual.size, dtype=bool)
        return
    speed = np.abs(track.speed[item.piece.index])
    band = np.round(np.log(np.maximum(speed, 1e-9)) / SPEED_STEP).astype(int)
    for number in np.unique(band).tolist():
        yield (equation, f"{track.procedure.value} {number}"), band == number


def _leave_out(fit: Fit, cross: Floats, own: Floats, pull: Floats, ridge: Floats) -> tuple[Floats, Floats]:
    normal = fit.normal
    p, k = fit.columns.size, own.shape[1]
    A = np.zeros((len(normal.runs), p + k, p + k))
    A[:, :p, :p], A[:, p:, p:] = normal.A, own
    A[:, p:, :p], A[:, :p, p:] = cross, np.swapaxes(cross, 1, 2)
    g = np.concatenate([normal.g, pull], axis=1)
    joint = type(normal)(normal.runs, A, g, normal.squares)
    prior, slope = np.concatenate([fit.prior, ridge]), np.concatenate([fit.pull, np.zeros(k)])
    return joint.leave_one_out(prior, slope), normal.leave_one_out(fit.prior, fit.pull)


def try_line(ground: Ground, kind: TermClass, order: float) -> Trial:
    """Score a line of this kind and order."""
    return try_columns(ground, kind.id, [line_columns(item, kind, order) for item in ground.fit.linear])


def line_gain(ground: Ground, kind: TermClass, order: float) -> float:
    """Give the gain of a line alone: what the search for the order maximises."""
    return columns_gain(ground, [line_columns(item, kind, order) for item in ground.fit.linear])


def columns_gain(ground: Ground, columns: Sequence[Floats | None]) -> float:
    """Give the gain of a candidate given by its columns (m, k) in every piece (None: it does not act there)."""
    fit = ground.fit
    size = next((c.shape[1] for c in columns if c is not None), 0)
    if size == 0:
        return 0.0
    own, score, cross = np.zeros((size, size)), np.zeros(size), np.zeros((size, fit.columns.size))
    for item, column in zip(fit.linear, columns, strict=True):
        if column is not None:
            weighted = item.weight * column
            cross += weighted.T @ item.jacobian
            own += weighted.T @ column
            score += weighted.T @ item.residual
    projector = cross @ ground.inverse
    schur = own - projector @ cross.T
    score = score - projector @ (fit.normal.g.sum(axis=0) + fit.pull)
    if np.any(np.diag(schur) <= ABSORBED * np.maximum(np.diag(own), 1e-300)):
        return 0.0
    return float(score @ solve(schur, score))

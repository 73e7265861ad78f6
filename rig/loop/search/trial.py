"""How much a further term would explain: gain, its significance whatever the noise, and leave-one-run-out.

The test statistic is Hotelling's T**2 of the term's scores summed over blocks of time, the base model projected out.
If the blocks' noise is symmetric about zero and independent between blocks (colour inside a block, heavy tails and
noise that grows with load are all allowed), then for any number of blocks

    P(T**2 > x) <= 2 e**3 / 9 * P(chi2_d > x)

so that no bootstrap is needed and a p-value may be as small as the number of tests demands.
Source: Pinelis, "Extremal probabilistic problems and Hotelling's T2 test under a symmetry condition", Ann. Statist.
22 (1994) 357-368.
"""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from rig.log.run import ProcedureName
from rig.loop.fitting.fit import Fit
from rig.loop.fitting.normal import LinearPiece, block_scores, side_by_side, solve
from rig.loop.model.equations import Equation
from rig.loop.model.terms import Derivative, Entry, TermClass, line_derivatives

Floats = NDArray[np.float64]

PINELIS = 2.0 * math.e**3 / 9.0
"""Constant of the bound on the tail."""

ABSORBED = 1e-6
"""A term of which the base leaves less than this share of its squares is not a term of its own."""

OWN = 0.3
"""Share of its gain that a candidate keeps at least beside another which explains something else."""


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
    """What all trials on one fit share: inverse of the normal matrix, block sums of the base's scores by piece.

    `left_out`: every run's weighted squares when predicted from all others, (r,).
    """

    fit: Fit
    inverse: Floats
    base_scores: tuple[Floats, ...]
    left_out: Floats


ColumnsOf = Callable[[LinearPiece], Floats | None]
"""A candidate: what gives its columns (m, k), centred, in a piece; None where it does not act. Picklable."""


@dataclass(frozen=True, slots=True)
class Sums:
    """What a candidate's columns sum to in a piece, weighted.

    With themselves (k, k), with the base's columns (k, p), with the residual (k,), and with it block by block (b, k).
    """

    own: Floats
    cross: Floats
    pull: Floats
    blocks: Floats


def prepare(fit: Fit) -> Ground:
    """Compute what all trials on `fit` share."""
    A = fit.normal.A.sum(axis=0) + np.diag(fit.prior)
    left_out = fit.normal.leave_one_out(fit.prior, fit.pull)
    return Ground(fit, solve(A, np.eye(A.shape[0])), tuple(fit.linear.map(block_scores)), left_out)


def _sums(item: LinearPiece, columns: ColumnsOf) -> Sums | None:
    made = columns(item)
    if made is None:
        return None
    weighted = item.weight * made
    scores = weighted * item.residual[:, None]
    return Sums(weighted.T @ made, weighted.T @ item.jacobian, scores.sum(axis=0), item.block_sums(scores))


def _brief_sums(item: LinearPiece, candidates: Sequence[ColumnsOf]) -> list[tuple[Floats, Floats, Floats] | None]:
    """Give what `Sums` has, without the blocks, for several candidates."""
    found: list[tuple[Floats, Floats, Floats] | None] = []
    for columns in candidates:
        made = columns(item)
        if made is None:
            found.append(None)
            continue
        weighted = item.weight * made
        found.append((weighted.T @ made, weighted.T @ item.jacobian, weighted.T @ item.residual))
    return found


def line_columns(item: LinearPiece, kind: TermClass, order: float) -> Floats | None:
    """Give sine and cosine column (m, 2) of a line in one piece, centred; None if the line does not act there."""
    position = item.evaluation.positions.get(kind.variable)
    if position is None or not acts(item, kind):
        return None
    return _columns_of(item, kind, line_derivatives(order, position))


def _columns_of(item: LinearPiece, kind: TermClass, derivatives: Sequence[Derivative]) -> Floats:
    return item.centred(side_by_side(item.evaluation.columns(kind, derivatives, item.piece.index)))


def _line_sums(item: LinearPiece, lines: Sequence[tuple[TermClass, float]]) -> Floats:
    """Give what `_brief_sums` has of several lines side by side, shape (lines, 2, 2 + p + 1); 0 where one does not act.

    Sines and cosines are worked out once for neighbours of one variable and order.
    """
    found = np.zeros((len(lines), 2, item.jacobian.shape[1] + 3))
    positions = item.evaluation.positions
    acting = [(place, kind, order) for place, (kind, order) in enumerate(lines) if acts(item, kind)]
    for (variable, order), some in itertools.groupby(acting, lambda one: (one[1].variable, one[2])):
        if variable not in positions:
            continue
        derivatives = line_derivatives(order, positions[variable])
        for place, kind, _ in some:
            made = _columns_of(item, kind, derivatives)
            weighted = item.weight * made
            found[place, :, :2] = weighted.T @ made
            found[place, :, 2:-1] = weighted.T @ item.jacobian
            found[place, :, -1] = weighted.T @ item.residual
    return found


def acts(item: LinearPiece, kind: TermClass) -> bool:
    """Whether a term of this kind has a column in the piece."""
    entry, evaluation = kind.entry, item.evaluation
    if entry.is_angle:
        reacts = entry in (Entry.TORSION, Entry.TORSION_TIMES_TORQUE) and evaluation.motor is not None
        return evaluation.angle or (reacts and bool(np.any(evaluation.torque)))
    if entry is Entry.MOTOR_AGAINST_MOTION:
        return evaluation.friction is not None
    return (evaluation.load if entry.equation is Equation.OUTPUT_TORQUE else evaluation.motor) is not None


def try_columns(ground: Ground, label: str, columns: ColumnsOf, *, ridge: float = 0.0) -> Trial:
    """Score a candidate.

    `ridge`: share of its own information that each column has as a prior at zero when runs are left out: the run that
    is left out may be the only one to hold a part of a curve.
    """
    fit = ground.fit
    sums = fit.linear.map(_sums, columns)
    size = next((one.pull.size for one in sums if one is not None), 0)
    if size == 0:
        return _nothing(label, 1)
    runs = len(fit.normal.runs)
    cross = np.zeros((runs, size, fit.columns.size))
    own, pull = np.zeros((runs, size, size)), np.zeros((runs, size))
    blocks = np.zeros((fit.block_count, size))
    for known, numbers, one in zip(fit.about, fit.blocks, sums, strict=True):
        if one is not None:
            row = fit.normal.runs.index(known.run)
            cross[row] += one.cross
            own[row] += one.own
            pull[row] += one.pull
            np.add.at(blocks, numbers, one.blocks)
    total_cross = cross.sum(axis=0)
    projector = total_cross @ ground.inverse
    for numbers, base in zip(fit.blocks, ground.base_scores, strict=True):
        np.add.at(blocks, numbers, -base @ projector.T)
    schur = own.sum(axis=0) - projector @ total_cross.T
    score = pull.sum(axis=0) - projector @ (fit.normal.g.sum(axis=0) + fit.pull)
    if np.any(np.diag(schur) <= ABSORBED * np.diag(own.sum(axis=0))):
        return _nothing(label, size)
    amplitudes = solve(schur, score)
    summed = blocks.sum(axis=0)
    statistic = float(summed @ solve(blocks.T @ blocks, summed))
    shares, carrying = _where(fit, sums, projector.T @ amplitudes, amplitudes)
    left, without = _leave_out(fit, cross, own, pull, ridge * np.diag(own.sum(axis=0))), ground.left_out
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
    fit: Fit, sums: Sequence[Sums | None], moved: Floats, amplitudes: Floats
) -> tuple[dict[Equation, float], NDArray[np.bool_]]:
    """Give the share of every equation's squares that is explained, and which runs carry the term.

    The share is that of the procedure in which it is largest: what acts in one need not hide behind the others.
    `moved` (p,): by how much the base gives way to the term.
    """
    expected_run = np.zeros(len(fit.normal.runs))
    by_procedure: dict[tuple[Equation, ProcedureName], list[float]] = {}
    for known, part, one in zip(fit.about, fit.parts, sums, strict=True):
        expected, along = float(moved @ part.A @ moved), -float(moved @ part.g)
        if one is not None:
            expected += float(amplitudes @ one.own @ amplitudes) - 2.0 * float(amplitudes @ one.cross @ moved)
            along += float(amplitudes @ one.pull)
        expected_run[fit.normal.runs.index(known.run)] += expected
        totals = by_procedure.setdefault((known.equation, known.procedure), [0.0, 0.0])
        totals[0] += 2.0 * along - expected
        totals[1] += part.squares
    total = float(expected_run.sum())
    shares: dict[Equation, float] = {}
    for (equation, _), (actual, squares) in by_procedure.items():
        if squares > 0:
            shares[equation] = max(shares.get(equation, -math.inf), actual / squares)
    return shares, expected_run >= 0.2 * total / expected_run.size


def _leave_out(fit: Fit, cross: Floats, own: Floats, pull: Floats, ridge: Floats) -> Floats:
    normal = fit.normal
    p, k = fit.columns.size, own.shape[1]
    A = np.zeros((len(normal.runs), p + k, p + k))
    A[:, :p, :p], A[:, p:, p:] = normal.A, own
    A[:, p:, :p], A[:, :p, p:] = cross, np.swapaxes(cross, 1, 2)
    g = np.concatenate([normal.g, pull], axis=1)
    joint = type(normal)(normal.runs, A, g, normal.squares)
    prior, slope = np.concatenate([fit.prior, ridge]), np.concatenate([fit.pull, np.zeros(k)])
    return joint.leave_one_out(prior, slope)


def line_at(kind: TermClass, order: float) -> ColumnsOf:
    """Give the candidate that is a line of this kind and order."""
    return partial(line_columns, kind=kind, order=order)


def try_line(ground: Ground, kind: TermClass, order: float) -> Trial:
    """Score a line of this kind and order."""
    return try_columns(ground, kind.id, line_at(kind, order))


def gains(ground: Ground, candidates: Sequence[ColumnsOf]) -> list[float]:
    """Give the gain of each of the candidates alone: what a search for an order or a parameter maximises."""
    by_piece = ground.fit.linear.map(_brief_sums, candidates)
    found = []
    for sums in zip(*by_piece, strict=True):
        known = [one for one in sums if one is not None]
        found.append(_gain(ground, *(sum(some[1:], some[0]) for some in zip(*known, strict=True))) if known else 0.0)
    return found


def line_gains(ground: Ground, lines: Sequence[tuple[TermClass, float]]) -> list[float]:
    """Give the gain of each line, by kind and order, alone; fastest where lines of one order are neighbours."""
    by_piece = ground.fit.linear.map(_line_sums, lines)
    return [_gain(ground, sums[:, :2], sums[:, 2:-1], sums[:, -1]) for sums in sum(by_piece[1:], by_piece[0])]


def explain_the_same(ground: Ground, one: tuple[ColumnsOf, int], other: tuple[ColumnsOf, int]) -> bool:
    """Whether a candidate keeps little of its gain where another is there already. Each with its number of columns."""
    both, first, second = gains(ground, [partial(_side_by_side, candidates=(one, other)), one[0], other[0]])
    return both - second < OWN * first


def _side_by_side(item: LinearPiece, candidates: Sequence[tuple[ColumnsOf, int]]) -> Floats | None:
    """Give the columns (m, k) of all candidates; of one that does not act here zeros."""
    made = [(columns(item), count) for columns, count in candidates]
    if all(some is None for some, _ in made):
        return None
    rows = item.residual.size
    return np.column_stack([np.zeros((rows, count)) if some is None else some for some, count in made])


def _gain(ground: Ground, own: Floats, cross: Floats, score: Floats) -> float:
    fit = ground.fit
    projector = cross @ ground.inverse
    schur = own - projector @ cross.T
    score = score - projector @ (fit.normal.g.sum(axis=0) + fit.pull)
    if np.any(np.diag(schur) <= ABSORBED * np.maximum(np.diag(own), 1e-300)):
        return 0.0
    return float(score @ solve(schur, score))

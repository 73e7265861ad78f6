"""How well a fit knows its parameters: covariance with all that the residual alone does not show.

    covariance = blocks of time, each left out in turn + A^-1 (catalogue + what the angles are unsure by) A^-1

Blocks of time are independent, samples inside need not be; where a play acts, its legs are. What is wrong in the same
way throughout a run or a leg (the zero of an encoder, a ripple below one count) shows in no block and is added; what
differs between conditions more than blocks tell widens the rest.
"""

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2
from scipy.stats import f as fisher
from scipy.stats import t as student

from rig.loop.fitting.fit import Fit
from rig.loop.fitting.normal import Columns, LinearPiece, block_scores, solve, untold
from rig.loop.model.equations import Law
from rig.loop.model.prediction import Model
from rig.loop.model.terms import Line
from rig.loop.signals.ripple import RESOLVED

Floats = NDArray[np.float64]

INFORMS = 0.05
"""Share of the best condition's information about a parameter that another must have to count for it."""


HELD_ALONE = 0.99
"""Share of a block that is left out to see what the others say: a part of what it alone tells of stays."""

LITTLE = 0.01
"""Share of all information, summed over the parameters, up to which a block has hardly moved the fit."""


def covariance(state: Fit) -> Floats:
    """Covariance (p, p) of the estimates: blocks of time are independent, samples inside need not be."""
    A = state.normal.A.sum(axis=0) + np.diag(state.prior)
    inverse = solve(A, np.eye(A.shape[0]))
    scores, information = _independent(state)
    moved = left_out(A, information, scores, inverse)
    few = of_few(np.einsum("jk,bkl,lj->bj", inverse, information, inverse))
    seen = moved.T @ moved * np.outer(few, few)
    # the catalogue's scatter is part of what is not known
    found = seen + inverse @ (np.diag(state.prior) + _unsure_ripple(state) + _unsure_zeros(state)) @ inverse
    widening = _between_conditions(state, inverse, np.diag(found))
    return np.asarray(found * np.outer(widening, widening)) + _left_to_prior(A, state.prior)


def _left_to_prior(A: Floats, prior: Floats) -> Floats:
    """Give the scatter (p, p) of what the data cannot tell at all, as Coulomb from viscous friction at one speed."""
    found = np.zeros_like(A)
    for way in untold(A):
        found += np.outer(way, way) / max(float(prior @ way**2), 1e-300)
    return found


def left_out(A: Floats, information: Floats, scores: Floats, inverse: Floats) -> Floats:
    """Give by what the estimates move when a block is left out, (b, p): the sum of squares is their variance.

    `A` (p, p): normal matrix with prior, and its `inverse`; `information` (b, p, p) and `scores` (b, p): a block's part
    of it and of the gradient. The fit has followed what the block says, and the more so the more it alone tells.
    Source: MacKinnon, Nielsen and Webb, "Fast and reliable jackknife and bootstrap methods for cluster-robust
    inference", Journal of Applied Econometrics 38 (2023) 671-694: CV3.
    """
    moved = scores @ inverse
    for k in np.flatnonzero(np.einsum("jk,bkj->b", inverse, information) > LITTLE):
        moved[k] = solve(A - HELD_ALONE * information[k], scores[k])
    return np.asarray(moved * math.sqrt((len(moved) - 1) / len(moved)))


def _independent(state: Fit) -> tuple[Floats, Floats]:
    """Give scores (b, p) and information (b, p, p), summed over what is independent: blocks, of a play its legs.

    By what noise moved the input of a play at a reversal, the whole leg behind it is wrong.
    """
    numbers, count = [], state.block_count
    sums = state.linear.map(_block_sums)
    for blocks, (_, _, legs) in zip(state.blocks, sums, strict=True):
        numbers.append(blocks if legs is None else count + legs)
        count += 0 if legs is None else int(legs.max()) + 1
    found, place = np.unique(np.concatenate(numbers), return_inverse=True)
    size = state.columns.size
    scores, information = np.zeros((found.size, size)), np.zeros((found.size, size, size))
    np.add.at(scores, place, np.concatenate([own for own, _, _ in sums]))
    np.add.at(information, place, np.concatenate([own for _, own, _ in sums]))
    return scores, information


def _block_sums(item: LinearPiece) -> tuple[Floats, Floats, NDArray[np.intp] | None]:
    """Give scores and information of a piece's blocks and, if a play acts, on which of its legs each begins."""
    parts = np.split(item.jacobian, item.starts[1:])
    scores, information = block_scores(item), item.weight * np.array([part.T @ part for part in parts])
    play = item.evaluation.play
    if play is None:
        return scores, information, None
    turns = np.diff(np.sign(play.side[item.piece.index])) != 0.0
    return scores, information, np.concatenate([[0], np.cumsum(turns)])[item.starts]


def of_few(variances: Floats) -> Floats:
    """Give the factors (p,) by which a scatter that few blocks tell of is to be widened, as Student's t does.

    `variances` (b, p): what each block adds to the variance of each estimate. What is as unequal as they are counts as
    (sum)**2 / (sum of squares) equal ones, and of as many the residual has taken one.
    Source: Bell and McCaffrey, "Bias reduction in standard errors for linear regression with multi-stage samples",
    Survey Methodology 28 (2002) 169-181: their freedom, with one mean for all regressors.
    """
    return np.asarray(student.ppf(0.975, _freedom(variances)) / student.ppf(0.975, 1000))


def _freedom(variances: Floats) -> Floats:
    count = variances.sum(axis=0) ** 2 / np.maximum((variances**2).sum(axis=0), 1e-300)
    return np.asarray(np.maximum(count - 1.0, 1.0))


def chance(state: Fit, number: int) -> float:
    """Give the chance that the amplitudes of a fitted effect are as far from 0 if all of them are 0.

    By Hotelling's T**2 over their covariance, with the freedom of the blocks that tell of them: it knows what the fit
    leaves, and takes sums over blocks for normal. 1 where no more blocks tell of them than there are amplitudes.
    Source: Hotelling, "The generalization of Student's ratio", Ann. Math. Statist. 2 (1931) 360-378.
    """
    term, first = state.model.shapes[number], state.columns.of_shape(number).start
    amplitudes = {first + place: term.values[k] for place, k in enumerate(term.free) if not term.is_logarithmic(k)}
    places, values = list(amplitudes), np.array(list(amplitudes.values()))
    A = state.normal.A.sum(axis=0) + np.diag(state.prior)
    inverse = solve(A, np.eye(A.shape[0]))
    _, information = _independent(state)
    freedom = float(_freedom(np.einsum("jk,bkl,lj->bj", inverse, information, inverse))[places].min())
    rest = freedom - len(places) + 1.0
    if rest < 1.0:
        return 1.0
    squared = float(values @ solve(covariance(state)[np.ix_(places, places)], values))
    return float(fisher.sf(squared * rest / (len(places) * freedom), len(places), rest))


def _unsure_ripple(state: Fit) -> Floats:
    """Give what the unsure ripple of the rotor adds to the scatter of the scores, shape (p, p).

    The rotor takes up J_r (k w)^2 times its ripple at a line of order k; a ripple below one count is known to a few per
    cent, and is wrong in the same way throughout a leg, so that no block of time tells.
    """
    size = state.columns.size
    return sum(state.linear.map(_unsure_ripple_of, state.model, state.columns), np.zeros((size, size)))


def _unsure_ripple_of(item: LinearPiece, model: Model, columns: Columns) -> Floats:
    found = np.zeros((columns.size, columns.size))
    inertia = abs(model.value("J_r"))
    track, rows = item.piece.track, item.piece.index
    if item.piece.law is not Law.FREE_RUN or track.ripple is None or "J_r" not in item.evaluation.base:
        return found
    for number, line in enumerate(model.lines):
        if line.kind.variable != "motor_position" or line.kind.entry.is_angle:
            continue
        pair = item.jacobian[:, columns.of_line(number)][:, :2]
        for speed in np.unique(track.speed[rows]):
            leg = track.speed[rows] == speed
            if not np.any(track.ripple.position[rows][leg]):
                continue
            error = inertia * (line.order * speed) ** 2 * float(track.ripple.noise[rows][leg].max())
            scores = item.weight * error * item.jacobian[leg].T @ pair[leg]
            found += scores @ scores.T
    return found


def hidden_share(state: Fit, number: int) -> float:
    """Give the share of a torque line that the rotor may take up unseen, because its ripple drowns in the encoder.

    The least over all legs: there the line is known best. 0 for a line that is no torque of the motor angle, and where
    no leg has lines. Below `RESOLVED` times its noise a ripple is not corrected for.
    """
    line = state.model.lines[number]
    if line.kind.variable != "motor_position" or line.kind.entry.is_angle:
        return 0.0
    inertia = abs(state.model.value("J_r"))
    taken = [
        inertia * (line.order * speed) ** 2 * noise for legs in state.linear.map(_ripples) for speed, noise in legs
    ]
    return min(taken, default=0.0) / max(line.amplitude, 1e-300)


def _ripples(item: LinearPiece) -> list[tuple[float, float]]:
    """Give speed (rad/s) and unseen ripple (rad) of every leg of a free run."""
    track, rows = item.piece.track, item.piece.index
    if item.piece.law is not Law.FREE_RUN or track.ripple is None:
        return []
    found = []
    for speed in np.unique(track.speed[rows]):
        leg = track.speed[rows] == speed
        resolved = bool(np.any(track.ripple.position[rows][leg]))
        found.append((float(speed), float(track.ripple.noise[rows][leg].max()) * (1.0 if resolved else RESOLVED)))
    return found


def _unsure_zeros(state: Fit) -> Floats:
    """Give what the unknown zeros of an encoder add to the scatter of the scores, shape (p, p).

    A zero that differs from run to run turns every line of that angle alike throughout a run. How much they differ is
    read off the runs: what the best turn of each exceeds its own uncertainty by.
    """
    found = np.zeros((state.columns.size, state.columns.size))
    for variable in {line.kind.variable for line in state.model.lines}:
        turned = list(_turned(state, variable))
        informs = np.array([information for information, _, _ in turned])
        seen = informs > INFORMS * informs.max(initial=0.0)
        if seen.sum() < 2:
            continue
        turn = np.array([pull for _, pull, _ in turned])[seen] / informs[seen]
        # the fit has taken one common turn out of them; of few runs the spread is itself hardly known
        freedom = turn.size - 1
        few = student.ppf(0.975, freedom) / student.ppf(0.975, 1000)
        noise = 1.0 / informs[seen] - 1.0 / float(informs.sum())
        excess = few**2 * float((turn**2 - noise).sum()) / freedom
        if excess > 0.0:
            found += excess * sum(np.outer(scores, scores) for _, _, scores in turned)
    return found


def _turned(state: Fit, variable: str) -> Iterator[tuple[float, float, Floats]]:
    """Give for every run what a turn of the angle `variable` by 1 rad does.

    Its information (1/rad^2), its pull on the residual (1/rad), and the scores (p,) that it would add.
    """
    lines = tuple((n, line) for n, line in enumerate(state.model.lines) if line.kind.variable == variable)
    found = state.linear.map(_turned_piece, lines, state.columns)
    for name in state.normal.runs:
        mine = [one for known, one in zip(state.about, found, strict=True) if known.run == name]
        scores = sum((scores for _, _, scores in mine), np.zeros(state.columns.size))
        yield sum(information for information, _, _ in mine), sum(pull for _, pull, _ in mine), scores


def _turned_piece(
    item: LinearPiece, lines: Sequence[tuple[int, Line]], columns: Columns
) -> tuple[float, float, Floats]:
    turn = np.zeros(item.residual.size)
    for number, line in lines:
        pair = item.jacobian[:, columns.of_line(number)]
        turn += line.order * (line.sine * pair[:, 1] - line.cosine * pair[:, 0])
    weighted = item.weight * turn
    return float(weighted @ turn), float(weighted @ item.residual), weighted @ item.jacobian


def _between_conditions(state: Fit, inverse: Floats, variance: Floats) -> Floats:
    """Give the factors (p,) by which estimates scatter more between conditions than blocks of time tell.

    What the model lacks is often the same within a run and its replicates and another at the next speed or angle:
    blocks then count one error many times. A factor is applied only where the excess is significant at 5 %.
    """
    conditions = sorted({item.condition for item in state.about})
    scores = np.zeros((len(conditions), variance.size))
    informed = np.zeros((len(conditions), variance.size))
    for item, part in zip(state.about, state.parts, strict=True):
        row = conditions.index(item.condition)
        scores[row] += part.g
        informed[row] += np.diag(part.A)
    between = ((scores @ inverse) ** 2).sum(axis=0)
    counts = (informed > INFORMS * informed.max(axis=0)).sum(axis=0)
    factors = np.ones(variance.size)
    for k in np.flatnonzero((counts >= 2) & (variance > 0)).tolist():
        freedom = int(counts[k]) - 1
        ratio = between[k] * counts[k] / (freedom * variance[k])
        if ratio > chi2.ppf(0.95, freedom) / freedom:
            factors[k] = math.sqrt(ratio) * student.ppf(0.975, freedom) / student.ppf(0.975, 1000)
    return np.maximum(factors, 1.0)


def quantile(state: Fit) -> float:
    """Give the factor from standard deviation to 95 % half width, for the number of blocks at hand."""
    return float(student.ppf(0.975, max(state.block_count - state.columns.size, 2)))

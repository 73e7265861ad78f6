"""How large an effect would have had to be in order to be added: what a campaign without one has ruled out."""

import math
from collections.abc import Sequence

import numpy as np
from scipy.stats import chi2

from rig.loop.fitting.normal import LinearPiece
from rig.loop.model.curves import Curve
from rig.loop.model.equations import Equation
from rig.loop.model.terms import TermClass
from rig.loop.search.acceptance import LEAST_SHAPE_SHARE, LEAST_SHARE
from rig.loop.search.decision import Limit
from rig.loop.search.line_candidates import LineCandidate
from rig.loop.search.proposals import KINEMATIC_ERROR, USUAL_ERRORS
from rig.loop.search.shape_trials import ShapeTrial, shape_of
from rig.loop.search.trial import PINELIS, ColumnsOf, Floats, Ground, Trial, line_at, try_line

SELDOM_MISSED = 1.645
"""Standard deviations above the threshold at which noise hides an effect in one case of twenty."""


def limits_of(
    ground: Ground, lines: Sequence[LineCandidate], shapes: Sequence[ShapeTrial], alpha: float
) -> list[Limit]:
    """Give the limit of every class of the catalogue that has one amplitude, from how it fares on what is left.

    Of a line that is the largest of the orders that were tried, and of those at which a strain wave gear errs.
    """
    found = []
    most = max((line.tests for line in lines), default=1.0)
    for kind in dict.fromkeys(line.proposal.kind for line in lines if line.proposal.kind.effect is not None):
        tried = [(line.proposal.order, line.trial, line.tests) for line in lines if line.proposal.kind == kind]
        if kind.effect == KINEMATIC_ERROR:
            tried += [(order, try_line(ground, kind, order), most) for order in USUAL_ERRORS]
        sizes = [_amplitude(ground, line_at(kind, order), kind, trial, tests, alpha) for order, trial, tests in tried]
        if any(size is not None for size in sizes):
            found.append(Limit(kind, max(size for size in sizes if size is not None)))
    for shape in shapes:
        if shape.trial.columns == 1 and not isinstance(shape.term.effect, Curve):
            size = _amplitude(ground, shape_of(shape.term), None, shape.trial, shape.tests, alpha)
            if size is not None:
                found.append(Limit(shape.term.kind, size))
    return found


def _amplitude(
    ground: Ground, columns: ColumnsOf, line: TermClass | None, trial: Trial, tests: float, alpha: float
) -> float | None:
    """Give the amplitude at which a term passes the test at `alpha` and explains enough; `line`: the class of a line.

    The share of the squares grows with the square of the amplitude, and so does T**2 until the term is all there is in
    its blocks: it cannot exceed their number. None where the runs tell nothing of it, or no size would pass.
    """
    shares = _shares_if_there(ground, columns, trial.amplitudes)
    of_angle = line is not None and line.is_angle and Equation.TORSION in shares
    share = shares[Equation.TORSION] if of_angle else max(shares.values(), default=0.0)
    if trial.statistic <= 0.0 or share <= 0.0:
        return None
    wanted = float(chi2.isf(min(1.0, alpha / (PINELIS * tests)), trial.columns))
    blocks = ground.fit.block_count
    if wanted >= blocks:
        return None
    wanted = (math.sqrt(wanted / (1.0 - wanted / blocks)) + SELDOM_MISSED) ** 2
    least = LEAST_SHAPE_SHARE if line is None else LEAST_SHARE
    return math.sqrt(max(wanted / trial.statistic, least / share)) * float(np.linalg.norm(trial.amplitudes))


def _shares_if_there(ground: Ground, columns: ColumnsOf, amplitudes: Floats) -> dict[Equation, float]:
    """Give what a term of these amplitudes would be in the squares that are left, the base fitted again.

    By equation, in the procedure where it is largest.
    """
    linear = ground.fit.linear
    moved = ground.inverse @ sum(linear.map(_pull_on_base, columns, amplitudes))
    squares: dict[Equation, dict[str, Floats]] = {}
    parts = linear.map(_squares_of, columns, amplitudes, moved)
    for about, part in zip(ground.fit.about, parts, strict=True):
        own = squares.setdefault(about.equation, {})
        own[about.procedure] = own.get(about.procedure, np.zeros(2)) + part
    return {
        equation: max(float(term / max(left, 1e-300)) for term, left in by_procedure.values())
        for equation, by_procedure in squares.items()
    }


def _pull_on_base(item: LinearPiece, columns: ColumnsOf, amplitudes: Floats) -> Floats:
    made = columns(item)
    size = item.jacobian.shape[1]
    return np.zeros(size) if made is None else item.weight * (item.jacobian.T @ (made @ amplitudes))


def _squares_of(item: LinearPiece, columns: ColumnsOf, amplitudes: Floats, moved: Floats) -> Floats:
    """Give the squares of a term beside the base that `moved` with it, and of the residual, (2,)."""
    made = columns(item)
    own = -(item.jacobian @ moved) if made is None else made @ amplitudes - item.jacobian @ moved
    return np.array([own @ own, item.residual @ item.residual])

"""Forward selection of terms, one at a time, with joint refits; training runs only.

A round scans every equation for lines, scores every class that a line could be and every other effect of the catalogue
on all equations together, and adds the best if it passes the family-wise test at alpha, pays when runs are left out,
and is consistent between procedures. Naming is strict: a catalogue class wins with at least 95 % of the best gain,
every other class with 90 % of the pick's gain joins the set, and then the verdict is `ambiguous`.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from rig.loop.fitting.fit import Fit, Material, fit
from rig.loop.model.prediction import Model
from rig.loop.search.contenders import by_joint_fit
from rig.loop.search.decision import Accepted, Decision, Selection, Unadded, lines_decided
from rig.loop.search.groups import QUOTIENT
from rig.loop.search.limits import limits_of
from rig.loop.search.line_candidates import LineCandidate, line_candidates
from rig.loop.search.line_verdict import judge_line
from rig.loop.search.shape_trials import ShapeTrial
from rig.loop.search.shape_verdict import judge_shape, shape_candidates
from rig.loop.search.trial import Ground, prepare
from rig.loop.search.unknown import unnamed
from rig.loop.search.withdraw import withdraw, withdraw_lines

MOST_LINES = 16
"""Lines that are added at most."""


def select(
    pieces: Material,
    base: Fit,
    alpha: float,
    known: Mapping[str, float],
    given: Sequence[Decision] = (),
    on_stage: Callable[[str], None] = lambda _: None,
) -> Selection:
    """Add terms to the base fit until nothing more passes. `alpha`: family-wise false-alarm probability a round.

    `known`: parameters of effects that no fit estimates, by name (`ratio`, `torque_constant`, ...). `given`: of the
    terms that the base has already; they are fitted and stay. `on_stage` is told what is being done.
    """
    current = base
    decisions = list(given)
    unadded: list[Unadded] = []
    here: _Tried | None = None
    while len(current.model.lines) - len(base.model.lines) < MOST_LINES:
        count = len(current.model.lines) + len(current.model.shapes)
        on_stage(f"trying every effect on what is left, {count} added so far")
        here = _look(pieces, current, known)
        unadded = []
        present = {term.effect.id for term in current.model.shapes}
        present |= set(QUOTIENT) if present & set(QUOTIENT) else set()
        present |= {name for decision in decisions for name in decision.members}
        shapes = [item for item in here.shapes if item.term.effect.id not in present]
        shapes = by_joint_fit(pieces.few, here.ground, shapes, alpha)
        accepted = _round(pieces, here.ground, here.lines, shapes, alpha, decisions, unadded)
        if accepted is None:
            break
        known_lines = len(current.model.lines)
        decision, current = accepted
        on_stage(f"added: {decision.kind.id}")
        decisions = _with(decisions, decision, [line.order for line in current.model.lines[known_lines:]])
    on_stage("judging whether what was added must stay")
    current = withdraw(pieces, current, alpha, base.model)
    on_stage("trying shapes without a name on what is left")
    named = current
    current, decisions = unnamed(pieces, named, _still_there(decisions, named.model), alpha, known)
    if current is not named:
        current = withdraw_lines(pieces, current, alpha, base.model)
    kept = _still_there(decisions, current.model)
    if here is None or here.ground.fit is not current:
        here = _look(pieces, current, known)
    found = any(not one.given for one in kept)
    limits = () if found else tuple(limits_of(here.ground, here.lines, here.shapes, alpha))
    return Selection(current, tuple(kept), tuple(unadded), tuple(item.trial for item in here.shapes), limits)


@dataclass(frozen=True, slots=True)
class _Tried:
    """Everything that may explain what is left of a fit, each alone, best first."""

    ground: Ground
    lines: list[LineCandidate]
    shapes: list[ShapeTrial]


def _look(pieces: Material, current: Fit, known: Mapping[str, float]) -> _Tried:
    ground = prepare(current)
    sparse = prepare(fit(pieces.few, current.model, current.noise, passes=0, block=current.block))
    lines = line_candidates(ground, sparse, known)
    most = max((line.trial.gain for line in lines), default=0.0)
    return _Tried(ground, lines, shape_candidates(ground, sparse, known, most))


def _with(decisions: Sequence[Decision], new: Decision, orders: Sequence[float]) -> list[Decision]:
    """Put a decision about lines of these orders to the others: lines of one class and set are one step."""
    for place, one in enumerate(decisions):
        if (one.kind, one.members, one.given) == (new.kind, new.members, new.given):
            joined = replace(one, orders=(*one.orders, *orders))
            return [*decisions[:place], joined, *decisions[place + 1 :]]
    return [*decisions, replace(new, orders=tuple(orders))]


def _still_there(decisions: Sequence[Decision], model: Model) -> list[Decision]:
    """Give the decisions whose terms the model still has."""
    kinds = {term.kind for term in model.shapes}
    return [one for one in decisions if one.kind in kinds or lines_decided(one, decisions, model.lines)]


def _round(
    pieces: Material,
    ground: Ground,
    lines: Sequence[LineCandidate],
    shapes: Sequence[ShapeTrial],
    alpha: float,
    decisions: list[Decision],
    unadded: list[Unadded],
) -> tuple[Decision, Fit] | None:
    """Give the best term that may be added, and the fit with it; None if there is none."""
    candidates: list[LineCandidate | ShapeTrial] = [*lines, *shapes]
    lines = list(lines)
    for candidate in sorted(candidates, key=lambda candidate: -candidate.trial.gain):
        if isinstance(candidate, ShapeTrial):
            judged = judge_shape(pieces, ground, candidate, lines, shapes, alpha, decisions)
        else:
            judged = judge_line(pieces, ground, candidate, lines, shapes, alpha, decisions)
        if isinstance(judged, Accepted):
            return judged.decision, judged.fit
        if judged is not None:
            unadded.append(judged)
            lines = [line for line in lines if line is not candidate]  # what is refused is no rival of the others
    return None

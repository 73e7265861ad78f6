"""The effects that are no lines: which of them explain what is left, whether one is added, and why not."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rig.loop.fitting.fit import SHORTEST_BLOCK, Fit, Material, fit, refit, with_noise
from rig.loop.fitting.intervals import chance
from rig.loop.model.equations import Equation
from rig.loop.model.prediction import Model
from rig.loop.model.shapes import ShapeClass, ShapeTerm
from rig.loop.result import Candidate, Verdict
from rig.loop.search.acceptance import (
    BEST_SHARE,
    COMPANION_SHARE,
    LARGE_SHARE,
    LEAST_SHAPE_SHARE,
    MOST_CLASSES,
    MOST_COMPANIONS,
    NOT_EVERYWHERE,
    QUICK,
    objection,
    pays_jointly,
    unpaid_by,
)
from rig.loop.search.aliases import counts_pass
from rig.loop.search.compliance_form import like_form, other_compliance
from rig.loop.search.conditions import consistent_shape
from rig.loop.search.contenders import explained_by
from rig.loop.search.decision import Accepted, Decision, Unadded
from rig.loop.search.groups import LEAST_SLOPE, NESTED, QUOTIENT, SET_SHARE
from rig.loop.search.line_candidates import LineCandidate, best_of_classes
from rig.loop.search.shape_trials import Scales, ShapeTrial, largest_of, scales_of, shape_of, shape_trials
from rig.loop.search.trial import Ground, Trial, explain_the_same, prepare, try_columns
from rig.loop.search.tried import by_gain, tried_line, tried_shape
from sim_backend.model.effects import Enters

LEAST_DELAY = 5e-4
"""s: half a cycle at 1 kHz, by which the output torque of a sweep is early where a drive holds each set-point."""

MOST_MEMBERS = 2
"""Rivals of a set that are fitted to see which of it fits best."""

LOOKS = 3.0
"""Tests that a candidate is given: before and after the joint fit, and by what that leaves."""

REACH = 0.5
"""Share of the largest speed up to which an effect must have changed."""

COUNTS = {"motor_position": "encoder_counts", "output_position": "output_encoder_counts"}
"""Which of the device's parameters holds the counts per revolution of an angle."""


def shape_candidates(ground: Ground, sparse: Ground, known: Mapping[str, float], least: float) -> list[ShapeTrial]:
    """Give how every effect that is no line explains what is left, best first. `sparse`: the ground on few samples."""
    scales = _scales(ground, known)
    at_output = {"motor_position": 1.0 / known.get("ratio", 1.0), "output_position": 1.0}
    encoders = {
        signal: (known[name], at_output[signal] * 2.0 * np.pi / known[name])
        for signal, name in COUNTS.items()
        if name in known
    }
    return [
        item
        for item in shape_trials(ground, sparse, scales, least)
        if not (item.term.frequencies and _counts(ground, item.term, encoders))
        and not _is_slight(item)
        and _is_in_reach(item, scales)
    ]


def _counts(ground: Ground, ringing: ShapeTerm, encoders: Mapping[str, tuple[float, float]]) -> bool:
    """Whether what rings may be the counts of one of these encoders; see `counts_pass`."""
    return counts_pass(ringing.frequencies, largest_of(ground, ringing), ground.fit.linear, encoders)


def _is_in_reach(item: ShapeTrial, scales: Scales) -> bool:
    """Whether the speeds were seen over which an effect changes: a part of a fall of friction is any curve."""
    term = item.term
    speeds = [v for p, v in zip(term.effect.parameters, term.values, strict=True) if p.unit == "rad/s"]
    return all(speed <= REACH * scales.speed for speed in speeds)


def _scales(ground: Ground, known: Mapping[str, float]) -> Scales:
    stiffness = ground.fit.model.table.entries[0].centre
    return scales_of(ground.fit.linear, {**known, "stiffness": stiffness})


def _is_slight(item: ShapeTrial) -> bool:
    """Whether a reading errs by less than is worth a statement, however significant: a share of the torque, a delay."""
    term = item.term
    if term.effect.id in QUOTIENT:
        return float(np.abs(item.trial.amplitudes).max()) < LEAST_SLOPE
    times = [v for p, v in zip(term.effect.parameters, term.values, strict=True) if p.unit == "s"]
    return bool(term.effect.reads and times) and max(times) < LEAST_DELAY


def judge_shape(
    pieces: Material,
    ground: Ground,
    candidate: ShapeTrial,
    lines: Sequence[LineCandidate],
    shapes: Sequence[ShapeTrial],
    alpha: float,
    decisions: Sequence[Decision],
) -> Accepted | Unadded | None:
    """Accept an effect that is no line, say why it is not added, or give None if it may be chance or is there already.

    As for a line; what makes a term ambiguous is every other class that explains nearly as much.
    """
    trial, term = candidate.trial, candidate.term
    p_value = min(1.0, trial.single_p * candidate.tests)
    significant, large = p_value <= alpha, trial.share >= LARGE_SHARE
    if not (significant or large) or any(x.effect.id == term.effect.id for x in ground.fit.model.shapes):
        return None
    size = float(np.abs(trial.amplitudes).max())

    def unadded(why: str) -> Unadded | None:
        return Unadded(term.kind, None, size, p_value, trial.share, why) if significant else None

    kinds = {decision.kind for decision in decisions if not decision.given}
    room = term.kind in kinds or len(kinds) < MOST_CLASSES
    why, unpaid = objection(trial.share, LEAST_SHAPE_SHARE, room=room), unpaid_by(trial)
    if why or (unpaid and not large):
        return unadded(why or unpaid)
    inner = NESTED.get(term.effect.id, ())
    if any(x.term.effect.id in inner and x.trial.gain >= BEST_SHARE * trial.gain for x in shapes):
        return None
    if term.effect.enters is Enters.TORSION and _without_windup(ground):
        return unadded("without a motor torque it cannot be told from the windup of the wave generator")
    rivals = _rivals(ground, candidate, lines, shapes)
    if rivals.form.gain > trial.gain / BEST_SHARE:
        return unadded("another shape explains more")
    model = replace(ground.fit.model, shapes=(*ground.fit.model.shapes, term))
    if unpaid and not _may_pay(pieces, ground, model):
        return unadded(unpaid)
    joint = refit(pieces, ground.fit, model)
    again = prepare(with_noise(ground.fit, joint.noise, SHORTEST_BLOCK))
    second = try_columns(again, term.effect.id, shape_of(joint.model.shapes[-1]))
    # what acts at reversals lies in few long blocks, whose signs alone cannot tell much
    third = chance(joint, len(joint.model.shapes) - 1)
    p_value = min(1.0, LOOKS * min(p_value, second.single_p * candidate.tests, third * candidate.tests))
    if p_value > alpha:
        return None
    if unpaid and not pays_jointly(ground.fit, joint):
        return unadded(unpaid)
    if not (
        consistent_shape(joint, len(joint.model.shapes) - 1)
        or _consistent_beside_another(pieces, ground, candidate, shapes, alpha)
    ):
        return unadded(NOT_EVERYWHERE)
    kind, best = _best_member(pieces, ground, term, joint, rivals.terms[:MOST_MEMBERS])
    members = tuple(sorted(rivals.near | {term.effect.id})) if rivals.near else ()
    verdict = Verdict.AMBIGUOUS if members else Verdict.NAMED
    return Accepted(Decision(kind, verdict, members, rivals.tried, p_value), best)


@dataclass(frozen=True, slots=True)
class _Rivals:
    """What stands against a candidate: `near` explains nearly as much of the same, `form` is a compliance of another.

    `terms`: those of `near` that can be fitted in the candidate's place. `tried`: all, the candidate too, best first.
    """

    form: Trial
    near: frozenset[str]
    terms: tuple[ShapeTerm, ...]
    tried: tuple[Candidate, ...]


def _rivals(
    ground: Ground, candidate: ShapeTrial, lines: Sequence[LineCandidate], shapes: Sequence[ShapeTrial]
) -> _Rivals:
    effect, least = candidate.term.effect.id, SET_SHARE * candidate.trial.gain
    form = other_compliance(ground, scales_of(ground.fit.linear, {}).torque)
    others = [x for x in shapes if x is not candidate]
    peers: list[ShapeTrial | LineCandidate] = [*others, *best_of_classes(lines)]
    apart = {effect, *(name for name, within in NESTED.items() if effect in within)}
    near = {
        peer.trial.label
        for peer in peers
        if peer.trial.gain >= least
        and peer.trial.label not in apart
        and explain_the_same(ground, candidate.columns, peer.columns)
    }
    near |= set(QUOTIENT) - {effect} if effect in QUOTIENT else set()
    terms = {x.term.effect.id: x.term for x in others if x.term.effect.id in near and x.term.effect.id not in QUOTIENT}
    if form.gain >= least:
        alike = {one.effect.id: one for one in like_form(ground.fit) if one.effect.id != effect}
        near |= {form.label, *alike}
        terms = {**alike, **terms}
    tried = [
        *(tried_shape(x) for x in (candidate, *others)),
        *(tried_line(x) for x in best_of_classes(lines)),
        Candidate(form.label, form.gain, min(1.0, form.single_p * candidate.tests)),
    ]
    return _Rivals(form, frozenset(near), tuple(terms.values()), by_gain(x for x in tried if x.gain > 0))


def _best_member(
    pieces: Material, ground: Ground, term: ShapeTerm, joint: Fit, rivals: Sequence[ShapeTerm]
) -> tuple[ShapeClass, Fit]:
    """Give which of a set fits best over all samples: what another leaves would be taken for one more effect."""
    kind, best = term.kind, joint
    for rival in rivals:
        model = replace(ground.fit.model, shapes=(*ground.fit.model.shapes, rival))
        like = refit(pieces, ground.fit, model)
        if explained_by(best, like) > 0.0:
            kind, best = rival.kind, like
    return kind, best


def _consistent_beside_another(
    pieces: Material, ground: Ground, candidate: ShapeTrial, shapes: Sequence[ShapeTrial], alpha: float
) -> bool:
    """Whether an effect shows everywhere once another is there that explains something else.

    A transducer that drifts with the temperature is also offset, unless it was tared at the catalogue's temperature.
    """
    others = [
        item
        for item in shapes
        if item is not candidate
        and item.trial.gain >= COMPANION_SHARE * candidate.trial.gain
        and item.trial.single_p * item.tests <= alpha
    ]
    for other in others[:MOST_COMPANIONS]:
        if explain_the_same(ground, candidate.columns, other.columns):
            continue
        shapes_with_both = (*ground.fit.model.shapes, candidate.term, other.term)
        joint = refit(pieces, ground.fit, replace(ground.fit.model, shapes=shapes_with_both))
        last = len(joint.model.shapes)
        if consistent_shape(joint, last - 2) and consistent_shape(joint, last - 1):
            return True
    return False


def _may_pay(pieces: Material, ground: Ground, model: Model) -> bool:
    """Whether a joint fit to few samples pays when runs are left out; it costs a small part of a whole one."""
    now = ground.fit
    before = fit(pieces.few, now.model, now.noise, passes=QUICK, block=now.block)
    return pays_jointly(before, fit(pieces.few, model, now.noise, passes=QUICK, block=now.block))


def _without_windup(ground: Ground) -> bool:
    """Whether a swept torsion was recorded without the motor torque, which winds up the wave generator."""
    return any(x.equation is Equation.TORSION and not x.moves and not x.winds for x in ground.fit.about)

"""The effects that are no lines: which of them explain what is left, whether one is added, and why not."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from rig.loop.fitting.fit import Material, fit, refit, with_noise
from rig.loop.model.equations import Equation
from rig.loop.result import Candidate, Verdict
from rig.loop.search.acceptance import (
    BEST_SHARE,
    LARGE_SHARE,
    LEAST_SHAPE_SHARE,
    MOST_CLASSES,
    NOT_EVERYWHERE,
    objection,
    pays_jointly,
    unpaid_by,
)
from rig.loop.search.aliases import counts_pass
from rig.loop.search.compliance_form import other_compliance
from rig.loop.search.decision import Accepted, Decision, Unadded
from rig.loop.search.groups import LEAST_SLOPE, NESTED, QUOTIENT, SET_SHARE
from rig.loop.search.line_candidates import LineCandidate, best_of_classes
from rig.loop.search.shape_trials import Scales, ShapeTrial, scales_of, shape_of, shape_trials
from rig.loop.search.trial import Ground, consistent_shape, prepare, try_columns
from sim_backend.model.effects import Enters

LEAST_DELAY = 5e-4
"""s: half a cycle at 1 kHz, by which the output torque of a sweep is early where a drive holds each set-point."""

COUNTS = {"motor_position": "encoder_counts", "output_position": "output_encoder_counts"}
"""Which of the device's parameters holds the counts per revolution of an angle."""


def shape_candidates(pieces: Material, ground: Ground, known: Mapping[str, float], least: float) -> list[ShapeTrial]:
    """Give how every effect that is no line explains what is left, best first."""
    scales, fitted = _scales(ground, known), ground.fit
    sparse = prepare(fit(pieces.few, fitted.model, fitted.noise, passes=0, block=fitted.block))
    counts = {signal: known[name] for signal, name in COUNTS.items() if name in known}
    return [
        item
        for item in shape_trials(ground, sparse, scales, least)
        if not counts_pass(item.term.frequencies, ground.fit.linear, counts) and not _is_slight(item)
    ]


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

    kinds = {decision.kind for decision in decisions}
    room = term.kind in kinds or len(kinds) < MOST_CLASSES
    why, unpaid = objection(trial.share, LEAST_SHAPE_SHARE, room=room), unpaid_by(trial)
    if why or (unpaid and not large):
        return unadded(why or unpaid)
    inner = NESTED.get(term.effect.id, ())
    if any(x.term.effect.id in inner and x.trial.gain >= BEST_SHARE * trial.gain for x in shapes):
        return None
    if term.effect.enters is Enters.TORSION and _without_windup(ground):
        return unadded("without a motor torque it cannot be told from the windup of the wave generator")
    form = other_compliance(ground, scales_of(ground.fit.linear, {}).torque)
    peers = [*(x.trial for x in shapes if x is not candidate), *best_of_classes(lines), form]
    outer = {name for name, within in NESTED.items() if term.effect.id in within}
    near = {p.label for p in peers if p.gain >= SET_SHARE * trial.gain and p.label not in {*outer, term.effect.id}}
    near |= set(QUOTIENT) - {term.effect.id} if term.effect.id in QUOTIENT else set()
    if form.gain > trial.gain / BEST_SHARE:
        return unadded("another shape explains more")
    joint = refit(pieces, ground.fit, replace(ground.fit.model, shapes=(*ground.fit.model.shapes, term)))
    again = prepare(with_noise(ground.fit, joint.noise))
    second = try_columns(again, term.effect.id, shape_of(joint.model.shapes[-1]))
    p_value = min(1.0, 2.0 * min(p_value, second.single_p * candidate.tests))
    if p_value > alpha:
        return None
    if unpaid and not pays_jointly(ground.fit, joint):
        return unadded(unpaid)
    if not consistent_shape(joint, len(joint.model.shapes) - 1):
        return unadded(NOT_EVERYWHERE)
    tried = [Candidate(p.label, p.gain, min(1.0, p.single_p * candidate.tests)) for p in (trial, *peers) if p.gain > 0]
    members = tuple(sorted(near | {term.effect.id})) if near else ()
    verdict = Verdict.AMBIGUOUS if near else Verdict.NAMED
    ordered = tuple(sorted(tried, key=lambda item: -item.gain))
    return Accepted(Decision(term.kind, verdict, members, ordered, p_value), joint)


def _without_windup(ground: Ground) -> bool:
    """Whether a swept torsion was recorded without the motor torque, which winds up the wave generator."""
    return any(x.equation is Equation.TORSION and not x.moves and not x.winds for x in ground.fit.about)

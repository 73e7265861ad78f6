"""Forward selection of terms, one at a time, with joint refits; training runs only.

A round scans every equation for lines, scores every class that a line could be and every other effect of the catalogue
on all equations together, and adds the best if it passes the family-wise test at alpha, pays when runs are left out,
and is consistent between procedures. Naming is strict: a catalogue class wins with at least 95 % of the best gain,
every other class with 90 % of the pick's gain joins the set, and then the verdict is `ambiguous`.
"""

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rig.loop.fitting.fit import Fit, refit, with_noise
from rig.loop.model.equations import Equation, Piece
from rig.loop.model.evaluation import angle_addition
from rig.loop.model.shapes import ShapeClass
from rig.loop.model.terms import Entry, Line, TermClass
from rig.loop.result import Candidate, Verdict
from rig.loop.search.acceptance import (
    BEST_SHARE,
    LARGE_SHARE,
    LEAST_CURVE_SHARE,
    LEAST_SHAPE_SHARE,
    LEAST_SHARE,
    MOST_CLASSES,
    NOT_EVERYWHERE,
    objection,
    pays_jointly,
    unpaid_by,
)
from rig.loop.search.aliases import aliases, beats, counts_pass, likeliest, samplings, small_beats
from rig.loop.search.compliance_form import other_compliance
from rig.loop.search.contenders import by_joint_fit
from rig.loop.search.decision import Decision, Selection, Unadded
from rig.loop.search.lines import USUAL_HIGHEST_ORDER, refine
from rig.loop.search.proposals import Proposal, propose, same_place
from rig.loop.search.shape_trials import Scales, ShapeTrial, scales_of, shape_trials, trial_columns
from rig.loop.search.trial import Ground, Trial, consistent, consistent_shape, line_gain, prepare, try_columns, try_line
from rig.loop.search.unknown import unnamed
from rig.loop.search.withdraw import withdraw
from sim_backend.model.effects import Enters

STANDS_OUT = 30.0
"""Power over the median of the neighbourhood of a line that is looked at however little it explains."""

SET_SHARE = 0.9
MOST_LINES = 16
QUOTIENT = ("torque-constant-error", "torque-sensor-gain")
"""What base parameters take up, each its own: only that the two torques do not agree shows, never which is wrong."""

LEAST_SLOPE = 3e-3
"""Relative deviation of the two torques' ratio that is worth a statement."""

LEAST_DELAY = 5e-4
"""s: half a cycle at 1 kHz, by which the output torque of a sweep is early where a drive holds each set-point."""

NESTED: Mapping[str, tuple[str, ...]] = {"rate-dependent-hysteresis": ("creep", "maxwell-slip")}
"""A class that holds others as special cases: it is taken only if it explains more."""

LEAST_START_ANGLES = 4
"""Start angles without which a locked sweep cannot tell an angle error from a torque-shaped one."""

COUNTS = {"motor_position": "encoder_counts", "output_position": "output_encoder_counts"}
"""Which of the device's parameters holds the counts per revolution of an angle."""

TWINS: dict[str, str] = {
    "kinematic-error": "motor-encoder-eccentricity",
    "motor-encoder-eccentricity": "kinematic-error",
}
"""What looks the same at order 1 until the encoder is re-clocked."""

SINGLE_ANGLE_SET = ("flexspline-compliance", "kinematic-error", "soft-windup", "stiffness-modulation")
"""What one start angle cannot tell apart (quotient group of the effect catalogue)."""


@dataclass(frozen=True, slots=True)
class _Candidate:
    """A proposal with its order refined, how it fares, and among how many tests it was found."""

    trial: Trial
    proposal: Proposal
    tests: float

    @property
    def p_value(self) -> float:
        return min(1.0, self.trial.single_p * self.tests)

    def unadded(self, p_value: float, why: str) -> Unadded:
        amplitude = float(np.hypot(*self.trial.amplitudes))
        return Unadded(self.proposal.kind, self.proposal.order, amplitude, p_value, self.trial.share, why)


@dataclass(frozen=True, slots=True)
class _Accepted:
    decision: Decision
    fit: Fit


def select(
    pieces: Sequence[Piece],
    base: Fit,
    alpha: float,
    known: Mapping[str, float],
    on_stage: Callable[[str], None] = lambda _: None,
) -> Selection:
    """Add terms to the base fit until nothing more passes. `alpha`: family-wise false-alarm probability a round.

    `known`: parameters of effects that no fit estimates, by name (`ratio`, `torque_constant`, ...). `on_stage` is told
    what is being done.
    """
    current = base
    decisions: list[Decision] = []
    unadded: dict[tuple[str, int], Unadded] = {}
    left: tuple[Trial, ...] = ()
    while len(current.model.lines) < MOST_LINES:
        count = len(current.model.lines) + len(current.model.shapes)
        on_stage(f"trying every effect on what is left, {count} added so far")
        ground = prepare(current)
        lines = _candidates(ground, known)
        shapes = _shapes(ground, known, max((c.trial.gain for c in lines), default=0.0))
        left = tuple(item.trial for item in shapes)
        present = {term.effect.id for term in current.model.shapes}
        present |= set(QUOTIENT) if present & set(QUOTIENT) else set()
        shapes = [item for item in shapes if item.term.effect.id not in present]
        shapes = by_joint_fit(pieces, ground, shapes, alpha)
        accepted = _round(pieces, ground, lines, shapes, alpha, decisions, unadded)
        if accepted is None:
            break
        decision, current = accepted
        on_stage(f"added: {decision.kind.id}")
        if all(decision.kind != earlier.kind for earlier in decisions):
            decisions.append(decision)
    on_stage("judging whether what was added must stay")
    current = withdraw(pieces, current, alpha)
    on_stage("trying shapes without a name on what is left")
    current, decisions = unnamed(pieces, current, decisions, alpha, known)
    kept: set[TermClass | ShapeClass] = {line.kind for line in current.model.lines}
    kept |= {term.kind for term in current.model.shapes}
    return Selection(current, tuple(d for d in decisions if d.kind in kept), tuple(unadded.values()), left)


def _round(
    pieces: Sequence[Piece],
    ground: Ground,
    lines: Sequence[_Candidate],
    shapes: Sequence[ShapeTrial],
    alpha: float,
    decisions: list[Decision],
    unadded: dict[tuple[str, int], Unadded],
) -> tuple[Decision, Fit] | None:
    """Give the best term that may be added, and the fit with it; None if there is none."""
    candidates: list[_Candidate | ShapeTrial] = [*lines, *shapes]
    for candidate in sorted(candidates, key=lambda candidate: -candidate.trial.gain):
        if isinstance(candidate, ShapeTrial):
            judged = _judge_shape(pieces, ground, candidate, lines, shapes, alpha, decisions)
            key = (candidate.term.effect.id, 0)
        else:
            judged = _judge(pieces, ground, candidate, lines, shapes, alpha, decisions)
            proposal = candidate.proposal
            key = (proposal.kind.id, round(proposal.order / max(proposal.resolution, 1e-9)))
        if isinstance(judged, _Accepted):
            return judged.decision, judged.fit
        if judged is not None:
            unadded[key] = judged
    return None


def _shapes(ground: Ground, known: Mapping[str, float], least: float) -> list[ShapeTrial]:
    """Give how every effect that is no line explains what is left, best first."""
    scales = _scales(ground, known)
    counts = {signal: known[name] for signal, name in COUNTS.items() if name in known}
    swept = [item for item in ground.fit.linear if item.piece.equation is Equation.TORSION]
    return [
        item
        for item in shape_trials(ground, scales, least)
        if not any(counts_pass(frequency, swept, counts) for frequency in item.term.frequencies)
        and not _is_slight(item)
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


def _judge_shape(
    pieces: Sequence[Piece],
    ground: Ground,
    candidate: ShapeTrial,
    lines: Sequence[_Candidate],
    shapes: Sequence[ShapeTrial],
    alpha: float,
    decisions: Sequence[Decision],
) -> _Accepted | Unadded | None:
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
    peers = [*(x.trial for x in shapes if x is not candidate), *_best_of_classes(lines), form]
    outer = {name for name, within in NESTED.items() if term.effect.id in within}
    near = {p.label for p in peers if p.gain >= SET_SHARE * trial.gain and p.label not in {*outer, term.effect.id}}
    near |= set(QUOTIENT) - {term.effect.id} if term.effect.id in QUOTIENT else set()
    if form.gain > trial.gain / BEST_SHARE:
        return unadded("another shape explains more")
    joint = refit(pieces, ground.fit, replace(ground.fit.model, shapes=(*ground.fit.model.shapes, term)))
    again = prepare(with_noise(ground.fit, joint.noise))
    second = try_columns(again, term.effect.id, trial_columns(again, joint.model.shapes[-1]))
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
    return _Accepted(Decision(term.kind, verdict, members, ordered, p_value), joint)


def _without_windup(ground: Ground) -> bool:
    """Whether a swept torsion was recorded without the motor torque, which winds up the wave generator."""
    swept = [
        x.piece.track for x in ground.fit.linear if x.piece.equation is Equation.TORSION and not x.piece.track.moves
    ]
    return any(track.M is None for track in swept)


def _best_of_classes(lines: Sequence[_Candidate]) -> list[Trial]:
    """Give the best trial of every catalogue class of lines."""
    best: dict[str, Trial] = {}
    for candidate in lines:
        effect = candidate.proposal.kind.effect
        if effect is not None and candidate.trial.gain > best.get(effect, candidate.trial).gain * (effect in best):
            best[effect] = candidate.trial
    return list(best.values())


def _candidates(ground: Ground, known: Mapping[str, float]) -> list[_Candidate]:
    """Give everything that the residual proposes, its order refined, best first."""
    proposals, free_tests, fixed_tests = propose(ground, known)
    scored = sorted(((line_gain(ground, p.kind, p.order), p) for p in proposals), key=lambda pair: -pair[0])
    found: list[_Candidate] = []
    for rank, (gain, proposal) in enumerate(scored):
        weak = rank >= 8 or (bool(found) and gain < 0.3 * max(candidate.trial.gain for candidate in found))
        if weak and proposal.height < STANDS_OUT:
            continue
        order, tests = proposal.kind.fixed_order, fixed_tests
        if order is None:
            gain_at = functools.partial(line_gain, ground, proposal.kind)
            order, tests = refine(gain_at, proposal.order, proposal.resolution), free_tests
            legs = samplings(ground.fit.linear, proposal.kind.variable)
            chosen = likeliest(order, aliases(order, USUAL_HIGHEST_ORDER, legs), legs)
            if chosen != order and gain_at(chosen) >= SET_SHARE * gain_at(order):
                order = refine(gain_at, chosen, proposal.resolution)
        trial = try_line(ground, proposal.kind, order)
        found.append(_Candidate(trial, replace(proposal, order=order), tests))
    return sorted(found, key=lambda candidate: -candidate.trial.gain)


def _angle_at_output(trial: Trial, kind: TermClass, ground: Ground) -> float:
    """Give the largest angle, rad at the output, that a line makes while the drive turns; 0 if it makes none."""
    size = float(np.linalg.norm(trial.amplitudes))
    turning = (item.evaluation for item in ground.fit.linear if item.piece.track.moves)
    angles = (angle_addition(kind.entry, np.full(one.torque.size, size), one.torque, one.ratio) for one in turning)
    return max((float(np.abs(angle).max(initial=0.0)) for angle in angles if angle is not None), default=0.0)


def _judge(
    pieces: Sequence[Piece],
    ground: Ground,
    candidate: _Candidate,
    candidates: Sequence[_Candidate],
    shapes: Sequence[ShapeTrial],
    alpha: float,
    decisions: Sequence[Decision],
) -> _Accepted | Unadded | None:
    """Accept a candidate, say why it is not added, or give None if it may be chance or is there already."""
    trial, proposal = candidate.trial, candidate.proposal
    significant, large = candidate.p_value <= alpha, trial.share >= LARGE_SHARE
    if not (significant or large) or _already_there(ground, proposal):
        return None
    kinds = {decision.kind for decision in decisions}
    # what bends an angle shows in the angle, not only in the torque by which it acts back on the motor
    share = trial.share_of(Equation.TORSION) if proposal.kind.is_angle else trial.share
    room = proposal.kind in kinds or len(kinds) < MOST_CLASSES
    least = LEAST_CURVE_SHARE if proposal.kind.variable == "time" else LEAST_SHARE
    why, unpaid = objection(share, least, room=room), unpaid_by(trial)
    legs = samplings(ground.fit.linear, proposal.kind.variable)
    if (
        not why
        and proposal.kind.fixed_order is None
        and beats(proposal.order, ground.fit.linear, proposal.kind.variable, legs)
    ):
        why = "it is the encoder's counts beating with the samples"
    if not why and proposal.kind.is_angle and proposal.kind.fixed_order is None:
        size = _angle_at_output(trial, proposal.kind, ground)
        if small_beats(proposal.order, size, ground.fit.linear, proposal.kind.variable, legs):
            why = "it is no larger than what an encoder's counts make, and beats with the samples as they do"
    # a strong term bends the base so far that only a joint refit can tell whether it pays
    if why or (unpaid and not large):
        return candidate.unadded(candidate.p_value, why or unpaid) if significant else None
    pick = _named(ground, candidate, candidates, shapes)
    if pick is None:
        return candidate.unadded(candidate.p_value, "another shape explains more") if significant else None
    decision, chosen = pick
    sine, cosine = chosen.trial.amplitudes.tolist()
    line = Line(chosen.proposal.kind, chosen.proposal.order, sine, cosine)
    joint = refit(pieces, ground.fit, replace(ground.fit.model, lines=(*ground.fit.model.lines, line)))
    p_value = _second_look(ground, joint, candidate)
    if p_value > alpha:
        return None
    why = _joint_objection(ground, joint, unpaid, proposal.resolution)
    return candidate.unadded(p_value, why) if why else _Accepted(replace(decision, p_value=p_value), joint)


def _second_look(ground: Ground, joint: Fit, candidate: _Candidate) -> float:
    """Give the p-value of the last line of `joint`, for two looks at it.

    What a slow, strong line explains looks like noise that remembers: the second look takes blocks of time as long as
    what the line leaves asks for.
    """
    line = joint.model.lines[-1]
    again = try_line(prepare(with_noise(ground.fit, joint.noise)), line.kind, line.order)
    return min(1.0, 2.0 * min(candidate.p_value, again.single_p * candidate.tests))


def _joint_objection(ground: Ground, joint: Fit, unpaid: str, resolution: float) -> str:
    """Say why the last line of a joint refit is not added; empty if it is."""
    if unpaid and not pays_jointly(ground.fit, joint):
        return unpaid
    if not consistent(joint, len(joint.model.lines) - 1):
        return NOT_EVERYWHERE
    return "it cannot be told from a line that is there already" if _crowded(joint, resolution) else ""


def _crowded(joint: Fit, resolution: float) -> bool:
    """Whether the last line came to lie within half a resolution of another of its kind."""
    *others, last = joint.model.lines
    return any(line.kind == last.kind and abs(line.order - last.order) < 0.5 * resolution for line in others)


def _already_there(ground: Ground, proposal: Proposal) -> bool:
    return any(
        line.kind == proposal.kind and abs(line.order - proposal.order) < 0.3 * proposal.resolution
        for line in ground.fit.model.lines
    )


def _named(
    ground: Ground, best: _Candidate, candidates: Sequence[_Candidate], shapes: Sequence[ShapeTrial]
) -> tuple[Decision, _Candidate] | None:
    """Choose the class and the verdict for the best line; None if another shape explains it better."""
    others = [
        c for c in candidates if c is not best and same_place(ground.fit.model.ratio or 1.0, c.proposal, best.proposal)
    ]
    peers = [best, *others]
    most = max(peer.trial.gain for peer in peers)
    named = [c for c in peers if c.proposal.kind.effect is not None and c.trial.gain >= BEST_SHARE * most]
    pick = max(named or peers, key=lambda candidate: candidate.trial.gain)
    kind, order, gain = pick.proposal.kind, pick.proposal.order, pick.trial.gain
    rivals = [item.trial for item in shapes]
    if kind.is_angle:
        rivals.append(other_compliance(ground, scales_of(ground.fit.linear, {}).torque))
    if any(rival.gain > gain / BEST_SHARE for rival in rivals):
        return None
    near = {
        peer.trial.label
        for peer in peers
        if peer.proposal.kind != kind and peer.proposal.kind.effect and peer.trial.gain >= SET_SHARE * gain
    }
    near |= {rival.label for rival in rivals if rival.gain >= SET_SHARE * gain}
    near |= _against_motion(ground, pick.trial, pick.proposal)
    if kind.effect in TWINS and abs(order - 1.0) < 0.5 * max(best.proposal.resolution, 0.01):
        near.add(TWINS[kind.effect])
    if kind.effect == "kinematic-error" and not _angles_cover(ground):
        near |= set(SINGLE_ANGLE_SET)
    tried = [Candidate(peer.trial.label, peer.trial.gain, peer.p_value) for peer in peers]
    tried += [Candidate(rival.label, rival.gain, min(1.0, rival.single_p * best.tests)) for rival in rivals]
    ordered = tuple(sorted(tried, key=lambda candidate: -candidate.gain))
    members = tuple(sorted(near | {kind.id})) if near else ()
    verdict = Verdict.AMBIGUOUS if near else Verdict.NAMED if kind.effect else Verdict.UNNAMED
    return Decision(kind, verdict, members, ordered, best.p_value), pick


def _against_motion(ground: Ground, pick: Trial, chosen: Proposal) -> set[str]:
    """Friction that varies with the angle joins the set where the data do not show both directions."""
    if chosen.kind.entry not in (Entry.MOTOR, Entry.OUTPUT) or chosen.kind.effect is None:
        return set()
    flipped = TermClass(
        None,
        Entry.MOTOR_AGAINST_MOTION if chosen.kind.entry is Entry.MOTOR else Entry.OUTPUT_AGAINST_MOTION,
        chosen.kind.variable,
    )
    rival = try_line(ground, flipped, chosen.order)
    return {"position-dependent-friction"} if rival.gain >= SET_SHARE * pick.gain else set()


def _angles_cover(ground: Ground) -> bool:
    """Whether torsion was seen over a whole motor turn, or from enough start angles."""
    starts: set[int] = set()
    for item in ground.fit.linear:
        if item.piece.equation is not Equation.TORSION:
            continue
        angle = item.evaluation.positions["motor_position"][item.piece.index]
        if np.ptp(angle) >= 2.0 * math.pi:
            return True
        starts.add(round(float(angle.mean()) % (2.0 * math.pi) / 0.1))
    return len(starts) >= LEAST_START_ANGLES

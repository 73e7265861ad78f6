"""Whether a line is added, under which name, and why not."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from rig.loop.fitting.fit import Fit, Material, refit, with_noise
from rig.loop.fitting.normal import LinearPiece
from rig.loop.model.equations import Equation
from rig.loop.model.evaluation import angle_addition
from rig.loop.model.terms import Entry, Line, TermClass
from rig.loop.result import Candidate, Verdict
from rig.loop.search.acceptance import (
    BEST_SHARE,
    LARGE_SHARE,
    LEAST_CURVE_SHARE,
    LEAST_SHARE,
    MOST_CLASSES,
    NOT_EVERYWHERE,
    objection,
    pays_jointly,
    unpaid_by,
)
from rig.loop.search.aliases import beats, samplings, small_beats
from rig.loop.search.compliance_form import other_compliance
from rig.loop.search.decision import Accepted, Decision, Unadded
from rig.loop.search.groups import LEAST_START_ANGLES, SET_SHARE, SINGLE_ANGLE_SET, TWINS
from rig.loop.search.line_candidates import LineCandidate
from rig.loop.search.proposals import Proposal, same_place
from rig.loop.search.shape_trials import ShapeTrial, scales_of
from rig.loop.search.trial import Ground, Trial, consistent, prepare, try_line

COMPANION_SHARE, MOST_COMPANIONS = 0.1, 2
"""Share of a line's gain from which on another may be added together with it, and how many are."""

CROWDED = "it cannot be told from a line that is there already"


def judge_line(
    pieces: Material,
    ground: Ground,
    candidate: LineCandidate,
    candidates: Sequence[LineCandidate],
    shapes: Sequence[ShapeTrial],
    alpha: float,
    decisions: Sequence[Decision],
) -> Accepted | Unadded | None:
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
        size, ratio = _angle_at_output(trial, proposal.kind, ground), ground.fit.model.ratio or 1.0
        if small_beats(proposal.order, size, ground.fit.linear, proposal.kind.variable, legs, ratio):
            why = "it is no larger than what an encoder's counts make, and beats with the samples as they do"
    # a strong term bends the base so far that only a joint refit can tell whether it pays
    if why or (unpaid and not large):
        return candidate.unadded(candidate.p_value, why or unpaid) if significant else None
    pick = _named(ground, candidate, candidates, shapes)
    if pick is None:
        return candidate.unadded(candidate.p_value, "another shape explains more") if significant else None
    decision, chosen = pick
    for more in ((), *_companions(ground, chosen, candidates, alpha)):
        lines = (*ground.fit.model.lines, chosen.line, *more)
        joint = refit(pieces, ground.fit, replace(ground.fit.model, lines=lines))
        p_value = _second_look(ground, joint, candidate)
        if p_value > alpha:
            return None
        why = _joint_objection(ground, joint, unpaid, proposal.resolution, 1 + len(more))
        if not why:
            return Accepted(replace(decision, p_value=p_value), joint)
        if why == CROWDED:
            break
    return candidate.unadded(p_value, why)


def _companions(
    ground: Ground, chosen: LineCandidate, candidates: Sequence[LineCandidate], alpha: float
) -> Iterator[tuple[Line, ...]]:
    """Give the other lines of the same sort that may be needed to see that this one is there: one, then two.

    A tooth or a bearing makes several lines. Where a run sees short pieces of a turn, another of them may show more
    there, and hide that this one shows too. None that may be chance at the false-alarm rate `alpha`.
    """
    kind, gain = chosen.proposal.kind, chosen.trial.gain
    ratio = ground.fit.model.ratio or 1.0
    found: list[LineCandidate] = []
    for other in candidates:
        apart = all(not same_place(ratio, other.proposal, one.proposal) for one in (chosen, *found))
        large = other.trial.gain >= COMPANION_SHARE * gain and other.p_value <= alpha
        if other.proposal.kind == kind and apart and large and not _already_there(ground, other.proposal):
            found.append(other)
            yield tuple(one.line for one in found)
        if len(found) == MOST_COMPANIONS:
            return


def _second_look(ground: Ground, joint: Fit, candidate: LineCandidate) -> float:
    """Give the p-value of the first line that `joint` adds, for two looks at it.

    What a slow, strong line explains looks like noise that remembers: the second look takes blocks of time as long as
    what the line leaves asks for.
    """
    line = joint.model.lines[len(ground.fit.model.lines)]
    again = try_line(prepare(with_noise(ground.fit, joint.noise)), line.kind, line.order)
    return min(1.0, 2.0 * min(candidate.p_value, again.single_p * candidate.tests))


def _joint_objection(ground: Ground, joint: Fit, unpaid: str, resolution: float, count: int) -> str:
    """Say why the last `count` lines of a joint refit are not added; empty if they are."""
    if unpaid and not pays_jointly(ground.fit, joint):
        return unpaid
    places = range(len(joint.model.lines) - count, len(joint.model.lines))
    if not all(consistent(joint, place) for place in places):
        return NOT_EVERYWHERE
    crowded = any(_crowded(joint, place, resolution) for place in places)
    return CROWDED if crowded else ""


def _crowded(joint: Fit, place: int, resolution: float) -> bool:
    """Whether a line came to lie within half a resolution of another of its kind."""
    one = joint.model.lines[place]
    return any(
        line.kind == one.kind and abs(line.order - one.order) < 0.5 * resolution
        for number, line in enumerate(joint.model.lines)
        if number != place
    )


def _already_there(ground: Ground, proposal: Proposal) -> bool:
    return any(
        line.kind == proposal.kind and abs(line.order - proposal.order) < 0.3 * proposal.resolution
        for line in ground.fit.model.lines
    )


def _named(
    ground: Ground, best: LineCandidate, candidates: Sequence[LineCandidate], shapes: Sequence[ShapeTrial]
) -> tuple[Decision, LineCandidate] | None:
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


def _angle_at_output(trial: Trial, kind: TermClass, ground: Ground) -> float:
    """Give the largest angle, rad at the output, that a line makes while the drive turns; 0 if it makes none."""
    return max(ground.fit.linear.map(_angle_of, kind, float(np.linalg.norm(trial.amplitudes))), default=0.0)


def _angle_of(item: LinearPiece, kind: TermClass, size: float) -> float:
    if not item.piece.track.moves:
        return 0.0
    torque = item.evaluation.torque
    angle = angle_addition(kind.entry, np.full(torque.size, size), torque, item.evaluation.ratio)
    return 0.0 if angle is None else float(np.abs(angle).max(initial=0.0))


def _angles_cover(ground: Ground) -> bool:
    """Whether torsion was seen over a whole motor turn, or from enough start angles."""
    starts: set[int] = set()
    for start, turns in (one for one in ground.fit.linear.map(_start) if one is not None):
        if turns:
            return True
        starts.add(start)
    return len(starts) >= LEAST_START_ANGLES


def _start(item: LinearPiece) -> tuple[int, bool] | None:
    """Give the mean motor angle of a torsion in tenths of a radian, and whether it turns; None of anything else."""
    if item.piece.equation is not Equation.TORSION:
        return None
    angle = item.evaluation.positions["motor_position"][item.piece.index]
    return round(float(angle.mean()) % (2.0 * math.pi) / 0.1), bool(np.ptp(angle) >= 2.0 * math.pi)

"""Whether a line is added, under which name, and why not."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rig.loop.fitting.fit import Fit, Material, fit, refit, with_noise
from rig.loop.fitting.normal import LinearPiece
from rig.loop.model.equations import Equation
from rig.loop.model.evaluation import angle_addition
from rig.loop.model.terms import Entry, TermClass
from rig.loop.result import Verdict
from rig.loop.search.acceptance import (
    BEST_SHARE,
    COMPANION_SHARE,
    LARGE_SHARE,
    LEAST_CURVE_SHARE,
    LEAST_SHARE,
    MOST_CLASSES,
    MOST_COMPANIONS,
    NOT_EVERYWHERE,
    QUICK,
    objection,
    pays_jointly,
    unpaid_by,
)
from rig.loop.search.aliases import beats, samplings, small_beats, stands_still
from rig.loop.search.companions import next_line
from rig.loop.search.compliance_form import other_compliance
from rig.loop.search.conditions import consistent, followed_up_to
from rig.loop.search.decision import Accepted, Decision, Unadded
from rig.loop.search.groups import SET_SHARE, SINGLE_ANGLE_SET, TWINS
from rig.loop.search.line_candidates import LineCandidate
from rig.loop.search.proposals import KINEMATIC_ERROR, Proposal, is_nameless_angle, same_place
from rig.loop.search.shape_trials import ShapeTrial, scales_of
from rig.loop.search.start_angles import enough, start_angle
from rig.loop.search.trial import Ground, Trial, explain_the_same, prepare, try_line
from rig.loop.search.tried import by_gain, tried_line, tried_shape

BESIDE_AN_ANGLE = "beside another angle error it may be what that leaves, or the encoders' counts"

FAR_LARGER, SEVERAL_SPEEDS, IN_QUADRATURE = 3.0, 1.5, 0.5
"""Times the friction from which a torque at its order may show as such a one, its angle read a third of a radian late,
the fastest over the slowest speed from which they tell the two apart, and the cosine of the angle between the two lines
up to which they are taken to stand a quarter of a period apart: a small line's phase is known to half a radian."""

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
    kinds = {decision.kind for decision in decisions if not decision.given}
    # what bends an angle shows in the angle, not only in the torque by which it acts back on the motor
    share = trial.share_of(Equation.TORSION) if proposal.kind.is_angle else trial.share
    room = proposal.kind in kinds or len(kinds) < MOST_CLASSES
    nameless = proposal.kind.variable == "time" or is_nameless_angle(proposal.kind)
    least = LEAST_CURVE_SHARE if nameless and proposal.kind not in kinds else LEAST_SHARE
    why, unpaid = objection(share, least, room=room), unpaid_by(trial)
    if not why and is_nameless_angle(proposal.kind) and any(k.is_angle and k != proposal.kind for k in kinds):
        why = BESIDE_AN_ANGLE
    why = why or _beats(ground, candidate)
    # a strong term bends the base so far that only a joint refit can tell whether it pays
    if why or (unpaid and not large):
        return candidate.unadded(candidate.p_value, why or unpaid) if significant else None
    pick = _named(ground, candidate, candidates, shapes)
    if pick is None:
        return candidate.unadded(candidate.p_value, "another shape explains more") if significant else None
    decision, chosen = pick
    return _judged_jointly(pieces, ground, candidate, decision, chosen, unpaid, alpha)


def _judged_jointly(
    pieces: Material,
    ground: Ground,
    candidate: LineCandidate,
    decision: Decision,
    chosen: LineCandidate,
    unpaid: str,
    alpha: float,
) -> Accepted | Unadded | None:
    """Judge a line by joint fits, alone and then beside further lines of its sort; `unpaid`: why it does not pay yet.

    Most fail in a quick fit already, at a small part of the time that a whole one takes.
    """
    lines, alone = [chosen], None
    for _ in range(1 + MOST_COMPANIONS):
        model = replace(ground.fit.model, lines=(*ground.fit.model.lines, *(one.line for one in lines)))
        quick = fit(pieces.all, model, ground.fit.noise, passes=QUICK, block=ground.fit.block)
        alone = alone or quick
        p_value, why = candidate.p_value, _joint_objection(ground, quick, unpaid, chosen.proposal.resolution, lines)
        if not why:
            joint = refit(pieces, ground.fit, model)
            p_value = _second_look(ground, joint, candidate)
            if p_value > alpha:
                return None
            why = _joint_objection(ground, joint, unpaid, chosen.proposal.resolution, lines)
            if not why:
                return Accepted(replace(decision, p_value=p_value), joint)
        hopeless = why == CROWDED or candidate.p_value > alpha or len(lines) > MOST_COMPANIONS
        more = None if hopeless else _companion(ground, quick, lines, alpha)
        if more is None:
            break
        lines.append(more)
    if p_value > alpha:
        return None
    followed = None
    if alone is not None and why == NOT_EVERYWHERE and not chosen.proposal.kind.is_angle:
        followed = followed_up_to(alone, len(ground.fit.model.lines))
    return replace(candidate.unadded(p_value, why), followed=followed)


def _beats(ground: Ground, candidate: LineCandidate) -> str:
    """Say that a line is what an encoder's counts make as they beat with the samples; empty if it is not."""
    trial, proposal = candidate.trial, candidate.proposal
    if proposal.kind.fixed_order is not None:
        return ""
    legs = samplings(ground.fit.linear, proposal.kind.variable)
    if beats(proposal.order, ground.fit.linear, proposal.kind.variable, legs):
        return "it is the encoder's counts beating with the samples"
    if stands_still(proposal.order, legs):
        return "at one of the speeds every sample sees it alike: it may be an offset of those legs"
    # counts know of no torque, and do not beat at the very order that a gear errs with
    usual = proposal.expected and proposal.kind.effect == KINEMATIC_ERROR
    if proposal.kind.is_angle and not proposal.kind.entry.is_product and not usual:
        size, ratio = _angle_at_output(trial, proposal.kind, ground), ground.fit.model.ratio or 1.0
        if small_beats(proposal.order, size, ground.fit.linear, proposal.kind.variable, ratio):
            return "it is no larger than what an encoder's counts make, and beats with the samples as they do"
    return ""


def _companion(ground: Ground, with_lines: Fit, lines: Sequence[LineCandidate], alpha: float) -> LineCandidate | None:
    """Give a further line of the same sort that may be needed to see that the first is there; None if there is none.

    None that may be chance at the false-alarm rate `alpha`, is small beside the first, or is one that is there already.
    """
    found, ratio = next_line(with_lines, lines[0].proposal.kind), ground.fit.model.ratio or 1.0
    if found is None or found.p_value > alpha or found.trial.gain < COMPANION_SHARE * lines[0].trial.gain:
        return None
    near = any(same_place(ratio, found.proposal, one.proposal) for one in lines)
    return None if near or _already_there(ground, found.proposal) or _beats(ground, found) else found


def _second_look(ground: Ground, joint: Fit, candidate: LineCandidate) -> float:
    """Give the p-value of the first line that `joint` adds, for two looks at it.

    What a slow, strong line explains looks like noise that remembers: the second look takes blocks of time as long as
    what the line leaves asks for.
    """
    line = joint.model.lines[len(ground.fit.model.lines)]
    again = try_line(prepare(with_noise(ground.fit, joint.noise)), line.kind, line.order)
    return min(1.0, 2.0 * min(candidate.p_value, again.single_p * candidate.tests))


def _joint_objection(ground: Ground, joint: Fit, unpaid: str, resolution: float, lines: Sequence[LineCandidate]) -> str:
    """Say why `lines`, the last of a joint fit, are not added; empty if they are."""
    if unpaid and not pays_jointly(ground.fit, joint):
        return unpaid
    places = range(len(joint.model.lines) - len(lines), len(joint.model.lines))
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
    rivals = [
        item.trial
        for item in shapes
        if item.trial.gain >= SET_SHARE * gain and explain_the_same(ground, pick.columns, item.columns)
    ]
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
    near |= _against_motion(ground, pick.trial, pick.proposal) | _of_a_late_angle(ground, pick.trial, pick.proposal)
    if kind.effect in TWINS and abs(order - 1.0) < 0.5 * max(best.proposal.resolution, 0.01):
        near.add(TWINS[kind.effect])
    if kind.effect in SINGLE_ANGLE_SET and not _angles_cover(ground):
        near |= set(SINGLE_ANGLE_SET)
    tried = [*(tried_line(peer) for peer in peers), *(tried_shape(item) for item in shapes)]
    ordered = by_gain(tried)
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


def _of_a_late_angle(ground: Ground, pick: Trial, chosen: Proposal) -> set[str]:
    """Give the far larger torques at the order of a friction which, their angle read a little late, leave such a part.

    That part stands a quarter of a period from them and grows with the speed, friction does not: where the drive turned
    at several speeds nothing joins the set.
    """
    if chosen.kind.entry is not Entry.MOTOR_AGAINST_MOTION:
        return set()
    slowest, fastest = zip(*ground.fit.linear.map(_speeds), strict=True)
    if max(fastest) > SEVERAL_SPEEDS * min(slowest):
        return set()
    size, middle = float(np.linalg.norm(pick.amplitudes)), _middle(ground, chosen.kind.variable)
    friction = math.atan2(pick.amplitudes[1], pick.amplitudes[0]) + chosen.order * middle
    return {
        line.kind.effect
        for line in ground.fit.model.lines
        if line.kind.entry is Entry.MOTOR
        and line.kind.variable == chosen.kind.variable
        and line.kind.effect is not None
        and abs(line.order - chosen.order) < chosen.resolution
        and line.amplitude > FAR_LARGER * size
        and abs(math.cos(friction - line.order * middle - math.atan2(line.cosine, line.sine))) < IN_QUADRATURE
    }


def _middle(ground: Ground, variable: str) -> float:
    """Give the mean angle (rad) where the drive turned: there the phases of two nearly equal orders compare."""
    sums = ground.fit.linear.map(_angle_sum, variable)
    return sum(total for total, _ in sums) / max(sum(count for _, count in sums), 1)


def _angle_sum(item: LinearPiece, variable: str) -> tuple[float, int]:
    """Give the sum of a turning piece's angles and their number; 0 and 0 of one that does not turn."""
    angle = item.evaluation.positions.get(variable)
    if angle is None or not item.piece.track.moves:
        return 0.0, 0
    return float(angle[item.piece.index].sum()), item.piece.index.size


def _speeds(item: LinearPiece) -> tuple[float, float]:
    """Give the slowest and the fastest speed of a piece while it turns, rad/s; infinite and 0 of one that does not."""
    speed = np.abs(item.piece.track.speed[item.piece.index]) * item.piece.track.moves
    return float(np.min(speed, where=speed > 0.0, initial=np.inf)), float(np.max(speed, initial=0.0))


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
    return enough({start for start in ground.fit.linear.map(_start) if start is not None})


def _start(item: LinearPiece) -> float | None:
    """Give the start angle of a torsion, see `start_angle`; None of anything else."""
    if item.piece.equation is not Equation.TORSION:
        return None
    return start_angle(item.evaluation.positions["motor_position"][item.piece.index])

"""The unknown route: shapes without a formula, of every signal that was recorded.

A curve takes the place of an effect of the catalogue, or joins those that were found, only where it explains more: the
catalogue wins with 95 % of the best gain. What it becomes in the result is `unnamed`, with its variable and shape.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rig.loop.fitting.fit import RIDGE, SHORTEST_BLOCK, Fit, Material, fit, refit, with_noise
from rig.loop.fitting.normal import LinearPiece
from rig.loop.model.curves import ANGLES, TURNING_LOAD, WITHOUT_KNOTS, Curve, Form, tents, zero_of
from rig.loop.model.equations import Equation, Piece
from rig.loop.model.evaluation import FLEXSPLINE_TORQUE
from rig.loop.model.prediction import Model
from rig.loop.model.shapes import CORNERS, FAST_MOTOR_TORQUE, SWEPT_TORQUE, ShapeTerm
from rig.loop.result import Verdict
from rig.loop.search.acceptance import (
    BESIDE_BENT_SHARE,
    BEST_SHARE,
    FAMILIES,
    LARGE_SHARE,
    LEAST_CURVE_SHARE,
    LEAST_SHAPE_SHARE,
    MOST_CLASSES,
    objection,
    pays_jointly,
    unpaid_by,
)
from rig.loop.search.conditions import consistent_shape
from rig.loop.search.contenders import by_joint_fit
from rig.loop.search.decision import Decision
from rig.loop.search.shape_trials import Scales, ShapeTrial, scales_of, shape_of, sized
from rig.loop.search.trial import Ground, prepare, try_columns
from rig.loop.search.tried import tried_shape
from rig.loop.workers.held import Held
from sim_backend.model.effects import Enters

Floats = NDArray[np.float64]

KNOTS = (9, 25)
"""Knots of a curve over a torque, for what is wide and what is narrow;"""
FEW_KNOTS = (2, 5)
"""over anything else, which moves less."""

MOST_SPEEDS, LEAST_STEP = 6, 0.1
"""Knots over a speed at most, on either side of zero, spread over the speeds that there are; and by how much of a speed
the next one must be faster to be another."""

RADII = (0.03, 0.08, 0.18, 0.4, 0.7)
"""Radii of plays, relative to the largest value of the variable."""

MOST_SAMPLES, FEWEST_AT_A_KNOT = 1000, 8
"""Samples of a piece that knots are laid by, and how many of all must be near one."""

LEAST_FACTOR = 0.1
"""Share of its largest value that the factor of a product has where samples tell of the product."""

LEAST_TRAVEL = 1e-9
"""Relative travel below which a signal is constant."""

ONE_LAG = tuple(0.05 * 2.0**k for k in range(13))
"""s; every one is tried alone, and every third of them together."""

WAVES = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
"""Orders of the motor's angle at which a line that grows with the torque otherwise than in proportion is tried."""

INTERNAL = frozenset(
    {
        FLEXSPLINE_TORQUE,
        SWEPT_TORQUE,
        CORNERS,
        FAST_MOTOR_TORQUE,
        "direction",
        "locked",
        "turning",
        "flexspline_torsion",
        "base_friction",
        "motor_current",
    }
)
"""Names of the model's own, no signals of a log; and a current, which says what the torque says."""
SPEEDS = ("motor_velocity", "output_velocity")
"""The speed that the model follows: the output's where a log knows nothing of the motor."""

MODELLED = frozenset({*ANGLES, *SPEEDS, "output_torque", "motor_torque", TURNING_LOAD})
"""Signals that the model follows anyway; whatever else was recorded is tried as it stands."""

WITHIN = 1.0 / 3.0
"""Share of a signal's range in the campaign below which it hardly changes within a run: a temperature's is 0.1 to 0.3,
that of a voltage with a level of the day 0.5."""

MORE_THAN_A_COLUMN = 30.0
"""Gain by which each further value of a curve must pay for itself before it is compared with an effect."""

MOST_TOLD = 8
"""Curves that are told as candidates."""

NEARLY = 0.9
"""Share of the best gain of a curve's choices of knots from which on the choice that pays most is taken."""

BESIDE = 0.9
"""Share of the best gain from which on a curve is tried even if two others explain more."""


def curves(ground: Ground, scales: Scales) -> list[ShapeTerm]:
    """Give every curve that is tried, with its knots scaled to the campaign and its values at 0."""
    # without the motor torque nothing tells another torsion from the windup of the wave generator
    if any(item.equation is Equation.TORSION and not item.winds for item in ground.fit.about):
        return []
    pieces = ground.fit.linear.map(_some_samples)
    samples = _moving(pieces)
    found = []
    for enters, variable, form, factor in _kinds(samples):
        most = float(np.abs(samples[variable]).max())
        choices: list[tuple[float, ...]]
        match form:
            case Form.CURVE:
                values = samples[variable]
                if factor:
                    values = _beside(pieces, variable, factor, float(np.abs(samples[factor]).max()))
                choices = _knots(variable, values)
            case Form.PLAY:
                choices = [tuple(share * most for share in RADII)]
            case Form.LAG:
                lags = tuple(lag for lag in ONE_LAG if 2.0 * scales.period < lag < 0.5 * scales.longest)
                choices = [*((lag,) for lag in lags), lags[::3]]
            case Form.WAVE:
                choices = [(order,) for order in WAVES]
            case _:
                choices = [()]
        found += [_at_zero(enters, variable, form, factor, at) for at in choices if at or form in WITHOUT_KNOTS]
    return found


def _at_zero(enters: Enters, variable: str, form: Form, factor: str, at: tuple[float, ...]) -> ShapeTerm:
    zero = zero_of(at, enters, factor) if form is Form.CURVE else -1
    curve = Curve(enters, variable, form, factor, len(at), zero)
    return ShapeTerm(curve, (*at, *(0.0 for _ in curve.parameters[len(at) :])))


def _kinds(samples: Mapping[str, Floats]) -> Iterator[tuple[Enters, str, Form, str]]:
    """Give where, of what, in which form and times what a curve is tried."""
    known = samples.keys()
    other = [name for name in known if name not in MODELLED]
    speeds = [name for name in SPEEDS if name in known]
    of_speed = [(name, form) for name in speeds for form in (Form.CURVE, Form.LAG)]
    torsion = [("output_torque", form) for form in (Form.CURVE, Form.PLAY, Form.PEAK, Form.LAG, Form.RATE)]
    torsion += of_speed
    if {"output_torque", "motor_position"} <= known:
        yield Enters.TORSION, "motor_position", Form.WAVE, "output_torque"
    motor = [*of_speed, *(("output_torque", form) for form in (Form.CURVE, Form.PLAY))]
    friction = [*(("output_torque", form) for form in (Form.CURVE, Form.RATE, Form.PEAK)), *of_speed]
    plain = {
        Enters.TORSION: torsion,
        Enters.MOTOR_BALANCE: motor,
        Enters.OUTPUT_BALANCE: [(name, Form.CURVE) for name in speeds],
        Enters.FRICTION: friction,
    }
    products = {
        Enters.TORSION: ("output_torque",),
        Enters.MOTOR_BALANCE: ("motor_torque",),
        Enters.FRICTION: ("output_torque", TURNING_LOAD),
    }
    for enters, pairs in plain.items():
        for variable, form in pairs:
            if variable in known:
                yield enters, variable, form, ""
        for variable in other:
            yield enters, variable, Form.CURVE, ""
        for factor in products.get(enters, ()):
            for variable in (*other, *speeds):
                if factor in known and variable in known:
                    yield enters, variable, Form.CURVE, factor


def _moving(pieces: Sequence[Mapping[str, Floats]]) -> dict[str, Floats]:
    """Give values of every signal that moves, (k,), of the samples of all pieces that have it."""
    names = dict.fromkeys(name for some in pieces for name in some)
    joined = {name: np.concatenate([some[name] for some in pieces if name in some]) for name in names}
    return {name: values for name, values in joined.items() if np.ptp(values) > LEAST_TRAVEL * np.abs(values).max()}


def _some_samples(item: LinearPiece) -> dict[str, Floats]:
    """Give some of the samples that count, by signal; the speed at which a sweep winds the gear up is none."""
    rows = item.piece.index[:: max(1, item.piece.index.size // MOST_SAMPLES)]
    left_out = INTERNAL if item.piece.track.moves else INTERNAL | set(SPEEDS)
    return {name: values[rows] for name, values in item.evaluation.signals.items() if name not in left_out}


def _beside(pieces: Sequence[Mapping[str, Floats]], variable: str, factor: str, most: float) -> Floats:
    """Give the values of a variable where the factor of a product is not small against the `most` that it becomes."""
    both = [some for some in pieces if variable in some and factor in some]
    parts = [some[variable][np.abs(some[factor]) > LEAST_FACTOR * most] for some in both]
    return np.concatenate([np.zeros(0), *parts])


def _knots(variable: str, values: Floats) -> list[tuple[float, ...]]:
    """Give the knots of curves over a signal; one that no sample stands for is left out."""
    if not values.size:
        return []
    if variable in SPEEDS:
        sides = _apart(np.unique(np.abs(values[values != 0.0])))
        if sides.size:
            sides = sides[np.unique(np.linspace(0, sides.size - 1, MOST_SPEEDS).round().astype(int))]
        choices = [np.concatenate([-sides[::-1], [0.0], sides])]
    else:
        counts = KNOTS if variable in ("output_torque", "motor_torque") else FEW_KNOTS
        choices = [np.linspace(float(values.min()), float(values.max()), count) for count in counts]
    held = [at[tents(values, at).sum(axis=0) >= FEWEST_AT_A_KNOT] for at in choices if at.size > 1]
    return [tuple(at.tolist()) for at in held if at.size > 1]


def _apart(speeds: Floats) -> Floats:
    """Give those of ascending speeds (k,) that differ: legs at one speed differ a little."""
    found: list[float] = []
    for speed in speeds.tolist():
        if not found or speed > (1.0 + LEAST_STEP) * found[-1]:
            found.append(speed)
    return np.array(found)


def curve_trials(ground: Ground, known: Mapping[str, float]) -> list[ShapeTrial]:
    """Score every curve with every choice of knots, best first; each further value has to pay for itself."""
    terms = curves(ground, scales_of(ground.fit.linear, known))
    found = []
    for term in terms:
        trial = try_columns(ground, term.effect.id, shape_of(term), ridge=RIDGE)
        grown = sized(term, trial.amplitudes) if trial.gain > 0.0 else None
        if grown is not None:
            gain = max(trial.gain - MORE_THAN_A_COLUMN * trial.columns, 0.0)
            found.append(ShapeTrial(grown, replace(trial, gain=gain), FAMILIES * len(terms)))
    return sorted(found, key=lambda item: -item.trial.gain)


def _one_of_each(trials: Sequence[ShapeTrial]) -> list[ShapeTrial]:
    """Keep one of the curves that differ in their knots only: of those with nearly the best gain what pays most."""
    groups: dict[tuple[str, str], list[ShapeTrial]] = {}
    for item in trials:
        groups.setdefault((item.term.effect.id, item.term.kind.enters), []).append(item)
    found = []
    for members in groups.values():
        most = max(item.trial.gain for item in members)
        found.append(max((x for x in members if x.trial.gain >= NEARLY * most), key=lambda item: item.trial.pays))
    return sorted(found, key=lambda item: -item.trial.gain)


def time_last(trials: Sequence[ShapeTrial]) -> list[ShapeTrial]:
    """Put the best that follows a signal first where it explains 95 % of what follows the time: time stands for it."""
    signal = next((item for item in trials if item.term.effect.variable != "time"), None)
    if signal is None or signal.trial.gain < BEST_SHARE * trials[0].trial.gain:
        return list(trials)
    return [signal, *(item for item in trials if item is not signal)]


def unnamed(
    pieces: Material, current: Fit, decisions: Sequence[Decision], alpha: float, known: Mapping[str, float]
) -> tuple[Fit, list[Decision]]:
    """Put shapes without a name where they explain more than the effects that were added, or beside them.

    Gives the fit and the decisions. `decisions`: of what was added so far; `alpha`: family-wise false-alarm rate;
    `known`: parameters that no fit estimates, by name. They are looked for among few samples and judged by all: few
    samples, each a mean, hold less noise, of which any shape has a larger share.
    """
    decisions, newest = list(decisions), None
    given = {decision.kind for decision in decisions if decision.given}
    for kind in [x.kind for x in current.model.shapes if x.kind not in given]:
        term = next(x for x in current.model.shapes if x.kind == kind)
        instead = _better_curve(pieces, current, term, known, alpha)
        if instead is not None and all(instead[0].term.kind != other.kind for other in decisions):
            better, current = instead
            place = next(k for k, decision in enumerate(decisions) if decision.kind == kind)
            decisions[place] = _of_curve(better, min(1.0, better.trial.single_p * better.tests), [better])
            newest = better.term.kind
    while len({decision.kind for decision in decisions if not decision.given}) < MOST_CLASSES:
        bent = any(term.effect.reads == "output_torque" for term in current.model.shapes)
        least = BESIDE_BENT_SHARE if bent else LEAST_CURVE_SHARE
        found = _best_curve(pieces, current, known, alpha, least)
        if found is None:
            break
        best, current, p_value, tried = found
        decisions.append(_of_curve(best, p_value, tried))
        newest = best.term.kind
    if newest is not None:
        for kind in [x.kind for x in current.model.shapes if x.kind != newest and x.kind not in given]:
            here = next(x for x in current.model.shapes if x.kind == kind)
            if not _still_needed(pieces.few, current, here, alpha):
                shapes = tuple(x for x in current.model.shapes if x is not here)
                current = refit(pieces, current, replace(current.model, shapes=shapes))
    return current, decisions


def _of_curve(best: ShapeTrial, p_value: float, tried: Sequence[ShapeTrial]) -> Decision:
    near = tuple(tried_shape(x) for x in tried[:MOST_TOLD])
    return Decision(best.term.kind, Verdict.UNNAMED, (), near, p_value)


def _best_curve(
    pieces: Material, current: Fit, known: Mapping[str, float], alpha: float, least: float
) -> tuple[ShapeTrial, Fit, float, list[ShapeTrial]] | None:
    """Give the best curve that may be added, the joint fit with it, its p-value, and all that were tried.

    `least`: share of an equation's squares below which none is.
    """
    sparse = prepare(_with(pieces.few, current, current.model))
    every = curve_trials(sparse, known)
    trials = _one_of_each(every)
    taken = {term.effect.id for term in current.model.shapes}
    fresh = [item for item in trials if item.term.effect.id not in taken and _may_be_added(item, alpha, least)]
    if not fresh:
        return None
    whole = prepare(current)
    ranked = time_last(by_joint_fit(pieces.few, sparse, fresh, alpha))
    for contender in (x for k, x in enumerate(ranked) if k < 2 or x.trial.gain > BESIDE * ranked[0].trial.gain):
        first = try_columns(whole, contender.term.effect.id, shape_of(contender.term), ridge=RIDGE)
        if objection(first.share, least, room=True):
            continue
        candidate, joint = _with_best_knots(pieces, current, contender, every)
        term, p_value = candidate.term, min(1.0, candidate.trial.single_p * candidate.tests)
        # what settles after a change of speed lies in few long blocks; now it is known what it leaves
        again = prepare(with_noise(current, joint.noise, SHORTEST_BLOCK))
        second = try_columns(again, term.effect.id, shape_of(term), ridge=RIDGE)
        p_value = min(1.0, 2.0 * min(p_value, second.single_p * candidate.tests))
        if p_value > alpha or objection(second.share, least, room=True):
            continue
        together = _is_condition(whole, term.effect.variable)
        if pays_jointly(current, joint, replicates_together=together) and consistent_shape(
            joint, len(joint.model.shapes) - 1
        ):
            return candidate, joint, p_value, trials
    return None


def _is_condition(ground: Ground, variable: str) -> bool:
    """Whether a signal beside those that the model follows hardly changes within a run, as a temperature.

    It is alike in replicates then, and may do no more than tell them from all other runs.
    """
    if variable in MODELLED:
        return False
    ranges = np.array([pair for pair in ground.fit.linear.map(_range, variable) if pair is not None])
    return bool(ranges.size and np.median(np.ptp(ranges, axis=1)) < WITHIN * np.ptp(ranges))


def _range(item: LinearPiece, variable: str) -> tuple[float, float] | None:
    values = item.evaluation.signals.get(variable)
    return None if values is None else (float(values.min()), float(values.max()))


def _with_best_knots(
    pieces: Material, before: Fit, contender: ShapeTrial, every: Sequence[ShapeTrial]
) -> tuple[ShapeTrial, Fit]:
    """Give the contender with those knots that predict best the runs that are left out, and the joint fit with it.

    Where few samples hold a knot, a curve with fewer of them foretells more. `every`: all choices of knots.
    """

    def with_it(item: ShapeTrial) -> Fit:
        return refit(pieces, before, replace(before.model, shapes=(*before.model.shapes, item.term)))

    best, joint = contender, with_it(contender)
    noise, least = joint.noise, _left_out(joint)
    for other in every:
        if not _differ_in_knots(other.term, contender.term):
            continue
        fitted = with_it(other)
        left = _left_out(with_noise(fitted, noise))
        if left < least:
            best, joint, least = other, fitted, left
    return best, joint


def _differ_in_knots(one: ShapeTerm, other: ShapeTerm) -> bool:
    """Whether both are the same curve through other knots."""
    curves = [x.effect for x in (one, other) if isinstance(x.effect, Curve) and x.effect.form is Form.CURVE]
    alike = {replace(curve, knots=0, zero=-1) for curve in curves}
    return len(curves) == 2 and len(alike) == 1 and one.values[: curves[0].knots] != other.values[: curves[1].knots]


def _left_out(joint: Fit) -> float:
    """Give the weighted squares of all runs, each predicted from the others."""
    return float(joint.normal.leave_one_out(joint.prior, joint.pull).sum())


def _may_be_added(item: ShapeTrial, alpha: float, least: float) -> bool:
    """Whether a curve is worth a joint fit: no chance, large enough, and paying when runs are left out, or large."""
    if objection(item.trial.share, least, room=True):
        return False
    large = item.trial.share >= LARGE_SHARE
    return large or (item.trial.single_p * item.tests <= alpha and not unpaid_by(item.trial))


def _better_curve(
    pieces: Material,
    current: Fit,
    term: ShapeTerm,
    known: Mapping[str, float],
    alpha: float,
) -> tuple[ShapeTrial, Fit] | None:
    """Give the curve that explains more than an effect which was added, and the fit with it in the effect's place.

    None if the effect holds with 95 %. Both are compared without the effect, everything else there, by joint fits to
    few samples, and at last by what they foretell of runs that are left out: part of it the base may have taken up.
    """
    without = prepare(_without(pieces.few, current, term))
    own = try_columns(without, term.effect.id, shape_of(term))
    trials = [
        x
        for x in time_last(_one_of_each(curve_trials(without, known)))
        if x.trial.gain * BEST_SHARE > own.gain
        and x.trial.single_p * x.tests <= alpha
        and not (objection(x.trial.share, LEAST_CURVE_SHARE, room=True) or unpaid_by(x.trial))
    ]
    if not trials:
        return None
    # what the base takes up nearly all of has no gain before the joint fit, and yet may be the whole truth
    contends = replace(own, gain=max(own.gain, trials[0].trial.gain))
    ranked = by_joint_fit(pieces.few, without, [trials[0], ShapeTrial(term, contends, 1.0)], alpha)
    gains = {item.term is term: item.trial.gain for item in ranked}
    if gains[False] * BEST_SHARE <= gains[True]:
        return None
    best, bare = trials[0], _without(pieces.all, current, term)
    again = try_columns(prepare(bare), best.term.effect.id, shape_of(best.term), ridge=RIDGE)
    if objection(again.share, LEAST_CURVE_SHARE, room=True):
        return None
    shapes = tuple(best.term if x is term else x for x in current.model.shapes)
    joint = refit(pieces, current, replace(current.model, shapes=shapes))
    most = _left_out(bare)
    foretold = most - _left_out(with_noise(joint, current.noise))
    return (best, joint) if foretold * BEST_SHARE > most - _left_out(current) else None


def _still_needed(few: Held[Piece], current: Fit, term: ShapeTerm, alpha: float) -> bool:
    """Whether an effect or a curve would be added to what else is there now."""
    without = prepare(_without(few, current, term))
    is_curve = isinstance(term.effect, Curve)
    trial = try_columns(without, term.effect.id, shape_of(term), ridge=RIDGE if is_curve else 0.0)
    least = LEAST_CURVE_SHARE if is_curve else LEAST_SHAPE_SHARE
    return trial.single_p <= alpha and trial.share >= least and not unpaid_by(trial)


def _without(few: Held[Piece], current: Fit, term: ShapeTerm) -> Fit:
    return _with(few, current, replace(current.model, shapes=tuple(x for x in current.model.shapes if x is not term)))


def _with(few: Held[Piece], current: Fit, model: Model) -> Fit:
    """Fit a model to few samples, weighted as they are in the current fit."""
    return fit(few, model, current.noise, passes=3, block=current.block)

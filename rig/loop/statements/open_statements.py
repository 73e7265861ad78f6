"""What stays open: structure without an accepted term, base parameters off their catalogue values.

Silence is not "no effect": a residual that repeats between replicates, or follows a shape that no accepted term has,
is reported as `untraced` with its evidence.
"""

import math
from collections import Counter
from collections.abc import Collection, Mapping, Sequence, Set

import numpy as np

from rig.config.dut import Dut
from rig.log.run import ProcedureName
from rig.log.units import mixed_up
from rig.loop.model.equations import Equation, Law
from rig.loop.model.parameters import flexspline_entries
from rig.loop.model.prediction import Model
from rig.loop.result import ABOVE_FLOOR, EquationResult, Json, Open, Verdict
from rig.loop.search.acceptance import LEAST_IMPROVED, LEAST_SHAPE_SHARE
from rig.loop.search.decision import Selection
from rig.loop.search.groups import LEAST_SLOPE, QUOTIENT, SET_SHARE
from rig.loop.statements.before_after import BeforeAfter, made_worse
from rig.loop.statements.channels import correlations
from rig.loop.statements.colour import cleaned_away, slow_noise
from rig.loop.statements.dwells import LEAST_DWELL, MEDIAN_TO_SIGMA, dwell_of, quantisation_square
from rig.loop.statements.events import Event
from rig.loop.statements.evidence import Louder, Memory, Repeats, louder, memory, repeats
from rig.loop.statements.hums import Hum, hum_of, without_hum
from rig.loop.statements.report_steps import base_estimates
from rig.loop.statements.residuals import Residual, by_procedure, pairs

STIFFNESS_DEVIATION = 0.10
"""Relative deviation of the stiffness without torque from the catalogue beyond which a quotient group is at work."""

STIFFNESS_GROUP = ("fixture-compliance", "flexspline-compliance", "torque-constant-error", "torque-sensor-gain")

SLOPE_GROUP = ("load-dependent-friction", "torque-constant-error", "torque-sensor-gain")
SURE = 1e-4
"""False-alarm probability of a single test below which such a statement is made."""

SURE_OF_MANY = 1e-7
"""The same for the best of all shapes at all points of their grids, some hundreds of tests."""

PLAYS = (Law.LOCKED, Law.BACKDRIVE)
"""Laws in which a play carries one torque to the other."""

MANY_COUNTS = 4
"""Counts of a step from which its error no longer tells a whole number."""

OUTLIER = 5.0
"""Standard deviations beyond which a value is an outlier."""

MISSING_DWELL = f"a dwell of {LEAST_DWELL:g} s before the first motion of every run"
MISSING_COUNTS = "the encoders' counts per turn in the device file"


def open_statements(
    selection: Selection,
    train: Sequence[BeforeAfter],
    held_out: Sequence[BeforeAfter],
    equations: Mapping[str, EquationResult],
    dut: Dut,
) -> tuple[Open, ...]:
    """Give everything that stays open after the selection. `train`, `held_out`: what all runs leave."""
    model, used = selection.fit.model, {decision.kind.variable for decision in selection.decisions}
    every = [*train, *held_out]
    runs, events, calm = [x.after for x in every], [x.events for x in every], [x.calm for x in every]
    found = [*_events(runs, events, used), *_left_over(calm[: len(train)], runs[: len(train)], dut, model, used)]
    if not any(events):  # the sum of steps looks like many things
        found += _shapes(selection)
    found += made_worse(equations) if selection.added else []
    known = {(item.evidence.get("equation"), item.evidence.get("procedure")) for item in found}
    found += [
        *_above_floor(calm[len(train) :], equations, known, dut, model),
        *_absorbed(selection, dut),
        *_slope(selection),
    ]
    if not found and not selection.added:
        found = _without_floor(runs, equations, dut, selection.fit.model.ratio)
    return tuple(found)


def _without_floor(
    residuals: Sequence[Residual], equations: Mapping[str, EquationResult], dut: Dut, ratio: float | None
) -> list[Open]:
    """Report that nothing tells noise from structure: no equation has a floor, and no replicates stand for one."""
    sides = [side for item in equations.values() for side in (item.held_out, item.train) if side is not None]
    if any(errors.floor is not None for side in sides for errors in (side, *side.by_procedure.values())):
        return []
    pieces = [residual.piece for residual in residuals]
    missing = [] if any(piece.track.replicate is not None for piece in pieces) else ["replicate runs"]
    if any(dwell_of(piece) is None for piece in pieces):
        missing.append(MISSING_DWELL)
    return [
        Open(
            verdict=Verdict.UNTRACED,
            evidence={
                "equation": ", ".join(equations),
                "missing": [*missing, *_missing_counts(residuals, dut, ratio)],
                "meaning": "no equation has a floor, so that nothing tells whether what is left is noise",
            },
        )
    ]


def _missing_counts(residuals: Sequence[Residual], dut: Dut, ratio: float | None) -> list[str]:
    angles = [residual.piece for residual in residuals if residual.piece.equation is Equation.TORSION]
    return [MISSING_COUNTS] if any(quantisation_square(piece, dut, ratio) is None for piece in angles) else []


def _events(residuals: Sequence[Residual], events: Sequence[tuple[Event, ...]], used: Collection[str]) -> list[Open]:
    """Report the steps that come at once, stay, and are in no replicate: what the model can add repeats."""
    found = []
    for (equation, procedure), members in by_procedure(residuals).items():
        own = {id(residual) for residual in members}
        listed = [
            event for residual, some in zip(residuals, events, strict=True) if id(residual) in own for event in some
        ]
        if not listed:
            continue
        runs = Counter(event.run for event in listed)
        evidence: dict[str, Json] = {
            "equation": equation,
            "procedure": procedure,
            "events": [
                {"run": event.run, "time_s": event.time, "counts": event.counts, "rad": event.size} for event in listed
            ],
            "odd_runs": [run for run, _ in runs.most_common()],
            "replicate_pairs": len(pairs(members)),
            "channels": _channels(residuals, equation, used),
            "meaning": f"the torsion steps {_by(listed)} at single moments, and stays there; "
            + ("no replicate steps with it" if pairs(members) else "no run was repeated that could show it again"),
        }
        found.append(Open(Verdict.UNCONTROLLED, evidence, times=tuple(event.time for event in listed)))
    return found


def _by(events: Sequence[Event]) -> str:
    """Say what the steps come to: a step of many counts is whole within its error, whatever made it."""
    if all(abs(event.counts) < MANY_COUNTS for event in events):
        return "by whole counts of the motor's encoder"
    return "by many counts of the motor's encoder, whole or not: it lost them, or a coupling or the lock slipped"


def _channels(residuals: Sequence[Residual], equation: str, used: Collection[str]) -> Json:
    same = [residual for residual in residuals if residual.piece.equation.value == equation]
    found = correlations(same, used)
    if not found:
        return "none recorded beside angles and torques"
    return {name: {"correlation": item.value, "p_value": item.p_value} for name, item in found.items()}


def _left_over(
    residuals: Sequence[Residual], recorded: Sequence[Residual], dut: Dut, model: Model, used: Collection[str]
) -> list[Open]:
    """Judge what is left of every equation and procedure; `recorded`: with the events that `residuals` lack."""
    found = []
    for members in by_procedure(residuals).values():
        hum = hum_of(members)
        if hum is not None:
            found.append(_hum(hum))
            members = [without_hum(residual, hum) for residual in members]
        judged = repeats(members, dut, model)
        if judged is not None:
            if judged.structured:
                found.append(_untraced(judged, _missing_counts(members, dut, model.ratio)))
            elif judged.unsteady:
                found.append(_uncontrolled(judged, _channels(recorded, judged.equation, used)))
            else:
                found += map(_louder, louder(members))
            continue
        alone = memory(members, dut, model)
        if alone is not None and alone.structured:
            found.append(_remembering(alone))
    return found


def _uncontrolled(item: Repeats, channels: Json) -> Open:
    return Open(
        verdict=Verdict.UNCONTROLLED,
        evidence={
            "equation": item.equation,
            "procedure": item.procedure,
            "rho": item.rho,
            "replicate_pairs": item.pairs,
            "rms_slow_not_repeating": math.sqrt(item.own_slow),
            "rms_slow_of_noise": None if item.noise is None else math.sqrt(item.noise),
            "ljung_box_per_lag": item.ljung_box,
            "odd_runs": list(item.odd),
            "channels": channels,
            "meaning": "the residual does not repeat between replicates, and is no noise of the colour that the dwells "
            "show: something acts that is not held, or an event",
        },
    )


def _louder(item: Louder) -> Open:
    return Open(
        verdict=Verdict.UNCONTROLLED,
        evidence={
            "equation": item.equation,
            "procedure": item.procedure,
            "odd_runs": [item.run],
            "replicates": f"{item.run} leaves {item.times:.2g} times what {item.replicate} does",
            "meaning": f"{item.run} does not repeat {item.replicate}: something acted in one of them alone",
        },
    )


def _hum(item: Hum) -> Open:
    return Open(
        verdict=Verdict.UNCONTROLLED,
        evidence={
            "equation": item.equation,
            "procedure": item.procedure,
            "frequency": item.frequency,
            "amplitude": item.amplitude,
            "legs": item.legs,
            "p_value": item.p_value,
            "meaning": "a hum over the time, at one frequency whatever the speed; it does not keep step with the logs, "
            "so that no term predicts it",
        },
    )


def _remembering(item: Memory) -> Open:
    known = "the dwells are quieter" if item.dwells else "coloured noise is not excluded"
    return Open(
        verdict=Verdict.UNTRACED,
        evidence={
            "equation": item.equation,
            "procedure": item.procedure,
            "replicate_pairs": 0,
            "rms_slow": item.slow,
            "rms_slow_of_noise": item.noise,
            "ljung_box_per_lag": item.ljung_box,
            "missing": ["replicate runs"] + ([] if item.dwells else [MISSING_DWELL]),
            "meaning": f"the residual has structure that no term explains; no run was repeated, and {known}",
        },
    )


def _untraced(item: Repeats, missing: Sequence[str]) -> Open:
    return Open(
        verdict=Verdict.UNTRACED,
        evidence={
            "equation": item.equation,
            "procedure": item.procedure,
            "rho": item.rho,
            "replicate_pairs": item.pairs,
            "rms_repeating": math.sqrt(item.common),
            "rms_not_repeating": math.sqrt(item.own),
            "ljung_box_per_lag": item.ljung_box,
            **({"missing": missing} if missing else {}),
            "meaning": "the residual repeats between replicates, but no term explains it"
            + (": without the counts nothing tells how much of it their steps are" if missing else ""),
        },
    )


def _shapes(selection: Selection) -> list[Open]:
    """Report the effect that explains most of what is left, if it is no chance."""
    trials = [
        trial
        for trial in selection.left
        if trial.label not in QUOTIENT
        and trial.single_p < SURE_OF_MANY
        and trial.share >= LEAST_SHAPE_SHARE
        and trial.improved >= LEAST_IMPROVED
        and trial.pays > 0.0
    ]
    if not trials:
        return []
    best = max(trials, key=lambda trial: trial.gain)
    near = sorted(trial.label for trial in trials if trial.gain >= SET_SHARE * best.gain)
    return [
        Open(
            verdict=Verdict.UNTRACED,
            group=tuple(near),
            evidence={
                "equation": max(best.shares, key=lambda equation: best.shares[equation]).value,
                "looks_like": near,
                "share_of_squares": float(best.share),
                "p_value": best.single_p,
                "meaning": "the residual follows this shape, but not so that it could be added",
            },
        )
    ]


def _above_floor(
    residuals: Sequence[Residual],
    equations: Mapping[str, EquationResult],
    known: Set[tuple[Json, Json]],
    dut: Dut,
    model: Model,
) -> list[Open]:
    """Report what is left far above the floor where no other statement does; `known`: (equation, procedure) there.

    Single outliers of a heavy-tailed noise are no structure: they count only as far as `OUTLIER`. Nor is what the
    smoothing of a torque took away, or put in where it was wrong, nor what a play carries on of a noise that remembers:
    one reversal that it moved shifts a whole leg, and a few replicates hold too few legs to show how far.
    """
    found = []
    for (name, procedure), members in by_procedure(residuals).items():
        whole, fitted = equations[name].held_out, equations[name].train
        errors = whole.by_procedure.get(procedure) if whole is not None else None
        if (
            fitted is None
            or procedure not in fitted.by_procedure
            or errors is None
            or errors.floor_ci95 is None
            or known & {(name, procedure), (name, None)}
        ):
            continue
        smoothed = np.concatenate([cleaned_away(residual, model) for residual in members])
        taken = float(np.mean(smoothed**2))
        if members[0].piece.law in PLAYS:
            taken = max(taken, slow_noise(members, dut, model).square)
        left, high = _without_outliers(members), math.hypot(errors.floor_ci95[1], math.sqrt(taken))
        if left > ABOVE_FLOOR * high:
            evidence: dict[str, Json] = {
                "equation": name,
                "procedure": procedure,
                "rms_after": left,
                "floor_high": high,
                "meaning": "what is left lies above the floor of the instruments, and no term explains it",
            }
            found.append(Open(verdict=Verdict.UNTRACED, evidence=evidence))
    return found


def _without_outliers(residuals: Sequence[Residual]) -> float:
    """Give the rms of the residuals, each value counted up to `OUTLIER` times their typical size."""
    values = np.abs(np.concatenate([residual.values for residual in residuals]))
    typical = float(np.median(values)) or float(np.sqrt(np.mean(values**2)))
    bound = OUTLIER * MEDIAN_TO_SIGMA * typical
    return float(np.sqrt(np.mean(np.minimum(values, bound) ** 2)))


def _slope(selection: Selection) -> list[Open]:
    """Report that the output torque is not ratio times the motor torque: no run here tells which of them is wrong."""
    trial = next((item for item in selection.left if item.label == "torque-sensor-gain"), None)
    if trial is None or trial.single_p > SURE or abs(float(trial.amplitudes[0])) < LEAST_SLOPE:
        return []
    deviation = float(trial.amplitudes[0])
    return [
        Open(
            verdict=Verdict.ABSORBED,
            group=SLOPE_GROUP,
            parameter="output_torque / (ratio * motor_torque)",
            deviation=deviation,
            evidence={
                "p_value": trial.single_p,
                "meaning": "the two torques do not agree, and these runs cannot tell which one is wrong",
            },
        )
    ]


def _absorbed(selection: Selection, dut: Dut) -> list[Open]:
    gear = dut.gear
    if gear.K1 is None or gear.K2 is None or gear.T1 is None or gear.T2 is None:
        return []
    # without a sweep of the torque its noise is all that tells of the stiffness
    swept = any(item.equation is Equation.TORSION and not item.moves for item in selection.fit.about)
    stiffness = flexspline_entries(gear, selection.fit.model.table.law)[0]
    estimate = base_estimates(selection.fit).get(stiffness.name)
    if not swept or estimate is None or estimate.ci95 is None:
        return []
    catalogue = stiffness.centre
    deviation = estimate.value / catalogue - 1.0
    low, high = estimate.ci95
    if abs(deviation) < STIFFNESS_DEVIATION or low <= catalogue <= high:
        return []
    unit = mixed_up("N*m", estimate.value / catalogue)
    units = f"; torques in {unit} that were taken for N*m would do so, or K1 and K2 in another unit" if unit else ""
    return [
        Open(
            verdict=Verdict.ABSORBED,
            group=_stiffness_group(selection, deviation),
            parameter=stiffness.name,
            deviation=deviation,
            evidence={
                "fitted": estimate.value,
                "catalogue": catalogue,
                "unit": stiffness.unit,
                "meaning": f"these runs cannot separate the members of the group{units}",
            },
        )
    ]


def _stiffness_group(selection: Selection, deviation: float) -> tuple[str, ...]:
    """Give what may have moved the stiffness: a fixture only makes it softer, and backdrives, which lack it, tell."""
    backdriven = any(
        item.equation is Equation.TORSION and item.procedure is ProcedureName.BACKDRIVE for item in selection.fit.about
    )
    yields = deviation < 0.0 and not backdriven
    return tuple(name for name in STIFFNESS_GROUP if yields or name != "fixture-compliance")

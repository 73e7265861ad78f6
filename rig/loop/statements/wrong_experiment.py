"""Runs that say nothing of what the model lacks: taken under other conditions, or unlike all others of their kind.

Ranges of what goes into the model are compared before errors are. A held-out run beyond the range of the fitted ones
with a larger error may be a wrong experiment, and says little of a missing effect. A run whose inputs are those of the
others and whose error is not had something else that nobody recorded: another load or pose, as a rule.
"""

import math
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from drivers.signals import BY_NAME
from rig.config.dut import Dut
from rig.log.run import ProcedureName
from rig.loop.model.equations import Equation
from rig.loop.model.prediction import Model
from rig.loop.result import Json, Open, Verdict
from rig.loop.signals.tracks import Track
from rig.loop.statements.colour import rows_of, slow_noise, slow_square
from rig.loop.statements.residuals import Residual

Floats = NDArray[np.float64]

BEYOND = 0.25
"""Share of the width of a range by which another run may lie beyond it."""

LEAST_BEYOND = {"N*m": 0.0, "rad/s": 1.0, "degC": 8.0, "rad": 0.2}
"""The same at least, in the signal's unit: a pose, a temperature and a slow speed matter little within it."""

ENDS = (0.5, 99.5)
"""Percentiles between which the range of a signal lies; single readings are noise."""

TURN = 2.0 * math.pi
"""rad at the output: runs over a full turn have seen every pose."""

UNLIKE = 4.0
"""Times the largest slow error of the other runs from which on a run does not fit with them."""

WORSE = 1.5
"""The same for a run that lies beyond the range of the fitted ones."""

ABOVE_NOISE = 3.0
"""Times what noise, counts and smoothing leave in the slow part of its error, from which on it is judged at all."""

LEAST_PART = 0.5
"""Part of a run's whole error that the slow one is at least: what is mostly noise says nothing of a condition."""

OTHER_SPEED = 0.15
"""Relative distance from the nearest speed of another run from which on a leg had a speed of its own."""

SAME_SPEED, SPEED_TERMS = 0.02, 2
"""The same where the others know no more speeds than the base law of friction has terms over the speed, T_c and b: it
goes through any friction at so few of them, and nothing says how it goes on.
"""

LEG_DIGITS, SAME_LEG = 6, 2e-6
"""Decimals of rad/s to which the speed of a leg is told, and by how much two of one leg may then differ, rad/s."""

FEWEST_OTHERS = 2
"""Runs with which one is compared; of two nobody knows which is the odd one."""

MOST_UNLIKE = 1.0 / 3.0
"""Share of the runs that may be odd; if more are, it is the model that does not fit."""


@dataclass(frozen=True, slots=True)
class Outside:
    """A signal of a run that leaves the range `low` to `high` of other runs: it reaches `value`; all in `unit`."""

    run: str
    procedure: str
    signal: str
    value: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True, slots=True)
class Unlike:
    """A run whose slow error of one equation is far above that `typical` of the others; both in `unit`.

    `repeated`: a replicate of it has no such error.
    """

    run: str
    equation: str
    procedure: str
    slow: float
    typical: float
    unit: str
    repeated: bool = False


@dataclass(frozen=True, slots=True)
class WrongExperiments:
    """What is said of such runs, `told` all of them; `runs`: those whose error says nothing of the model."""

    runs: frozenset[str]
    told: frozenset[str]
    open: tuple[Open, ...]
    warnings: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Range:
    """Where a signal lies in a run, in `unit`; `noise`: five standard deviations of it."""

    low: float
    high: float
    noise: float
    unit: str


@dataclass(frozen=True, slots=True)
class Inputs:
    """What went into one run: ranges by signal, and by velocity the sizes of its legs' speeds, rad/s."""

    run: str
    procedure: str
    ranges: Mapping[str, Range]
    speeds: Mapping[str, tuple[float, ...]]


def wrong_experiments(
    tracks: Sequence[Track], names: Set[str], residuals: Sequence[Residual], dut: Dut, model: Model, left_out: str = ""
) -> WrongExperiments:
    """Judge all runs of a campaign, of which those called `names` were fitted.

    `residuals`: of all, as `BeforeAfter.kept_apart_by` gives them; `model`: the one with all effects. `left_out`: a run
    that is neither fitted nor held out, because the others agree without it.
    """
    everyone = {track.name: inputs_of(track) for track in tracks}
    fitted = [item for name, item in everyone.items() if name in names]
    others = [item for name, item in everyone.items() if name not in names and name != left_out]
    beyond = {item.run: outside(item, fitted) for item in others}
    odd: list[tuple[Unlike, Residual]] = []
    worse: set[str] = set()
    groups: dict[tuple[str, str], list[Residual]] = {}
    for residual in residuals:
        groups.setdefault((residual.piece.equation.value, residual.piece.track.procedure.value), []).append(residual)
    for members in groups.values():
        errors = [_error(residual, dut, model) for residual in members]
        by_run = {residual.piece.track.name: residual for residual in members}
        odd += [(item, by_run[item.run]) for item in unlike(errors)]
        outer = [error for error in errors if beyond.get(error.run)]
        worse |= worse_than_fitted(outer, errors, {item.run for item in fitted})
    rest = [item for name, item in everyone.items() if name not in {one.run for one, _ in odd}]
    found: list[Unlike] = []
    statements = []
    for run in dict.fromkeys(one.run for one, _ in odd):
        if beyond.get(run) or outside(everyone[run], rest):
            continue
        mine = [(one, residual) for one, residual in odd if one.run == run]
        own = own_speeds(everyone[run], rest)
        items = [one for one, _ in mine]
        if own and all(_fits_elsewhere(one, residual, own, dut, model) for one, residual in mine):
            statements.append(_open_speeds(items, own))
        else:
            found += items
            statements.append(_open(items))
    if left_out and all(item.evidence["run"] != left_out for item in statements):
        statements.append(_open_left_out(everyone[left_out], outside(everyone[left_out], fitted)))
    return WrongExperiments(
        runs=frozenset([*worse, *(item.run for item in found), *([left_out] if left_out else [])]),
        told=frozenset([*worse, *(str(item.evidence["run"]) for item in statements)]),
        open=tuple(statements),
        warnings=tuple(_said(item, item.run in worse) for items in beyond.values() for item in items),
    )


def outside(run: Inputs, others: Sequence[Inputs]) -> tuple[Outside, ...]:
    """Give every input by which a run lies beyond the range of the other runs of its procedure."""
    found = []
    like = [other for other in others if other.procedure == run.procedure and other.run != run.run]
    for name, own in run.ranges.items():
        known = [other.ranges[name] for other in like if name in other.ranges]
        if not known:
            continue
        low, high = min(r.low for r in known), max(r.high for r in known)
        if name == "output_position" and high - low >= TURN:
            continue
        scale = max(high - low, abs(low), abs(high)) if own.unit in SCALED else high - low
        margin = max(BEYOND * scale, LEAST_BEYOND[own.unit], own.noise)
        if own.high > high + margin or own.low < low - margin:
            value = own.high if own.high - high > low - own.low else own.low
            found.append(Outside(run.run, run.procedure, name, value, low, high, own.unit))
    return tuple(found)


def own_speeds(run: Inputs, others: Sequence[Inputs]) -> tuple[float, ...]:
    """Give the speeds of a run's legs, rad/s, that no other run of its procedure comes near."""
    found: list[float] = []
    for name, own in run.speeds.items():
        known = sorted(v for other in others if other.procedure == run.procedure for v in other.speeds.get(name, ()))
        differing = 1 + sum(b > (1.0 + SAME_SPEED) * a for a, b in pairwise(known))
        apart = OTHER_SPEED if differing > SPEED_TERMS else SAME_SPEED
        found += [v for v in own if known and min(abs(v - speed) for speed in known) > apart * v]
    return tuple(found)


def _fits_elsewhere(item: Unlike, residual: Residual, own: Sequence[float], dut: Dut, model: Model) -> bool:
    """Whether a run that does not fit does so only on the legs at speeds of its `own`, rad/s."""
    size = np.abs(residual.piece.track.speed[rows_of(residual)])
    kept = ~np.any(np.abs(size[:, None] - np.asarray(own)) <= SAME_LEG, axis=1)
    if not kept.any():
        return True
    error = _error(replace(residual, time=residual.time[kept], values=residual.values[kept]), dut, model)
    return error.slow <= UNLIKE * item.typical or not error.stands_out


SCALED = ("N*m", "rad/s")
"""Units in which zero means nothing: a share of the largest size is a share."""


@dataclass(frozen=True, slots=True)
class Error:
    """What is left of one equation in a run: its `slow` part, the whole of it, and what noise leaves of the slow part.

    Root mean squares in the equation's unit.
    """

    run: str
    replicate: str | None
    equation: Equation
    procedure: str
    slow: float
    whole: float
    noise: float

    @property
    def stands_out(self) -> bool:
        """Whether it is far more than noise, and mostly slow: what is mostly noise says nothing of a condition."""
        return self.slow > max(ABOVE_NOISE * self.noise, LEAST_PART * self.whole)


def _error(residual: Residual, dut: Dut, model: Model) -> Error:
    track, values = residual.piece.track, residual.values
    return Error(
        run=track.name,
        replicate=track.replicate,
        equation=residual.piece.equation,
        procedure=track.procedure.value,
        slow=math.sqrt(slow_square(residual)),
        whole=float(np.sqrt(np.mean(values**2))) if values.size else 0.0,
        noise=math.sqrt(slow_noise([residual], dut, model).square),
    )


def unlike(errors: Sequence[Error]) -> tuple[Unlike, ...]:
    """Give the runs, of one equation and procedure, each of whose slow errors is `UNLIKE` times all others or more.

    Runs under several conditions differ: only what stands apart from the largest of the rest is odd.
    """
    ordered = sorted(errors, key=lambda error: -error.slow)
    slow = [error.slow for error in ordered]
    most = int(MOST_UNLIKE * len(slow))
    count = max((k for k in range(1, most + 1) if slow[k - 1] > UNLIKE * slow[k]), default=0)
    if len(slow) <= FEWEST_OTHERS or not count:
        return ()
    odd = [error for error in ordered[:count] if error.stands_out]
    fine = {error.replicate for error in errors if error.replicate is not None and error not in odd}
    typical = float(np.median(slow[count:]))
    return tuple(
        Unlike(x.run, x.equation.value, x.procedure, x.slow, typical, x.equation.unit, x.replicate in fine) for x in odd
    )


def worse_than_fitted(beyond: Sequence[Error], errors: Sequence[Error], fitted: Set[str]) -> set[str]:
    """Give the runs, of those beyond the range of the fitted ones, whose slow error is larger than any of theirs."""
    largest = max((error.slow for error in errors if error.run in fitted), default=0.0)
    return {error.run for error in beyond if error.slow > max(WORSE * largest, ABOVE_NOISE * error.noise)}


def inputs_of(track: Track) -> Inputs:
    """Give the ranges of what goes into the model and is not predicted by it, at the samples that count."""
    use = track.usable & track.steady if track.moves else track.usable
    of_motor = track.motor_position is not None or track.motor_torque is not None or track.motor_current is not None
    turns = "motor_velocity" if of_motor else "output_velocity"
    # of either sign: a device that turns the same way has its motor's signs turned
    drive = None if track.motor_torque is None else np.abs(track.motor_torque)
    locked = track.procedure is ProcedureName.LOCKED_OUTPUT
    known = {
        "output_torque": None if locked else track.output_torque,
        "motor_torque": drive if locked else None,
        turns: np.abs(track.speed) if track.moves else None,
        "output_position": track.output_position,
        "temperature": track.auxiliary.get("temperature"),
        "motor_temperature": track.auxiliary.get("motor_temperature"),
    }
    ranges = {
        name: _range(values[use], "rad/s" if name == turns else BY_NAME[name].unit)
        for name, values in known.items()
        if values is not None and use.any()
    }
    legs = np.unique(np.abs(track.speed[use]).round(LEG_DIGITS)) if track.moves else np.zeros(0)
    return Inputs(track.name, track.procedure.value, ranges, {turns: tuple(legs.tolist())})


def _range(values: Floats, unit: str) -> Range:
    low, high = np.percentile(values, ENDS)
    noise = 5.0 * float(np.sqrt(np.mean(np.diff(values) ** 2) / 2.0)) if values.size > 1 else 0.0
    return Range(float(low), float(high), noise, unit)


def _said(item: Outside, worse: bool) -> str:
    end = (
        "its larger error may be that of a wrong experiment, and is not held against the model"
        if worse
        else "a larger error there might be that of a wrong experiment, and not of a missing effect"
    )
    return (
        f"{item.run} (held out): {item.signal} reaches {item.value:.4g} {item.unit}, outside {item.low:.4g} to "
        f"{item.high:.4g} {item.unit} of the {item.procedure} runs that were fitted; {end}. Hold out a run within that "
        f"range, or fit one like it."
    )


def _open(items: Sequence[Unlike]) -> Open:
    """Say that a run does not fit with the others; `items`: its equations in which that shows."""
    run, procedure = items[0].run, items[0].procedure
    evidence: dict[str, Json] = {
        "equation": ", ".join(item.equation for item in items),
        "procedure": procedure,
        "run": run,
        "odd_runs": [run],
        "rms_slow": [item.slow for item in items],
        "rms_slow_of_others": [item.typical for item in items],
        "unit": ", ".join(item.unit for item in items),
        "meaning": f"{run} does not fit with the other {procedure} runs though its recorded inputs are theirs: most "
        f"likely another load, pose or condition that was not recorded, a wrong experiment rather than a missing "
        f"effect; repeat it under the conditions of the others",
    }
    if any(item.repeated for item in items):
        return Open(Verdict.UNCONTROLLED, {**evidence, "replicates": "a replicate of it has no such error"})
    return Open(Verdict.UNTRACED, evidence)


def _open_left_out(run: Inputs, beyond: Sequence[Outside]) -> Open:
    """Say that a run was left out: with it the others do not fit, without it they do, and show nothing."""
    far = "; ".join(
        f"{x.signal} reaches {x.value:.4g} {x.unit}, theirs {x.low:.4g} to {x.high:.4g} {x.unit}" for x in beyond
    )
    evidence: dict[str, Json] = {
        "procedure": run.procedure,
        "run": run.run,
        "odd_runs": [run.run],
        "meaning": f"{run.run} was left out of the fit: the other runs agree without it, and show no effect; with it "
        f"they do not. {f'Its {far}' if far else 'Its recorded inputs are theirs'}: a scale, load, pose or condition "
        f"of its own, or what shows there alone; repeat it under the conditions of the others",
    }
    return Open(Verdict.UNTRACED, evidence)


def _open_speeds(items: Sequence[Unlike], own: Sequence[float]) -> Open:
    """Say that a run does not fit, at speeds of its own: the law over the speed is as much in doubt as the run."""
    run, procedure = items[0].run, items[0].procedure
    shown = ", ".join(dict.fromkeys(f"{speed:.3g}" for speed in own))
    evidence: dict[str, Json] = {
        "equation": ", ".join(item.equation for item in items),
        "procedure": procedure,
        "run": run,
        "speeds": list(own),
        "unit": "rad/s",
        "meaning": f"{run} does not fit with the other {procedure} runs, and was run at speeds of its own "
        f"({shown} rad/s): what changes with the speed between theirs, or a condition that was not recorded; "
        f"run a ladder of speeds, or repeat it at the speeds of the others",
    }
    return Open(Verdict.UNTRACED, evidence)

"""How well the catalogue's effects that are no lines explain what a fit leaves, each at its own best parameters.

An effect is linear in its amplitudes; its other parameters (a lag, a radius, a frequency) are searched over a grid that
is scaled to the campaign and then refined continuously: a coarse grid alone makes false unknowns.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from rig.loop.fitting.normal import LinearPiece, side_by_side
from rig.loop.model.curves import Curve
from rig.loop.model.shapes import ShapeTerm, addition, catalogue_shapes, unit_columns
from rig.loop.search.acceptance import FAMILIES
from rig.loop.search.trial import ColumnsOf, Ground, Trial, gains, try_columns
from rig.loop.workers.held import Held
from sim_backend.model.effects import Effect

Floats = NDArray[np.float64]

TORQUES = (0.01, 0.03, 0.1, 0.3, 0.6)
"""Torques tried, relative to the campaign's largest."""

SPEEDS = (0.01, 0.03, 0.1, 0.3)
"""Speeds tried, relative to the campaign's largest."""

LAGS = (0.1, 0.4, 1.5, 6.0, 25.0, 100.0, 400.0)
"""s."""

SMALL = 0.3
"""Size, relative to the typical one, at which an effect that is not linear in its amplitude is looked at first."""

FINEST_DAMPING = 0.02
LOWEST_FREQUENCY = 0.3
"""Damping ratio with which a resonance is looked for, and from which frequency (Hz); neighbours overlap."""

BELOW_SAMPLING, LEFT_BY_MEANS = 0.4, 0.8
"""Cycles a sample of the log, and cycles a mean of samples, up to which it is looked for: means fold a frequency above
half of theirs, as the model's means of a ringing do, and leave a quarter of its size at that one."""

REFINED = 0.5
"""Share of the best gain from which on an effect's parameters are refined."""

SWEEPS, STEPS = 2, 7
"""Rounds over the parameters, and golden sections in each."""

NEXT_VALUE, NEXT_FREQUENCY = 1.3, 2.0 * FINEST_DAMPING
"""Natural logarithm of the factor between neighbours of a grid."""


@dataclass(frozen=True, slots=True)
class ShapeTrial:
    """One effect at its best parameters: how it fares, and among how many tests it was found.

    `tests`: `FAMILIES` times the number of effects times the points of its own grid.
    """

    term: ShapeTerm
    trial: Trial
    tests: float

    @property
    def columns(self) -> tuple[ColumnsOf, int]:
        """What gives its columns, and how many."""
        return shape_of(self.term), self.trial.columns


@dataclass(frozen=True, slots=True)
class Scales:
    """Sizes of a campaign: largest torque N*m, largest speed rad/s, longest run and longest sample period s.

    `highest`: frequency (Hz) up to which a ringing is looked for.
    """

    torque: float
    speed: float
    longest: float
    period: float
    highest: float
    known: Mapping[str, float]


def shape_trials(ground: Ground, sparse: Ground, scales: Scales, least: float) -> list[ShapeTrial]:
    """Score every effect, best first. `least`: gain of something else; what stays far below it is not refined.

    `sparse`: the same ground on few samples, where parameters are looked for unless they are frequencies.
    """
    starts = [terms for effect in catalogue_shapes() if (terms := _starts(effect, scales))]
    first = [_best_of(_where_to_look(ground, sparse, terms[0]), terms) for terms in starts]
    best = list(zip(gains(ground, [shape_of(term) for term in first]), first, strict=True))
    most = max([least, *(gain for gain, _ in best)], default=0.0)
    found = []
    for (gain, term), grid in zip(best, starts, strict=True):
        if gain <= 0.0:
            continue
        tuned = _refined(_where_to_look(ground, sparse, term), term) if gain >= REFINED * most else term
        trial = try_columns(ground, term.effect.id, shape_of(tuned))
        sized_term = sized(tuned, trial.amplitudes)
        if trial.gain > 0.0 and sized_term is not None:
            # every effect has its share of the false alarms, however fine its grid
            found.append(ShapeTrial(sized_term, trial, FAMILIES * len(starts) * len(grid)))
    return sorted(found, key=lambda item: -item.trial.gain)


def _where_to_look(ground: Ground, sparse: Ground, term: ShapeTerm) -> Ground:
    return ground if term.frequencies else sparse


def _best_of(ground: Ground, terms: Sequence[ShapeTerm]) -> ShapeTerm:
    found = gains(ground, [shape_of(term) for term in terms])
    return max(zip(found, terms, strict=True), key=lambda pair: pair[0])[1]


def scales_of(items: Held[LinearPiece], known: Mapping[str, float]) -> Scales:
    """Measure the campaign. `known`: parameters that no fit estimates, by name."""
    measured = items.map(_scales)
    torque, speed, longest, period, highest = (max(values, default=0.0) for values in zip(*measured, strict=True))
    return Scales(torque, speed, longest, period, highest, {"full_scale": max(torque, 1e-9), **known})


def _scales(item: LinearPiece) -> tuple[float, float, float, float, float]:
    track = item.piece.track
    if not track.size:
        return 0.0, 0.0, 0.0, track.step, 0.0
    torque = 0.0 if track.T is None else float(np.abs(track.T).max())
    highest = min(BELOW_SAMPLING * track.fine, LEFT_BY_MEANS) / track.period
    return torque, float(np.abs(track.speed).max()), float(np.ptp(track.time)), track.step, highest


def largest_of(ground: Ground, term: ShapeTerm) -> float:
    """Give the largest size of what a term adds to the signals of any piece, in its unit."""
    return max(ground.fit.linear.map(_largest, term), default=0.0)


def _largest(item: LinearPiece, term: ShapeTerm) -> float:
    added = addition(term, item.evaluation.signals, item.piece.track.step)
    return 0.0 if added is None else float(np.abs(added).max(initial=0.0))


def shape_of(term: ShapeTerm) -> ColumnsOf:
    """Give the candidate that is this term, one column (m,) for every amplitude."""
    return partial(_piece_columns, term=term)


def _piece_columns(item: LinearPiece, term: ShapeTerm) -> Floats | None:
    evaluation, step = item.evaluation, item.piece.track.step
    if not evaluation.shows(term.effect):
        return None
    columns: list[Floats] = []
    if isinstance(term.effect, Curve):
        units = unit_columns(term.effect, term.values, evaluation.signals, step)
        columns = [evaluation.shown(term.effect, one, item.piece.index) for one in units or ()]
        if not columns:
            return None
    for unit, size in _units(term):
        added = addition(unit, evaluation.signals, step)
        if added is None:
            return None
        columns.append(evaluation.shown(term.effect, added, item.piece.index) / size)
    stacked = item.centred(side_by_side(columns))
    return stacked if np.any(stacked) else None


def _units(term: ShapeTerm) -> list[tuple[ShapeTerm, float]]:
    """Give the term with one amplitude at a time, and by what its addition is divided to be that of amplitude 1.

    Of a curve none: its columns are computed at once.
    """
    if isinstance(term.effect, Curve):
        return []
    names = [p.name for p in term.effect.parameters]
    found = []
    for name in term.effect.amplitudes:
        size = 1.0 if term.effect.linear else term.value(name)
        values = [
            size if n == name else (0.0 if n in term.effect.amplitudes else v)
            for n, v in zip(names, term.values, strict=True)
        ]
        found.append((ShapeTerm(term.effect, tuple(values)), size))
    return found


def sized(term: ShapeTerm, amplitudes: Floats) -> ShapeTerm | None:
    """Give the term with these amplitudes; None if no device has them."""
    values = dict(zip((p.name for p in term.effect.parameters), term.values, strict=True))
    for name, value in zip(term.effect.amplitudes, amplitudes.tolist(), strict=True):
        parameter = next(p for p in term.effect.parameters if p.name == name)
        if not parameter.low <= value <= parameter.high:
            return None
        values[name] = value
    return ShapeTerm(term.effect, tuple(values.values()))


def _starts(effect: Effect, scales: Scales) -> list[ShapeTerm]:
    """Give the points of the effect's grid."""
    choices: list[tuple[float, ...]] = []
    for parameter in effect.parameters:
        if parameter.known:
            choices.append((scales.known.get(parameter.name, parameter.typical),))
        elif parameter.name in effect.amplitudes:
            choices.append((1.0 if effect.linear else SMALL * parameter.typical,))
        else:
            choices.append(_values(parameter.name, parameter.unit, parameter.typical, scales))
    return [ShapeTerm(effect, values) for values in itertools.product(*choices)]


def _values(name: str, unit: str, typical: float, scales: Scales) -> tuple[float, ...]:
    """Give the values that are tried for a parameter which is no amplitude, in its unit."""
    match unit:
        case "N*m":
            return tuple(share * scales.torque for share in TORQUES) if scales.torque > 0.0 else ()
        case "rad/s":
            return tuple(share * scales.speed for share in SPEEDS) if scales.speed > 0.0 else ()
        case "s":
            return tuple(lag for lag in LAGS if lag < 2.0 * scales.longest)
        case "Hz":
            count = math.ceil(math.log(max(scales.highest / LOWEST_FREQUENCY, 1.0)) / (2.0 * FINEST_DAMPING))
            return tuple(LOWEST_FREQUENCY * math.exp(2.0 * FINEST_DAMPING * k) for k in range(count))
        case _:
            return (FINEST_DAMPING,) if name == "damping" else (typical,)


def _refined(ground: Ground, term: ShapeTerm) -> ShapeTerm:
    """Maximise the gain over the parameters that are no amplitudes, one after the other."""
    for sweep in range(SWEEPS):
        for k in (k for k in term.free if term.is_logarithmic(k)):
            reach = NEXT_FREQUENCY if term.effect.parameters[k].unit == "Hz" else NEXT_VALUE
            term = _best_along(ground, term, k, reach / (1.0 + 2.0 * sweep))
    return term


def _best_along(ground: Ground, term: ShapeTerm, k: int, reach: float) -> ShapeTerm:
    """Maximise the gain over one parameter, within a factor exp(reach) either way, by golden section."""
    golden = 0.5 * (math.sqrt(5.0) - 1.0)

    def at(shift: float) -> tuple[float, ShapeTerm]:
        moved = term.scaled(k, math.exp(shift))
        return gains(ground, [shape_of(moved)])[0], moved

    low, high = -reach, reach
    a, b = high - golden * (high - low), low + golden * (high - low)
    at_a, at_b, best = at(a), at(b), at(0.0)
    for _ in range(STEPS):
        best = max(best, at_a, at_b, key=lambda pair: pair[0])
        if at_a[0] >= at_b[0]:
            high, b, at_b = b, a, at_a
            a = high - golden * (high - low)
            at_a = at(a)
        else:
            low, a, at_a = a, b, at_b
            b = low + golden * (high - low)
            at_b = at(b)
    return best[1]

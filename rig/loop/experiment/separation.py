"""How far a planned run would tell rivals apart: expected squares between them after each has fitted what it can.

One rival is taken for the truth and predicts the run; another is fitted to that, with what the training runs already
say of its parameters. What remains is what the run would hold against it:

    d2 = r' W r - g' (A_old + J' W J)^-1 g,    r = y_truth - y_tested,    g = J' W r

with the Jacobian J of all parameters of the tested model, base and terms. The square root is in standard deviations.
Source: Hunter & Reiner, Technometrics 7 (1965) 307-323, with the parameters refitted.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rig.config.dut import Dut
from rig.loop.experiment.rivals import Form, Rival
from rig.loop.fitting.fit import Fit
from rig.loop.fitting.normal import Columns, Kind, Noise, linearise, solve
from rig.loop.model.equations import Equation, Piece, pieces_of
from rig.loop.model.prediction import Model, predict
from rig.loop.search.compliance_form import form_columns
from rig.loop.signals.recordings import FEWEST_SAMPLES
from rig.loop.signals.tracks import SMOOTHING, Track

Floats = NDArray[np.float64]

TORQUE_SHARE = 1e-3
"""Noise of a torque that no training run tells of, in shares of the rated torque (at the motor: over the ratio)."""

TYPICAL_COUNTS = 16384


@dataclass(frozen=True, slots=True)
class Coming:
    """A piece of a planned run, and for how many samples of the fit each of its own stands.

    `group`: number of the run among those that are no replicates of each other; a group is held out as a whole.
    """

    piece: Piece
    times: float
    group: int


@dataclass(frozen=True, slots=True)
class Forecast:
    """What one rival says of planned runs, every sample in standard deviations.

    `value` (n,): prediction, up to what all rivals share; `jacobian` (n, p): its derivatives; `known` (p, p): what
    training runs and priors tell of its parameters. `groups` (n,): number of the group of runs of every sample.
    """

    value: Floats
    jacobian: Floats
    known: Floats
    groups: NDArray[np.intp]


def pieces_to_come(tracks: Sequence[tuple[Track, int]], model: Model, cycle_time: float) -> tuple[Coming, ...]:
    """Give the pieces of a planned run, where the law determines them.

    `tracks`: each with how often it is run; `cycle_time`: s between the samples of a log.
    """
    found = []
    for number, (track, count) in enumerate(tracks):
        step = cycle_time if track.moves else max(cycle_time, SMOOTHING)
        for piece in pieces_of(track, model.ratio):
            settled = predict(piece, model).settled[piece.index]
            if settled.sum() >= FEWEST_SAMPLES:
                kept = replace(piece, index=piece.index[settled], target=piece.target[settled])
                found.append(Coming(kept, count * track.period / step, number))
    return tuple(found)


def forecast(rival: Rival, coming: Sequence[Coming], noise: Mapping[Kind, Noise]) -> Forecast:
    """Give what a rival, fitted to the training runs, says of the pieces to come."""
    fit, form, pieces = rival.fit, rival.form, [item.piece for item in coming]
    used = set(fit.columns.base).union(*(predict(piece, fit.model).base for piece in pieces))
    columns = replace(fit.columns, base=tuple(name for name in fit.model.table.names if name in used))
    known, more = _known(fit, columns, form), 0 if form is None else 2
    values, jacobians = [np.zeros(0)], [np.zeros((0, columns.size + more))]
    for item, planned in zip(linearise(pieces, fit.model, columns, dict(noise), fit.block), coming, strict=True):
        value, jacobian = -item.residual, item.jacobian
        if form is not None:
            own = form_columns(item, form.largest)
            jacobian = np.column_stack([jacobian, np.zeros((value.size, 2)) if own is None else own])
            value = value + jacobian[:, _places(fit, columns, more)] @ form.step
        scale = math.sqrt(planned.times * item.weight)
        values.append(scale * value)
        jacobians.append(scale * jacobian)
    groups = np.repeat([item.group for item in coming], [item.piece.index.size for item in coming])
    return Forecast(np.concatenate(values), np.concatenate(jacobians), known, groups)


def apart(truth: Forecast, tested: Forecast, repeat: int = 1) -> float:
    """Give the squares by which the runs, made `repeat` times, speak against `tested` if `truth` is true.

    Of several groups of runs one is held out by the loop, and it may be the one that tells most.
    """
    difference, numbers = truth.value - tested.value, np.unique(tested.groups)
    left = [tested.groups != number for number in numbers] if numbers.size > 1 else [np.ones(difference.size, bool)]
    return min(_against(difference[rows], tested.jacobian[rows], tested.known, repeat) for rows in left)


def _against(difference: Floats, jacobian: Floats, known: Floats, repeat: int) -> float:
    g = repeat * jacobian.T @ difference
    A = known + repeat * jacobian.T @ jacobian
    return max(0.0, repeat * float(difference @ difference) - float(g @ solve(A, g)))


def _known(fit: Fit, columns: Columns, form: Form | None) -> Floats:
    """Give what training runs and priors say of the parameters in `columns` and of the form's, shape (p, p)."""
    table, base, more = fit.model.table, columns.base, 0 if form is None else 2
    A = np.zeros((columns.size + more, columns.size + more))
    prior = table.prior_weight()[[table.names.index(name) for name in base]]
    A[np.arange(len(base)), np.arange(len(base))] = prior
    place = _places(fit, columns, more)
    A[np.ix_(place, place)] += fit.normal.A.sum(axis=0) if form is None else form.information
    return A


def _places(fit: Fit, columns: Columns, more: int) -> list[int]:
    """Give where the fit's own parameters, and `more` after them, stand among those of a planned run."""
    terms = range(len(columns.base), columns.size + more)
    return [*(columns.base.index(name) for name in fit.columns.base), *terms]


def noise_to_come(fit: Fit, pieces: Sequence[Piece], dut: Dut) -> dict[Kind, Noise]:
    """Give the noise of every kind of piece: as the training runs show it, of kinds that they lack from the nearest."""
    found = dict(fit.noise)
    for kind in {piece.kind for piece in pieces} - found.keys():
        same = [noise for known, noise in fit.noise.items() if known[0] is kind[0]]
        found[kind] = min(same, key=lambda noise: noise.sigma) if same else Noise(_typical(kind[0], dut), 1.0)
    return found


def _typical(equation: Equation, dut: Dut) -> float:
    """Give a noise (unit of the equation) for instruments of which only the device file tells."""
    rated, ratio = dut.gear.rated_torque or 16.0, dut.gear.ratio or 100.0
    match equation:
        case Equation.TORSION:
            motor = 2.0 * math.pi / (dut.motor.encoder_counts or TYPICAL_COUNTS) / ratio
            output = 2.0 * math.pi / (dut.output.encoder_counts or TYPICAL_COUNTS)
            return math.hypot(motor, output) / math.sqrt(12.0)
        case Equation.OUTPUT_TORQUE:
            return TORQUE_SHARE * rated
        case Equation.MOTOR_TORQUE:
            return TORQUE_SHARE * rated / ratio
        case Equation.MOTOR_CURRENT:
            return TORQUE_SHARE * rated / ratio / (dut.motor.torque_constant or 1.0)

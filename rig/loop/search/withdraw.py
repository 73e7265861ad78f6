"""Taking out what no longer pays beside the terms that were added after it; training runs only."""

import math
from dataclasses import replace

import numpy as np

from rig.loop.fitting.fit import Fit, Material, fit, refit
from rig.loop.fitting.intervals import covariance, quantile
from rig.loop.fitting.normal import LinearPiece
from rig.loop.model.curves import Curve
from rig.loop.model.prediction import Model
from rig.loop.model.shapes import ShapeTerm
from rig.loop.model.terms import Line, TermClass
from rig.loop.search.acceptance import LEAST_SHAPE_SHARE, pays_jointly
from rig.loop.search.shape_trials import shape_of
from rig.loop.search.trial import prepare, try_columns, try_line


def withdraw(pieces: Material, current: Fit, alpha: float, given: Model) -> Fit:
    """Take out terms that no longer pay beside the others, or have moved onto another; none that was `given`."""
    return withdraw_lines(pieces, _withdraw_shapes(pieces, current, alpha, given), alpha, given)


def _withdraw_shapes(pieces: Material, current: Fit, alpha: float, given: Model) -> Fit:
    for kind in [term.kind for term in current.model.shapes[len(given.shapes) :]]:
        here = next(x for x in current.model.shapes if x.kind == kind)
        shapes = tuple(x for x in current.model.shapes if x is not here)
        without = fit(pieces.all, replace(current.model, shapes=shapes), current.noise, passes=3, block=current.block)
        if not _pays(without, current, here, alpha):
            current = refit(pieces, current, without.model)
    return current


def _pays(without: Fit, current: Fit, here: ShapeTerm, alpha: float) -> bool:
    """Whether an effect still pays; of what the base takes up nearly all, only the joint fits tell."""
    trial = try_columns(prepare(without), here.effect.id, shape_of(here))
    if trial.gain <= 0.0:
        return pays_jointly(without, current)
    if trial.share < LEAST_SHAPE_SHARE and _size_may_be_nothing(current, here):
        return False
    return trial.single_p <= alpha and trial.pays > 0.0


def _size_may_be_nothing(state: Fit, here: ShapeTerm) -> bool:
    """Whether the intervals of all amplitudes of an effect hold zero; never of a curve, judged as a whole."""
    if isinstance(here.effect, Curve):
        return False
    place = state.columns.of_shape(state.model.shapes.index(here))
    spread, names = covariance(state)[place, place], [here.effect.parameters[k].name for k in here.free]
    halves = {name: quantile(state) * math.sqrt(max(float(spread[n, n]), 0.0)) for n, name in enumerate(names)}
    sizes = [(here.value(name), halves[name]) for name in here.effect.amplitudes if name in halves]
    return bool(sizes) and all(abs(value) < half for value, half in sizes)


def withdraw_lines(pieces: Material, current: Fit, alpha: float, given: Model) -> Fit:
    """Take out lines that no longer pay beside the other terms, or of which nothing may be there.

    None of those that were `given`, which come first.
    """
    for line in sorted(current.model.lines[len(given.lines) :], key=lambda line: line.amplitude):
        present = current.model.lines
        matches = [
            x
            for x in present[len(given.lines) :]
            if x.kind == line.kind and abs(x.order - line.order) < 1e-3 * line.order
        ]
        if not matches:
            continue
        here = min(matches, key=lambda x: abs(x.amplitude - line.amplitude))
        others = tuple(x for x in present if x is not here)
        near = any(
            x.kind == here.kind and abs(x.order - here.order) < 0.5 * _resolution(current, here.kind) for x in others
        )
        without = fit(pieces.all, replace(current.model, lines=others), current.noise, passes=3, block=current.block)
        trial = try_line(prepare(without), here.kind, here.order)
        if near or trial.single_p > alpha or trial.pays <= 0.0 or _may_be_nothing(current, here):
            current = refit(pieces, current, without.model)
    return current


def _may_be_nothing(state: Fit, line: Line) -> bool:
    """Whether the interval of a line's amplitude holds zero, now that the others are there too."""
    place = state.columns.of_line(state.model.lines.index(line)).start
    size = max(line.amplitude, 1e-300)
    direction = np.array([line.sine, line.cosine]) / size
    pair = covariance(state)[place : place + 2, place : place + 2]
    return size < quantile(state) * math.sqrt(max(float(direction @ pair @ direction), 0.0))


def _resolution(state: Fit, kind: TermClass) -> float:
    """Give the distance of orders that the travel of all runs can tell apart."""
    spans = [span for span in state.linear.map(extent, kind.variable) if span is not None]
    travel = max(high for _, high in spans) - min(low for low, _ in spans)
    return 2.0 * math.pi / max(travel, 1e-9)


def extent(item: LinearPiece, variable: str) -> tuple[float, float] | None:
    """Give the least and the largest angle of a piece, rad; None where it is not known."""
    angle = item.evaluation.positions.get(variable)
    return None if angle is None else (float(angle.min()), float(angle.max()))

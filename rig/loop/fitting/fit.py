"""Joint bounded non-linear least squares of base parameters and lines over all training runs.

Levenberg-Marquardt on the summed normal matrices. Positive parameters are estimated as logarithms, which bounds
them without hard limits; the catalogue enters as a prior, in units of the information in the data.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rig.loop.fitting.normal import (
    About,
    Columns,
    Kind,
    LinearPiece,
    Noise,
    Normal,
    Part,
    Predicted,
    about,
    base_names,
    linearised,
    noise_of,
    normal_of,
    numbered,
    part_of,
    predicted,
    solve,
    squares_of,
    tried,
    weight_of,
    weighted,
)
from rig.loop.model.curves import Curve
from rig.loop.model.equations import Piece
from rig.loop.model.prediction import Model
from rig.loop.signals.recordings import FEWEST_SAMPLES
from rig.loop.signals.tracks import pick_rows, thin_track
from rig.loop.workers.held import Held

Floats = NDArray[np.float64]

BLOCK, SHORTEST_BLOCK = 2.0, 0.25
"""s over which residuals are summed for tests and intervals; longer where the residual remembers longer. Down to the
second for short campaigns and what acts for a short time: with few blocks nothing is significant, however clear it is.
"""

COARSE = 3000
COARSE_PERIOD = 0.1
"""Samples of a turning run, and s between those of one that does not turn, in a coarse fit."""

RIDGE = 1e-4
"""Share of its own information that every value of a curve has as a prior at zero: a part of it that one run alone
holds, or none, must not run away."""

CONVERGED = 0.01
"""Change of the weighted squares at which the fit stops: a tenth of a standard deviation of one parameter."""

PASSES, REWEIGHTINGS = 30, 4
STABLE = 0.03
"""Steps of a fit and rounds of weighting at most, and the relative change of a noise at which these end."""


@dataclass(frozen=True, slots=True)
class Material:
    """What is fitted: `all` pieces, and the same with `few` samples, enough to find the way, not the interval."""

    all: Held[Piece]
    few: Held[Piece]


def material(pieces: Held[Piece]) -> Material:
    """Give the pieces with their coarse versions."""
    return Material(pieces, pieces.keep(coarse))


@dataclass(frozen=True, slots=True)
class Fit:
    """A fitted model with everything linearised about it.

    `about`, `parts` and `blocks` (numbers of its blocks of time in the campaign) are those of every piece in `linear`.
    """

    model: Model
    columns: Columns
    noise: dict[Kind, Noise]
    about: tuple[About, ...]
    linear: Held[LinearPiece]
    parts: tuple[Part, ...]
    blocks: tuple[NDArray[np.intp], ...]
    normal: Normal
    prior: Floats
    pull: Floats
    block: float

    @property
    def squares(self) -> float:
        """Weighted sum of squares of the residual."""
        return float(self.normal.squares.sum())

    @property
    def block_count(self) -> int:
        """Number of blocks of time."""
        return 1 + max((int(numbers.max()) for numbers in self.blocks), default=0)

    @property
    def pieces(self) -> Held[Piece]:
        """The pieces that were fitted."""
        return self.linear.keep(_piece_of)


def _piece_of(item: LinearPiece) -> Piece:
    return item.piece


def fit(
    pieces: Held[Piece], model: Model, noise: dict[Kind, Noise], *, passes: int = PASSES, block: float = BLOCK
) -> Fit:
    """Fit base and lines together from the model's values. `noise` weighs the kinds; empty: all alike.

    Raises ModelError where no drive is like the model.
    """
    first, known = pieces.keep(predicted, model), tuple(pieces.map(about))
    columns = _columns(first, model)
    linear = first.keep(linearised, model, columns, noise, block)
    return _improved(pieces, _state(known, linear, model, columns, noise, block), passes)


def _improved(pieces: Held[Piece], start: Fit, passes: int) -> Fit:
    """Go on from a fit of these pieces, whose weights may have changed since."""
    columns, current, damping = start.columns, start, 1e-3
    for _ in range(passes):
        A = current.normal.A.sum(axis=0) + np.diag(current.prior)
        g = current.normal.g.sum(axis=0) + current.pull
        cost = _cost(current)
        improved = False
        for _ in range(6):
            step = solve(A + damping * np.diag(np.diag(A)), g)
            trial = _moved(current.model, columns, step)
            attempt = pieces.keep(tried, trial)
            trial_cost = _cost_of(attempt, trial, current)
            if trial_cost <= cost:
                improved = True
                damping = max(damping * 0.1, 1e-9)
                break
            damping *= 10.0
        if not improved:
            break
        linear = attempt.keep(linearised, trial, columns, current.noise, current.block)
        current = _state(current.about, linear, trial, columns, current.noise, current.block)
        if cost - trial_cost <= CONVERGED:
            break
    return current


def coarse(piece: Piece) -> Piece:
    """Give the piece with about `COARSE` samples of a turning run, one a `COARSE_PERIOD` of any other.

    The samples stay even in time, for what remembers.
    """
    if not piece.track.moves:
        return _averaged(piece)
    step = -(-piece.index.size // COARSE)
    if step == 1:
        return piece
    rows = np.arange(0, piece.track.size, step)
    _, kept, at = np.intersect1d(rows, piece.index, assume_unique=True, return_indices=True)
    return replace(piece, track=pick_rows(piece.track, rows), index=kept, target=piece.target[at])


def _averaged(piece: Piece) -> Piece:
    """Join the samples of a run that does not turn; the piece itself where too few would be left."""
    track = thin_track(piece.track, COARSE_PERIOD)
    factor = track.fine // piece.track.fine
    place = piece.index // factor
    kept, counts = np.unique(place[place < track.size], return_counts=True)
    if factor == 1 or kept.size < FEWEST_SAMPLES:
        return piece
    sums = np.bincount(place, weights=piece.target)[kept]
    return replace(piece, track=track, index=kept, target=sums / counts)


def fit_stably(pieces: Material, model: Model, noise: dict[Kind, Noise], block: float) -> Fit:
    """Fit until the weights that follow from the residual no longer change.

    Starts from the model's own base values and from the catalogue's, coarsely, and goes on with the better one over all
    samples: what swings too fast for the coarse ones moves only there.
    """
    starts = (model, replace(model, values=model.table.start()))
    best = min((fit(pieces.few, start, noise, block=block) for start in starts), key=_cost)
    return settled(pieces.all, fit(pieces.all, best.model, noise, block=block))


def settled(pieces: Held[Piece], state: Fit, passes: int = PASSES) -> Fit:
    """Go on from a fit of these pieces until the weights that follow from its residual no longer change."""
    state = reweighted(state)
    for _ in range(REWEIGHTINGS):
        before = state.noise
        state = reweighted(_improved(pieces, state, passes))
        if all(abs(np.log(state.noise[kind].sigma / before[kind].sigma)) < STABLE for kind in before):
            break
    return state


def refit(pieces: Material, like: Fit, model: Model) -> Fit:
    """Fit the model with weights that follow from its own residual."""
    return fit_stably(pieces, model, like.noise, like.block)


def reweighted(state: Fit) -> Fit:
    """Give the same fit with the weights and blocks that its own residual calls for."""
    return with_noise(state, noise_of(state.about, state.linear))


def with_noise(state: Fit, noise: dict[Kind, Noise], block: float | None = None) -> Fit:
    """Give the same fit with other weights and the blocks that go with them, of `block` s at least if that is given."""
    least = state.block if block is None else block
    linear = state.linear.keep(weighted, noise, least)
    return _state(state.about, linear, state.model, state.columns, noise, least)


def _columns(first: Held[Predicted], model: Model) -> Columns:
    used = {name for names in first.map(base_names) for name in names}
    names = tuple(name for name in model.table.names if name in used)
    free_order = tuple(line.kind.fixed_order is None for line in model.lines)
    return Columns(names, free_order, tuple(len(term.free) for term in model.shapes))


def _state(
    known: tuple[About, ...],
    linear: Held[LinearPiece],
    model: Model,
    columns: Columns,
    noise: dict[Kind, Noise],
    block: float,
) -> Fit:
    parts = tuple(linear.map(part_of))
    prior, pull = np.zeros(columns.size), np.zeros(columns.size)
    if noise:
        rows = [model.table.names.index(name) for name in columns.base]
        prior[: len(rows)] = model.table.prior_weight()[rows]
        pull[: len(rows)] = -prior[: len(rows)] * _deviation(model)[rows]
    normal = normal_of(known, parts)
    for number, values in _curves(model):
        place = columns.of_shape(number)
        prior[place] = RIDGE * np.diag(normal.A.sum(axis=0))[place]
        pull[place] = -prior[place] * values
    blocks = numbered(known, parts)
    return Fit(model, columns, noise, known, linear, parts, blocks, normal, prior, pull, block)


def _curves(model: Model) -> list[tuple[int, Floats]]:
    """Give the shapes that are curves, by number, with their fitted values: their prior is at zero."""
    return [
        (number, np.array([term.values[k] for k in term.free]))
        for number, term in enumerate(model.shapes)
        if isinstance(term.effect, Curve)
    ]


def _prior_cost(model: Model, like: Fit) -> float:
    """Give what the prior of a fit like `like` costs a model."""
    rows = [model.table.names.index(name) for name in like.columns.base]
    cost = float(like.prior[: len(rows)] @ _deviation(model)[rows] ** 2)
    return cost + sum(float(like.prior[like.columns.of_shape(k)] @ values**2) for k, values in _curves(model))


def _deviation(model: Model) -> Floats:
    """Distance of the base values from the prior's centre, in the scale of the fit."""
    centre, logarithmic = model.table.centre(), model.table.logarithmic()
    positive = np.where(logarithmic, model.values, 1.0)
    return np.where(logarithmic, np.log(positive / np.where(logarithmic, centre, 1.0)), model.values - centre)


def _cost(state: Fit) -> float:
    return state.squares + _prior_cost(state.model, state)


def _cost_of(attempt: Held[Predicted | None], model: Model, like: Fit) -> float:
    """Cost of a trial model without its Jacobian; infinite where no drive is like it."""
    squares = attempt.map(squares_of)
    total = sum(weight_of(item.kind, like.noise) * one for item, one in zip(like.about, squares, strict=True))
    return total + _prior_cost(model, like)


def _moved(model: Model, columns: Columns, step: Floats) -> Model:
    values = model.values.copy()
    for number, name in enumerate(columns.base):
        place = model.table.names.index(name)
        if model.table.entries[place].logarithmic:
            values[place] *= np.exp(np.clip(step[number], -1.0, 1.0))
        else:
            values[place] += step[number]
    lines = []
    for number, line in enumerate(model.lines):
        change = step[columns.of_line(number)]
        order = line.order + float(change[2]) if change.size == 3 else line.order
        lines.append(
            replace(line, sine=line.sine + float(change[0]), cosine=line.cosine + float(change[1]), order=order)
        )
    shapes = tuple(term.moved(step[columns.of_shape(number)]) for number, term in enumerate(model.shapes))
    return replace(model, values=values, lines=tuple(lines), shapes=shapes)

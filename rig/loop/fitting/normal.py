"""Normal matrices per run: everything that fitting, leave-one-run-out and trial terms need of the samples.

Each piece gives its weighted residual and Jacobian with the run's own constant projected out where the equation is
an angle. Sums over samples are kept per run and per block of time, so that a fold that leaves a run out, or a test
that turns the sign of blocks, costs one small solve. The samples stay where the runs are held; only sums travel.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rig.log.run import ProcedureName
from rig.loop.model.equations import Equation, Law, Piece
from rig.loop.model.evaluation import Evaluation
from rig.loop.model.prediction import Model, predict
from rig.loop.model.terms import line_values
from rig.loop.workers.held import Held
from sim_backend.errors import ModelError

Floats = NDArray[np.float64]
Kind = tuple[Equation, Law, bool]

LONGEST_MEMORY = 5.0
"""Samples of correlation that lower a weight at most: structure that a better fit removes must keep its say."""

MEMORIES_A_BLOCK = 10.0
"""A block is at least this many correlation times long,"""

LEAST_BLOCKS = 4.0
"""but a run has at least this many."""

ROUNDING = 1e-12
"""Share of a parameter's information that may be left of it when the only run that tells it is taken away."""


@dataclass(frozen=True, slots=True)
class Noise:
    """Residual of one kind of piece: rms `sigma` in the equation's unit and correlation `length` in samples (>= 1)."""

    sigma: float
    length: float

    @property
    def weight(self) -> float:
        """Information of one sample, 1/unit**2."""
        return 1.0 / (self.sigma**2 * min(self.length, LONGEST_MEMORY))


@dataclass(frozen=True, slots=True)
class Columns:
    """What is estimated: base parameters by name, then sine, cosine and (unless fixed) order of every line.

    After them the free parameters of every shape, `shapes`: how many each has.
    """

    base: tuple[str, ...]
    free_order: tuple[bool, ...]
    shapes: tuple[int, ...] = ()

    @property
    def size(self) -> int:
        """Number of columns."""
        return len(self.base) + sum(3 if free else 2 for free in self.free_order) + sum(self.shapes)

    def of_shape(self, number: int) -> slice:
        """Give the columns of one shape."""
        start = self.size - sum(self.shapes[number:])
        return slice(start, start + self.shapes[number])

    def of_line(self, number: int) -> slice:
        """Give the columns of one line."""
        start = len(self.base) + sum(3 if free else 2 for free in self.free_order[:number])
        return slice(start, start + (3 if self.free_order[number] else 2))


@dataclass(frozen=True, slots=True)
class About:
    """What the search asks of a piece without its samples; `winds`: the motor torque was recorded."""

    run: str
    condition: str
    procedure: ProcedureName
    equation: Equation
    law: Law
    moves: bool
    winds: bool
    samples: int

    @property
    def kind(self) -> Kind:
        """Pieces of one kind share their noise."""
        return self.equation, self.law, self.moves


def about(piece: Piece) -> About:
    """Describe a piece."""
    track = piece.track
    condition = f"{track.procedure} {track.replicate or track.name}"
    winds, size = track.M is not None, piece.index.size
    return About(track.name, condition, track.procedure, piece.equation, piece.law, track.moves, winds, size)


@dataclass(frozen=True, slots=True)
class Predicted:
    """A piece evaluated at a model: residual (m,), the run's own constant projected out of an angle."""

    piece: Piece
    evaluation: Evaluation
    residual: Floats

    @property
    def squares(self) -> float:
        """Sum of squares of the residual."""
        return float(self.residual @ self.residual)


@dataclass(frozen=True, slots=True)
class LinearPiece:
    """A piece linearised about a model: residual (m,), Jacobian (m, p), weight, and its blocks of time.

    `starts`: first sample of every block; `slots`: the blocks' numbers in the run, shape as `starts`.
    """

    piece: Piece
    evaluation: Evaluation
    residual: Floats
    jacobian: Floats
    weight: float
    starts: NDArray[np.intp]
    slots: NDArray[np.intp]

    def centred(self, values: Floats) -> Floats:
        """Project the run's own constant out of `values` (m,) or (m, k), where the equation is an angle."""
        return values - values.mean(axis=0) if self.piece.demeaned else values

    def block_sums(self, values: Floats) -> Floats:
        """Sum `values` (m,) or (m, k) over each block."""
        return np.asarray(np.add.reduceat(values, self.starts, axis=0))


@dataclass(frozen=True, slots=True)
class Normal:
    """Normal equations of a campaign: per run A (r, p, p), g (r, p), weighted squares (r,); `runs` names the rows."""

    runs: tuple[str, ...]
    A: Floats
    g: Floats
    squares: Floats

    def leave_one_out(self, prior: Floats, pull: Floats) -> Floats:
        """Give each run's weighted squares when predicted from all others, shape (r,).

        `prior` (p,): weights; `pull` (p,): gradient of the prior at the point of linearisation.
        """
        total_A, total_g = self.A.sum(axis=0) + np.diag(prior), self.g.sum(axis=0) + pull
        rest, slope = total_A - self.A, total_g - self.g
        # of what a run alone told only rounding is left, of either sign
        told = np.diagonal(rest, axis1=1, axis2=2) > ROUNDING * np.diag(total_A)
        step = solve(np.where(told[:, :, None] & told[:, None, :], rest, 0.0), np.where(told, slope, 0.0)[:, :, None])
        own = self.A @ step - 2.0 * self.g[:, :, None]
        return np.asarray(self.squares + np.sum(step * own, axis=(1, 2)))


def joined(normal: Normal, names: Sequence[str]) -> Normal:
    """Give the normal equations with the runs of one name, of `names` (r,), taken together."""
    groups = tuple(dict.fromkeys(names))
    rows = np.array([groups.index(name) for name in names])
    size = normal.g.shape[1]
    A, g, squares = np.zeros((len(groups), size, size)), np.zeros((len(groups), size)), np.zeros(len(groups))
    for total, own in ((A, normal.A), (g, normal.g), (squares, normal.squares)):
        np.add.at(total, rows, own)
    return Normal(groups, A, g, squares)


def side_by_side(columns: Sequence[Floats]) -> Floats:
    """Give columns (m,) as a matrix (m, k) that holds each in one piece of memory: sums along them take a tenth so."""
    return np.array(columns).T


TOLD = 1e-11
"""Share of the largest eigenvalue, of a matrix with unit diagonal, from which on a direction is told."""


def solve(A: Floats, b: Floats) -> Floats:
    """Solve A x = b for a positive semi-definite A, scaled to unit diagonal; directions without information give 0.

    A (p, p) and b (p,) or (p, k), or a stack of them: A (r, p, p) and b (r, p, k).
    """
    if not A.size:
        return np.zeros_like(b)
    if b.ndim == 1:
        return solve(A, b[:, None])[:, 0]
    scale, values, vectors = _scaled(A)
    keep = values > TOLD * values[..., -1:]
    solved = np.where(keep, 1.0 / np.where(keep, values, 1.0), 0.0)
    projected = vectors.swapaxes(-1, -2) @ (b / scale[..., None])
    return np.asarray(vectors @ (solved[..., None] * projected) / scale[..., None])


def untold(A: Floats) -> Floats:
    """Give the directions (k, p) of which A tells nothing: there `solve` gives 0."""
    if not A.size:
        return np.zeros((0, 0))
    scale, values, vectors = _scaled(A)
    return np.asarray((vectors / scale[:, None]).T[values <= TOLD * values[-1]])


def _scaled(A: Floats) -> tuple[Floats, Floats, Floats]:
    scale = np.sqrt(np.maximum(np.diagonal(A, axis1=-2, axis2=-1), 1e-300))
    values, vectors = np.linalg.eigh(A / (scale[..., :, None] * scale[..., None, :]))
    return scale, values, vectors


def predicted(piece: Piece, model: Model) -> Predicted:
    """Evaluate a piece. Raises ModelError where no drive is like the model."""
    evaluation = predict(piece, model)
    residual = piece.target - evaluation.value[piece.index]
    return Predicted(piece, evaluation, residual - residual.mean() if piece.demeaned else residual)


def tried(piece: Piece, model: Model) -> Predicted | None:
    """Evaluate a piece; None where no drive is like the model (T1 above T2)."""
    try:
        return predicted(piece, model)
    except ModelError:
        return None


def squares_of(item: Predicted | None) -> float:
    """Give the squares of a piece that was tried, infinite where no drive is like the model."""
    return math.inf if item is None else item.squares


def base_names(item: Predicted) -> tuple[str, ...]:
    """Give the base parameters that the piece tells of."""
    return tuple(item.evaluation.base)


def linearised(
    item: Predicted | None, model: Model, columns: Columns, noise: Mapping[Kind, Noise], block: float
) -> LinearPiece:
    """Linearise a piece about the model it was evaluated at. `block`: length of the blocks of time at least, s."""
    if item is None:
        raise ValueError("no drive is like this model")
    piece, evaluation, rows = item.piece, item.evaluation, item.piece.index
    jacobian = np.zeros((rows.size, columns.size), order="F")
    for number, name in enumerate(columns.base):
        column = evaluation.base.get(name)
        if column is not None:
            scale = model.value(name) if _is_logarithmic(model, name) else 1.0
            jacobian[:, number] = scale * column[rows]
    for number, line in enumerate(model.lines):
        position = evaluation.positions.get(line.kind.variable)
        if position is not None:
            three = evaluation.columns(line.kind, line_values(line, position).derivatives, rows)
            place = columns.of_line(number)
            for offset in range(place.stop - place.start):
                jacobian[:, place.start + offset] = three[offset]
    for number, term in enumerate(model.shapes):
        derivatives = evaluation.shape_columns(term, rows, piece.track.step)
        if derivatives is not None:
            jacobian[:, columns.of_shape(number)] = np.column_stack(derivatives)
    if piece.demeaned:
        jacobian -= jacobian.mean(axis=0)
    nothing = np.zeros(0, dtype=np.intp)
    return weighted(LinearPiece(piece, evaluation, item.residual, jacobian, 1.0, nothing, nothing), noise, block)


def weighted(item: LinearPiece, noise: Mapping[Kind, Noise], block: float) -> LinearPiece:
    """Give the piece with the weight and the blocks that go with `noise`."""
    slot = np.floor(item.piece.track.time[item.piece.index] / _block_of(item.piece, noise, block)).astype(np.intp)
    starts = np.flatnonzero(np.concatenate([[True], np.diff(slot) != 0]))
    return replace(item, weight=weight_of(item.piece.kind, noise), starts=starts, slots=slot[starts])


def weight_of(kind: Kind, noise: Mapping[Kind, Noise]) -> float:
    """Give the weight of a sample of a piece of this kind: 1 where nothing is known of its noise."""
    return noise[kind].weight if kind in noise else 1.0


def linearise(
    pieces: Sequence[Piece], model: Model, columns: Columns, noise: Mapping[Kind, Noise], block: float
) -> list[LinearPiece]:
    """Evaluate and linearise pieces that are here."""
    return [linearised(predicted(piece, model), model, columns, noise, block) for piece in pieces]


def _block_of(piece: Piece, noise: Mapping[Kind, Noise], block: float) -> float:
    """Give the length (s) of a piece's blocks: at least `block`, longer where its residual remembers longer."""
    if piece.kind not in noise:
        return block
    memory = MEMORIES_A_BLOCK * noise[piece.kind].length * piece.track.period
    return max(block, min(memory, float(np.ptp(piece.track.time)) / LEAST_BLOCKS))


def _is_logarithmic(model: Model, name: str) -> bool:
    return bool(model.table.entries[model.table.names.index(name)].logarithmic)


@dataclass(frozen=True, slots=True)
class Part:
    """What a piece adds to the normal equations: A (p, p), g (p,) and the weighted squares; `slots`: of its blocks."""

    A: Floats
    g: Floats
    squares: float
    slots: NDArray[np.intp]


def part_of(item: LinearPiece) -> Part:
    """Sum a piece."""
    scaled = item.weight * item.jacobian.T
    squares = item.weight * float(item.residual @ item.residual)
    return Part(scaled @ item.jacobian, scaled @ item.residual, squares, item.slots)


def block_scores(item: LinearPiece) -> Floats:
    """Give the base's weighted scores summed over the blocks of a piece, (b, p)."""
    return item.block_sums(item.jacobian * (item.weight * item.residual)[:, None])


def normal_of(known: Sequence[About], parts: Sequence[Part]) -> Normal:
    """Sum the pieces into one normal matrix a run."""
    runs = tuple(dict.fromkeys(item.run for item in known))
    size = parts[0].g.size if parts else 0
    A, g, squares = np.zeros((len(runs), size, size)), np.zeros((len(runs), size)), np.zeros(len(runs))
    for item, part in zip(known, parts, strict=True):
        row = runs.index(item.run)
        A[row] += part.A
        g[row] += part.g
        squares[row] += part.squares
    return Normal(runs, A, g, squares)


def numbered(known: Sequence[About], parts: Sequence[Part]) -> tuple[NDArray[np.intp], ...]:
    """Give the numbers of every piece's blocks in the campaign: pieces of one run and law share theirs."""
    numbers: dict[tuple[str, Law, int], int] = {}
    return tuple(
        np.array([numbers.setdefault((item.run, item.law, slot), len(numbers)) for slot in part.slots.tolist()])
        for item, part in zip(known, parts, strict=True)
    )


def left_of(item: LinearPiece) -> tuple[float, float]:
    """Give the squares of a piece's residual and its correlation length in samples."""
    return float(item.residual @ item.residual), correlation_length(item.residual)


def noise_of(known: Sequence[About], linear: Held[LinearPiece]) -> dict[Kind, Noise]:
    """Estimate size and correlation length of the residual for every kind of piece."""
    left = linear.map(left_of)
    found: dict[Kind, Noise] = {}
    for kind in dict.fromkeys(item.kind for item in known):
        same = [(item.samples, *one) for item, one in zip(known, left, strict=True) if item.kind == kind]
        mean_square = sum(squares for _, squares, _ in same) / sum(samples for samples, _, _ in same)
        length = float(np.median([length for _, _, length in same]))
        found[kind] = Noise(max(np.sqrt(mean_square), 1e-12), length)
    return found


def correlation_length(residual: Floats) -> float:
    """Give 1 + 2 sum of the autocorrelation up to its first zero, in samples."""
    n = residual.size
    if n < 8 or not np.any(residual):
        return 1.0
    size = 1 << (2 * n - 1).bit_length()
    spectrum = np.abs(np.fft.rfft(residual - residual.mean(), size)) ** 2
    correlation = np.fft.irfft(spectrum, size)[: n // 2]
    if correlation[0] <= 0:
        return 1.0
    correlation = correlation / correlation[0]
    negative = np.flatnonzero(correlation <= 0)
    stop = int(negative[0]) if negative.size else correlation.size
    return float(max(1.0, 1.0 + 2.0 * correlation[1:stop].sum()))

"""Normal matrices per run: everything that fitting, leave-one-run-out and trial terms need of the samples.

Each piece gives its weighted residual and Jacobian with the run's own constant projected out where the equation is
an angle. Sums over samples are kept per run and per block of time, so that a fold that leaves a run out, or a test
that turns the sign of blocks, costs one small solve.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.loop.model.equations import Equation, Law, Piece
from rig.loop.model.evaluation import Evaluation
from rig.loop.model.prediction import Model, predict
from rig.loop.model.terms import line_values

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
class LinearPiece:
    """A piece linearised about a model: residual (m,), Jacobian (m, p), weight, and its blocks of time.

    `starts`: first sample of every block; `blocks`: the blocks' numbers in the campaign, shape as `starts`.
    """

    piece: Piece
    evaluation: Evaluation
    residual: Floats
    jacobian: Floats
    weight: float
    starts: NDArray[np.intp]
    blocks: NDArray[np.intp]

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
        left = np.empty(len(self.runs))
        for k in range(len(self.runs)):
            rest, slope = total_A - self.A[k], total_g - self.g[k]
            # of what this run alone told only rounding is left, of either sign
            told = np.diag(rest) > ROUNDING * np.diag(total_A)
            step = solve(np.where(np.outer(told, told), rest, 0.0), np.where(told, slope, 0.0))
            left[k] = self.squares[k] - 2.0 * step @ self.g[k] + step @ self.A[k] @ step
        return left


def solve(A: Floats, b: Floats) -> Floats:
    """Solve A x = b for a positive semi-definite A, scaled to unit diagonal; directions without information give 0."""
    if not A.size:
        return np.zeros_like(b)
    scale = np.sqrt(np.maximum(np.diag(A), 1e-300))
    values, vectors = np.linalg.eigh(A / np.outer(scale, scale))
    keep = values > 1e-11 * values[-1]
    projected = vectors.T @ (b.T / scale).T
    solved = np.where(keep, 1.0 / np.where(keep, values, 1.0), 0.0)
    return np.asarray(((vectors @ (solved * projected.T).T).T / scale).T)


def linearise(
    pieces: Sequence[Piece], model: Model, columns: Columns, noise: dict[Kind, Noise], block: float
) -> list[LinearPiece]:
    """Evaluate every piece about the model. `block`: length of the blocks of time at least, s."""
    numbers: dict[tuple[str, Law, int], int] = {}
    found = []
    for piece in pieces:
        evaluation = predict(piece, model)
        rows = piece.index
        jacobian = np.zeros((rows.size, columns.size))
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
        residual = piece.target - evaluation.value[rows]
        if piece.demeaned:
            residual = residual - residual.mean()
            jacobian -= jacobian.mean(axis=0)
        slot = np.floor(piece.track.time[rows] / _block_of(piece, noise, block)).astype(int)
        starts = np.flatnonzero(np.concatenate([[True], np.diff(slot) != 0]))
        ids = [numbers.setdefault((piece.track.name, piece.law, int(slot[start])), len(numbers)) for start in starts]
        weight = noise[piece.kind].weight if piece.kind in noise else 1.0
        found.append(LinearPiece(piece, evaluation, residual, jacobian, weight, starts, np.array(ids)))
    return found


def _block_of(piece: Piece, noise: dict[Kind, Noise], block: float) -> float:
    """Give the length (s) of a piece's blocks: at least `block`, longer where its residual remembers longer."""
    if piece.kind not in noise:
        return block
    memory = MEMORIES_A_BLOCK * noise[piece.kind].length * piece.track.period
    return max(block, min(memory, float(np.ptp(piece.track.time)) / LEAST_BLOCKS))


def _is_logarithmic(model: Model, name: str) -> bool:
    return bool(model.table.entries[model.table.names.index(name)].logarithmic)


def normal_of(linear: Sequence[LinearPiece]) -> Normal:
    """Sum the pieces into one normal matrix a run."""
    runs = tuple(dict.fromkeys(item.piece.track.name for item in linear))
    size = linear[0].jacobian.shape[1] if linear else 0
    A, g, squares = np.zeros((len(runs), size, size)), np.zeros((len(runs), size)), np.zeros(len(runs))
    for item in linear:
        row = runs.index(item.piece.track.name)
        A[row] += item.weight * item.jacobian.T @ item.jacobian
        g[row] += item.weight * item.jacobian.T @ item.residual
        squares[row] += item.weight * item.residual @ item.residual
    return Normal(runs, A, g, squares)


def noise_of(linear: Sequence[LinearPiece]) -> dict[Kind, Noise]:
    """Estimate size and correlation length of the residual for every kind of piece."""
    found: dict[Kind, Noise] = {}
    for kind in dict.fromkeys(item.piece.kind for item in linear):
        same = [item for item in linear if item.piece.kind == kind]
        count = sum(item.residual.size for item in same)
        mean_square = sum(float(item.residual @ item.residual) for item in same) / count
        lengths = [correlation_length(item.residual) for item in same]
        found[kind] = Noise(max(np.sqrt(mean_square), 1e-12), float(np.median(lengths)))
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

"""What a model leaves of the runs at the full rate of their logs, and its errors; replicates side by side."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.loop.model.equations import Piece
from rig.loop.model.prediction import Model, predict

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Residual:
    """Residual (m,) of a piece at the samples that count, at `time` (m,)."""

    piece: Piece
    time: Floats
    values: Floats

    @property
    def fast(self) -> float:
        """Give the rms difference of neighbouring samples over sqrt(2): white noise without slow structure."""
        if self.values.size < 3:
            return 0.0
        step = np.diff(self.values)[np.diff(self.time) < 1.5 * self.piece.track.period]
        return float(np.sqrt(np.mean(step**2) / 2.0)) if step.size else 0.0

    @property
    def step_sizes(self) -> Floats:
        """Give the size of the differences of neighbouring samples over sqrt(2), (k,)."""
        step = np.diff(self.values)[np.diff(self.time) < 1.5 * self.piece.track.period]
        return np.abs(step) / math.sqrt(2.0)

    @property
    def fast_of_target(self) -> float:
        """Give what `fast` is of what was measured, whatever the model makes of it."""
        step = np.diff(self.piece.target)[np.diff(self.piece.index) == 1]
        return float(np.sqrt(np.mean(step**2) / 2.0)) if step.size else 0.0


def residual_of(piece: Piece, model: Model, judge: Model | None = None) -> Residual:
    """Evaluate the piece where the law determines it; an angle's own constant is removed.

    `judge`: the model whose law decides which samples those are, so that two models are compared on the same ones.
    """
    evaluation = predict(piece, model)
    settled = (evaluation if judge is None else predict(piece, judge)).settled[piece.index]
    keep = settled if settled.any() else np.ones(piece.index.size, dtype=bool)
    rows = piece.index[keep]
    values = piece.target[keep] - evaluation.value[rows]
    if piece.demeaned:
        values = values - values.mean()
    return Residual(piece, piece.track.time[rows], values)


def by_procedure(residuals: Sequence[Residual]) -> dict[tuple[str, str], list[Residual]]:
    """Group residuals by equation and procedure."""
    groups: dict[tuple[str, str], list[Residual]] = {}
    for residual in residuals:
        key = (residual.piece.equation.value, residual.piece.track.procedure.value)
        groups.setdefault(key, []).append(residual)
    return groups


def pairs(residuals: Sequence[Residual]) -> list[tuple[Residual, Residual]]:
    """Give the replicate pairs among residuals of one equation: neighbours within a group."""
    groups: dict[tuple[str, str], list[Residual]] = {}
    for residual in residuals:
        track = residual.piece.track
        if track.replicate is not None:
            groups.setdefault((track.replicate, track.procedure.value), []).append(residual)
    return [pair for members in groups.values() for pair in itertools.pairwise(members)]


def aligned(one: Residual, two: Residual) -> tuple[Floats, Floats, Floats]:
    """Give time, and both residuals at the samples that both have; runs of a pair are commanded alike in time."""
    period = one.piece.track.period
    a, b = np.round(one.time / period).astype(np.int64), np.round(two.time / period).astype(np.int64)
    common, at_a, at_b = np.intersect1d(a, b, return_indices=True)
    return np.asarray(common * period, dtype=float), one.values[at_a], two.values[at_b]


def rms(values: Floats) -> float:
    """Give the root of the mean square, 0 of nothing."""
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0

"""What every selector is given: residual and ready columns of the catalogue, the base model projected out of both.

Derivatives of the base model are projected out of residual and columns, which is what a joint refit does; on the
held-out runs base and columns are corrected together. Every equation is weighted by its noise, a run's own constant is
taken out where the equation is an angle, and angles in columns are those that the model predicts. The columns are made
by the loop's own functions, with true orders among the lines and a few values of every other parameter.
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rig.config.dut import Dut
from rig.log.run import Run
from rig.loop.fitting.base import known_parameters
from rig.loop.fitting.fit import Fit
from rig.loop.fitting.normal import LinearPiece, linearise
from rig.loop.model.equations import pieces_of
from rig.loop.model.shapes import ShapeTerm, catalogue_shapes
from rig.loop.model.terms import TermClass, periodic_effects
from rig.loop.search.shape_trials import shape_of
from rig.loop.search.trial import line_columns
from rig.loop.signals.tracks import make_track, thin_track
from sim_backend.model.effects import Effect

Floats = NDArray[np.float64]

RATE = 10.0
"""Samples a second that a selector sees at most."""

VALUES: Mapping[str, tuple[float, ...]] = {
    "N*m": (0.5, 1.5, 3.0, 6.0),
    "rad/s": (3.0, 10.0),
    "s": (0.3, 3.0, 30.0),
    "Hz": (8.0, 12.0, 18.0, 27.0),
}
"""By unit: what is tried for a parameter that is no amplitude and no order. True values lie between these."""

ORDERS: Mapping[str, tuple[float, ...]] = {
    "kinematic-error": (1.0, 2.0, 4.0),
    "cogging": (14.0, 84.0),
    "position-dependent-friction": (1.0, 2.0, 3.0),
    "stiffness-modulation": (1.0, 2.0, 3.0),
    "torque-ripple": (42.0,),
    "gravity-load": (1.0,),
    "motor-encoder-eccentricity": (1.0,),
    "output-encoder-eccentricity": (1.0, 2.0),
    "encoder-subdivision-error": (2048.0,),
}
"""Orders of lines: all that are drawn are among them."""

LEAST_LEFT = 1e-6
"""Share of a column's squares that the base must leave, or it is no column of its own."""

NOT_LINEAR = 0.3
"""Size, relative to the typical one, at which an effect is taken that is not linear in its amplitude."""


@dataclass(frozen=True, slots=True)
class Task:
    """Columns (n, k) and target (n,) of unit size, of the training runs; `runs` (n,): of which run a row is.

    `groups` (k,): the effect of every column.
    """

    X: Floats
    y: Floats
    runs: NDArray[np.intp]
    groups: tuple[str, ...]

    def split(self) -> tuple["Task", "Task"]:
        """Give three quarters of the runs to fit, and one to choose a threshold by."""
        checked = np.isin(self.runs, np.unique(self.runs)[3::4])
        fitted, chosen = (replace(self, X=self.X[r], y=self.y[r], runs=self.runs[r]) for r in (~checked, checked))
        return fitted, chosen


def sparsest_as_good(tried: Sequence[Floats], checked: Task) -> int:
    """Give which coefficients to take: the fewest that are within a standard error of the best on the checked runs."""
    squares = [(checked.y - checked.X @ coefficients) ** 2 for coefficients in tried]
    by_run = np.array([[np.mean(some[checked.runs == run]) for run in np.unique(checked.runs)] for some in squares])
    behind = by_run - by_run[int(np.argmin(by_run.mean(axis=1)))]
    error = behind.std(axis=1, ddof=1) / np.sqrt(behind.shape[1])
    good = [k for k in range(len(tried)) if behind[k].mean() <= error[k]]
    return min(good, key=lambda k: (np.count_nonzero(tried[k]), behind[k].mean()))


@dataclass(frozen=True, slots=True)
class _Rows:
    """Some samples of one piece, unweighted: residual (m,), base derivatives (m, p), columns (m, k); square root of
    the weight."""

    equation: str
    run: str
    residual: Floats
    base: Floats
    columns: Floats
    weight: float


@dataclass(frozen=True, slots=True)
class Prepared:
    """A task, and what tells the error that coefficients leave on the held-out runs."""

    task: Task
    checked: tuple[_Rows, ...]
    shift: Floats
    absorbed: Floats
    unit: Floats

    def rms(self, coefficients: Floats) -> dict[str, float]:
        """Give what is left of the held-out runs per equation, in its unit, at coefficients (k,) of the task."""
        b = coefficients * self.unit
        squares: dict[str, list[Floats]] = {}
        for rows in self.checked:
            left = rows.residual - rows.base @ (self.shift - self.absorbed @ b) - rows.columns @ b
            squares.setdefault(rows.equation, []).append(left**2)
        return {name: float(np.sqrt(np.mean(np.concatenate(values)))) for name, values in squares.items()}


def prepare_columns(base: Fit, runs: Sequence[Run], held_out: Sequence[str], dut: Dut) -> Prepared:
    """Give task and held-out rows of a campaign whose base fit is `base`."""
    known = known_parameters(dut, base.model.ratio) | {"stiffness": base.model.table.entries[0].centre}
    terms, lines = _shapes(known), _lines()
    out = [thin_track(make_track(run, dut)) for run in runs if run.name in held_out]
    pieces = [piece for track in out for piece in pieces_of(track, base.model.ratio)]
    linear = linearise(pieces, base.model, base.columns, base.noise, base.block)
    train, checked = (_rows(some, terms, lines) for some in (base.linear.gather(), linear))
    J, C, r = (
        np.concatenate([rows.weight * getattr(rows, name) for rows in train])
        for name in ("base", "columns", "residual")
    )
    size = np.maximum(np.sqrt(np.mean(J**2, axis=0)), 1e-300)
    inverse = np.linalg.pinv(J / size, rcond=1e-9) / size[:, None]
    shift, absorbed = inverse @ r, inverse @ C
    y, X = r - J @ shift, C - J @ absorbed
    kept = np.sum(X**2, axis=0) > LEAST_LEFT * np.maximum(np.sum(C**2, axis=0), 1e-300)
    spread, noise = np.std(X[:, kept], axis=0), float(np.std(y))
    names = list(dict.fromkeys(rows.run for rows in train))
    index = np.concatenate([np.full(rows.residual.size, names.index(rows.run)) for rows in train])
    groups = [term.effect.id for term in terms for _ in term.effect.amplitudes]
    groups += [kind.id for kind, _ in lines for _ in range(2)]
    task = Task(X[:, kept] / spread, y / noise, index, tuple(np.array(groups)[kept].tolist()))
    fewer = tuple(replace(rows, columns=rows.columns[:, kept]) for rows in checked)
    return Prepared(task, fewer, shift, absorbed[:, kept], noise / spread)


def _rows(
    linear: Sequence[LinearPiece], terms: Sequence[ShapeTerm], lines: Sequence[tuple[TermClass, float]]
) -> list[_Rows]:
    found = []
    for item in linear:
        step = max(1, round(item.residual.size / max(RATE * float(np.ptp(_times(item))), 1.0)))
        blocks = [_filled(shape_of(term)(item), item, len(term.effect.amplitudes)) for term in terms]
        blocks += [_filled(line_columns(item, kind, order), item, 2) for kind, order in lines]
        columns = np.column_stack(blocks)[::step]
        piece = item.piece
        found.append(
            _Rows(
                piece.equation.value,
                piece.track.name,
                item.residual[::step],
                item.jacobian[::step],
                columns,
                float(np.sqrt(item.weight)),
            )
        )
    return found


def _times(item: LinearPiece) -> Floats:
    return item.piece.track.time[item.piece.index]


def _filled(columns: Floats | None, item: LinearPiece, count: int) -> Floats:
    return np.zeros((item.residual.size, count)) if columns is None else columns


def _lines() -> list[tuple[TermClass, float]]:
    return [(kind, order) for kind in periodic_effects() for order in ORDERS[kind.id]]


def _shapes(known: Mapping[str, float]) -> list[ShapeTerm]:
    return [ShapeTerm(effect, values) for effect in catalogue_shapes() for values in _points(effect, known)]


def _points(effect: Effect, known: Mapping[str, float]) -> list[tuple[float, ...]]:
    choices: list[tuple[float, ...]] = []
    for parameter in effect.parameters:
        if parameter.known:
            choices.append((known.get(parameter.name, parameter.typical),))
        elif parameter.name in effect.amplitudes:
            choices.append((1.0 if effect.linear else NOT_LINEAR * parameter.typical,))
        else:
            choices.append(VALUES.get(parameter.unit, (parameter.typical,)))
    return list(itertools.product(*choices))

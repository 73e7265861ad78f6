"""Evaluate a model on runs: prediction and residual of every equation that a run allows, one CSV file a run."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from drivers.errors import ConfigError, DataError, Mistake
from rig.log.names import safe_name, written_aside
from rig.log.run import Run
from rig.loop.files.model_file import Model as ModelFile
from rig.loop.fitting.base import start_model
from rig.loop.model.equations import Piece, pieces_of, target_of
from rig.loop.model.evaluation import Evaluation
from rig.loop.model.prediction import Model, predict
from rig.loop.signals.checks import check_gear
from rig.loop.signals.tracks import make_track

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Prediction:
    """Prediction and residual (n,) of one equation of one run, in `unit`.

    `settling`: true where the sample does not count: outside the legs of constant speed, masked, still dependent on
    the unknown start of a play, or, in an equation of a torque, taken while the mesh sticks.
    """

    equation: str
    column: str
    unit: str
    predicted: Floats
    residual: Floats
    settling: NDArray[np.bool_]

    @property
    def rms(self) -> float:
        """Give the rms of the residual over the samples that count, in `unit`."""
        return float(np.sqrt(np.mean(np.square(self.residual[~self.settling]))))

    @property
    def share(self) -> float:
        """Give the share of the run's samples that count."""
        return float(np.mean(~self.settling))


@dataclass(frozen=True, slots=True)
class Remaining:
    """What a model leaves of one equation of a run: rms of the residual, in `unit`, over a `share` of the samples."""

    equation: str
    unit: str
    rms: float
    share: float


@dataclass(frozen=True, slots=True)
class Predicted:
    """One run that was predicted: its name, the file written, and what remains of each equation."""

    run: str
    file: Path
    remaining: tuple[Remaining, ...]


def model_of_file(model: ModelFile) -> Model:
    """Give the model that a file describes."""
    return start_model(model.dut, model.base.ratio, model.base.law, model)


def predict_run(run: Run, model: ModelFile) -> tuple[Prediction, ...]:
    """Predict every equation that the run allows.

    Raises DataError where the device contradicts the run, or where what the model says of it is no number. The run's
    own constant of an angle is removed; the predicted value never uses the channel it predicts.
    """
    track = make_track(run, model.dut)
    check_gear([track], model.dut)
    computed = model_of_file(model)
    # the track has rows that the log lacks, and lacks those in which a slow channel was not read
    place = np.minimum(np.searchsorted(track.time, run.time), track.size - 1)
    there = track.time[place] == run.time
    sense = -1.0 if model.dut.gear.rotation.value == "same" else 1.0
    found = []
    for piece in pieces_of(track, computed.ratio):
        evaluation = _evaluated(piece, computed)
        target = target_of(piece, computed.ratio)
        counted = np.zeros(track.size, dtype=bool)
        counted[piece.index] = evaluation.settled[piece.index]
        if not counted.any():
            counted[piece.index] = True
        predicted = evaluation.value
        if piece.demeaned:
            predicted = predicted + float(np.mean(target[counted] - predicted[counted]))
        sign = sense if piece.equation.value.startswith("motor") else 1.0
        found.append(
            Prediction(
                equation=piece.equation.value,
                column=piece.equation.column,
                unit=piece.equation.unit,
                predicted=sign * np.interp(run.time, track.time, predicted),
                residual=sign * np.interp(run.time, track.time, target - predicted),
                settling=~(counted[place] & there),
            )
        )
    return tuple(found)


def _evaluated(piece: Piece, model: Model) -> Evaluation:
    """Evaluate the model for a piece. Raises DataError where that overflows or leaves a sample without a number."""
    try:
        with np.errstate(over="raise", divide="raise", invalid="raise"):
            evaluation = predict(piece, model)
        sound = bool(np.all(np.isfinite(evaluation.value[piece.index])))
    except (FloatingPointError, OverflowError):
        sound = False
    if not sound:
        terms = [f"{line.kind.id} of order {line.order:g}, amplitude {line.amplitude:g}" for line in model.lines]
        terms += [shape.effect.id for shape in model.shapes]
        raise DataError(
            piece.track.name,
            f"what the model predicts of its {piece.equation.value} is no number",
            expected="parameters and effects with which every sample can be computed",
            hint=f"Something in the model is too large for this run: {'; '.join(['its base parameters', *terms])}.",
        )
    return evaluation


def write_predictions(runs: Sequence[Run], model: ModelFile, folder: Path) -> tuple[Predicted, ...]:
    """Write `<run>.csv` for every run; give the files with what remains.

    All are written aside and moved there at the end. Raises DataError as `predict_run`, ConfigError where they cannot
    be written or one would take the place of a log that was read.
    """
    _refuse_logs(runs, folder)
    with written_aside(folder) as aside:
        written = _written(runs, model, aside)
    return tuple(replace(one, file=folder / one.file.name) for one in written)


def _refuse_logs(runs: Sequence[Run], folder: Path) -> None:
    """Raise ConfigError where a prediction would take the place of one of the logs."""
    logs = {run.file.resolve() for run in runs}
    taken = [path for run in runs if (path := _file_of(run, folder)).resolve() in logs]
    if taken:
        raise ConfigError(
            "-o",
            [Mistake("-o", str(folder), f"holds {taken[0].name}, a log that is read: it would be lost")],
            hint="Choose another folder with -o.",
        )


def _file_of(run: Run, folder: Path) -> Path:
    return folder / f"{safe_name(run.name)}.csv"


def _written(runs: Sequence[Run], model: ModelFile, folder: Path) -> list[Predicted]:
    written = []
    for run in runs:
        predictions = predict_run(run, model)
        columns = [run.time]
        names = ["time[s]"]
        for item in predictions:
            columns += [item.predicted, item.residual]
            names += [f"{item.column}_predicted[{item.unit}]", f"{item.column}_residual[{item.unit}]"]
        for item in predictions:
            columns.append(item.settling.astype(float))
            names.append(f"{item.column}_settling[1]")
        path = _file_of(run, folder)
        np.savetxt(path, np.column_stack(columns), fmt="%.10g", delimiter=",", header=",".join(names), comments="")
        remaining = tuple(Remaining(item.equation, item.unit, item.rms, item.share) for item in predictions)
        written.append(Predicted(run.name, path, remaining))
    return written

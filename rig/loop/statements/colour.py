"""How much noise is left in the slow part of a residual: by the colour that the quiet dwells show.

The slow part are the means over half a second. White noise loses most of its squares in them, a noise that remembers
keeps them; the dwell before the first motion tells which it is. The size of the noise comes from the run itself,
because a noise may grow with the load.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.config.dut import Dut
from rig.loop.model.equations import Law, Piece, target_of
from rig.loop.model.hum import with_hums
from rig.loop.model.prediction import Model
from rig.loop.model.shapes import Place, addition, place_of
from rig.loop.signals.counts import count_of, lone_steps
from rig.loop.statements.dwells import dwell_of
from rig.loop.statements.residuals import Residual
from sim_backend.model.compliance import wave_generator_stiffness

Floats = NDArray[np.float64]

SMOOTHING = 0.5
"""s."""

STANDS = 3.0
"""Counts of an encoder that it moves in a second at most while its reading stands."""

ROUNDED, FEWEST_ROUNDED = 1.5, 5
"""Counts beyond which a step is more than one, and steps between samples at rest from which on they are told."""

SPEED_SIDE, HARMONICS = 1.0, 10
"""s on either side over which the speed of a reading is taken, and harmonics of its rounding that are looked at."""


def means(values: Floats, period: float) -> Floats:
    """Give the means of `values` (n,) over `SMOOTHING`; period: s between samples."""
    window = max(1, round(SMOOTHING / period))
    count = values.size // window
    return np.asarray(values[: count * window].reshape(count, window).mean(axis=1))


def slow_square(residual: Residual) -> float:
    """Give the mean square of the residual's slow part."""
    slow = means(residual.values, residual.piece.track.period)
    return float(np.mean(slow**2)) if slow.size else 0.0


def rows_of(residual: Residual) -> NDArray[np.intp]:
    """Give the samples of the piece's track at which the residual stands, (m,)."""
    rows = np.searchsorted(residual.piece.track.time, residual.time - 0.5 * residual.piece.track.period)
    return np.asarray(np.minimum(rows, residual.piece.track.size - 1), dtype=np.intp)


@dataclass(frozen=True, slots=True)
class SlowNoise:
    """Mean square that noise leaves in the slow part. `dwells`: its colour is that of dwells, else taken for white."""

    square: float
    dwells: bool


def slow_noise(residuals: Sequence[Residual], dut: Dut, model: Model) -> SlowNoise:
    """Give what noise and the encoders' counts leave in the slow part of residuals of one equation and procedure."""
    pieces = [residual.piece for residual in residuals]
    torques = [] if pieces[0].demeaned else [(piece, target_of(piece, model.ratio)) for piece in pieces]
    quiet = any(dwell_of(piece) is not None for piece in pieces)
    inputs = [_inputs(piece, model) for piece in pieces]
    colours = {
        name: _colour(
            [(piece, item[name].recorded) for piece, item in zip(pieces, inputs, strict=True) if name in item]
        )
        for name in {name for item in inputs for name in item}
    }
    own, squares = _colour(torques), []
    for residual, item in zip(residuals, inputs, strict=True):
        white = 1.0 / max(1, round(SMOOTHING / residual.piece.track.period))
        square = residual.fast**2 * max(own, white)
        for name, torque in item.items():
            left = float(np.mean(np.diff(torque.recorded) ** 2)) / 2.0 * max(colours[name], white)
            square += float(np.mean(torque.weight**2)) * left
        square += _reading_square(residual, dut, model.ratio) if residual.piece.demeaned else 0.0
        taken = means(cleaned_away(residual, model), residual.piece.track.period)
        squares.append(square + (float(np.mean(taken**2)) if taken.size else 0.0))
    return SlowNoise(float(np.mean(squares)), quiet)


def encoder_counts(piece: Piece, dut: Dut, ratio: float | None) -> tuple[float, float] | None:
    """Give the counts of the motor's and of the output's encoder, rad at the output; None where one is not known.

    0 for one that the device file does not say and that reads the same throughout.
    """
    track, given, found = piece.track, (dut.motor.encoder_counts, dut.output.encoder_counts), []
    if ratio is None:
        return None
    for count, position, gear in zip(given, (track.motor_position, track.output_position), (ratio, 1.0), strict=True):
        step = _step_of(position, 2.0 * math.pi / count if count else None)
        if step is None:
            return None
        found.append(step / gear)
    return found[0], found[1]


def _step_of(position: Floats | None, count: float | None) -> float | None:
    """Give the steps in which an angle goes: those of its encoder, or coarser ones where it was rounded.

    A step of one count, or of the rounding, stands between samples that do not differ.
    """
    if position is None or count is None:
        return count if position is None else 0.0 if np.ptp(position) == 0.0 else count_of([position])
    lone = lone_steps(position, count / ROUNDED)
    step = float(np.median(lone)) if lone.size >= FEWEST_ROUNDED else 0.0
    return step if step > ROUNDED * count else count


def slow_counts(position: Floats, count: float, period: float) -> Floats:
    """Give which part of the squares of an encoder's rounding is slow, around every sample of `position` (n,).

    count: of the encoder, as `position`; period: s. It is 1 where the reading stands, 0 where it moves at a usual
    speed, and in between where the counts beat with the samples: a whole number of them, or a simple fraction, from one
    sample to the next. The rounding of a steady motion is a sawtooth, whose harmonic k has the share 1 / k^2.
    """
    index, half = np.arange(position.size), max(1, round(SPEED_SIDE / period))
    low, high = np.maximum(index - half, 0), np.minimum(index + half, position.size - 1)
    per_sample = (position[high] - position[low]) / (high - low) / count
    window = max(2, round(SMOOTHING / period))
    found = np.zeros(position.size)
    for k in range(1, HARMONICS + 1):
        phase = math.pi * (k * per_sample - np.round(k * per_sample))
        sine = np.sin(phase)
        near = np.abs(sine) < 1e-9
        kernel = np.where(near, 1.0, np.sin(window * phase) / (window * np.where(near, 1.0, sine)))
        found += 6.0 / (math.pi * k) ** 2 * kernel**2
    return found


def _reading_square(residual: Residual, dut: Dut, ratio: float | None) -> float:
    """Bound the mean square of the slow part that the rounding of the encoders leaves: up to half a count."""
    track, counts, rows = residual.piece.track, encoder_counts(residual.piece, dut, ratio), rows_of(residual)
    square = 0.0
    for position, count, gear in zip(
        (track.motor_position, track.output_position), counts or (), (ratio or 1.0, 1.0), strict=False
    ):
        if position is not None and position.size > 2 and np.ptp(position) > 0.0:
            square += count**2 / 4.0 * float(np.mean(slow_counts(position, count * gear, track.period)[rows]))
    return square


def cleaned_away(residual: Residual, model: Model) -> Floats:
    """Give what the prediction would have more, had its torques kept all that smoothing took from them, (m,).

    Where a torque was smoothed wrongly this is as large as the error of the prediction by it.
    """
    rows, found = rows_of(residual), np.zeros(residual.values.size)
    for torque in _inputs(residual.piece, model).values():
        found += ((torque.recorded - torque.used) * torque.weight)[rows]
    return found


def steeply_read(residual: Residual, model: Model) -> Floats:
    """Give what the noise of a motor torque makes of the shapes that follow it, where they are steep, rad, (m,).

    Within a gap the torque decides on which side it stands, and whether it does the reading hardly tells.
    """
    track, rows = residual.piece.track, rows_of(residual)
    found = np.zeros(rows.size)
    if residual.piece.law is not Law.TORSION or track.moves or track.M is None or track.motor_torque is None:
        return found
    noise = float(np.std((track.motor_torque - track.M)[rows]))
    for term in model.shapes:
        if term.is_of_motor_torque and place_of(term.effect) is Place.ANGLE:
            sides = [addition(term, {"motor_torque": track.M[rows] + way * noise}, track.step) for way in (1.0, -1.0)]
            if sides[0] is not None and sides[1] is not None:
                found += 0.5 * np.abs(sides[0] - sides[1])
    return found


@dataclass(frozen=True, slots=True)
class _Input:
    """A torque that enters a prediction: as recorded, as used, and how much of it shows, each of shape (n,)."""

    recorded: Floats
    used: Floats
    weight: Floats


def _inputs(piece: Piece, model: Model) -> dict[str, _Input]:
    """Give the torques that enter the prediction of a piece, by signal."""
    track, ratio, found = with_hums(piece.track, model.lines), model.ratio or 1.0, {}
    load = track.swept_torque if track.moves and track.swept_torque is not None else track.T
    if track.output_torque is not None and load is not None:
        weight = {
            Law.TORSION: 1.0 / model.flexspline_stiffness(load),
            Law.BACKDRIVE: np.full(track.size, 1.0 / ratio),
            Law.FREE_RUN: np.full(track.size, 1.0 / ratio),
        }.get(piece.law)
        used = track.play_load if piece.law is Law.BACKDRIVE and track.play_load is not None else load
        if weight is not None:
            found["output_torque"] = _Input(track.output_torque, used, weight)
    if track.motor_torque is not None and track.M is not None and not track.moves:
        stiffness = wave_generator_stiffness(track.M, model.value("K_w0"), model.value("C_w"))
        weight = {Law.TORSION: 1.0 / (stiffness * ratio), Law.LOCKED: np.full(track.size, ratio)}.get(piece.law)
        used = track.play_drive if piece.law is Law.LOCKED and track.play_drive is not None else track.M
        if weight is not None:
            found["motor_torque"] = _Input(track.motor_torque, used, np.asarray(weight))
    return found


def _colour(signals: Sequence[tuple[Piece, Floats]]) -> float:
    """Give the squares of the slow part over those of the fast part in the dwells of signals; 0 without dwells."""
    slow, fast = [], []
    for piece, values in signals:
        quiet = dwell_of(piece)
        if quiet is None:
            continue
        slow.append(means(values[quiet] - values[quiet].mean(), piece.track.period))
        fast.append(np.diff(values[quiet]))
    power = float(np.mean(np.concatenate(fast) ** 2)) / 2.0 if fast else 0.0
    return float(np.mean(np.concatenate(slow) ** 2)) / power if power > 0.0 else 0.0

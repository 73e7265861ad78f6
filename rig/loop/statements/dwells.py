"""What a dwell before a run's first motion and the encoders' counts say of the noise of the instruments."""

import math

import numpy as np
from numpy.typing import NDArray

from rig.config.dut import Dut
from rig.loop.model.equations import Equation, Piece, target_of
from rig.loop.model.parameters import TYPICAL_RATIO
from rig.loop.model.prediction import Model
from rig.loop.signals.counts import count_of
from rig.loop.signals.tracks import SHARE_OF_A_TURN
from sim_backend.model.compliance import wave_generator_stiffness

Floats = NDArray[np.float64]

MEDIAN_TO_SIGMA = 1.4826
"""Standard deviation of a normal variable over its median size."""

QUIET_TRAVEL = 2e-3
"""rad at the motor within which a run still dwells."""

LOADED = 30.0
"""A torque that has left its first value by this many times its own noise is not a dwell."""

LEAST_DWELL = 2.0
"""s of dwell that tell something about noise."""


def dwell_of(piece: Piece) -> slice | None:
    """Give the quiet samples before a run's first motion, None if there are too few."""
    track = piece.track
    angle = track.motor_position if track.motor_position is not None else track.output_position
    if angle is None:
        return None
    travel = QUIET_TRAVEL if track.motor_position is not None else QUIET_TRAVEL / TYPICAL_RATIO
    moved = np.abs(angle - angle[0]) > travel
    for torque in (track.output_torque, track.motor_torque):
        if torque is not None and torque.size > 3:
            # a sweep has slope in every sample, but no second difference
            noise = MEDIAN_TO_SIGMA * float(np.median(np.abs(np.diff(torque, 2)))) / math.sqrt(6.0)
            moved |= np.abs(torque - torque[0]) > LOADED * max(noise, 1e-3 * float(np.abs(torque).max()))
    places = np.flatnonzero(moved)
    end = int(places[0]) if places.size else angle.size
    end = round(0.8 * end)
    return slice(0, end) if end * track.period >= LEAST_DWELL else None


def dwell_spread(piece: Piece) -> float:
    """Give the relative 95 % half width of the rms of the torques in a dwell: of heavy tails it tells little."""
    quiet, track = dwell_of(piece), piece.track
    if quiet is None:
        return 0.0
    apart = [(values[quiet] - values[quiet].mean()) ** 2 for values in (track.T, track.M) if values is not None]
    known = [squares for squares in apart if squares.size > 1 and np.any(squares)]
    return max((0.5 * 1.96 * float(x.std(ddof=1) / x.mean()) / math.sqrt(x.size) for x in known), default=0.0)


def instrument_square(piece: Piece, dut: Dut, model: Model) -> float | None:
    """Give the variance that the instruments leave in a piece, in its unit squared; None where it is not known."""
    track = piece.track
    quiet = dwell_of(piece)
    if piece.equation is not Equation.TORSION:
        return None if quiet is None else float(np.var(target_of(piece, model.ratio)[quiet]))
    square = quantisation_square(piece, dut, model.ratio)
    if square is None or model.ratio is None:
        return None
    if quiet is None and (track.T is not None or track.M is not None):
        return None
    if track.T is not None and quiet is not None:
        noise = float(np.var(track.T[quiet])) * _averaged_away(piece)
        square += noise * float(np.mean((1.0 / model.flexspline_stiffness(track.T[piece.index])) ** 2))
    if track.M is not None and quiet is not None and not track.moves:
        softness = 1.0 / wave_generator_stiffness(track.M[piece.index], model.value("K_w0"), model.value("C_w"))
        square += float(np.var(track.M[quiet]) * np.mean((softness / model.ratio) ** 2))
    return square


def _averaged_away(piece: Piece) -> float:
    """Give the share of white noise that is left in the output torque of a turning run, averaged leg by leg."""
    track = piece.track
    if not track.moves:
        return 1.0
    width = SHARE_OF_A_TURN * 2.0 * math.pi / np.abs(track.speed[piece.index]) / track.period
    return float(np.mean(1.0 / np.maximum(np.round(width), 1.0)))


def quantisation_square(piece: Piece, dut: Dut, ratio: float | None) -> float | None:
    """Give the variance (rad**2) which the encoders' counts leave in the torsion, None where counts are unknown.

    Counts that the device file lacks are read off the steps of the angle.
    """
    motor, output, track = dut.motor.encoder_counts, dut.output.encoder_counts, piece.track
    if ratio is None:
        return None
    square = 0.0
    for position, count, gear in ((track.motor_position, motor, ratio), (track.output_position, output, 1.0)):
        step = 2.0 * math.pi / count if count is not None else _step_of(position)
        if step is None:
            return None
        if position is not None and np.ptp(position) > 3.0 * step:
            square += (step / gear) ** 2 / 12.0
    return square


def _step_of(position: Floats | None) -> float | None:
    return None if position is None else count_of([position])

"""Starting values scaled to the data: catalogue values are priors, and may be wrong by any factor.

A secant of the torque over the torsion gives the stiffness, half the width of the friction loop its level. Where such a
rough value differs from the catalogue's by more than `FACTOR`, the fit starts from it; the prior stays the catalogue's
(but for the stiffnesses of a piecewise linear flexspline).
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rig.log.run import ProcedureName
from rig.loop.model.prediction import Model
from rig.loop.signals.tracks import Track

Floats = NDArray[np.float64]

FACTOR = 3.0
"""A rough value nearer to the catalogue's than this says nothing against it."""

WAVE_GENERATOR_SHARE = 1.6
"""K_w0 * ratio^2 over K_F0 of the drive in Zhang, Ahmad & Liu 2014."""

STIFFNESSES = ("K_F0", "a1", "K1", "K2", "K3")
"""Stiffnesses of the flexspline in one law or another."""

LINES = ("K1", "K2", "K3")
"""Of these a prior that the data contradict goes as well: it would drive T2 out of the data before it gives in."""

BEND = 0.7
"""C_F times the largest torque of that drive; the square is the share by which the flexspline stiffens up to there."""

LEVELS = (10.0, 90.0)
"""Percentiles between which a friction loop is wide."""


def scaled_to_data(start: Model, tracks: Sequence[Track]) -> Model:
    """Give the model with starting values that lie within reach of the data."""
    far = {
        name: value
        for name, value in _rough_values(start, tracks)
        if name in start.table.names and not 1.0 / FACTOR < value / start.value(name) < FACTOR
    }
    table = start.table.with_start(far).with_centre({name: far[name] for name in LINES if name in far})
    values = np.where([entry.name in far for entry in table.entries], table.start(), start.values)
    return replace(start, table=table, values=values)


def _rough_values(start: Model, tracks: Sequence[Track]) -> Iterator[tuple[str, float]]:
    """Give rough values by name, for every law of the flexspline; T1 and T2 are the catalogue's."""
    ratio = start.ratio
    swept = [track for track in tracks if not track.moves and track.usable.sum() > 2]
    if ratio is None:
        return
    stiffness = _median([secant for track in swept if (secant := _secant(track, ratio)) is not None])
    if stiffness is not None:
        yield from ((name, stiffness) for name in STIFFNESSES)
        yield "K_w0", WAVE_GENERATOR_SHARE * stiffness / ratio**2
    largest = max((float(np.abs(track.T[track.usable]).max()) for track in swept if track.T is not None), default=0.0)
    if largest > 0.0:
        yield "C_F", BEND / largest
        if stiffness is not None:
            yield "a3", (BEND / largest) ** 2 * stiffness**3 / 3.0
    locked = _median([_level(t, ratio) for t in swept if t.procedure is ProcedureName.LOCKED_OUTPUT and _both(t)])
    if locked is not None:
        yield "T_fs", locked
        yield "C_w", 1.0 / locked
    driven = _median([_level(t, ratio) for t in swept if t.procedure is ProcedureName.BACKDRIVE and _both(t)])
    if driven is not None:
        yield "T_fb", ratio * driven
        if locked is None:
            yield "C_w", 1.0 / driven


def _both(track: Track) -> bool:
    return track.T is not None and track.M is not None


def _secant(track: Track, ratio: float) -> float | None:
    """Give the slope of torque over torsion, N*m/rad; None where there is none."""
    if track.motor_position is None or track.output_position is None or track.T is None:
        return None
    torsion = (track.output_position + track.motor_position / ratio)[track.usable]
    torque = track.T[track.usable]
    torsion, torque = torsion - torsion.mean(), torque - torque.mean()
    power = float(torsion @ torsion)
    slope = float(torsion @ torque) / power if power > 0.0 else 0.0
    return slope if slope > 0.0 else None


def _level(track: Track, ratio: float) -> float:
    """Give half the width of the loop between motor torque and output torque over the ratio, N*m at the motor."""
    if track.T is None or track.M is None:
        return 0.0
    away = (track.M - track.T / ratio)[track.usable]
    low, high = np.percentile(away, LEVELS)
    return 0.5 * float(high - low)


def _median(values: Sequence[float]) -> float | None:
    known = [value for value in values if value > 0.0]
    return float(np.median(known)) if known else None

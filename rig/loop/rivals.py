"""Other explanations of a structured torsion, tried beside a periodic one so that a name is not given too early.

They are scored on the same ground as the term that is about to be named; one that explains nearly as much joins the
set, one that explains more says that the periodic name would be wrong. Laws as in the effect catalogue; ids are the
catalogue's.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from rig.loop.equations import Equation
from rig.loop.normal import LinearPiece
from rig.loop.play import play_path
from rig.loop.trial import Ground, Trial, try_columns

Floats = NDArray[np.float64]

SOFT_ZONES = (0.03, 0.15)
PLAY_RADII = (0.06, 0.12, 0.3)
"""Torques relative to the largest torque of the campaign."""

LAGS = (1.0, 5.0, 25.0)
"""s."""

RIVALS = (
    "soft-windup",
    "flexspline-compliance",
    "maxwell-slip",
    "channel-delay",
    "creep",
    "stiffness-modulation",
    "torque-sensor-drift",
)


def rivals_of_an_angle(ground: Ground, order: float) -> tuple[Trial, ...]:
    """Score every other explanation of a torsion line of this order."""
    largest = max(
        (float(np.abs(item.piece.track.T).max()) for item in ground.fit.linear if item.piece.track.T is not None),
        default=0.0,
    )
    if largest == 0.0:
        return ()
    found = []
    for name in RIVALS:
        columns = [_columns(item, name, order, largest) for item in ground.fit.linear]
        if any(column is not None for column in columns):
            found.append(try_columns(ground, name, columns))
    return tuple(found)


def _columns(item: LinearPiece, name: str, order: float, largest: float) -> Floats | None:
    piece, track = item.piece, item.piece.track
    if piece.equation is not Equation.TORSION or track.T is None or track.moves:
        return None
    columns = np.column_stack(list(_laws(item, name, order, track.T, largest)))
    return item.centred(columns[piece.index])


def _laws(item: LinearPiece, name: str, order: float, T: Floats, largest: float) -> Iterator[Floats]:
    track = item.piece.track
    relative = T / largest
    match name:
        case "soft-windup":
            for zone in SOFT_ZONES:
                yield np.tanh(relative / zone)
        case "flexspline-compliance":
            yield relative**3
            yield relative**5
        case "maxwell-slip":
            for radius in PLAY_RADII:
                yield play_path(relative, radius).output
        case "channel-delay":
            yield np.gradient(relative, track.time)
        case "creep":
            for lag in LAGS:
                pole = float(np.exp(-track.period / lag))
                yield np.asarray(lfilter([1.0 - pole], [1.0, -pole], relative))
        case "stiffness-modulation":
            angle = item.evaluation.positions["motor_position"]
            yield relative * np.sin(order * angle)
            yield relative * np.cos(order * angle)
        case _:
            yield track.time / max(float(track.time[-1]), 1e-9)

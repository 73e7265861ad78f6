"""Friction of a free-running drive from the torque of constant-speed legs in both directions.

    M(+w) = T_c + b w + c        M(-w) = -T_c - b w + c

The half difference of the two directions is friction, the half sum c does not turn with the motion (cogging and
gravity left over, offset of the current reading). Source: Zhang, Ahmad & Liu 2014, section V; friction flips its
sign with the direction, detent torque does not.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from procedures.hysteresis import Value

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class FrictionLine:
    """Coulomb torque N*m and viscous coefficient N*m*s, seen at the motor."""

    coulomb: Value
    viscous: Value


def leg_mean(torque: Floats, turns: int) -> Value:
    """Give the mean torque (N*m) of a leg at constant speed over `turns` whole motor turns.

    torque: shape (n,), evenly spaced in time; NaN is left out. The uncertainty is the scatter of the means of the
    single turns: what repeats in every turn does not count.
    """
    blocks = np.array([np.nanmean(block) for block in np.array_split(torque, max(1, min(turns, torque.size)))])
    spread = float(np.std(blocks, ddof=1) / math.sqrt(blocks.size)) if blocks.size > 1 else 0.0
    return Value(float(np.nanmean(torque)), spread)


def friction_line(speeds: Sequence[float], friction: Sequence[Value]) -> FrictionLine | None:
    """Fit Coulomb and viscous friction to the friction torque at several speeds (rad/s); None with one speed only.

    Each point counts alike; the uncertainties are the larger of what the scatter about the line and what the
    points' own uncertainties give.
    """
    w = np.asarray(speeds, dtype=np.float64)
    if np.unique(np.round(w, 6)).size < 2:
        return None
    matrix = np.stack([np.ones_like(w), w], axis=1)
    values = np.array([f.value for f in friction])
    own = np.array([f.uncertainty for f in friction])
    inverse = np.linalg.inv(matrix.T @ matrix)
    solution = inverse @ matrix.T @ values
    rest = values - matrix @ solution
    scatter = float(rest @ rest) / (w.size - 2) if w.size > 2 else 0.0
    gain = inverse @ matrix.T
    error = np.sqrt(np.maximum(np.diag(inverse) * scatter, np.sum((gain * own) ** 2, axis=1)))
    return FrictionLine(Value(float(solution[0]), float(error[0])), Value(float(solution[1]), float(error[1])))

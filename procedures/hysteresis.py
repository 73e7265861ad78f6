"""Width, friction and stiffness of one closed loop of torque and angle, from its two branches.

    falling: torque from +peak to -peak        rising: torque from -peak to +peak

For a locked output T = play(N M; N T_fs), for a held input M = play(T/N; T_fb/N): at T = 0 the branches lie apart
in the motor torque M by twice the friction level, and in the torsion by the hysteresis loss.
Source: Zhang, Ahmad & Liu 2014, equations (27), (28) and (36).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.errors import DataError

Floats = NDArray[np.float64]

NEAR_ZERO = 0.05
"""Share of the peak torque within which a branch is a parabola; the wave generator stiffens e-fold within 8 %."""

FEWEST_SAMPLES = 12
"""Four samples per coefficient of the parabola."""


@dataclass(frozen=True, slots=True)
class Value:
    """A number and its standard uncertainty, in the same unit."""

    value: float
    uncertainty: float


def gap_at_zero(branch: tuple[Floats, Floats], other: tuple[Floats, Floats]) -> Value:
    """Give by how much the second quantity of `branch` exceeds that of `other` where the first is zero.

    Each branch is (x, y), both of shape (n,); NaN is left out. Raises DataError if a branch has too few samples
    near zero.
    """
    one, two = _at_zero(*branch), _at_zero(*other)
    return Value(one.value - two.value, math.hypot(one.uncertainty, two.uncertainty))


def stiffness(torque: Floats, torsion: Floats) -> Value:
    """Give the slope of the chord of a loop, N*m/rad, from its extreme tenths of torque.

    torque N*m and torsion rad, shape (n,). The uncertainty is that of the mean torsion of both ends.
    """
    good = np.isfinite(torque) & np.isfinite(torsion)
    torque, torsion = torque[good], torsion[good]
    low, high = float(np.min(torque)), float(np.max(torque))
    margin = 0.05 * (high - low)
    top, bottom = torque >= high - margin, torque <= low + margin
    rise = float(np.mean(torque[top]) - np.mean(torque[bottom]))
    twist = float(np.mean(torsion[top]) - np.mean(torsion[bottom]))
    if twist == 0.0:
        raise DataError("stiffness", "the angle did not change with the torque", expected="a sweep that winds up")
    spread = math.hypot(_of_mean(torque[top], torsion[top]), _of_mean(torque[bottom], torsion[bottom]))
    slope = rise / twist
    return Value(slope, abs(slope / twist) * spread)


def _at_zero(x: Floats, y: Floats) -> Value:
    good = np.isfinite(x) & np.isfinite(y)
    x, y = x[good], y[good]
    near = np.abs(x) <= NEAR_ZERO * np.max(np.abs(x), initial=0.0)
    if int(np.count_nonzero(near)) < FEWEST_SAMPLES:
        raise DataError(
            "hysteresis loop",
            f"{int(np.count_nonzero(near))} samples of a branch lie near zero torque",
            expected=f"at least {FEWEST_SAMPLES}",
            hint="Sweep more slowly (parameter rates).",
        )
    coefficients, covariance = np.polyfit(x[near], y[near], 2, cov=True)
    return Value(float(coefficients[2]), math.sqrt(max(0.0, float(covariance[2, 2]))))


def _of_mean(x: Floats, y: Floats) -> float:
    """Give the standard error of the mean of y once its slope on x is taken out."""
    if x.size < 3:
        return 0.0
    line = np.polynomial.Polynomial.fit(x, y, 1)
    return float(np.std(y - line(x)) / math.sqrt(x.size))

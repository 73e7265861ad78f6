"""At how many angles of the motor a torsion was seen: what naming an angle error asks."""

import math
from collections.abc import Set

import numpy as np
from numpy.typing import NDArray

from rig.loop.search.groups import LEAST_START_ANGLES

STEP = 0.1
"""rad within which two start angles are one."""


def start_angle(angle: NDArray[np.float64]) -> float:
    """Give the mean of a run's motor angle (n,) rad in steps of a tenth of a radian; infinity where it turns."""
    if float(np.ptp(angle)) >= 2.0 * math.pi:
        return math.inf
    return float(round(float(angle.mean()) % (2.0 * math.pi) / STEP))


def enough(starts: Set[float], held_out: int = 0) -> bool:
    """Whether they are a whole motor turn, or enough start angles, `held_out` of them not counting."""
    return math.inf in starts or len(starts) - held_out >= LEAST_START_ANGLES

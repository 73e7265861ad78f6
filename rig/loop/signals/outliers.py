"""Single samples that stand far out of a torque's noise, drawn in before anything follows the torque."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from rig.loop.signals.noise import noise_and_memory

Floats = NDArray[np.float64]

NEIGHBOURS = 5
"""Samples of the running median that a sample must stand out of: what lasts for three of them is no outlier."""

FAR = 4.5
"""Standard deviations of the noise to which a sample is drawn in; of normal noise one in 150 000 lies beyond."""


def outliers_drawn_in(values: Floats, period: float) -> Floats:
    """Give a torque (n,), N*m, whose single samples lie no further than `FAR` from the median of their neighbours.

    A play keeps the largest torque it has seen and so follows the tails of the noise. period: s between samples.
    """
    if values.size <= NEIGHBOURS:
        return values
    middle = median_filter(values, NEIGHBOURS, mode="nearest")
    far = FAR * np.sqrt(noise_and_memory(values, period)[0])
    return np.where(far > 0.0, np.clip(values, middle - far, middle + far), values)

"""Single readings of a torque that are none: spikes and dropouts, far out of what the readings around them say."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from rig.log.run import Run
from rig.loop.signals.living import TORQUES

Flags = NDArray[np.bool_]

AROUND = 7
"""Samples of the running median; what lasts for half of them is no single reading."""

FAR = 0.4
"""Share of the torque's range by which a reading is off at least: no noise of a transducer comes near."""

NOISES = 20.0
"""Times the typical distance from the running median that it is at least."""

FEWEST_ALIKE, NEAR = 3, 5.0
"""Readings of one and the same value so far out from which on all of it are dropouts, and noises they stand out by."""


def spikes(run: Run) -> Mapping[str, Flags]:
    """Give, for each torque that has some, the samples (n,) at which its reading is none."""
    found = {}
    for name in TORQUES:
        values = run.signals.get(name)
        known = np.zeros(0, dtype=bool) if values is None else np.isfinite(values)
        if values is None or known.sum() <= AROUND:
            continue
        place = np.arange(values.size)
        values = np.interp(place, place[known], values[known])
        middle = median_filter(values, AROUND, mode="nearest")
        off = np.abs(values - middle)
        flags = known & (off > max(FAR * float(np.ptp(middle)), NOISES * float(np.median(off))))
        if not flags.any() or float(np.ptp(middle)) == 0.0:
            continue
        if flags.sum() >= FEWEST_ALIKE and np.ptp(values[flags]) == 0.0:
            flags = known & (values == values[flags][0]) & (off > NEAR * float(np.median(off)))
        found[name] = flags
    return found


def without_spikes(run: Run) -> Run:
    """Give the run with such readings missing (NaN)."""
    found = spikes(run)
    if not found:
        return run
    masked = {name: np.where(flags, np.nan, run.signals[name]) for name, flags in found.items()}
    return replace(run, signals={**run.signals, **masked})

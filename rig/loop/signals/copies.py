"""Further channels that are another reading of a channel that is predicted: no cause of it, whatever they explain.

A drive that logs its current as `iq` beside the torque that was made of it has the same noise in both. Fitted as a
cause, such a column would take the noise away with the error.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rig.log.run import Run
from rig.loop.signals.living import ANGLES, TORQUES

Floats = NDArray[np.float64]

SAME_NOISE = 0.15
"""Correlation of what two channels do from sample to sample, from which on they have the same noise."""

SURE = 6.0
"""Standard deviations by which it must differ from 0 as well."""

CLIPPED = 3.0
"""Times the usual second difference beyond which one counts no more: a cause that switches moves a torque with it."""


def without_copies(runs: Sequence[Run]) -> tuple[tuple[Run, ...], tuple[str, ...]]:
    """Give the runs without the further channels that follow the noise of a recorded one, and a warning for each."""
    copies = {
        name: channel
        for name in dict.fromkeys(name for run in runs for name in run.auxiliary)
        if (channel := _copied([run for run in runs if name in run.auxiliary], name)) is not None
    }
    left = tuple(
        replace(run, auxiliary={name: values for name, values in run.auxiliary.items() if name not in copies})
        for run in runs
    )
    warnings = tuple(
        f"{name} moves with {channel} from sample to sample: taken for another reading of it, and not for a cause."
        for name, channel in copies.items()
    )
    return (left, warnings) if copies else (tuple(runs), ())


def _copied(runs: Sequence[Run], name: str) -> str | None:
    """Give the recorded channel whose noise the further channel `name` follows most, None where it follows none's."""
    found: dict[str, float] = {}
    for channel in (*TORQUES, *ANGLES):
        pairs = [
            _bends(run.auxiliary[name]) * _bends(run.signals[channel])
            for run in runs
            if channel in run.signals and run.auxiliary[name].size > 2
        ]
        products = np.concatenate([np.zeros(0), *pairs])
        products = products[np.isfinite(products)]
        size = float(np.sqrt(np.sum(products**2)))
        share = abs(float(products.mean())) if products.size else 0.0
        if share > SAME_NOISE and share * products.size > SURE * size:
            found[channel] = share
    return max(found, key=lambda channel: found[channel], default=None)


def _bends(values: Floats) -> Floats:
    """Give the second differences (n - 2,), clipped, over their rms; NaN where values are missing or mostly stand."""
    bends = np.diff(values, 2)
    known = bends[np.isfinite(bends)]
    usual = float(np.median(np.abs(known))) if known.size else 0.0
    if usual == 0.0:
        return np.full(bends.size, np.nan)
    clipped = np.clip(bends, -CLIPPED * usual, CLIPPED * usual)
    return np.asarray(clipped / np.sqrt(np.nanmean(clipped**2)))

"""A torque channel that is far louder or quieter in one run than in the others of its procedure.

A held-out run whose torque is in mN*m or whose cable is loose has a floor as large as its error: nothing else names it.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from drivers.signals import BY_NAME
from rig.log.run import Run
from rig.loop.signals.living import TORQUES
from rig.loop.statements.dwells import MEDIAN_TO_SIGMA

Floats = NDArray[np.float64]

TIMES = 5.0
"""Times by which the noise of a run must be off. Where it grows with the load, loads of one procedure make some 2."""

FEWEST_RUNS = 3
"""Runs of a procedure without which nobody knows which is the odd one."""

BLOCK, FEWEST_BLOCKS = 100, 4
"""Samples over which the noise is measured, and how many of them a run needs."""

QUIET = 0.25
"""Share of the blocks that are quieter than the one that is compared: in others a run turns faster or bears a load."""


def loud_or_quiet(runs: Sequence[Run]) -> list[str]:
    """Name the runs whose noise of a torque is far from that of most other runs of their procedure."""
    found = []
    for procedure in dict.fromkeys(run.procedure for run in runs):
        for channel in TORQUES:
            levels = {run.name: _noise(run, channel) for run in runs if run.procedure is procedure}
            levels = {name: level for name, level in levels.items() if level > 0.0}
            usual = {name: _usual(name, levels) for name in levels}
            odd = [name for name, level in usual.items() if level is not None]
            if 2 * len(odd) < len(levels):
                found += [_told(name, channel, procedure, levels[name], usual[name] or 1.0) for name in odd]
    return found


def _told(name: str, channel: str, procedure: str, level: float, usual: float) -> str:
    times = float(f"{level / usual:.2g}")  # 1000, not 1e+03
    return (
        f"{name}: noise of {channel} is {level:.2g} {BY_NAME[channel].unit}, {times:g} times that of the other "
        f"{procedure} runs: unit, range or cable?"
    )


def _usual(name: str, levels: Mapping[str, float]) -> float | None:
    """Give the noise of the other runs where it is another than that of `name`, None where most are like it."""
    others = [level for other, level in levels.items() if other != name]
    if len(levels) < FEWEST_RUNS:
        return None
    others.sort(key=lambda level: abs(math.log(levels[name] / level)))
    usual = others[(len(others) - 1) // 2]
    return None if 1.0 / TIMES <= levels[name] / usual <= TIMES else usual


def _noise(run: Run, channel: str) -> float:
    """Give the white part of a channel's noise, in its unit; 0 where it is not known, or a current tells no more."""
    values = run.signals.get(channel, np.empty(0))
    if channel == "motor_current" and "motor_torque" in run.signals:
        return 0.0
    bends = np.abs(np.diff(values[np.isfinite(values)], 2))  # a sweep has slope in every sample
    count = bends.size // BLOCK
    levels = np.median(bends[: count * BLOCK].reshape(count, BLOCK), axis=1) if count else bends
    levels = levels[levels > 0.0]  # a quantised torque may stand still
    if levels.size < FEWEST_BLOCKS:
        return 0.0
    return MEDIAN_TO_SIGMA * float(np.quantile(levels, QUIET)) / math.sqrt(6.0)

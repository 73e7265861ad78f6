"""Which runs alone went somewhere: slower, faster, further, colder or warmer than all others of their procedure."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from rig.log.run import SWEEPS, Run

Floats = NDArray[np.float64]

PARTS = 100
"""Differences are taken over a hundredth of a run: of its noise little is left in them."""

MUCH_FURTHER = math.log(1.5)
"""Logarithm of the ratio of torques, rates or speeds beyond which a run is not where any other is."""

MUCH_WARMER = 5.0
"""K, the same for the temperature."""

TURNING = 1e-3
"""Share of the highest speed from which on a shaft turns."""


def outermost(groups: Mapping[str, Sequence[Run]]) -> frozenset[str]:
    """Give the names of groups whose runs are beyond all other groups in one condition, on either side.

    `groups`: runs of one procedure by the name of what they repeat; those of a group are alike: the first is looked at.
    """
    where = {name: _conditions(runs[0]) for name, runs in groups.items()}
    found = set()
    for name, here in where.items():
        for condition, value in here.items():
            others = [there[condition] for other, there in where.items() if other != name and condition in there]
            margin = MUCH_WARMER if condition == "temperature" else MUCH_FURTHER
            if others and (value > max(others) + margin or value < min(others) - margin):
                found.add(name)
    return frozenset(found)


def _conditions(run: Run) -> Mapping[str, float]:
    """Give where a run was, by condition: the temperature in degC; else the logarithm of a size, in SI units.

    Those are the largest torque and its rate, and of a run that turns the slowest and the fastest speed.
    """
    found = {}
    torque = next((run.signals[name] for name in ("output_torque", "motor_torque") if name in run.signals), None)
    if torque is not None:
        found["torque"] = _log(_percentile(np.abs(torque), 99.0))
        found["rate"] = _log(_percentile(_rates(run.time, torque), 75.0))
    if run.procedure not in SWEEPS and "motor_position" in run.signals:
        speeds = _rates(run.time, run.signals["motor_position"])
        turning = speeds[speeds > TURNING * _percentile(speeds, 100.0)]
        found["slowest"], found["fastest"] = (_log(_percentile(turning, share)) for share in (10.0, 90.0))
    if "temperature" in run.signals:
        found["temperature"] = _percentile(run.signals["temperature"], 50.0)
    return {name: value for name, value in found.items() if math.isfinite(value)}


def _rates(time: Floats, values: Floats) -> Floats:
    step = max(1, values.size // PARTS)
    return np.abs(np.diff(values[::step])) / np.diff(time[::step])


def _percentile(values: Floats, share: float) -> float:
    known = values[np.isfinite(values)]
    return float(np.percentile(known, share)) if known.size else math.nan


def _log(value: float) -> float:
    return math.log(value) if value > 0.0 else math.nan

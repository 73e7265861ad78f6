"""Joins the results of repeated runs."""

import math
from collections.abc import Sequence

import numpy as np

from procedures.intents import Measurement, Result


def mean_over_runs(results: Sequence[Result]) -> Result:
    """Give, for every measurement's name, the mean over all runs that have it, in the order of first appearance.

    The uncertainty joins the standard error of the mean and the runs' own uncertainties. The latter are not averaged
    down: what a run cannot resolve (steps of a torque command, say) may be off alike in every run.
    """
    groups: dict[str, list[Measurement]] = {}
    for result in results:
        for measurement in result.measurements:
            groups.setdefault(measurement.name, []).append(measurement)
    return Result(tuple(mean(group) for group in groups.values()))


def mean(group: Sequence[Measurement], name: str | None = None, meaning: str | None = None) -> Measurement:
    """Join measurements of one quantity; `name` and `meaning` replace those of the first."""
    values = np.array([m.value for m in group])
    count = len(group)
    own = [m.uncertainty for m in group if m.uncertainty is not None]
    known = [float(np.mean(own))] if own else []
    if count > 1:
        known.append(float(np.std(values, ddof=1)) / math.sqrt(count))
    return Measurement(
        name=group[0].name if name is None else name,
        value=float(np.mean(values)),
        unit=group[0].unit,
        uncertainty=math.hypot(*known) if known else None,
        meaning=group[0].meaning if meaning is None else meaning,
    )

"""Whether a fitted run is better left out: the others then agree and show nothing. Training runs alone decide."""

from collections.abc import Mapping, Sequence

import numpy as np

from rig.loop.result import Open, Verdict
from rig.loop.statements.residuals import Residual, rms

BETTER, NOT_WORSE = 1.2, 0.95
"""Times as much as without a run that must be left of one equation with it, and of any at least."""

Left = Mapping[tuple[str, str], float]
"""Rms that is left of a training run, in the equation's unit, by run and by equation and procedure."""


def left_of(residuals: Sequence[Residual]) -> Left:
    """Give what is left of the training runs."""
    return {
        (x.piece.track.name, f"{x.piece.equation.value} in {x.piece.track.procedure.value}"): rms(x.values)
        for x in residuals
    }


def unexplained(said: Sequence[Open]) -> bool:
    """Whether the training runs leave something that nothing explains; `said`: what stays open in them."""
    return any(item.verdict in (Verdict.UNTRACED, Verdict.UNCONTROLLED) for item in said)


def shows_nothing_else(said: Sequence[Open], run: str) -> bool:
    """Whether all that stays open without a run is that this run does not fit."""
    return all(item.evidence.get("run") == run for item in said)


def fits_better(without: Left, before: Left) -> bool:
    """Whether far less is left of the other runs without a run than with it and all that was added; nowhere more."""
    times: dict[str, list[float]] = {}
    for (run, place), rms_without in without.items():
        times.setdefault(place, []).append(before[run, place] / max(rms_without, 1e-300))
    typical = [float(np.median(some)) for some in times.values()]
    return bool(typical) and max(typical) > BETTER and min(typical) > NOT_WORSE

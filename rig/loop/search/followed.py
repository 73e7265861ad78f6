"""Torque of legs so fast that the drive no longer follows a line of it: how far it is fitted and predicted."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from rig.loop.fitting.base import fit_base
from rig.loop.fitting.fit import Fit, material
from rig.loop.model.equations import Equation, Law, Piece
from rig.loop.model.prediction import Model
from rig.loop.search.decision import Decision, Selection
from rig.loop.search.select import select
from rig.loop.signals.recordings import FEWEST_SAMPLES
from rig.loop.workers.held import Held

SAME_SPEED = 1.05
"""Ratio below which two legs have the same speed."""

KNOWN_SPEED = 1.5
"""Times the fastest fitted leg up to which a torque line is predicted."""


def select_followed(
    pieces: Held[Piece],
    start: Model,
    alpha: float,
    known: Mapping[str, float],
    given: Sequence[Decision],
    on_stage: Callable[[str], None],
) -> tuple[Fit, Selection, float]:
    """Fit and select; give the base fit, the selection, and the fastest leg (rad/s) whose torque was used.

    A torque line that shows at slow legs and not at fast ones is one that the drive does not follow there: it stands
    in the speed, not in the torque. The torque of the fastest legs is then left out, as far as it takes.
    """
    every = material(pieces)
    base = fit_base(every, start)
    whole = select(every, base, alpha, known, given, on_stage)
    found, fastest = whole, math.inf
    while (followed := _followed(found)) is not None and SAME_SPEED * followed < fastest:
        fastest = SAME_SPEED * followed
        fewer = material(pieces.spread(up_to, fastest))
        on_stage(f"once more without the torque of legs faster than {fastest:.4g} rad/s")
        slow = fit_base(fewer, start)
        found = select(fewer, slow, alpha, known, given, on_stage)
        if takes_over(found, whole):
            return slow, found, fastest
    return base, whole, math.inf


def takes_over(found: Selection, whole: Selection) -> bool:
    """Whether what was `found` without the fast legs stays: it has a line of a torque more, or more of anything.

    What was added in place of a line, with all legs, is no reason to do without it.
    """
    return _torque_lines(found) > _torque_lines(whole) or len(found.decisions) > len(whole.decisions)


def _torque_lines(selection: Selection) -> int:
    return sum(not line.kind.entry.is_angle for line in selection.fit.model.lines)


def _followed(selection: Selection) -> float | None:
    """Give the speed (rad/s) up to which the largest torque line shows that does not show at every speed."""
    lines = [item for item in selection.unadded if item.followed is not None]
    return max(lines, key=lambda item: item.share).followed if lines else None


def known_speed(pieces: Held[Piece], selection: Selection) -> float:
    """Give the leg speed up to which a torque line may be predicted, rad/s: not far beyond those it was fitted on."""
    lines = [line for line in selection.fit.model.lines if line.kind.variable == "motor_position"]
    speeds = [speed for some in pieces.map(_free_speeds) for speed in some]
    if not speeds or all(line.kind.entry.is_angle for line in lines):
        return math.inf
    return KNOWN_SPEED * max(speeds)


def _free_speeds(piece: Piece) -> list[float]:
    """Give the speeds of the legs of a torque in a free run, rad/s; none of any other piece."""
    return np.unique(np.abs(piece.track.speed[piece.index])).tolist() if _runs_free(piece) else []


def faster_than(piece: Piece, fastest: float) -> bool:
    """Whether a torque of a free run has legs faster than `fastest` (rad/s at the motor)."""
    return _runs_free(piece) and float(np.abs(piece.track.speed[piece.index]).max(initial=0.0)) > fastest


def _runs_free(piece: Piece) -> bool:
    return piece.law is Law.FREE_RUN and piece.equation is not Equation.TORSION


def up_to(piece: Piece, fastest: float) -> list[Piece]:
    """Leave out the torque of legs faster than `fastest` (rad/s at the motor); none where too few samples are left."""
    if not _runs_free(piece) or not math.isfinite(fastest):
        return [piece]
    slow = np.abs(piece.track.speed[piece.index]) <= fastest
    if slow.sum() < FEWEST_SAMPLES:
        return []
    return [replace(piece, index=piece.index[slow], target=piece.target[slow])]

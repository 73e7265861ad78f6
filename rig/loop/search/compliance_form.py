"""A base law of another form: what no effect of the catalogue is, but much looks like.

The flexspline's compliance is a base term; where its true form differs from the law that is fitted, the difference is
odd in the torque, and nothing else can be told of it.
"""

from functools import partial

from rig.loop.fitting.normal import LinearPiece, side_by_side
from rig.loop.model.equations import Equation
from rig.loop.search.trial import Floats, Ground, Trial, try_columns

FORM_ERROR = "flexspline-compliance"


def other_compliance(ground: Ground, largest: float) -> Trial:
    """Score a compliance of another form: odd powers of the torque, relative to `largest` (N*m)."""
    return try_columns(ground, FORM_ERROR, partial(form_columns, largest=largest))


def form_columns(item: LinearPiece, largest: float) -> Floats | None:
    """Give the columns (m, 2) of a compliance of another form in one piece; None where it does not act."""
    track = item.piece.track
    if item.piece.equation is not Equation.TORSION or track.T is None or track.moves or largest <= 0.0:
        return None
    relative = track.T[item.piece.index] / largest
    return item.centred(side_by_side([relative**3, relative**5]))

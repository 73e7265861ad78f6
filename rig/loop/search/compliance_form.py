"""A base law of another form: what no effect of the catalogue is, but much looks like.

The flexspline's compliance is a base term; where its true form differs from the law that is fitted, the difference is
odd in the torque, and nothing else can be told of it. A fixture that yields in proportion to the torque makes another
form as well, as long as the output is held in every run.
"""

from functools import partial

from rig.log.run import ProcedureName
from rig.loop.fitting.fit import Fit
from rig.loop.fitting.normal import LinearPiece, side_by_side
from rig.loop.model.equations import Equation
from rig.loop.model.shapes import ShapeTerm
from rig.loop.search.trial import Floats, Ground, Trial, try_columns
from sim_backend.model.effects import CATALOGUE

FORM_ERROR = "flexspline-compliance"
FIXTURE = CATALOGUE["fixture-compliance"]


def other_compliance(ground: Ground, largest: float) -> Trial:
    """Score a compliance of another form: odd powers of the torque, relative to `largest` (N*m)."""
    return try_columns(ground, FORM_ERROR, partial(form_columns, largest=largest))


def like_form(fit: Fit) -> tuple[ShapeTerm, ...]:
    """Give, at its typical size, what is no more to be told from another form: a fixture that holds in every run.

    Most of it goes into the stiffness, so that no linearised trial sees it; what the law cannot bend to is left.
    """
    torsions = [item for item in fit.about if item.equation is Equation.TORSION]
    if any(item.procedure is not ProcedureName.LOCKED_OUTPUT for item in torsions):
        return ()
    return (ShapeTerm(FIXTURE, tuple(parameter.typical for parameter in FIXTURE.parameters)),)


def form_columns(item: LinearPiece, largest: float) -> Floats | None:
    """Give the columns (m, 2) of a compliance of another form in one piece; None where it does not act."""
    track = item.piece.track
    if item.piece.equation is not Equation.TORSION or track.T is None or track.moves or largest <= 0.0:
        return None
    relative = track.T[item.piece.index] / largest
    return item.centred(side_by_side([relative**3, relative**5]))

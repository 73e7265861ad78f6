"""What a selection comes to: what was decided of every class, what was found but not added, and the fit in the end."""

from dataclasses import dataclass

from rig.loop.fitting.fit import Fit
from rig.loop.model.shapes import ShapeClass
from rig.loop.model.terms import TermClass
from rig.loop.result import Candidate, Verdict
from rig.loop.search.trial import Trial


@dataclass(frozen=True, slots=True)
class Decision:
    """What was decided about one class that was added: verdict, set (if ambiguous), candidates and p-value."""

    kind: TermClass | ShapeClass
    verdict: Verdict
    members: tuple[str, ...]
    candidates: tuple[Candidate, ...]
    p_value: float

    @property
    def effect(self) -> str:
        """The id in the result."""
        return "ambiguous:" + "|".join(self.members) if self.members else self.kind.id


@dataclass(frozen=True, slots=True)
class Unadded:
    """A term that was found and is significant, but was not added, and why. `order`: of a line.

    `followed`: speed (rad/s at the motor) up to which a torque line shows, where it does not at higher ones.
    """

    kind: TermClass | ShapeClass
    order: float | None
    amplitude: float
    p_value: float
    share: float
    why: str
    followed: float | None = None


@dataclass(frozen=True, slots=True)
class Selection:
    """Outcome: the fit with everything that was added, the decisions in order, and what was found but not added.

    `left`: how the effects that are no lines explain what is left at the end.
    """

    fit: Fit
    decisions: tuple[Decision, ...]
    unadded: tuple[Unadded, ...]
    left: tuple[Trial, ...]


@dataclass(frozen=True, slots=True)
class Accepted:
    """A term that was added, and the fit with it."""

    decision: Decision
    fit: Fit

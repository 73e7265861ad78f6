"""What a selection comes to: what was decided of every class, what was found but not added, and the fit in the end."""

from collections.abc import Sequence
from dataclasses import dataclass

from rig.loop.fitting.fit import Fit
from rig.loop.model.shapes import ShapeClass
from rig.loop.model.terms import Line, TermClass
from rig.loop.result import Candidate, Verdict
from rig.loop.search.trial import Trial


@dataclass(frozen=True, slots=True)
class Decision:
    """What was decided about one class that was added: verdict, set (if ambiguous), candidates and p-value.

    `orders`: of the lines it is about, as they were when they were added. `given`: by the model file that was started
    from.
    """

    kind: TermClass | ShapeClass
    verdict: Verdict
    members: tuple[str, ...]
    candidates: tuple[Candidate, ...]
    p_value: float
    orders: tuple[float, ...] = ()
    given: bool = False

    @property
    def effect(self) -> str:
        """The id in the result."""
        return "ambiguous:" + "|".join(self.members) if self.members else self.kind.id


def lines_decided(decision: Decision, decisions: Sequence[Decision], lines: Sequence[Line]) -> list[int]:
    """Give the numbers of the lines that a decision is about: of all `decisions` its orders are the nearest to theirs.

    Lines of one class may be told apart, where one of them has a set of its own, and move as others join them.
    """
    alike = [one for one in decisions if one.kind == decision.kind and one.orders]
    own = []
    for number, line in enumerate(lines):
        if line.kind == decision.kind and alike:
            nearest = min(alike, key=lambda one: min(abs(line.order - order) for order in one.orders))
            if nearest is decision:
                own.append(number)
    return own


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
class Limit:
    """Amplitude (in its unit) from which on an effect of this class would have been significant and large enough."""

    kind: TermClass | ShapeClass
    amplitude: float


@dataclass(frozen=True, slots=True)
class Selection:
    """Outcome: the fit with everything that was added, the decisions in order, and what was found but not added.

    `left`: how the effects that are no lines explain what is left at the end; `limits`: where nothing was added, how
    large effects would have had to be.
    """

    fit: Fit
    decisions: tuple[Decision, ...]
    unadded: tuple[Unadded, ...]
    left: tuple[Trial, ...]
    limits: tuple[Limit, ...] = ()

    @property
    def added(self) -> tuple[Decision, ...]:
        """The decisions about what the model that was started from had not."""
        return tuple(decision for decision in self.decisions if not decision.given)


@dataclass(frozen=True, slots=True)
class Accepted:
    """A term that was added, and the fit with it."""

    decision: Decision
    fit: Fit

"""What a result says of the classes that were tried for one step, those that cannot be told apart once."""

from collections.abc import Iterable

from rig.loop.result import Candidate
from rig.loop.search.line_candidates import LineCandidate
from rig.loop.search.shape_trials import ShapeTrial

SAME_ORDER = 6
"""Digits to which two lines of one class are at the same order."""


def tried_line(item: LineCandidate) -> Candidate:
    """Give a line that was tried."""
    kind = item.proposal.kind
    return Candidate(item.trial.label, item.trial.gain, item.p_value, kind.variable, kind.enters, item.proposal.order)


def tried_shape(item: ShapeTrial) -> Candidate:
    """Give an effect that is no line, or a curve, with its p-value among its own tests."""
    kind, p_value = item.term.kind, min(1.0, item.trial.single_p * item.tests)
    return Candidate(item.term.effect.id, item.trial.gain, p_value, kind.variable, kind.enters)


def by_gain(tried: Iterable[Candidate]) -> tuple[Candidate, ...]:
    """Order by gain, the best first; of one class at one order and place the best stays."""
    found: dict[tuple[str, str, str, str], Candidate] = {}
    for item in sorted(tried, key=lambda item: -item.gain):
        order = "" if item.order is None else f"{item.order:.{SAME_ORDER}g}"
        found.setdefault((item.effect, item.variable, item.enters, order), item)
    return tuple(found.values())

"""The lines that the residual proposes: classes at the peaks of its spectra, with their orders refined."""

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rig.loop.model.terms import Line, TermClass
from rig.loop.search.aliases import aliases, likeliest, samplings
from rig.loop.search.decision import Unadded
from rig.loop.search.groups import SET_SHARE
from rig.loop.search.lines import LEAST_CYCLES, USUAL_HIGHEST_ORDER, averaged_over, refine
from rig.loop.search.proposals import Proposal, propose
from rig.loop.search.trial import ColumnsOf, Ground, Trial, line_at, line_gains, try_line

STANDS_OUT = 30.0
"""Power over the median of the neighbourhood of a line that is looked at however little it explains."""

KEPT_BY_MEANS = 0.6
"""rad of a line between two means that keep it: they take a hundredth and a half of its amplitude."""

MATTERS, MOST_LOOKED_AT = 0.3, 8
"""Share of the best gain from which on a line that does not stand out is looked at, and how many are."""


@dataclass(frozen=True, slots=True)
class LineCandidate:
    """A proposal with its order refined, how it fares, and among how many tests it was found."""

    trial: Trial
    proposal: Proposal
    tests: float

    @property
    def p_value(self) -> float:
        """The chance that noise alone would pass for it, counting all tests."""
        return min(1.0, self.trial.single_p * self.tests)

    @property
    def columns(self) -> tuple[ColumnsOf, int]:
        """What gives its columns, and how many."""
        return line_at(self.proposal.kind, self.proposal.order), self.trial.columns

    @property
    def line(self) -> Line:
        """The line with the amplitudes of its trial."""
        sine, cosine = self.trial.amplitudes.tolist()
        return Line(self.proposal.kind, self.proposal.order, sine, cosine)

    def unadded(self, p_value: float, why: str) -> Unadded:
        """Give what is told of it where it is not added."""
        amplitude = float(np.hypot(*self.trial.amplitudes))
        return Unadded(self.proposal.kind, self.proposal.order, amplitude, p_value, self.trial.share, why)


def line_candidates(ground: Ground, sparse: Ground, known: Mapping[str, float]) -> list[LineCandidate]:
    """Give everything that the residual proposes, best first, with its order refined.

    Orders are looked for on `sparse`, the ground on few samples, as far as their means keep a line of that order; what
    is chosen is refined again by the joint fit, with all samples.
    """
    proposals, free_tests, fixed_tests = propose(ground, known)
    gained = line_gains(ground, [(p.kind, p.order) for p in proposals])
    scored = sorted(zip(gained, proposals, strict=True), key=lambda pair: -pair[0])
    sampled = {variable: samplings(ground.fit.linear, variable) for variable in {p.kind.variable for p in proposals}}
    averaged = {variable: averaged_over(sparse.fit, variable) for variable in sampled}
    found: list[LineCandidate] = []
    for rank, (gain, proposal) in enumerate(scored):
        rivals = [x.trial.gain for x in found if not proposal.expected or x.proposal.kind == proposal.kind]
        weak = gain < MATTERS * max(rivals, default=0.0) or (rank >= MOST_LOOKED_AT and not proposal.expected)
        if weak and proposal.height < STANDS_OUT:
            continue
        order, tests = proposal.kind.fixed_order, fixed_tests
        if order is None:
            seen = proposal.order * averaged[proposal.kind.variable] < KEPT_BY_MEANS
            gain_at = functools.partial(gains_at, sparse if seen else ground, proposal.kind)
            order = refine(gain_at, proposal.order, proposal.resolution)
            tests = fixed_tests if proposal.expected else free_tests
            legs = sampled[proposal.kind.variable]
            chosen = likeliest(order, aliases(order, USUAL_HIGHEST_ORDER, legs), legs)
            if chosen != order:
                at_chosen, at_order = gain_at((chosen, order))
                order = refine(gain_at, chosen, proposal.resolution) if at_chosen >= SET_SHARE * at_order else order
            if order < LEAST_CYCLES * proposal.resolution:
                continue
        trial = try_line(ground, proposal.kind, order)
        found.append(LineCandidate(trial, replace(proposal, order=order), tests))
    return sorted(found, key=lambda candidate: -candidate.trial.gain)


def gains_at(ground: Ground, kind: TermClass, orders: Sequence[float]) -> list[float]:
    """Give the gains of a line of this kind at several orders."""
    return line_gains(ground, [(kind, order) for order in orders])


def best_of_classes(lines: Sequence[LineCandidate]) -> list[LineCandidate]:
    """Give the best of every catalogue class of lines. `lines`: best first."""
    best: dict[str, LineCandidate] = {}
    for candidate in lines:
        effect = candidate.proposal.kind.effect
        if effect is not None:
            best.setdefault(effect, candidate)
    return list(best.values())

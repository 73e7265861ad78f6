"""The line that shows beside another: a tooth or a bearing makes several, and one may hide that the other is there.

Where a run sees short pieces of a turn, two lines of one size look like one that changes from run to run. So the first
does not pay when runs are left out, and what else is there shows only once it is taken off, with its side lobes.
"""

from rig.loop.fitting.fit import Fit
from rig.loop.model.terms import TermClass
from rig.loop.search.acceptance import FAMILIES
from rig.loop.search.line_candidates import LineCandidate, gains_at
from rig.loop.search.lines import LEAST_CYCLES, refine, scan
from rig.loop.search.proposals import Proposal, tops
from rig.loop.search.trial import Ground, prepare, try_line


def next_line(with_first: Fit, kind: TermClass) -> LineCandidate | None:
    """Give the best further line of a class in what a fit leaves that has the first already; None if there is none.

    None of a class that is multiplied by something, or has one order.
    """
    if kind.fixed_order is not None or kind.entry.is_product:
        return None
    ground = prepare(with_first)
    found, tests = _proposed(ground, kind)
    candidates = []
    for proposal in found:
        order = refine(lambda orders: gains_at(ground, kind, orders), proposal.order, proposal.resolution)
        if order >= LEAST_CYCLES * proposal.resolution:
            trial = try_line(ground, kind, order)
            candidates.append(LineCandidate(trial, Proposal(kind, order, proposal.resolution), tests))
    return max(candidates, key=lambda candidate: candidate.trial.gain, default=None)


def _proposed(ground: Ground, kind: TermClass) -> tuple[list[Proposal], float]:
    """Give the strongest orders of the pieces in which the class shows first, and among how many tests."""
    found: list[Proposal] = []
    tests = 0.0
    for piece_kind in dict.fromkeys(item.kind for item in ground.fit.about):
        spectrum = scan(ground.fit, piece_kind, kind.variable) if piece_kind[0] is kind.equation else None
        if spectrum is not None:
            tests += spectrum.tests
            low, high = kind.orders
            found += [
                Proposal(kind, peak.order, spectrum.resolution)
                for peak in tops(spectrum)
                if low - spectrum.resolution <= peak.order <= high + spectrum.resolution
            ]
    return found, FAMILIES * max(tests, 1.0)

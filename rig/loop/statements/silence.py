"""What the verdict `none` rests on: how like noise the residuals are, and what would have been seen in them."""

from collections.abc import Sequence

from rig.config.dut import Dut
from rig.loop.model.shapes import units_of
from rig.loop.model.terms import TermClass
from rig.loop.result import Replicates, Silence, Smallest
from rig.loop.search.decision import Limit, Selection
from rig.loop.statements.evidence import repeats
from rig.loop.statements.report_steps import primary_equation
from rig.loop.statements.residuals import Residual, by_procedure


def silence_of(selection: Selection, train: Sequence[Residual], dut: Dut) -> Silence:
    """Give the evidence for `none`. `train`: residuals of the fitted runs."""
    judged = [repeats(members, dut, selection.fit.model) for members in by_procedure(train).values()]
    pairs = [
        Replicates(item.equation, item.procedure, item.pairs, item.rho, item.ljung_box)
        for item in judged
        if item is not None
    ]
    return Silence(tuple(pairs), tuple(_smallest(limit, selection) for limit in selection.limits))


def _smallest(limit: Limit, selection: Selection) -> Smallest:
    equation = primary_equation(limit.kind, selection.fit)
    if isinstance(limit.kind, TermClass):
        return Smallest(limit.kind.id, limit.amplitude, limit.kind.entry.unit_in(equation))
    law = limit.kind.law
    return Smallest(limit.kind.id, limit.amplitude, units_of(law, equation)[law.amplitudes[0]])

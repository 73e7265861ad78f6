"""Beyond the paper: it ends with an error that "is caused by the unmodeled kinematic error"; the loop closes on it.

A campaign of the first experiment from several start angles, on the bench with as much kinematic error as leaves the
printed 4.9e-5 rad. The loop is not told of it; the paper's own run is held out.
"""

from dataclasses import dataclass, replace

import numpy as np
from matplotlib.figure import Figure

from rig.log.run import Run
from rig.loop.campaign import LoopOptions
from rig.loop.display import interval_text
from rig.loop.predict import predict_run
from rig.loop.result import LoopResult
from rig.loop.trace import trace
from rig.papers.figures import label, new_figure
from rig.papers.item import Outcome, Row, Workbench
from rig.papers.zhang2014.bench import Floats, Recorded, branches, paper_dut, record
from rig.papers.zhang2014.colors import MODEL_COLORS, TRACED
from rig.papers.zhang2014.locked_output import (
    ORDER,
    PEAK,
    PRINTED_LARGEST,
    PRINTED_RMS,
    QUICK_TIME,
    kinematic_error,
    needed_amplitude,
    sweep_settings,
)
from rig.papers.zhang2014.rivals import PIECEWISE, PROPOSED, Misfit, misfit, misfit_of, rivals

HELD_OUT = "the-papers-run"

START_ANGLES = 12
"""Each sweep shows 0.4 rad of a motor turn, less its free zero; with 8 the loop finds order 2 sometimes only."""


@dataclass(frozen=True, slots=True)
class Closed:
    """The paper's run, the loop's result, and the error of the traced model on its falling branch."""

    run: Run
    result: LoopResult
    traced: Misfit


def closed(bench: Workbench) -> Closed:
    """Record the paper's run and the campaign on one bench, and trace."""
    effects = (kinematic_error(needed_amplitude(bench)),)
    (paper,) = record(
        bench, "closing-paper", "locked-output", sweep_settings(bench.quick), effects=effects, seed=2
    ).runs
    paper = replace(paper, name=HELD_OUT)
    settings = {
        "dwell": "1",
        "peak_torque": repr(PEAK),
        "rates": repr(PEAK / (1.0 if bench.quick else QUICK_TIME)),
        "amplitudes": "1" if bench.quick else "1,0.5",
        "start_angles": str(START_ANGLES),
        "replicate_pairs": "2",
    }
    campaign: Recorded = record(bench, "closing-campaign", "locked-output", settings, effects=effects, seed=3)
    bench.tell("  closing the loop")
    result = trace((paper, *campaign.runs), paper_dut(), LoopOptions(held_out=(HELD_OUT,)))
    falling = branches(paper)[1]
    (torsion,) = (item for item in predict_run(paper, result.model) if item.column == "torsion")
    return Closed(paper, result, misfit_of(torsion.residual[np.isin(paper.time, falling.time)]))


def next_column(bench: Workbench) -> Outcome:
    """Give the errors before, as the paper leaves them, and after the traced effect is added."""
    found = bench.share(closed)
    falling = branches(found.run)[1]
    before = {name: misfit(rivals()[name], falling, -falling.motor_torque) for name in (PIECEWISE, PROPOSED)}
    columns = {**before, TRACED: found.traced}
    rows = [
        Row(f"{what} error, {name}", table.get(name), getattr(columns[name], key), "rad", _note(name))
        for what, key, table in (("rms", "rms", PRINTED_RMS), ("largest", "largest", PRINTED_LARGEST))
        for name in columns
    ]
    torsion = found.result.equations["torsion"].held_out
    if torsion is not None:
        note = "whole run, both branches; base model refitted to the campaign without an effect"
        rows.append(Row("rms error, (28) refitted", None, torsion.rms_before, "rad", note))
        note = f"whole run; noise alone leaves {torsion.floor or float('nan'):.2g} rad"
        rows.append(Row("rms error, (28) refitted with the effect", None, torsion.rms_after, "rad", note))
    rows.append(Row("what the loop says", '"kinematic error"', _said(found.result), "", "it was told nothing"))
    rows += _parameters(found.result, needed_amplitude(bench))
    return Outcome(tuple(rows), {"": _draw(falling.motor_position, columns)})


def _note(name: str) -> str:
    return "the next column: (28) with the traced effect, all refitted to other runs" if name == TRACED else ""


def _said(result: LoopResult) -> str:
    return f"{result.verdict}: {', '.join(result.effects) or 'nothing added'}"


def _parameters(result: LoopResult, amplitude: float) -> list[Row]:
    """Give what was found of the kinematic error, beside what was hidden in the bench."""
    hidden = {"amplitude": amplitude, "order": ORDER, "phase": 0.0}
    rows = []
    for step in (step for step in result.steps if step.effect == "kinematic-error"):
        for name, value in hidden.items():
            found = step.parameters[name]
            interval = "" if found.ci95 is None else f", 95 % interval {interval_text(*found.ci95)}"
            note = f"hidden in the bench: {value:.4g}{interval}"
            rows.append(Row(f"{name} of {step.effect}", None, found.value, found.unit, note))
    return rows


def _draw(angle: Floats, columns: dict[str, Misfit]) -> Figure:
    figure, (axes,) = new_figure("After Zhang 2014, Fig. 12(b): the next column")
    for name, found in columns.items():
        told = f"{name}, rms {1e6 * found.rms:.3g} urad"
        axes.plot(angle, 1e6 * found.error, color=MODEL_COLORS[name], linewidth=0.7, label=told)
    label(axes, "motor position [rad]", "error [urad]")
    return figure

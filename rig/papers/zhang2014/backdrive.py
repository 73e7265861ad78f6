"""The second experiment of section V: external torque of both signs on the output, input held; figures 13 and 14.

T_w comes from the torque sensor through (36) with the backdriving torque, in its corrected form. The drive on the bench
has one level of dry friction. The paper's two, N T_fs = 1.2 N*m and T_fb = 2.0 N*m, are one each in its two
experiments; so the bench has 2.0 N*m here and 1.2 N*m in the first experiment, and the other case beside it.
"""

from dataclasses import dataclass, replace

import numpy as np

from rig.papers.figures import label, new_figure
from rig.papers.item import Outcome, Row, Workbench
from rig.papers.zhang2014.bench import Branch, branches, record
from rig.papers.zhang2014.colors import MEASURED, MODEL_COLORS
from rig.papers.zhang2014.drive import BACKDRIVING_TORQUE, HYSTERESIS_LOSS, RATED_TORQUE, RATIO, paper_drive
from rig.papers.zhang2014.rivals import PIECEWISE, PRINTED, PROPOSED, Misfit, misfit, rivals
from sim_backend.model.friction import backdriving_torque

PEAK_TIME, QUICK_TIME = 9.0, 3.0
"""s from zero to the peak."""


@dataclass(frozen=True, slots=True)
class Backdriven:
    """One bench: the whole sweep, T_w from (36) (n,), the misfit of every model, and the loop's width, rad."""

    sweep: Branch
    wave_generator_torque: np.ndarray
    misfits: dict[str, Misfit]
    hysteresis_loss: float
    uncertainty: float | None


def _backdriven(bench: Workbench, friction: float) -> Backdriven:
    rate = RATED_TORQUE / (QUICK_TIME if bench.quick else PEAK_TIME)
    settings = {"dwell": "2", "amplitudes": "1", "start_angles": "1", "repeats": "1", "rates": repr(rate)}
    drive = replace(paper_drive(), friction_torque=friction)
    recorded = record(bench, f"backdrive-{friction:g}-Nm", "backdrive", settings, drive=drive)
    (run,) = recorded.runs
    parts = branches(run)
    sweep = Branch(*(np.concatenate([getattr(part, name) for part in parts]) for name in Branch.__slots__))
    T_w = backdriving_torque(sweep.output_torque, RATIO, friction)
    loss = recorded.measured["hysteresis_loss"]
    misfits = {name: misfit(rival, sweep, T_w) for name, rival in rivals().items()}
    return Backdriven(sweep, T_w, misfits, loss.value, loss.uncertainty)


def with_printed_friction(bench: Workbench) -> Backdriven:
    """Measure the bench whose drive has the printed backdriving torque, 2.0 N*m."""
    return _backdriven(bench, BACKDRIVING_TORQUE)


def with_starting_friction(bench: Workbench) -> Backdriven:
    """Measure the bench of the first experiment, N T_fs = 1.2 N*m."""
    return _backdriven(bench, paper_drive().friction_torque)


def torque_history(bench: Workbench) -> Outcome:
    """Draw Fig. 13."""
    sweep = bench.share(with_printed_friction).sweep
    figure, (axes,) = new_figure("Zhang 2014, Fig. 13: external torque on the output")
    axes.plot(sweep.time, sweep.output_torque, color=MEASURED, linewidth=0.7)
    label(axes, "time [s]", "output torque [N*m]")
    return Outcome(
        (
            Row("largest", None, float(np.max(sweep.output_torque)), "N*m", "the paper's figure has no readable scale"),
            Row("lowest", '"bidirectional"', float(np.min(sweep.output_torque)), "N*m"),
        ),
        {"": figure},
    )


def loop(bench: Workbench) -> Outcome:
    """Draw Fig. 14 and give the hysteresis loss Psi, with both levels of friction."""
    case = bench.share(with_printed_friction)
    sweep, found = case.sweep, case.misfits[PROPOSED]
    figure, (axes,) = new_figure("Zhang 2014, Fig. 14: output torque against torsion")
    axes.plot(1e3 * sweep.torsion, sweep.output_torque, ".", markersize=1.0, color=MEASURED, label="measured")
    predicted = 1e3 * (sweep.torsion - found.error)
    axes.plot(predicted, sweep.output_torque, color=MODEL_COLORS[PROPOSED], linewidth=0.8, label=PROPOSED)
    label(axes, "torsion [mrad]", "output torque [N*m]")
    balance = float(np.sqrt(np.mean((case.wave_generator_torque + sweep.motor_torque) ** 2)))
    return Outcome(
        (
            _loss(case, BACKDRIVING_TORQUE),
            _loss(bench.share(with_starting_friction), paper_drive().friction_torque),
            Row("rms error of the torsion (28)", '"agreement"', found.rms, "rad"),
            Row("largest error of the torsion (28)", None, found.largest, "rad"),
            Row(f"rms error of {PRINTED}", None, case.misfits[PRINTED].rms, "rad"),
            Row(f"rms error of {PIECEWISE}", None, case.misfits[PIECEWISE].rms, "rad"),
            Row("T_w by (36) against the drive's torque, rms", None, balance, "N*m", "(36) in its corrected form"),
        ),
        {"": figure},
    )


def _loss(case: Backdriven, friction: float) -> Row:
    drive = paper_drive()
    share = 1.0 - np.exp(-drive.C_w * friction / RATIO)
    note = f"{share:.0%} of 1.8e-4 is what (27) leaves at T_F = 0; +- {case.uncertainty or 0.0:.1g}"
    name = f"hysteresis loss at zero torque, friction {friction:g} N*m"
    return Row(name, HYSTERESIS_LOSS, case.hysteresis_loss, "rad", note)

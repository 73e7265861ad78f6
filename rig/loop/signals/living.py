"""Channels that stand still while the drive moves, dead and as good as not recorded; and torques that only some have.

Used as a reading, a dead encoder is a torsion as large as the travel, and a dead torque sensor a drive without load.
Sweeps with a torque and sweeps without it do not follow one law: the torque would be missing physics of the others.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from drivers.errors import DataError
from rig.log.run import SWEEPS, ProcedureName, Run

Floats = NDArray[np.float64]

TORQUES = ("motor_torque", "motor_current", "output_torque")
ANGLES = ("motor_position", "output_position")

TURNED_MOTOR, TURNED_OUTPUT = 6.0, 0.05
"""rad of travel of one shaft beyond which the other one must have moved."""


LIKE_SWEEPS = (
    ("output", ("output_torque",), SWEEPS),
    *(("motor", ("motor_torque", "motor_current"), (procedure,)) for procedure in SWEEPS),
)
"""Shaft, channels that say its torque, and procedures whose sweeps all have one of them or none: the output's winds the
flexspline in either sweep, the motor's is another's in each."""

STANDS = 2e-3
"""rad of an angle below which a run in which nothing else moves may have ended before it began; a small quick sweep,
which looks like noise, winds the motor further."""

PARTS, MORE_THAN_NOISE = 20, 3.0
"""Parts of a run whose means are compared, and how many times the typical distance from them they must spread by."""


def living(runs: Sequence[Run]) -> tuple[tuple[Run, ...], tuple[str, ...]]:
    """Give the runs without their dead channels, and a warning for every run that has any.

    Where only some sweeps have a torque, the fewer are left out, or taken without it. Raises DataError
    where nothing changes in any run.
    """
    if runs and not any(_moves(run) for run in runs):
        names = sorted({name for run in runs for name in (*ANGLES, *TORQUES) if name in run.signals})
        raise DataError(
            ", ".join(run.name for run in runs[:4]),
            f"nothing changes in any run: {', '.join(names) or 'no position and no torque'} constant throughout, but "
            f"for noise",
            expected="positions and torques that a procedure moves",
            hint="Check that the channels are connected, and the columns and their scale in the mapping.",
        )
    kept, warnings = [], []
    for run in runs:
        if not _moves(run) and all(_span(run.signals[name]) < STANDS for name in ANGLES if name in run.signals):
            kept.append(_without(run, run.signals))
            seconds = float(np.ptp(run.time)) if run.time.size else 0.0
            warnings.append(f"{run.name}: nothing but noise changes in its {seconds:.3g} s, left out. Was it aborted?")
            continue
        run, warning = without_dead(run)
        kept.append(run)
        warnings += [warning] if warning else []
    for shaft, channels, procedures in LIKE_SWEEPS:
        kept, told = _alike(kept, procedures, shaft, channels)
        warnings += told
    return tuple(kept), tuple(warnings)


def _alike(
    runs: Sequence[Run], procedures: tuple[ProcedureName, ...], shaft: str, channels: tuple[str, ...]
) -> tuple[list[Run], list[str]]:
    """Leave out the sweeps without a torque (`channels`) that most have, or take from the few what most lack."""
    sweeps = [run for run in runs if run.procedure in procedures and run.signals]
    kind = " and ".join(procedures)
    with_it = {run.name for run in sweeps if run.signals.keys() & set(channels)}
    without = {run.name for run in sweeps} - with_it
    if not with_it or not without:
        return list(runs), []
    few = without if len(without) <= len(with_it) else with_it
    kept = [run if run.name not in few else _without(run, run.signals if few is without else channels) for run in runs]
    what = (
        f"no torque of the {shaft} was recorded, and other {kind} runs have it: the run is left out. Repeat it."
        if few is without
        else f"most {kind} runs have no torque of the {shaft}: taken without it."
    )
    return kept, [f"{run.name}: {what}" for run in runs if run.name in few]


def without_dead(run: Run) -> tuple[Run, str]:
    """Give a run without its dead channels, and a warning that names them ("" without any); one at rest stays."""
    lost = _dead(run)
    if not lost:
        return run, ""
    return _without(run, lost), f"{run.name}: {_and(lost)} stood still while the drive moved, taken as not recorded."


def _dead(run: Run) -> tuple[str, ...] | None:
    """Give the names of the channels that must be dead; None where no position and no torque changes at all."""
    span = {name: _span(run.signals[name]) for name in (*ANGLES, *TORQUES) if name in run.signals}
    if not any(span.values()):
        return None
    motor, output = span.get("motor_position", 0.0), span.get("output_position", 0.0)
    loaded = any(span.get(name, 0.0) > 0.0 for name in TORQUES)
    found = []
    if motor == 0.0 and (output > TURNED_OUTPUT or (loaded and run.procedure is ProcedureName.LOCKED_OUTPUT)):
        found.append("motor_position")
    turned = motor > TURNED_MOTOR and run.procedure is not ProcedureName.LOCKED_OUTPUT
    if output == 0.0 and (turned or (loaded and run.procedure is ProcedureName.BACKDRIVE)):
        found.append("output_position")
    moved = motor > 0.0 or output > 0.0
    found += [name for name in TORQUES if moved and span.get(name, 1.0) == 0.0]
    return tuple(name for name in found if name in span)


def _moves(run: Run) -> bool:
    """Whether a position or a torque does more than its own noise."""
    return any(_changes(run.signals[name]) for name in (*ANGLES, *TORQUES) if name in run.signals)


def _changes(values: Floats) -> bool:
    """Whether values change by more than noise does: means over parts of a run spread less, the more samples they have.

    A noise that remembers lets them spread by all of it.
    """
    known = values[np.isfinite(values)]
    size = known.size // PARTS
    if size < 2:
        return bool(known.size) and float(np.ptp(known)) > 0.0
    means = known[: size * PARTS].reshape(PARTS, size).mean(axis=1)
    noise = float(np.median(np.abs(known[: size * PARTS].reshape(PARTS, size) - means[:, None])))
    return float(np.ptp(means)) > MORE_THAN_NOISE * noise


def _span(values: Floats) -> float:
    known = values[np.isfinite(values)]
    return float(np.ptp(known)) if known.size else 0.0


def _without(run: Run, names: Iterable[str]) -> Run:
    left_out = set(names)
    return replace(run, signals={name: values for name, values in run.signals.items() if name not in left_out})


def _and(names: Sequence[str]) -> str:
    return " and ".join(names)

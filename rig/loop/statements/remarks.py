"""What the loop says beside its verdicts: what was masked, left out or found and not added, and what is doubtful."""

import math
from collections.abc import Sequence

import numpy as np

from rig.config.catalogue import doubt
from rig.config.dut import Dut
from rig.log.run import SWEEPS, ProcedureName, Run
from rig.log.units import mixed_up
from rig.loop.files.model_file import Model as ModelFile
from rig.loop.fitting.fit import Fit
from rig.loop.fitting.intervals import hidden_share
from rig.loop.fitting.starts import FACTOR
from rig.loop.model.equations import Equation, pieces_of
from rig.loop.model.prediction import Model
from rig.loop.model.terms import TermClass
from rig.loop.result import FOUND_NOT_ADDED, Open
from rig.loop.search.aliases import aliases, samplings
from rig.loop.search.decision import Selection
from rig.loop.search.lines import USUAL_HIGHEST_ORDER
from rig.loop.signals.checks import measured_slope
from rig.loop.signals.grid import finer_grids
from rig.loop.signals.living import ANGLES, TORQUES
from rig.loop.signals.spikes import spikes
from rig.loop.signals.tracks import LEG_END, SPEED_BAND, Track
from rig.loop.statements.loudness import loud_or_quiet
from rig.terminal import counted
from sim_backend.model.compliance import LAWS

LEAST_TOLD = 1e-3
"""Share of an equation's squares below which a significant term that was not added is not even told."""

FAR_FROM_PRIOR = 3.0
"""Standard deviations of its prior by which a parameter of the flexspline's law may move without a word."""

FEWEST_A_SWEEP = 100
"""Samples of a torque from one end to the other that a sweep needs."""

STRIDE = 10
"""Samples over which a torque must move for its rate to stand out of its noise."""

LEAST_HIDDEN = 0.05
"""Share of a torque line that may hide in the rotor's motion and is then said."""

LEAST_CORRELATION = 0.95
"""Of motor torque and motor current, so that one was worked out from the other."""

OFF_CONSTANT = 0.05
"""Relative difference of torque constants that is said; magnets and copper lose less as they warm up."""

SLOWEST = 2.0
"""s between samples beyond which the unit of the time is doubtful."""

_MEASURED = (*ANGLES, *TORQUES)
_HELD = {ProcedureName.LOCKED_OUTPUT: "output_position", ProcedureName.BACKDRIVE: "motor_position"}
"""What a procedure holds may well be constant."""


def _far_from_catalogue(dut: Dut, model: Model) -> list[tuple[str, float, float]]:
    """Give the friction levels of the device file that the fit contradicts by more than the starting values allow."""
    given = {"T_fs": ("starting_torque", dut.gear.starting_torque)}
    given["T_fb"] = ("backdriving_torque", dut.gear.backdriving_torque)
    return [
        (name, catalogue, model.value(parameter))
        for parameter, (name, catalogue) in given.items()
        if catalogue is not None
        and model.value(parameter) != catalogue
        and not 1.0 / FACTOR < catalogue / model.value(parameter) < FACTOR
    ]


def far_from_prior(final: Fit, told: Sequence[Open]) -> list[str]:
    """Give a warning for every parameter of the flexspline's law that the data moved far off its prior.

    `told`: statements that name their parameter already.
    """
    table = final.model.table
    touched, named = set(final.columns.base), {item.parameter for item in told}
    found = []
    for entry in table.entries:
        value = final.model.value(entry.name)
        if entry.name not in LAWS[table.law].parameters or entry.name not in touched or entry.name in named:
            continue
        # all of them are positive, and estimated as logarithms
        widths = math.log(value / entry.centre) / entry.spread
        if abs(widths) > FAR_FROM_PRIOR:
            off, width = 100.0 * (value / entry.centre - 1.0), 100.0 * entry.spread
            found.append(
                f"{entry.name} of the flexspline is {value:.4g} {entry.unit}, {off:+.0f} % off its prior of "
                f"{entry.centre:.4g} ({abs(widths):.2g} times the prior's width of {width:.0f} %, in logarithms): the "
                f"device file is off, or {entry.name} makes up for another law (--compliance) or an effect that the "
                f"model lacks."
            )
    return found


def _coarse(runs: Sequence[Run]) -> str:
    """Say of which sweeps the log is too slow: what a reversal does then lies between two samples. Empty if of none."""
    samples = {}
    for run in runs:
        torque = run.signals.get("output_torque", np.empty(0))
        known = torque[np.isfinite(torque)]
        if run.procedure not in SWEEPS or known.size <= STRIDE or np.ptp(known) == 0.0:
            continue
        step = float(np.quantile(np.abs(known[STRIDE:] - known[:-STRIDE]), 0.75)) / STRIDE
        samples[run.name] = float(np.ptp(known)) / step if step > 0.0 else math.inf
    few = {name: count for name, count in samples.items() if count < FEWEST_A_SWEEP}
    if not few:
        return ""
    worst = min(few, key=lambda name: few[name])
    return (
        f"Sampled too slowly for how fast their torque is swept: {', '.join(sorted(few))}. {worst} has "
        f"{few[worst]:.0f} samples from one end of its torque to the other, where {FEWEST_A_SWEEP} are needed to see "
        f"what a reversal does: sample faster or sweep more slowly. What the model leaves of them may be that."
    )


def remarks(tracks: Sequence[Track], runs: Sequence[Run], dut: Dut, model: Model) -> list[str]:
    """Say what was masked, left out, or could not be known, and where the device file is off."""
    return [
        *_masked(tracks),
        *_spikes(runs),
        *loud_or_quiet(runs),
        *_unused(tracks, model.ratio),
        *_of_the_ratio(tracks, dut, model.ratio),
        *_of_the_device_file(runs, dut, model),
        *_of_the_logs(runs),
    ]


def of_another_drive(base: ModelFile | None, dut: Dut) -> list[str]:
    """Say where the model to start from is that of a drive with another name or ratio."""
    if base is None:
        return []
    pairs = (("name", base.dut.name, dut.name), ("ratio", base.dut.gear.ratio, dut.gear.ratio))
    other = [f"{what} {theirs}, not {ours}" for what, theirs, ours in pairs if theirs != ours]
    if not other:
        return []
    return [
        f"The model of --base is of another drive ({'; '.join(other)}): its effects and levels may not be this one's."
    ]


def of_the_current(recorded: Sequence[Run], living: Sequence[Run], dut: Dut) -> list[str]:
    """Say that the current stands in for a motor torque that was recorded and is dead. `living`: without what is."""
    constant = dut.motor.torque_constant
    lost = {run.name for run in recorded if "motor_torque" in run.signals}
    lost -= {run.name for run in living if "motor_torque" in run.signals or "motor_current" not in run.signals}
    if constant is None or not lost:
        return []
    return [
        f"Motor torque is motor_current times torque_constant ({constant:.4g} N*m/A) in {len(lost)} of "
        f"{counted(len(recorded), 'run')}."
    ]


def _masked(tracks: Sequence[Track]) -> list[str]:
    found = []
    saturated = {track.name: track.saturated for track in tracks if track.saturated}
    if saturated:
        text = ", ".join(f"{name} ({count})" for name, count in saturated.items())
        found.append(
            f"Saturated samples (torque limit active, a torque cut off at its extreme, or stuck) were masked: {text}."
        )
    masked = {
        track.name: 100.0 * (1.0 - float(track.steady.mean())) for track in tracks if track.moves and track.steady.any()
    }
    if masked:
        text = ", ".join(f"{name} {share:.0f} %" for name, share in masked.items())
        legs = f"{100.0 * SPEED_BAND:.0f} %, ends of {LEG_END:g} s cut"
        found.append(f"Outside legs of constant speed ({legs}) and masked: {text}.")
    return found


def _spikes(runs: Sequence[Run]) -> list[str]:
    """Say which torques have readings that are none."""
    counts = [f"{run.name} {name} ({int(flags.sum())})" for run in runs for name, flags in spikes(run).items()]
    if not counts:
        return []
    return [f"Readings far out of those around them (spikes, dropouts) were taken as missing: {', '.join(counts)}."]


def _have(names: Sequence[str]) -> str:
    return "has" if len(names) == 1 else "have"


def _unused(tracks: Sequence[Track], ratio: float | None) -> list[str]:
    found = []
    unwound = [t.name for t in tracks if t.M is None and t.motor_position is not None and t.output_position is not None]
    if unwound and ratio is not None:
        found.append(
            f"Shapes without a name were not looked for: {', '.join(unwound)} {_have(unwound)} no motor torque, and "
            f"the windup of the wave generator may be any of them."
        )
    unused = [track.name for track in tracks if track.procedure is ProcedureName.STARTING_TORQUE]
    if unused:
        found.append(f"Starting-torque runs enter no equation of the loop: {', '.join(unused)}.")
    silent = [t.name for t in tracks if t.name not in unused and not pieces_of(t, ratio)]
    if silent:
        found.append(f"No equation can be formed from: {', '.join(silent)}.")
    return found


def _of_the_ratio(tracks: Sequence[Track], dut: Dut, ratio: float | None) -> list[str]:
    found = []
    both = any(track.motor_position is not None and track.output_position is not None for track in tracks)
    if both and ratio is None:
        found.append("The gear ratio is unknown and no run turns far enough to measure it: torsion is left out.")
    if both and dut.gear.ratio is not None and measured_slope(tracks) is None:
        found.append(
            f"No run turns far enough to measure the ratio: the device file's {dut.gear.ratio:g} was taken as given. A "
            f"wrong one looks like a wrong stiffness, torque constant or gain; a free run of one turn would tell."
        )
    if ratio is not None and dut.gear.ratio is None:
        found.append(f"The device file gives no ratio; {ratio:.6g} was measured from both encoders.")
    return found


def _of_the_device_file(runs: Sequence[Run], dut: Dut, model: Model) -> list[str]:
    found = []
    if doubtful := doubt(dut):
        found.append(f"The device file is doubtful: {doubtful}")
    for name, catalogue, measured in _far_from_catalogue(dut, model):
        found.append(
            f"The device file's {name} ({catalogue:.4g} N*m) is {catalogue / measured:.2g} times what these runs show, "
            f"{measured:.4g} N*m."
        )
    found += finer_grids(runs, dut)
    found += _of_other_scale(runs)
    logged, given = _logged_torque_constant(runs), dut.motor.torque_constant
    if logged is not None and given is not None and abs(logged / given - 1.0) > OFF_CONSTANT:
        torque = mixed_up("N*m", logged / given) if logged > given else None
        current = mixed_up("A", given / logged) if given > logged else None
        looks = f"motor_torque looks like {torque}" if torque else f"motor_current looks like {current}"
        correct = f"{looks}: state the unit and import again" if torque or current else "Correct the device file"
        found.append(
            f"The logs' motor_torque is {logged:.4g} N*m for 1 A of motor_current, but the device file's "
            f"torque_constant is {given:.4g} N*m/A: motor_torque was taken as recorded. {correct}."
        )
    return found


def _of_the_logs(runs: Sequence[Run]) -> list[str]:
    found = []
    if not any(run.replicate is not None for run in runs):
        found.append("No replicate runs: the floor is computed or unknown, and structure is judged by shape alone.")
    for run in runs:
        constant = sorted(
            name
            for name, values in run.signals.items()
            if name in _MEASURED and name != _HELD.get(run.procedure) and values.size and np.ptp(values) == 0.0
        )
        if constant:
            found.append(f"{run.name}: constant throughout: {', '.join(constant)}.")
    slow = [run.name for run in runs if run.time.size > 1 and float(np.median(np.diff(run.time))) > SLOWEST]
    if slow:
        found.append(
            f"Sampled less than once in {SLOWEST:g} s: {', '.join(slow)}. Check that the time is in seconds; what "
            f"delays, creeps or rings faster than that is not seen for what it is."
        )
    backends = sorted({run.metadata["backend"] for run in runs if "backend" in run.metadata})
    if len(backends) > 1:
        found.append(f"Recorded with different backends: {'; '.join(backends)}. Is it one device?")
    if coarse := _coarse(runs):
        found.append(coarse)
    gaps = {run.name: len(run.gaps) for run in runs if run.gaps}
    if gaps:
        most = max(gaps, key=lambda name: gaps[name])
        found.append(f"{counted(sum(gaps.values()), 'gap')} in {len(gaps)} of {len(runs)} runs, most in {most}.")
    return found


def _of_other_scale(runs: Sequence[Run]) -> list[str]:
    """Say of which runs motor torque and current are another number of N*m to 1 A than in most."""
    known = {run.name: constant for run in runs if (constant := _logged_torque_constant([run])) is not None}
    usual = float(np.median(list(known.values()))) if known else 0.0
    other = {name: constant for name, constant in known.items() if abs(constant / usual - 1.0) > OFF_CONSTANT}
    if 2 * len(other) >= len(known):
        return []
    return [
        f"{name}: motor_torque is {constant:.4g} N*m for 1 A of motor_current, in most other runs {usual:.4g} N*m: one "
        f"of the two has another scale there. Correct it, or leave the run out."
        for name, constant in other.items()
    ]


def _logged_torque_constant(runs: Sequence[Run]) -> float | None:
    """Give motor torque over motor current (N*m/A) of the runs that have both and in which they are one measurement."""
    sums = np.zeros(3)
    for run in runs:
        torque, current = run.signals.get("motor_torque"), run.signals.get("motor_current")
        if torque is None or current is None:
            continue
        both = np.isfinite(torque) & np.isfinite(current)
        sums += torque[both] @ torque[both], torque[both] @ current[both], current[both] @ current[both]
    torques, common, currents = sums
    alike = common > LEAST_CORRELATION * math.sqrt(torques * currents)
    return math.sqrt(torques / currents) if currents > 0.0 and alike else None


def doubts(final: Fit) -> list[str]:
    """Say what the legs cannot tell about the lines that were added."""
    found = []
    for number, line in enumerate(final.model.lines):
        legs = samplings(final.linear, line.kind.variable)
        others = aliases(line.order, USUAL_HIGHEST_ORDER, legs) if line.kind.fixed_order is None else ()
        if others:
            same = ", ".join(f"{order:.6g}" for order in others[:6])
            found.append(
                f"These legs cannot tell the order {line.order:.6g} of {line.kind.variable} from {same}; speeds that "
                f"are no multiples of each other, or faster sampling, would."
            )
        share = hidden_share(final, number)
        if share > LEAST_HIDDEN:
            found.append(
                f"Of the line of order {line.order:.6g} the rotor may take up {100 * share:.2g} % unseen: its ripple "
                f"drowns in the encoder's counts. A slower leg tells more."
            )
    return found


def unadded(selection: Selection) -> list[str]:
    """Give a line for everything that was found, significant, and not added, with the reason; the largest first."""
    current = any(item.equation is Equation.MOTOR_CURRENT for item in selection.fit.about)
    found = []
    for item in sorted(selection.unadded, key=lambda item: -item.share):
        if item.share < LEAST_TOLD:
            continue
        if item.order is None:
            found.append(f"{FOUND_NOT_ADDED}: {item.kind.id}: {item.why}.")
            continue
        seen = item.kind.equation
        seen = Equation.MOTOR_CURRENT if current and seen is Equation.MOTOR_TORQUE else seen
        unit = item.kind.entry.unit_in(seen) if isinstance(item.kind, TermClass) else seen.unit
        amplitude = f"{item.amplitude:.3g}" + ("" if unit == "1" else f" {unit}")
        found.append(
            f"{FOUND_NOT_ADDED}: {item.kind.id}, {_at(item.order, item.kind.variable)}, amplitude "
            f"{amplitude}: {item.why}."
        )
    return found


def _at(order: float, variable: str) -> str:
    return f"{order:.6g} Hz" if variable == "time" else f"order {order:.6g} of {variable}"

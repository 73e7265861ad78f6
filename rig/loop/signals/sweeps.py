"""What sweeps say of themselves: which shaft was held, how stiff the drive is, and whether the work is taken or given.

Looked at before channels that stand still are taken for dead. Everything is judged by means over a hundredth of a run,
which neither noise nor an encoder's counts reach.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from drivers.errors import DataError
from rig.config.dut import Dut, Rotation
from rig.log.run import SWEEPS, ProcedureName, Run
from rig.loop.signals.recordings import FEWEST_SAMPLES

Floats = NDArray[np.float64]

PARTS = 100
"""Means that a sweep is cut into."""

GOES_INSTEAD = 3.0
"""Times the way of the other shaft that a shaft goes, both at the output, so that it was not held. Behind a fixture
that yields the motor goes even further; a motor that is turned through the gear goes as far as the output."""

LEAST_WAY = 2e-4
"""rad at the output that a shaft goes in a sweep; below it is noise, counts or a run without load."""

DEGREES, ALIKE = 180.0 / math.pi, 1.4
"""Factor between stiffness and catalogue that angles in another unit make, and the factor within which it is that. A
catalogue that is off by anything else is a prior, no limit."""

LOADED = 0.5
"""Share of the torque up to which K1 is stated that a sweep needs to show a stiffness beside play and friction."""

GIVEN_BACK = 0.03
"""Share of torque times way that a loop must give back, instead of taking it, so that it runs backwards."""

CLOSED = 0.1
"""Share of its range by which a torque may differ at both ends of a loop."""

FEWEST_LEVELS = 80
"""Steps of a rounded torque in a sweep from which on the law between them can be told."""

FEWEST_STEPS, SAME_STEP, MOST_ALIKE = 30, 0.01, 0.9
"""Changes of a torque from which it is judged, how alike they are where it was rounded, and how many of them."""


def check_sweeps(runs: Sequence[Run], dut: Dut) -> None:
    """Raise DataError for a sweep under another procedure's name or in other units."""
    if dut.gear.ratio is None:
        return
    sweeps = _sweeps(runs)
    for run in sweeps:
        _check_held_shaft(run, dut.gear.ratio)
    _check_stiffness(sweeps, dut.gear.ratio, dut)


def check_work(runs: Sequence[Run]) -> None:
    """Raise DataError for a locked sweep that gives its motor work back: friction only takes it."""
    for run in _sweeps(runs):
        _check_work(run)


def check_steps(runs: Sequence[Run]) -> None:
    """Raise DataError for a sweep whose torque was rounded to few steps: what lies between them is lost.

    A staircase that was commanded stays long on each of its stairs.
    """
    for run in _sweeps(runs):
        driven = run.procedure is ProcedureName.LOCKED_OUTPUT
        names = ("output_torque", "motor_torque") if driven else ("output_torque",)
        for name in names:
            values = run.signals.get(name)
            steps = np.zeros(0) if values is None else np.abs(np.diff(values[np.isfinite(values)]))
            moved = steps[steps > 0.0]
            if values is None or moved.size < FEWEST_STEPS:
                continue
            step, span = float(np.median(moved)), float(np.ptp(values[np.isfinite(values)]))
            if span >= FEWEST_LEVELS * step or np.mean(np.abs(moved - step) < SAME_STEP * step) < MOST_ALIKE:
                continue
            raise DataError(
                run.name,
                f"{name} goes in steps of {step:.3g} N*m, {span / step:.0f} of them in the whole sweep",
                column=name,
                value=step,
                expected=f"at least {FEWEST_LEVELS} steps: what lies between them is not in the log",
                hint="Record it with more digits, or a finer range of the transducer.",
            )


def _sweeps(runs: Sequence[Run]) -> list[Run]:
    return [run for run in runs if run.procedure in SWEEPS and run.time.size >= FEWEST_SAMPLES]


def _check_held_shaft(run: Run, ratio: float) -> None:
    motor, output = _parts(run, "motor_position"), _parts(run, "output_position")
    if motor is None or output is None:
        return
    locked = run.procedure is ProcedureName.LOCKED_OUTPUT
    ways = (float(np.ptp(output)), float(np.ptp(motor)) / ratio)
    held, other = ways if locked else ways[::-1]
    if held <= max(LEAST_WAY, GOES_INSTEAD * other):
        return
    names = ("output", "motor") if locked else ("motor", "output")
    meant = ProcedureName.BACKDRIVE if locked else ProcedureName.LOCKED_OUTPUT
    raise DataError(
        run.name,
        f"the {names[0]} goes {held:.3g} rad and the {names[1]} {other:.3g} rad (both at the output), but a "
        f"{run.procedure} run holds the {names[0]}",
        column="procedure",
        value=str(run.procedure),
        expected=f"the {names[0]} at rest while the torque twists the drive",
        hint=f"Correct the procedure in the sidecar or mapping ({meant} holds the {names[1]}), the columns of both "
        f"angles, or connect the encoder of the {names[1]}.",
    )


def _check_stiffness(sweeps: Sequence[Run], ratio: float, dut: Dut) -> None:
    """Raise DataError where the most loaded sweep is softer or stiffer than the catalogue as degrees would make it."""
    shown = [found for run in sweeps if (found := _twist(run, ratio, dut)) is not None]
    if dut.gear.K1 is None or not shown:
        return
    torque, torsion, name = max(shown)
    loaded = torque > LOADED * (dut.gear.T1 or dut.gear.rated_torque or 0.0)
    if not loaded or torque == 0.0:
        return
    stiffness = torque / torsion
    off = abs(math.log(stiffness / dut.gear.K1))
    if not DEGREES / ALIKE < math.exp(off) < DEGREES * ALIKE:
        return
    raise DataError(
        name,
        f"{torque:.3g} N*m twist the drive by {torsion:.3g} rad, which is {stiffness:.3g} N*m/rad, but the device "
        f"file's K1 is {dut.gear.K1:g} N*m/rad",
        column="gear.K1",
        value=dut.gear.K1,
        expected="angles in rad, or K1 as these runs show it",
        hint=f"Between degrees and rad lies a factor of {DEGREES:.3g}, and between these values {math.exp(off):.3g}: "
        "check the unit of both angles in the header or mapping, and K1.",
    )


def _twist(run: Run, ratio: float, dut: Dut) -> tuple[float, float, str] | None:
    """Give by how much torque (N*m) and torsion (rad) change in a sweep, and its name; None where it does not tell."""
    motor, output, torque = (_parts(run, name) for name in ("motor_position", "output_position", "output_torque"))
    if motor is None or output is None or torque is None:
        return None
    turned = motor if run.procedure is ProcedureName.LOCKED_OUTPUT else output
    sense = -1.0 if dut.gear.rotation is Rotation.SAME else 1.0
    torsion = float(np.ptp(output + sense * motor / ratio))
    return (float(np.ptp(torque)), torsion, run.name) if np.ptp(turned) > 0.0 and torsion > 0.0 else None


def _check_work(run: Run) -> None:
    name = next((name for name in ("motor_torque", "motor_current") if name in run.signals), "")
    torque, angle = _parts(run, name), _parts(run, "motor_position")
    if run.procedure is not ProcedureName.LOCKED_OUTPUT or torque is None or angle is None:
        return
    size = float(np.ptp(torque) * np.ptp(angle))
    if size == 0.0 or abs(torque[-1] - torque[0]) > CLOSED * np.ptp(torque):
        return
    following = np.roll(torque, -1), np.roll(angle, -1)  # the last part is followed by the first: a closed loop
    work = float(np.sum(0.5 * (following[0] + torque) * (following[1] - angle)))
    if work > -GIVEN_BACK * size:
        return
    raise DataError(
        run.name,
        f"the loop of {name} over motor_position runs backwards: it gives back {-work / size:.2g} of torque times way",
        column=name,
        value=round(work / size, 4),
        expected="work that friction takes",
        hint=f"Check the order of the rows and the signs of {name} and motor_position; leave the run out or repeat it.",
    )


def _parts(run: Run, name: str) -> Floats | None:
    """Give the means (m,) of the parts of a signal; None where it is not there or has gaps that leave none."""
    values = run.signals.get(name)
    if values is None:
        return None
    known = np.isfinite(values)
    places = np.linspace(0, values.size, min(PARTS, values.size), endpoint=False).astype(np.intp)
    counts = np.add.reduceat(known.astype(float), places)
    sums = np.add.reduceat(np.where(known, values, 0.0), places)
    return np.asarray(sums / counts) if np.all(counts > 0.0) else None

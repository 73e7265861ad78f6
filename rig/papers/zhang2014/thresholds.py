"""Section V: starting torque T_fs, backdriving torque T_fb, and the parameters that the bench's own figures give.

The paper reads T_fs as the motor torque at the first pulse of the encoder. The wave generator winds up from the first
torque on, so that this reading is set by the encoder's resolution; the breakaway is where the rotor runs away.
"""

import math
from dataclasses import replace

import numpy as np

from procedures.intents import Measurement
from rig.papers.item import Outcome, Row, Workbench
from rig.papers.zhang2014.backdrive import with_printed_friction, with_starting_friction
from rig.papers.zhang2014.bench import record
from rig.papers.zhang2014.drive import (
    BACKDRIVING_TORQUE,
    EDGES,
    LINES,
    RATIO,
    STARTING_TORQUE,
    paper_drive,
)
from sim_backend.model.compliance import wave_generator_torque
from sim_backend.model.effects import CATALOGUE, ActiveEffect
from sim_backend.model.estimation import wave_generator_from_tests

Measurements = dict[str, Measurement]


def _started(bench: Workbench, edges: int) -> Measurements:
    settings = {"dwell": "2", "start_angles": "1", "repeats": "1" if bench.quick else "3"}
    return dict(record(bench, f"starting-torque-x{edges}", "starting-torque", settings, edges=edges).measured)


def started_coarse(bench: Workbench) -> Measurements:
    """Measure T_fs with one evaluation a count, 4096 a revolution."""
    return _started(bench, 1)


def started_fine(bench: Workbench) -> Measurements:
    """Measure T_fs with four evaluations a count, 16384 a revolution."""
    return _started(bench, EDGES)


def _backdriven(bench: Workbench, name: str, friction: float, effects: tuple[ActiveEffect, ...] = ()) -> Measurements:
    settings = {"input": "free", "dwell": "2", "start_angles": "1", "repeats": "1" if bench.quick else "3"}
    drive = replace(paper_drive(), friction_torque=friction)
    return dict(record(bench, name, "backdrive", settings, drive=drive, effects=effects).measured)


def backdriven(bench: Workbench) -> Measurements:
    """Measure T_fb of the drive of the first experiment, with friction N T_fs = 1.2 N*m."""
    return _backdriven(bench, "backdriving-torque-1.2-Nm", paper_drive().friction_torque)


def backdriven_as_printed(bench: Workbench) -> Measurements:
    """Measure T_fb of a drive with friction 2.0 N*m."""
    return _backdriven(bench, "backdriving-torque-2-Nm", BACKDRIVING_TORQUE)


def load_friction() -> float:
    """Give the growth of friction with load, N*m per N*m at the output, for which T_fb = N T_fs + mu T_fb."""
    return 1.0 - paper_drive().friction_torque / BACKDRIVING_TORQUE


def backdriven_under_load(bench: Workbench) -> Measurements:
    """Measure T_fb of a drive whose friction grows with load so that both printed figures are its own."""
    effect = CATALOGUE["load-dependent-friction"]
    values = {"amplitude": load_friction(), "ratio": RATIO}
    active = ActiveEffect(effect, tuple(values[parameter.name] for parameter in effect.parameters))
    return _backdriven(bench, "backdriving-torque-load-friction", paper_drive().friction_torque, (active,))


def starting_torque(bench: Workbench) -> Outcome:
    """Give T_fs by the breakaway and by the first pulse, with both resolutions."""
    rows = []
    for edges, measured in ((1, bench.share(started_coarse)), (EDGES, bench.share(started_fine))):
        counts = LINES * edges
        total = measured["starting_torque"]
        pulse = max(abs(measured[f"first_pulse_torque_{way}"].value) for way in ("forward", "backward"))
        most = _torque_of_a_count(counts)
        rows += [
            Row(f"T_fs by breakaway, {counts} counts", STARTING_TORQUE, total.value, "N*m", _spread(total)),
            Row(
                f"torque at the first pulse, {counts} counts",
                STARTING_TORQUE,
                pulse,
                "N*m",
                f"by (27) one count is wound up at {1e3 * most:.2g} mN*m: it reads the encoder, not friction",
            ),
        ]
    return Outcome(tuple(rows))


def backdriving_torque(bench: Workbench) -> Outcome:
    """Give T_fb of a drive with the friction of T_fs, and of one with that of the printed T_fb."""
    one, two, three = (
        bench.share(measure)["backdriving_torque"]
        for measure in (backdriven, backdriven_as_printed, backdriven_under_load)
    )
    level = paper_drive().friction_torque
    return Outcome(
        (
            Row(
                f"T_fb, friction N T_fs = {level:g} N*m",
                BACKDRIVING_TORQUE,
                one.value,
                "N*m",
                f"one level of friction serves both ways; {_spread(one)}",
            ),
            Row(f"T_fb, friction {BACKDRIVING_TORQUE:g} N*m", BACKDRIVING_TORQUE, two.value, "N*m", _spread(two)),
            Row(
                f"T_fb, friction {level:g} N*m + {load_friction():.2g} |T_F|",
                BACKDRIVING_TORQUE,
                three.value,
                "N*m",
                f"gives T_fs too, but drives show 0.02 to 0.3; {_spread(three)}",
            ),
        )
    )


def estimated(bench: Workbench) -> Outcome:
    """Put the bench's own T_fs and Psi into (33), (35), and set what comes out beside what the bench is."""
    true = paper_drive()
    T_fs = bench.share(started_fine)["starting_torque"].value
    rows = []
    for friction, case in (
        (true.friction_torque, bench.share(with_starting_friction)),
        (BACKDRIVING_TORQUE, bench.share(with_printed_friction)),
    ):
        K_w0, C_w = wave_generator_from_tests(RATIO, case.hysteresis_loss, T_fs)
        note = f"the bench has {true.K_w0:.4g}: the loop at T_F = 0 is narrower than Psi of (34), so (33) is too stiff"
        rows += [
            Row(f"K_w0 by (33), Psi with friction {friction:g} N*m", 1.33, K_w0, "N*m/rad", note),
            Row(f"C_w by (35), Psi with friction {friction:g} N*m", 83.5, C_w, "1/(N*m)", "1/T_fs, whatever Psi is"),
        ]
    return Outcome(tuple(rows))


def _torque_of_a_count(counts: int) -> float:
    """Give the motor torque that winds up the wave generator by one count of the encoder, N*m."""
    drive = paper_drive()
    return float(wave_generator_torque(np.array(math.tau / counts), drive.K_w0, drive.C_w))


def _spread(measurement: Measurement) -> str:
    return "" if measurement.uncertainty is None else f"standard uncertainty {measurement.uncertainty:.2g} N*m"

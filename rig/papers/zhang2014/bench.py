"""The paper's bench, simulated: its hardware on the bus, its two experiments as procedures that log every cycle.

Motor with 0.321 N*m/A and 188 mN*m rated torque, SHD-17-100, encoder of 4096 counts (x 1 or x 4) at the motor and of 19
bit at the output, torque sensor: the shipped simulated bench has them. Rotor inertia and noise are the bench's own.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from procedures.intents import Measurement
from procedures.plan import build_parameters
from procedures.registry import PROCEDURES
from rig.config.bench import load_bench
from rig.config.dut import Dut, default_dut
from rig.log.load import load_runs
from rig.log.run import Run
from rig.operator import SimulatedOperator
from rig.papers.item import Workbench
from rig.papers.zhang2014.drive import EDGES, LINES, RATIO
from rig.session import Job, Provenance, Session, Watcher, run_jobs
from rig.simulation import simulate
from rig.stop import Stop
from sim_backend.model.effects import ActiveEffect
from sim_backend.model.parameters import HarmonicDrive, Piecewise, PlantConfig

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Recorded:
    """What a procedure logged and measured: its measuring runs, and its joint results by name."""

    runs: tuple[Run, ...]
    measured: Mapping[str, Measurement]


@dataclass(frozen=True, slots=True)
class Branch:
    """A part of a run; arrays (n,). Contract signals: `motor_torque` drives the motor, so that T_w = -motor_torque."""

    time: Floats
    motor_torque: Floats
    motor_position: Floats
    output_torque: Floats
    torsion: Floats


def paper_dut(edges: int = EDGES) -> Dut:
    """Give the device under test with the encoder's counts evaluated `edges` times each."""
    dut, _ = default_dut()
    return dut.model_copy(update={"motor": dut.motor.model_copy(update={"encoder_counts": LINES * edges})})


def record(
    workbench: Workbench,
    name: str,
    procedure: str,
    settings: Mapping[str, str],
    *,
    drive: HarmonicDrive | None = None,
    flexspline: Piecewise | None = None,
    effects: Sequence[ActiveEffect] = (),
    edges: int = EDGES,
    seed: int = 1,
) -> Recorded:
    """Run one procedure on the simulated bench and read its logs back; `name` is the folder of the logs.

    drive: what turns on the bench, None: the paper's. flexspline: its law, None: (24). effects: what it has besides.
    seed: of the instruments' noise.
    """

    def built(config: PlantConfig) -> PlantConfig:
        return replace(config, drive=drive or config.drive, flexspline=flexspline)

    workbench.tell(f"  bench: {name}")
    bench_file, bench_text = load_bench("sim")
    dut, dut_text = paper_dut(edges), default_dut()[1].replace("16384", str(LINES * edges))
    simulated = simulate(bench_file, dut, effects=effects, seed=seed, revise=built)
    entry = PROCEDURES[procedure]
    job = Job(entry, build_parameters(entry, dict(settings)))
    folder = workbench.folder / "logs" / name
    with Stop().listening() as stop:
        session = Session(
            simulated.bench,
            dut,
            Provenance(bench_text, dut_text, "simulated"),
            folder,
            SimulatedOperator(),
            stop,
            Watcher(on_assumed=lambda _: None),
        )
        (done,) = run_jobs(session, (job,))
    runs = load_runs([record.file for record in done.runs if not record.set_up])
    return Recorded(tuple(runs), {m.name: m for m in done.result.measurements})


def branches(run: Run, ratio: float = RATIO) -> tuple[Branch, ...]:
    """Cut a run into its sweeps, in order. The torsion (13) has the zero of the encoders."""
    marks = [event for event in run.events if event.kind == "phase"]
    ends = [*(event.time for event in marks[1:]), np.inf]
    return tuple(
        _cut(run, (run.time >= event.time) & (run.time < end), ratio)
        for event, end in zip(marks, ends, strict=True)
        if event.text.startswith("sweep")
    )


def _cut(run: Run, part: NDArray[np.bool_], ratio: float) -> Branch:
    signals = run.signals
    part = part & np.all(
        [np.isfinite(signals[n]) for n in ("motor_torque", "output_torque", "output_position")], axis=0
    )
    torsion = signals["output_position"] + signals["motor_position"] / ratio
    columns = (run.time, signals["motor_torque"], signals["motor_position"], signals["output_torque"], torsion)
    return Branch(*(column[part] for column in columns))

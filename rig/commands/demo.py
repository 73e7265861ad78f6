"""`rig demo`: the simulated bench carries an effect that the loop is not told; find it, then reveal the truth."""

import json
import math
import secrets
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from drivers.clock import Clock, RealClock
from procedures.plan import PlannedRun, build_parameters
from procedures.registry import PROCEDURES
from rig.commands.further import Asked, with_commands
from rig.commands.loop import dut_of, print_files, print_result, write_loop
from rig.commands.report import REPORT_NAME, write_report
from rig.config.bench import SIMULATED, load_bench
from rig.config.dut import default_dut
from rig.log.load import load_runs
from rig.log.names import writable_folder
from rig.loop.campaign import LoopOptions
from rig.loop.display import interval_text
from rig.loop.files.model_file import Model, ModelBase, ModelEffect, ModelLine
from rig.loop.files.model_storage import write_model
from rig.loop.model.terms import Entry, entry_of, periodic_effects
from rig.loop.result import LoopResult, Step
from rig.loop.trace import trace
from rig.operator import SimulatedOperator
from rig.provenance import file_identity, software_version
from rig.session import Job, Provenance, RunRecord, Session, Watcher, run_jobs
from rig.simulation import simulate
from rig.stages import Stages
from rig.stop import Stop
from rig.terminal import emit, tell
from sim_backend.model.effects import CATALOGUE, ActiveEffect

SHORT: Mapping[str, Mapping[str, str]] = {
    "starting-torque": {"dwell": "2", "start_angles": "1", "repeats": "1"},
    "locked-output": {"dwell": "3", "rates": "0.12", "start_angles": "6", "amplitudes": "1,0.5"},
    "backdrive": {"dwell": "3", "amplitudes": "1"},
    "free-run": {"dwell": "3", "speeds": "20,26,34", "turns": "1"},
}
"""Settings that keep the demo short; a real campaign takes the defaults."""

SPREAD = math.log(2.0)
"""The undeclared amplitude lies within a factor of two of its typical size."""


@dataclass(frozen=True, slots=True)
class Truth:
    """What the simulated bench carries."""

    effect: str
    parameters: Mapping[str, tuple[float, str]]


def demo_command(seed: int | None, out: Path, as_json: bool) -> None:
    """Run all procedures, close the loop, reveal the truth."""
    clock: Clock = RealClock()
    out = _fresh(out)
    seed = secrets.randbits(31) if seed is None else seed
    hidden = draw_effect(seed)
    tell("The simulated bench carries an effect that neither the logs nor the loop are told.")
    logs = out / "logs"
    with Stages(clock) as stage:
        stage("building the simulated bench")
        write_model(bench_model(hidden), out / "bench.json")
        backend = f"{SIMULATED}, {file_identity(out / 'bench.json')}"
        bench_seconds = record((hidden,), seed, logs, on_stage=stage, backend=backend)
        recorded = clock.now()
        tell(f"Recorded {bench_seconds / 60:.1f} minutes of bench time in {recorded:.0f} s. Closing the loop ...")
        stage("reading the logs")
        runs = load_runs([logs])
        result = trace(runs, dut_of(runs), LoopOptions(), on_stage=stage)
        result = with_commands(result, runs, Asked((logs,), model=out / "bench.json"))
        stage("drawing and writing the result")
        files = write_loop(result, out / "loop")
        report = write_report(out / "loop", out / "loop" / REPORT_NAME)
    truth = Truth(
        hidden.effect.id, {p.name: (v, p.unit) for p, v in zip(hidden.effect.parameters, hidden.values, strict=True)}
    )
    (out / "truth.json").write_text(json.dumps({"effect": truth.effect, "parameters": truth.parameters}) + "\n")
    if as_json:
        emit(
            {"seed": seed, "truth": {"effect": truth.effect, "parameters": truth.parameters}, "loop": result.to_json()}
        )
        return
    print_result(result)
    Console().print(_comparison(truth, result))
    tell(judged(truth, result))
    tell(f"seed    {seed}   (rig demo --seed {seed} tells the same story)")
    tell(f"logs    {logs}")
    print_files(files)
    tell(f"report  {report}   (open it in a browser)")
    tell(f"Took {clock.now():.0f} s, of which the loop {clock.now() - recorded:.0f} s.")


def _fresh(out: Path) -> Path:
    """Give a folder that does not exist yet: `out`, or the same with a number."""
    candidate, number = out, 2
    while candidate.exists():
        candidate, number = out.with_name(f"{out.name}-{number}"), number + 1
    writable_folder(candidate)
    return candidate


def draw_effect(seed: int) -> ActiveEffect:
    """Draw an effect that the loop can name: which one, its amplitude around the typical one, its phase."""
    random = np.random.default_rng(seed)
    plain = (Entry.TORSION, Entry.MOTOR, Entry.OUTPUT)
    nameable = [kind.effect for kind in periodic_effects() if kind.effect is not None and kind.entry in plain]
    effect = CATALOGUE[nameable[int(random.integers(len(nameable)))]]
    values = []
    for parameter in effect.parameters:
        if parameter.name in effect.amplitudes:
            values.append(parameter.typical * math.exp(random.uniform(-SPREAD, SPREAD)))
        elif parameter.name == "phase":
            values.append(float(random.uniform(-math.pi, math.pi)))
        else:
            values.append(parameter.typical)
    return ActiveEffect(effect, tuple(values))


def bench_model(hidden: ActiveEffect) -> Model:
    """Give the simulated bench with its hidden effect as a model, for `rig run --model`: a next experiment needs it."""
    dut, effect = default_dut()[0], hidden.effect
    known = {parameter.name: value for parameter, value in zip(effect.parameters, hidden.values, strict=True)}
    line = ModelLine(order=known.get("order", 1.0), amplitude=known["amplitude"], phase=known["phase"])
    term = ModelEffect(
        effect=effect.id,
        enters=entry_of(effect).value,
        variable=effect.variable,
        shape=effect.shape.value,
        lines=(line,),
        parameters={},
    )
    base = ModelBase(model="zhang-2014", ratio=dut.gear.ratio, parameters={})
    return Model.model_validate(
        {"schema": "rig.model/1", "dut": dut, "base": base, "effects": (term,), "software": software_version()}
    )


def record(
    hidden: Sequence[ActiveEffect],
    seed: int,
    logs: Path,
    on_stage: Callable[[str], None] = lambda _: None,
    backend: str = SIMULATED,
) -> float:
    """Run all four procedures on the bench that carries the hidden effects; give the bench time, s.

    `backend`: what the logs say of where they come from.
    """
    bench_file, bench_text = load_bench("sim")
    dut, dut_text = default_dut()
    simulated = simulate(bench_file, dut, effects=hidden, seed=seed + 1)
    jobs = tuple(
        Job(PROCEDURES[name], build_parameters(PROCEDURES[name], dict(settings))) for name, settings in SHORT.items()
    )
    seconds: list[float] = []

    def on_run(procedure: str, planned: PlannedRun, number: int, of: int) -> None:
        if not planned.set_up:
            on_stage(f"  run {number}/{of}: {procedure}-{planned.name}, {planned.duration:.0f} s of bench time")

    def on_end(record: RunRecord) -> None:
        seconds.append(record.outcome.duration)

    with Stop().listening() as stop:
        provenance = Provenance(bench_text, dut_text, backend)
        watcher = Watcher(on_run, on_end=on_end)
        run_jobs(Session(simulated.bench, dut, provenance, logs, SimulatedOperator(), stop, watcher), jobs)
    return sum(seconds)


def judged(truth: Truth, result: LoopResult) -> str:
    """Say in a sentence how the loop did."""
    found = next((step for step in result.steps if truth.effect in (step.effect, *step.members)), None)
    others = [step.effect for step in result.steps if step is not found]
    beside = f"and beside it what is not there: {', '.join(others)}" if others else "and nothing else"
    if found is None:
        what = f"; it added what is not there: {', '.join(others)}" if others else ""
        return f"The loop did not find what was hidden{what}."
    if found.members:
        return f"The loop found what was hidden as one of {' | '.join(found.members)}, {beside}."
    inside = [_inside(name, value, found) for name, (value, _) in truth.parameters.items()]
    known = [one for one in inside if one is not None]
    return f"The loop found what was hidden, {beside}; {sum(known)} of {len(known)} intervals hold the truth."


def _inside(name: str, value: float, found: Step | None) -> bool | None:
    """Whether the interval of a parameter holds its true value; None where it has none."""
    estimate = None if found is None else found.parameters.get(name)
    if estimate is None or estimate.ci95 is None:
        return None
    turns = 2 * math.pi * round((estimate.value - value) / (2 * math.pi)) if name == "phase" else 0.0
    return estimate.ci95[0] <= value + turns <= estimate.ci95[1]


def _comparison(truth: Truth, result: LoopResult) -> Table:
    """Set the hidden effect beside what the loop found."""
    table = Table(title="Now the truth", title_justify="left", header_style="bold", box=None, padding=(0, 1))
    for heading in ("", "hidden", "found", "95 % interval", "in"):
        table.add_column(heading, no_wrap=True)
    found = next((step for step in result.steps if step.effect == truth.effect), None)
    table.add_row("effect", truth.effect, ", ".join(result.effects) or str(result.verdict), "", "")
    for name, (value, unit) in truth.parameters.items():
        estimate = found.parameters.get(name) if found is not None else None
        if estimate is None:
            table.add_row(name, f"{value:.6g} {unit}", "", "", "")
            continue
        shown, inside = f"{estimate.value:.6g} {estimate.unit}", _inside(name, value, found)
        interval = "" if estimate.ci95 is None else interval_text(*estimate.ci95, digits=6)
        table.add_row(name, f"{value:.6g} {unit}", shown, interval, {True: "yes", False: "NO", None: ""}[inside])
    return table

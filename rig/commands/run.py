"""`rig run`: open the bench, run the procedures, log every run; or walk through them in simulation (dry run)."""

import math
import shlex
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from drivers.clock import Clock, RealClock
from drivers.errors import ConfigError, LimitError, Mistake, RigError
from drivers.spelling import did_you_mean
from procedures.intents import Measurement
from procedures.plan import PlannedRun, build_parameters
from procedures.registry import PROCEDURES
from rig.bench import Bench, FixtureLock
from rig.commands.measurements import measurement_table
from rig.commands.walk import Walk, nearest_limit, walk_table
from rig.config.bench import BenchFile, Lock, load_bench, naming_the_bench
from rig.config.catalogue import doubt
from rig.config.dut import Dut, default_dut, load_dut
from rig.facts import bench_facts
from rig.log.load import load_run, logs_in
from rig.log.names import NEXT_FOLDER
from rig.log.run import ProcedureName
from rig.loop.campaign import FEWEST_RUNS
from rig.loop.files.model_file import Model
from rig.loop.files.model_storage import load_model
from rig.operator import Answered, ConsentGiven, Operator, SimulatedOperator, TerminalOperator
from rig.provenance import file_identity
from rig.runner import REACTION, Progress
from rig.session import (
    LOG_SO_FAR,
    Job,
    JobRecord,
    Plans,
    Provenance,
    RunRecord,
    Session,
    Watcher,
    margin_table,
    plan_jobs,
    run_count,
    run_jobs,
)
from rig.simulation import as_simulated, simulate
from rig.stop import Stop
from rig.terminal import counted, emit, shortened, tell

LEAST_STEP = 60.0
STEPS = 0.1
"""Without a terminal, progress is told at most every minute of bench time and every tenth of a run."""


@dataclass(frozen=True, slots=True)
class RunOptions:
    """The options of `rig run`, as given."""

    bench: str
    dut: Path | None
    model: Path | None
    settings: tuple[str, ...]
    repeat: int
    yes: bool
    seed: int | None
    out: Path
    as_json: bool


class OperatorLock:
    """A fixture that the operator closes and opens by hand."""

    def __init__(self, operator: Operator) -> None:
        self._operator = operator

    def set_lock(self, locked: bool) -> Answered:
        """Ask for it."""
        return self._operator.ask("Lock the output to the frame." if locked else "Release the output from the frame.")


def run_command(names: tuple[str, ...], options: RunOptions, dry_run: bool) -> None:
    """Run the named procedures as the options say."""
    jobs = _jobs(names, options)
    bench_file, bench_text = load_bench(options.bench)
    model = load_model(options.model) if options.model is not None else None
    if model is not None and not (bench_file.simulated or dry_run):
        raise ConfigError("--model", [Mistake("--model", str(options.model), "only the simulated bench runs a model")])
    if options.dut is None and model is None and not (bench_file.simulated or dry_run):
        raise ConfigError(
            "--dut",
            [Mistake("--dut", None, "missing; torques and speeds on a real bench are scaled by the device under test")],
            hint="Describe the mounted device in a dut file.",
        )
    dut, dut_text = _dut(options.dut, model)
    if doubtful := doubt(dut):
        tell(f"doubtful: {doubtful}")
    if dry_run:
        with naming_the_bench(options.bench), _nothing_moves():
            _dry_run(jobs, bench_file, dut, model, options)
        return
    with naming_the_bench(options.bench), Stop().listening() as stop:
        bench, operator, backend, assumed = _make_bench(bench_file, dut, model, options)
        planned = planned_time(plan_jobs(bench_facts(bench_file, dut), jobs))
        for line in assumed:
            tell(f"assumed: {line}")
        tell(planned)
        if earlier := logs_in(options.out):
            tell(
                f"{options.out} already holds {counted(len(earlier), 'log')}: "
                f"rig loop {options.out} will read these and the new ones."
            )
        if not bench_file.simulated:
            consent = operator.ask(f"The motor of bench '{bench_file.name}' is going to move. Is the bench clear?")
            while not consent():
                stop.check("consent")
                bench.clock.sleep_until(bench.clock.now() + 0.05)
        watcher = Watcher() if options.as_json else _watcher(dry_run=False)
        if options.model is not None:
            backend = f"{backend}, {file_identity(options.model)}"
        provenance = Provenance(bench_text, dut_text, backend)
        records = run_jobs(Session(bench, dut, provenance, options.out, operator, stop, watcher), jobs)
    _report(records, options)


def _jobs(names: tuple[str, ...], options: RunOptions) -> tuple[Job, ...]:
    """Give one job per procedure named; every unknown procedure and setting is reported at once."""
    mistakes = [
        Mistake(
            "PROCEDURE", shortened(name), f"unknown{did_you_mean(name, PROCEDURES)}; there are {', '.join(PROCEDURES)}"
        )
        for name in names
        if name not in PROCEDURES
    ]
    settings: dict[str, dict[str, str]] = {name: {} for name in names}
    for setting in options.settings:
        path, equals, value = setting.partition("=")
        procedure, dot, parameter = path.partition(".")
        if not (equals and dot):
            mistakes.append(Mistake("--set", shortened(setting), "expected PROCEDURE.NAME=VALUE"))
        elif procedure not in settings:
            rule = f"'{shortened(procedure)}' is not among the procedures of this run"
            mistakes.append(Mistake("--set", shortened(setting), rule))
        elif parameter in settings[procedure]:
            mistakes.append(Mistake("--set", shortened(setting), f"{shortened(path)} is set twice"))
        else:
            settings[procedure][parameter] = value
    jobs = []
    for name in names:
        if name not in PROCEDURES:
            continue
        chosen = PROCEDURES[name]
        try:
            jobs.append(Job(chosen, build_parameters(chosen, settings[name]), options.repeat))
        except ConfigError as error:
            mistakes.extend(error.mistakes)
    if mistakes:
        raise ConfigError("command line", mistakes, hint="`rig procedures` lists what there is.")
    return tuple(jobs)


def _dut(path: Path | None, model: Model | None) -> tuple[Dut, str]:
    """Give the device under test: the file named, else the model's, else the one on the shipped bench."""
    if path is not None:
        return load_dut(path)
    if model is not None:
        return model.dut, model.dut_text()
    return default_dut()


def _make_bench(
    bench_file: BenchFile, dut: Dut, model: Model | None, options: RunOptions
) -> tuple[Bench, Operator, str, tuple[str, ...]]:
    """Give the bench (not opened yet), who operates it, the backend's name, and what was assumed."""
    if bench_file.simulated:
        simulated = simulate(bench_file, dut, model, seed=options.seed)
        return simulated.bench, SimulatedOperator(), "simulated", simulated.assumed
    clock: Clock = RealClock()
    operator: Operator = ConsentGiven(tell) if options.yes else TerminalOperator()
    fixture: FixtureLock | None = OperatorLock(operator) if bench_file.fixture.lock is Lock.OPERATOR else None
    return Bench(bench_file, clock, fixture), operator, "hardware", ()


@contextmanager
def _nothing_moves() -> Iterator[None]:
    """Let an error of the dry run say that it is one, and not what the simulated drives did or where the log was."""
    try:
        yield
    except ConfigError:
        raise
    except RigError as error:
        kept = [note for note in getattr(error, "__notes__", ()) if not note.startswith((REACTION, LOG_SO_FAR))]
        error.__notes__ = [*kept, "This was a dry run: no device was opened and nothing moved."]
        error.facts["dry_run"] = True
        raise


def _dry_run(jobs: tuple[Job, ...], bench_file: BenchFile, dut: Dut, model: Model | None, options: RunOptions) -> None:
    """Run on a simulated copy of the bench against its limits; print phases, extremes, durations, assumptions."""
    stand_in = as_simulated(bench_file)
    with Stop().listening() as stop, tempfile.TemporaryDirectory() as folder:
        simulated = simulate(stand_in, dut, model, seed=options.seed)
        planned = planned_time(plan_jobs(bench_facts(stand_in, dut), jobs))
        tell(planned)
        records: list[RunRecord] = []
        phases: dict[str, tuple[tuple[float, str], ...]] = {}

        teller = Watcher() if options.as_json else _watcher(dry_run=True)

        def on_end(record: RunRecord) -> None:
            teller.on_end(record)
            records.append(record)
            events = load_run(record.file).events
            phases[record.file.stem] = tuple((e.time, e.text) for e in events if e.kind == "phase")

        watcher = Watcher(teller.on_run, teller.on_progress, on_end)
        try:
            session = Session(
                simulated.bench, dut, Provenance("", "", "dry run"), Path(folder), SimulatedOperator(), stop, watcher
            )
            run_jobs(session, jobs)
        except LimitError as error:
            raise ConfigError(
                "dry run",
                [
                    Mistake(
                        error.signal,
                        f"{error.value:.6g} {error.unit}",
                        f"would break the limit: {error.message.rstrip('.')}",
                    )
                ],
                hint="Nothing was moved. Change the procedure's parameters, or the limit if the bench can bear it.",
            ) from error
    assumed = simulated.assumed
    if options.dut is None and model is None:
        assumed = (f"device under test '{dut.name}' (no --dut given)", *assumed)
    duration = sum(record.outcome.duration for record in records)
    rows = [
        {
            "run": f"{record.procedure}-{record.name}",
            "set_up": record.set_up,
            "duration_s": record.outcome.duration,
            "phases": [list(phase) for phase in phases[record.file.stem]],
            "extremes": {
                name: [value, limit if math.isfinite(limit) else None]
                for name, value, limit in margin_table(record, simulated.bench)
            },
        }
        for record in records
    ]
    if options.as_json:
        emit({"dry_run": rows, "duration_s": duration, "assumed": list(assumed)})
        return
    walks = [
        Walk(
            f"{record.procedure}-{record.name}",
            record.procedure,
            record.set_up,
            record.outcome.duration,
            phases[record.file.stem],
            margin_table(record, simulated.bench),
        )
        for record in records
    ]
    Console().print(walk_table(walks))
    moves = sum(record.set_up for record in records)
    tell(f"{runs_and_moves(len(records) - moves, moves)} took {length(duration)} of bench time")
    for line in assumed:
        tell(f"assumed: {line}")
    tell(nearest_limit(walks))


def planned_time(plans: Plans) -> str:
    """Say how many runs there will be and how long they will take on the bench, set-up moves included."""
    runs = run_count(plans)
    moves = sum(len(plan) for _, plan in plans) - runs
    seconds = [sum(run.duration for run in plan) for _, plan in plans]
    parts = ", ".join(f"{job.procedure.name} {length(s)}" for (job, _), s in zip(plans, seconds, strict=True))
    each = f" ({parts})" if len(plans) > 1 else ""
    return f"Planned: {runs_and_moves(runs, moves)}, {length(sum(seconds))} of bench time{each}"


def runs_and_moves(runs: int, moves: int) -> str:
    """Give the number of runs and, where there are any, of moves that set the bench up for them."""
    return counted(runs, "run") + (f" with {counted(moves, 'set-up move')}" if moves else "")


def length(seconds: float) -> str:
    """Give a duration in the unit that suits it."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.1f} minutes" if seconds < 6000 else f"{seconds / 3600:.1f} hours"


class _Teller:
    """Tells which run is under way and what it gave: in a line that changes, or line by line without a terminal."""

    def __init__(self, dry_run: bool) -> None:
        self._dry_run = dry_run
        self._console = Console(stderr=True)
        self._status = self._console.status("") if self._console.is_terminal else None
        self._run = ""
        self._duration = 0.0
        self._told = 0.0

    def on_run(self, procedure: str, planned: PlannedRun, number: int, of: int) -> None:
        """Name the run."""
        place = f"before run {number}/{of}" if planned.set_up else f"run {number}/{of}"
        self._run, self._duration, self._told = f"{procedure}, {place}: {planned.name}", planned.duration, 0.0
        if self._status is not None:
            self._status.start()
            self._status.update(self._run)
        elif not planned.set_up:
            self._line(f"{self._run}, {length(planned.duration)}")

    def on_progress(self, progress: Progress) -> None:
        """Say how far it is."""
        if self._status is not None:
            torque = progress.sample.motor_torque
            shown = f"motor {torque:+.4f} N*m" if torque is not None else ""
            time = f"{progress.time:.0f} of about {self._duration:.0f} s"
            self._status.update(f"{self._run}, {progress.phase}, {time}  {shown}")
        elif progress.time >= self._told + max(LEAST_STEP, STEPS * self._duration):
            self._told = progress.time
            self._line(f"{self._run}, {progress.phase}, {progress.time:.0f} of about {self._duration:.0f} s")

    def on_end(self, record: RunRecord) -> None:
        """Say how it ended and where its log is; the log of a dry run is not kept."""
        if self._status is not None:
            self._status.stop()
        if not (record.set_up or self._dry_run):
            self._line(f"{record.outcome.status:8} {record.outcome.duration:7.1f} s  {record.file}")

    def _line(self, text: str) -> None:
        self._console.print(text, highlight=False, markup=False, soft_wrap=True)


def _watcher(*, dry_run: bool) -> Watcher:
    teller = _Teller(dry_run)
    return Watcher(teller.on_run, teller.on_progress, teller.on_end)


def _report(records: tuple[JobRecord, ...], options: RunOptions) -> None:
    """Print what each procedure measured."""
    if options.as_json:
        emit(
            {
                "procedures": [
                    {
                        "procedure": record.procedure,
                        "runs": [
                            {
                                "file": str(run.file),
                                "set_up": run.set_up,
                                "status": str(run.outcome.status),
                                "duration_s": run.outcome.duration,
                                "safe_state_confirmed": run.outcome.safe_state.confirmed,
                                "measurements": [_measurement(m) for m in run.result.measurements],
                            }
                            for run in record.runs
                        ],
                        "measurements": [_measurement(m) for m in record.result.measurements],
                    }
                    for record in records
                ]
            }
        )
        return
    console = Console()
    for record in records:
        console.print(measurement_table(record.procedure, record.result.measurements))
    tell(f"Logs in {options.out}.{_loop_to_come(records, options.out)}")


def _loop_to_come(records: Sequence[JobRecord], out: Path) -> str:
    """Say how the loop is called on these logs; nothing where it would refuse them.

    A starting torque is no equation of the loop; of a single run, or of replicates alone, nothing can be held out. Of
    a further experiment the loop reads the earlier logs as well, which lie in the folder above.
    """
    earlier = logs_in(out.parent) if out.name.partition("-")[0] == NEXT_FOLDER else []
    if earlier:
        return f" Next: rig loop {shlex.join([str(out.parent), str(out)])}, with the options of the loop before"
    usable = [log for log in logs_in(out) if not log.name.startswith(f"{ProcedureName.STARTING_TORQUE}-")]
    new = {(record.procedure, run.group) for record in records for run in record.runs if not run.set_up}
    new = {(procedure, group) for procedure, group in new if procedure != ProcedureName.STARTING_TORQUE}
    added = [run.file for record in records for run in record.runs]
    distinct = len(new) > len({procedure for procedure, _ in new})
    enough = distinct if set(usable) <= set(added) else len(usable) >= FEWEST_RUNS
    return f" Next: rig loop {shlex.join([str(out)])}" if enough else ""


def _measurement(m: Measurement) -> dict[str, object]:
    return {"name": m.name, "value": m.value, "unit": m.unit, "uncertainty": m.uncertainty, "meaning": m.meaning}

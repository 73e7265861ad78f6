"""Run procedures on a bench, one log per run, set-up moves apart.

A run that does not end as planned ends the session: a fault or a limit never continues with the next run.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from drivers.errors import ConfigError, Mistake, RigError
from drivers.registry import Kind
from drivers.signals import BY_NAME
from drivers.types import DeviceInfo
from procedures.intents import Result
from procedures.plan import BenchFacts, PlannedRun, Procedure
from rig.bench import Bench
from rig.config.bench import ROLES, SIGNED_SIGNALS, BenchFile
from rig.config.dut import Dut
from rig.facts import bench_facts
from rig.log.names import writable_folder
from rig.log.run import RunEvent
from rig.log.writer import LogWriter
from rig.operator import Operator
from rig.provenance import git_state, operator_name, software_version
from rig.runner import Progress, RunOutcome, Status, execute
from rig.stop import Stop
from rig.terminal import tell

SET_UP_FOLDER = "set-up"
"""Logs of moves between runs go here, so that a folder of logs holds measuring runs only."""

LOG_SO_FAR = "The log up to here is complete: "
"""What the note begins with that names the log of a run which did not go as planned."""


@dataclass(frozen=True, slots=True)
class Job:
    """One procedure with its parameters, to be run `repeat` times as a whole."""

    procedure: Procedure
    parameters: Any
    repeat: int = 1


@dataclass(frozen=True, slots=True)
class RunRecord:
    """One run that was carried out: its name, log file, how it ended, what it measured, the error that ended it.

    `group`: what the run shares with its replicates; its name where it has none.
    """

    procedure: str
    name: str
    group: str
    file: Path
    set_up: bool
    outcome: RunOutcome
    result: Result
    error: RigError | None


@dataclass(frozen=True, slots=True)
class JobRecord:
    """One procedure that was carried out: its runs and the joint result of the measuring ones."""

    procedure: str
    runs: tuple[RunRecord, ...]
    result: Result


@dataclass(frozen=True, slots=True)
class Provenance:
    """What every log carries: bench and dut file as written, backend, software, git state, operator.

    `backend`: `hardware`, or `simulated` with the name and hash of the model file that the simulated bench ran, if any.
    """

    bench_text: str
    dut_text: str
    backend: str
    software: str = field(default_factory=software_version)
    git: str = field(default_factory=git_state)
    operator: str = field(default_factory=operator_name)


@dataclass(frozen=True, slots=True)
class Watcher:
    """Who is told what happens: each run before it starts, its progress, its end, and first what had to be assumed.

    `on_run` takes procedure, run, its number among all measuring runs and how many these are; a set-up move has the
    number of the run that it prepares.
    """

    on_run: Callable[[str, PlannedRun, int, int], None] = lambda *_: None
    on_progress: Callable[[Progress], None] = lambda _: None
    on_end: Callable[[RunRecord], None] = lambda _: None
    on_assumed: Callable[[str], None] = lambda line: tell(f"assumed: {line}")


def check_equipment(job: Job, facts: BenchFacts) -> None:
    """Raise ConfigError if the bench lacks what the procedure needs, before anything moves."""
    procedure = job.procedure
    signals = {"motor_position", "motor_torque"}
    signals |= {"output_position"} if facts.has_output_encoder else set()
    signals |= {"output_torque"} if facts.has_torque_sensor else set()
    signals |= {"load_torque", "load_position"} if facts.has_load_drive else set()
    mistakes = [
        Mistake(procedure.name, name, "needs this signal, which no device of the bench gives")
        for name in procedure.needs
        if name not in signals
    ]
    if procedure.needs_load_drive and not facts.has_load_drive:
        mistakes.append(Mistake(procedure.name, "load", "needs a load drive (devices.load)"))
    if procedure.needs_lock and not facts.has_lock:
        mistakes.append(Mistake(procedure.name, "fixture.lock", "needs an output that can be locked"))
    if mistakes:
        raise ConfigError("bench", mistakes)


@dataclass(frozen=True, slots=True)
class Session:
    """Where and with whom runs are carried out: bench (closed between runs), device, output folder, operator."""

    bench: Bench
    dut: Dut
    provenance: Provenance
    out: Path
    operator: Operator
    stop: Stop
    watcher: Watcher = field(default_factory=Watcher)


Plans = tuple[tuple[Job, tuple[PlannedRun, ...]], ...]


def plan_jobs(facts: BenchFacts, jobs: Sequence[Job]) -> Plans:
    """Give the runs of each job. Raises ConfigError where bench or dut do not allow it."""
    for job in jobs:
        check_equipment(job, facts)
    return tuple((job, _repeated(job.procedure.plan(job.parameters, facts), job.repeat)) for job in jobs)


def run_count(plans: Plans) -> int:
    """Count the measuring runs, without the moves that set the bench up for them."""
    return sum(not run.set_up for _, plan in plans for run in plan)


def run_jobs(session: Session, jobs: Sequence[Job]) -> tuple[JobRecord, ...]:
    """Run every job and log into the session's folder. Raises the error that ended a run early.

    The bench is opened and closed around each run: every run starts from devices that were configured and read back
    just before, and nothing waits for a heartbeat while results are computed.
    """
    facts = bench_facts(session.bench.config, session.dut)
    for line in facts.assumed:
        session.watcher.on_assumed(line)
    plans = plan_jobs(facts, jobs)
    writable_folder(session.out)
    records = []
    done, of = 0, run_count(plans)
    tares: dict[str, str] = {}
    for job, plan in plans:
        runs = []
        for planned in plan:
            session.watcher.on_run(job.procedure.name, planned, min(done + 1, of), of)
            record = _run(session, job, planned, facts.assumed, tares)
            session.watcher.on_end(record)
            runs.append(record)
            done += not planned.set_up
            if record.error is not None:
                record.error.add_note(f"{LOG_SO_FAR}{record.file}")
                raise record.error
        measured = tuple(record.result for record in runs if not record.set_up)
        records.append(JobRecord(job.procedure.name, tuple(runs), job.procedure.summarise(measured)))
    return tuple(records)


def _repeated(plan: tuple[PlannedRun, ...], repeat: int) -> tuple[PlannedRun, ...]:
    """Repeat a whole plan; repeats of one run are replicates of each other."""
    if repeat == 1:
        return plan
    return tuple(
        replace(run, name=f"{run.name}-repeat{number}", replicate=None if run.set_up else run.replicate or run.name)
        for number in range(1, repeat + 1)
        for run in plan
    )


class _TaresNoted:
    """A log that also keeps what each tare removed, for the runs that follow; by signal."""

    def __init__(self, log: LogWriter, tares: dict[str, str]) -> None:
        self.write = log.write
        self.device_event = log.device_event
        self._log = log
        self._tares = tares

    def event(self, event: RunEvent) -> None:
        """Log an event."""
        self._log.event(event)
        if event.kind == "tare":
            self._tares["output_torque"] = f"{event.text} in {self._log.path.name} at {event.time:.3f} s"


def _run(session: Session, job: Job, planned: PlannedRun, assumed: tuple[str, ...], tares: dict[str, str]) -> RunRecord:
    bench = session.bench
    folder = session.out / SET_UP_FOLDER if planned.set_up else session.out
    file = _free_name(folder, f"{job.procedure.name}-{planned.name}")
    outcome: RunOutcome | None = None
    result, error = Result(), None
    try:
        log = _open_log(session, job, planned, file, bench.open(), assumed, tares)
        try:
            noting, told = _TaresNoted(log, tares), session.watcher.on_progress
            outcome = execute(bench, planned.steps(), noting, session.operator, session.stop, told)
            error = _closed(bench, outcome.error)
            if error is None:
                try:
                    result = outcome.evaluate()
                except RigError as caught:
                    error = caught
        finally:
            log.close(_outcome_record(outcome, result, error))
    finally:
        with suppress(RigError):  # the error that led here says more; a bench that was closed already stays so
            bench.close()
    group = planned.replicate or planned.name
    return RunRecord(job.procedure.name, planned.name, group, file, planned.set_up, outcome, result, error)


def _closed(bench: Bench, error: RigError | None) -> RigError | None:
    """Close the bench; give the run's error with a failure to close added, or that failure alone."""
    try:
        bench.close()
    except RigError as closing:
        if error is None:
            return closing
        error.add_note(" ".join((f"Closing the bench failed too: {closing}", *getattr(closing, "__notes__", ()))))
    return error


def _open_log(
    session: Session,
    job: Job,
    planned: PlannedRun,
    file: Path,
    devices: tuple[DeviceInfo, ...],
    assumed: tuple[str, ...],
    tares: Mapping[str, str],
) -> LogWriter:
    clock, provenance = session.bench.clock, session.provenance
    begin_ns = clock.epoch_ns() + round(clock.now() * 1e9)
    info = {
        "run_id": f"{file.stem}@{begin_ns}",
        "procedure": "other" if planned.set_up else job.procedure.name,
        "parameters": json.dumps(asdict(job.parameters)),
        "replicate": planned.replicate,
        "start_angle": None if planned.start_angle is None else repr(planned.start_angle),
        "operator": provenance.operator,
        "dut": session.dut.name,
        "bench": session.bench.config.name,
        "backend": provenance.backend,
        "software": provenance.software,
        "git": provenance.git,
        "epoch_ns": str(begin_ns),
        "started": datetime.fromtimestamp(begin_ns / 1e9, UTC).isoformat(),
        "assumed": json.dumps(assumed) if assumed else None,
        "calibration": json.dumps(calibration(session.bench.config, devices, tares)),
        "devices": json.dumps([_device(device) for device in devices]),
    }
    return LogWriter(
        file,
        {key: value for key, value in info.items() if value},
        attachments=_attachments(session),
        cycle_rate=session.bench.config.cycle_rate,
        epoch_ns=begin_ns,
    )


def _attachments(session: Session) -> dict[str, bytes]:
    """Give the files that belong to a run: bench, dut, and what describes the devices."""
    found = {"bench.toml": session.provenance.bench_text.encode(), "dut.toml": session.provenance.dut_text.encode()}
    for role, device in session.bench.config.devices.items():
        path = device.options.get("eds")
        if isinstance(path, str):
            found[f"{role}{Path(path).suffix}"] = Path(path).read_bytes()
    return found


def calibration(
    bench: BenchFile, devices: Sequence[DeviceInfo], tares: Mapping[str, str]
) -> dict[str, dict[str, object]]:
    """Give what turns each channel's raw value into the logged one: sign, step and full scale in SI, last tare.

    The step is what one count means; None where the device does not tell. `tares`: what was removed, by signal.
    """
    known = {info.name: info for info in devices}
    channels: dict[str, dict[str, object]] = {}
    for role, device in bench.devices.items():
        info = known.get(role)
        for name in sorted(SIGNED_SIGNALS[role]):
            # a drive tells the step of its torque, an encoder that of its angle
            main = info if info is not None and (ROLES[role] is not Kind.DRIVE or name.endswith("_torque")) else None
            channels[name] = {
                "device": role,
                "unit": BY_NAME[name].unit,
                "sign": device.sign.get(name, 1),
                "resolution": main.resolution if main is not None else None,
                "full_scale": main.full_scale if main is not None else None,
            }
            if ROLES[role] is Kind.TORQUE_SENSOR:
                channels[name]["tare"] = tares.get(name)
    return channels


def _device(info: DeviceInfo) -> dict[str, object]:
    return {
        "name": info.name,
        "driver": info.driver,
        "address": info.address,
        "identity": dict(info.identity),
        "changed": [list(change) for change in info.changed],
        "warnings": list(info.warnings),
    }


def _outcome_record(outcome: RunOutcome | None, result: Result, error: RigError | None) -> Mapping[str, str]:
    """Give the log's closing record; an outcome of None means that the program itself failed."""
    if outcome is None:
        return {"status": str(Status.ERROR), "error": "the program failed; see its message"}
    safe = outcome.safe_state
    record = {
        "status": str(outcome.status if outcome.error is not None or error is None else Status.ERROR),
        "cycles": str(outcome.cycles),
        "late": str(outcome.late),
        "missing": str(outcome.missing),
        "duration": f"{outcome.duration:.6f}",
        "safe_state": json.dumps({"reaction": safe.reaction, "states": dict(safe.states), "problem": safe.problem}),
        "safe_state_confirmed": str(safe.confirmed).lower(),
        "extremes": json.dumps(dict(outcome.extremes)),
        "measurements": json.dumps([asdict(m) for m in result.measurements]),
    }
    if error is not None:
        record["error"] = " ".join([str(error), *getattr(error, "__notes__", [])])
    return record


def _free_name(folder: Path, stem: str) -> Path:
    """Give a file name that no other run of this folder has taken."""
    candidate, number = folder / f"{stem}.mcap", 2
    while candidate.exists():
        candidate, number = folder / f"{stem}_{number}.mcap", number + 1
    return candidate


def margin_table(record: RunRecord, bench: Bench) -> tuple[tuple[str, float, float], ...]:
    """Give (signal, largest magnitude, limit) for every bounded signal of a run."""
    limits = bench.config.limits.frozen()
    bounds = {
        "motor_torque": limits.motor_torque,
        "motor_velocity": limits.motor_velocity,
        "output_torque": limits.output_torque,
        "load_torque": limits.load_torque,
        "load_velocity": limits.load_velocity,
    }
    return tuple(
        (name, record.outcome.extremes[name], b) for name, b in bounds.items() if name in record.outcome.extremes
    )

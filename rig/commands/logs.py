"""Look into logs, recover, export and import them."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from drivers.errors import ConfigError, Mistake
from drivers.signals import BY_NAME
from drivers.spelling import did_you_mean
from procedures.plan import parameter_table
from procedures.registry import PROCEDURES
from rig.commands.measurements import measurement_table
from rig.log.export import ExportKind, export_run
from rig.log.importer import import_files
from rig.log.load import load_run, load_runs
from rig.log.mcap_reader import AT_IMPORT
from rig.log.measurements import MEASUREMENTS, measurements_in
from rig.log.recover import recover
from rig.log.run import ENDINGS, Run
from rig.log.show import Summary, describe
from rig.log.timeline import GAPS
from rig.terminal import counted, emit, tell

DEVICES = "devices"
"""Key of the metadata under which the devices of a run are kept, as JSON."""


def show_command(path: Path, as_json: bool) -> None:
    """Print what a log holds."""
    summary = describe(load_run(path))
    if as_json:
        emit(summary.as_dict())
        return
    _print_summary(summary)


def recover_command(path: Path, out: Path | None, as_json: bool) -> None:
    """Write what is readable of a cut-off log into a new file."""
    report = recover(path, out)
    if as_json:
        emit({**asdict(report), "source": str(report.source), "file": str(report.file), "intact": report.intact})
        return
    for damage in report.damage:
        tell(f"damage: {damage}")
    found = "The log was whole; its copy is" if report.intact else "Saved to"
    tell(f"{found} {report.file}: {report.samples} samples over {report.seconds:.3f} s, {report.messages} messages.")


def export_command(paths: tuple[Path, ...], kind: str, out: Path, as_json: bool) -> None:
    """Export every log to one file each."""
    if kind not in list(ExportKind):
        rule = f"expected one of {', '.join(ExportKind)}{did_you_mean(kind, ExportKind)}"
        raise ConfigError("--to", [Mistake("--to", kind, rule)])
    written = [export_run(run, ExportKind(kind), out) for run in load_runs(paths)]
    _print_files(written, as_json)


def import_command(files: tuple[Path, ...], mapping: Path | None, out: Path, as_json: bool) -> None:
    """Turn foreign recordings into logs."""
    written = import_files(files, mapping, out)
    recordings: dict[str, list[Run]] = {}
    for run in load_runs(written):
        recordings.setdefault(run.metadata["source"], []).append(run)
    for source, runs in recordings.items():
        for run in runs:
            tell(f"{run.file}: {len(run.time)} samples, {run.time[-1]:.2f} s, {', '.join(run.signals)}")
        _warn(source, runs)
    _print_files(written, as_json)


def _warn(source: str, runs: list[Run]) -> None:
    """Tell once what holds for the whole recording, and of each run only what holds for it alone."""
    whole = [note for note in runs[0].warnings if all(note in run.warnings for run in runs)]
    imported = " ".join(note for note in whole if note.startswith(AT_IMPORT))
    for note in whole:
        if note.startswith(AT_IMPORT) or note not in imported:
            tell(f"{source}: {note.removeprefix(AT_IMPORT)}")
    gaps_throughout = len(runs) > 1 and all(run.gaps for run in runs)
    for run in runs:
        for note in run.warnings:
            if note not in whole and not (gaps_throughout and GAPS in note):
                tell(f"{run.name}: {note}")


def _print_files(files: list[Path], as_json: bool) -> None:
    if as_json:
        emit({"files": [str(path) for path in files]})
        return
    for path in files:
        print(path)


def _outcome(summary: Summary) -> str:
    """Say how the run ended and why; what did not go as planned in capitals."""
    if summary.status is None:
        return "not recorded"
    if summary.status == "done":
        return f"done: {ENDINGS['done']}"
    return f"{summary.status.upper()}: {summary.reason or ENDINGS.get(summary.status, 'no reason recorded')}"


def _print_summary(summary: Summary) -> None:
    console = Console()

    def line(name: str, value: object) -> None:
        console.print(f"{name:12} {escape(str(value))}", highlight=False, soft_wrap=True)

    line("log", summary.file)
    line("procedure", summary.procedure)
    rate = f" at {summary.rate:.6g} Hz" if summary.rate is not None else ""
    line("samples", f"{summary.samples} over {summary.duration:.3f} s{rate}")
    line("outcome", _outcome(summary))
    line("file", "complete: it was closed" if summary.complete else "NOT complete: the log was cut off")
    if summary.late is not None or summary.missing is not None:
        line("cycles", f"{summary.late or 0} late, {summary.missing or 0} missing")
    if summary.replicate is not None:
        line("replicate", summary.replicate)
    if summary.start_angle is not None:
        line("start angle", f"{summary.start_angle:.6g} rad")
    table = Table(header_style="bold")
    table.add_column("signal")
    table.add_column("unit")
    for heading in ("smallest", "largest", "rms", "absent"):
        table.add_column(heading, justify="right")
    for signal in summary.signals:
        numbers = [f"{v:.6g}" if v is not None else "" for v in (signal.minimum, signal.maximum, signal.rms)]
        table.add_row(escape(signal.name), escape(signal.unit), *numbers, str(signal.missing or ""))
    console.print(table)
    for event in summary.events:
        line(f"{event.time:10.3f} s", f"{event.kind}: {event.text}")
    widest = max(map(len, summary.metadata), default=0)
    for name, value in summary.metadata.items():
        if name == MEASUREMENTS and (measured := measurements_in(summary.metadata)):
            console.print(measurement_table("measured", measured))
            continue
        lines = _devices(value) if name == DEVICES else []
        first, *further = lines or _lines(value, _units(name, summary.procedure))
        line(f"{name:{widest}}", first)
        for text in further:
            line(" " * widest, text)
    for warning in summary.warnings:
        line("warning", warning)


def _devices(text: str) -> list[str]:
    """Give one short line for each device; identity and settings in full are for `--json`. None of an odd record."""
    try:
        devices = json.loads(text)
        lines = []
        for device in devices:
            parts = [f"{device['name']}: {device['driver']}, {device['address']}"]
            serial = device["identity"].get("serial")
            parts += [f"serial {serial}"] if serial else []
            changed = len(device["changed"])
            parts += [f"{counted(changed, 'setting')} changed"] if changed else []
            lines.append(", ".join([*parts, *device["warnings"]]))
    except (ValueError, TypeError, KeyError, AttributeError):  # written by another program
        return []
    return [*lines, "(identity and settings in full: rig show --json)"] if lines else []


def _units(key: str, procedure: str) -> dict[str, str]:
    """Give the units of what is kept under a key of the metadata, by name, as far as they are known."""
    if key == "outcome.extremes":
        # the load's speed is taken from its positions and is no signal
        return {name: signal.unit for name, signal in BY_NAME.items()} | {"load_velocity": "rad/s"}
    known = PROCEDURES.get(procedure) if key == "parameters" else None
    return {} if known is None else {info.name: info.unit for info in parameter_table(known.parameters)}


def _lines(text: str, units: Mapping[str, str]) -> list[str]:
    """Give a value of the metadata in lines; what is kept as JSON in one line for every name or item."""
    try:
        content = json.loads(text) if text[:1] in ("{", "[") else text
    except ValueError:
        content = text
    if isinstance(content, dict) and content:
        width = max(len(name) for name in content)
        return [f"{name:{width}}  {_plain(value, units.get(name, ''))}" for name, value in content.items()]
    if isinstance(content, list) and content:
        return [_plain(item) for item in content]
    return [text]


def _plain(value: object, unit: str = "") -> str:
    """Give a value of JSON as a person writes it, with its unit."""
    suffix = f" {unit}" if unit not in ("", "1") else ""
    if isinstance(value, dict):
        return ", ".join(f"{name} {_part(item)}" for name, item in value.items() if item not in (None, "", [], {}))
    if isinstance(value, list):
        return ", ".join(_part(item) for item in value) + suffix if value else "empty"
    if value is None:
        return "not set"
    if value == "":
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return (f"{value:.6g}" if isinstance(value, float) else str(value)) + suffix


def _part(value: object) -> str:
    """Give a value within another one, in brackets where it has parts itself."""
    return f"({_plain(value)})" if isinstance(value, list | dict) else _plain(value)

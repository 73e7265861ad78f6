"""Look into logs, recover, export and import them."""

from pathlib import Path

from rich.console import Console
from rich.table import Table

from drivers.errors import ConfigError, Mistake
from rig.log.export import KINDS, export_run
from rig.log.importer import import_files
from rig.log.load import load_run, load_runs
from rig.log.recover import recover
from rig.log.show import describe
from rig.terminal import emit, tell


def show_command(path: Path, as_json: bool) -> None:
    """Print what a log holds."""
    summary = describe(load_run(path))
    if as_json:
        emit(summary.to_dict())
        return
    console = Console()
    console.print(summary.to_text(), highlight=False, markup=False)


def recover_command(path: Path, out: Path | None, as_json: bool) -> None:
    """Write what is readable of a cut-off log into a new file."""
    report = recover(path, out)
    if as_json:
        emit(report.to_dict())
        return
    tell(report.to_text())


def export_command(paths: tuple[Path, ...], kind: str, out: Path, as_json: bool) -> None:
    """Export every log to one file each."""
    if kind not in KINDS:
        raise ConfigError("--to", [Mistake("--to", kind, f"expected one of {', '.join(KINDS)}")])
    written = [export_run(run, kind, out) for run in load_runs(paths)]
    if as_json:
        emit({"files": [str(path) for path in written]})
        return
    for path in written:
        tell(str(path))


def import_command(files: tuple[Path, ...], mapping: Path, out: Path, as_json: bool) -> None:
    """Turn foreign recordings into logs."""
    written = import_files(files, mapping, out)
    if as_json:
        emit({"files": [str(path) for path in written]})
        return
    table = Table(box=None, header_style="bold")
    for heading in ("log", "samples", "seconds", "signals"):
        table.add_column(heading)
    for run in load_runs(written):
        table.add_row(str(run.file), str(len(run.time)), f"{run.time[-1]:.2f}", ", ".join(run.signals))
        for warning in run.warnings:
            tell(f"{run.name}: {warning}")
    Console().print(table)

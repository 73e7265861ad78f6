"""`rig report`: one self-contained HTML file for each folder of a loop, each log and each folder of logs."""

from collections.abc import Sequence
from pathlib import Path

from drivers.errors import ConfigError, DataError, Mistake
from rig.config.dut import Dut
from rig.config.toml_file import parse_toml
from rig.log.load import MOST_SAMPLES, READERS, load_runs, logs_in
from rig.log.names import safe_name, writable_folder
from rig.log.run import Run
from rig.provenance import software_version
from rig.report.loop_report import loop_page
from rig.report.reading import is_loop, read_loop
from rig.report.run_report import run_page
from rig.terminal import emit

REPORT_NAME = "report.html"


def report_command(paths: tuple[Path, ...], out: Path | None, as_json: bool) -> None:
    """Write the reports; print the files. Each lies beside what it is about, or under its name in `out`."""
    if out is not None:
        writable_folder(out)
    files = [write_report(path, file) for path, file in zip(paths, _files(paths, out), strict=True)]
    if as_json:
        emit({"files": [str(file) for file in files]})
        return
    for file in files:
        print(file)


def write_report(path: Path, file: Path) -> Path:
    """Write the report of a loop's folder, of a log or of a folder of logs; give the file.

    Raises DataError where there is none of these or it cannot be read, ConfigError where `file` cannot be written.
    """
    text = _text(path)
    try:
        file.write_text(text, encoding="utf-8")
    except OSError as error:
        mistake = Mistake("-o", str(file), f"cannot be written: {error.strerror or error}")
        raise ConfigError("-o", [mistake], hint="Choose another folder with -o.") from error
    return file


def _text(path: Path) -> str:
    if is_loop(path):
        return loop_page(read_loop(path), software_version())
    if path.is_file() or logs_in(path):
        return run_page([(run, _dut(run)) for run in load_runs([path], MOST_SAMPLES)], software_version())
    what = "there is neither a loop.json nor a log in it" if path.is_dir() else "there is no such file or folder"
    raise DataError(
        str(path),
        what,
        expected="a folder that rig loop wrote, a log, or a folder of logs",
        hint="Write a loop's folder with rig loop RUN... -o FOLDER.",
    )


def _dut(run: Run) -> Dut | None:
    """Give the device that the log names; None where its attachment is missing or no longer understood."""
    try:
        return parse_toml(run.dut_text, Dut, "dut") if run.dut_text else None
    except ConfigError:
        return None


def _files(paths: Sequence[Path], out: Path | None) -> list[Path]:
    """Give the file of every report: beside its subject, or in `out` under its name, numbered where that is taken."""
    if out is None:
        return [_beside(path) for path in paths]
    found: list[Path] = []
    for path in paths:
        name = safe_name(path.resolve().stem if _is_log(path) else path.resolve().name)
        numbered = (out / f"{name}{end}.html" for end in ("", *(f"-{k}" for k in range(2, len(paths) + 1))))
        found.append(next(file for file in numbered if file not in found))
    return found


def _beside(path: Path) -> Path:
    return path.with_suffix(".html") if _is_log(path) else path / REPORT_NAME


def _is_log(path: Path) -> bool:
    return path.suffix.lower() in READERS and not path.is_dir()

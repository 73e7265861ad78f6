"""`rig report`: one self-contained HTML file for each folder of a loop."""

from collections.abc import Sequence
from pathlib import Path

from drivers.errors import ConfigError, DataError, Mistake
from rig.log.names import safe_name, writable_folder
from rig.provenance import software_version
from rig.report.loop_report import loop_page
from rig.report.reading import is_loop, read_loop
from rig.terminal import emit

REPORT_NAME = "report.html"


def report_command(paths: tuple[Path, ...], out: Path | None, as_json: bool) -> None:
    """Write the reports; print the files. Each lies in the folder it is about, or under its name in `out`."""
    if out is not None:
        writable_folder(out)
    files = [write_report(path, file) for path, file in zip(paths, _files(paths, out), strict=True)]
    if as_json:
        emit({"files": [str(file) for file in files]})
        return
    for file in files:
        print(file)


def write_report(folder: Path, file: Path) -> Path:
    """Write the report of the loop in `folder`; give the file. Raises DataError where the folder holds none."""
    if not is_loop(folder):
        what = "there is no loop.json in this folder" if folder.is_dir() else "there is no such folder"
        raise DataError(
            str(folder), what, expected="a folder that rig loop wrote", hint="Write one with rig loop RUN... -o FOLDER."
        )
    text = loop_page(read_loop(folder), software_version())
    try:
        file.write_text(text, encoding="utf-8")
    except OSError as error:
        mistake = Mistake("-o", str(file), f"cannot be written: {error.strerror or error}")
        raise ConfigError("-o", [mistake], hint="Choose another folder with -o.") from error
    return file


def _files(paths: Sequence[Path], out: Path | None) -> list[Path]:
    """Give the file of every report: in the folder itself, or in `out` under its name, numbered where that is taken."""
    if out is None:
        return [path / REPORT_NAME for path in paths]
    found: list[Path] = []
    for path in paths:
        name = safe_name(path.resolve().name)
        numbered = (out / f"{name}{end}.html" for end in ("", *(f"-{k}" for k in range(2, len(paths) + 1))))
        found.append(next(file for file in numbered if file not in found))
    return found

"""Find and read the runs that a command line names."""

import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from drivers.errors import DataError
from rig.log.csv_file import read_csv
from rig.log.mcap_reader import read_mcap
from rig.log.rows import size
from rig.log.run import Run
from rig.log.timeline import averaged
from rig.terminal import counted

READERS = {".mcap": read_mcap, ".csv": read_csv}

MOST_NAMED = 3
"""Logs of a folder that a message names."""


MOST_SAMPLES = 3_000_000
"""Samples of all runs that the loop works on at once: 50 minutes at 1 kHz, for which it needs some 5 GB."""


def load_runs(paths: Iterable[Path], most_samples: int | None = None) -> tuple[Run, ...]:
    """Read files and folders; a folder stands for all `.mcap` and `.csv` files directly in it, sorted by name.

    Hidden files, whose name begins with a dot, count only where they are named themselves.
    Runs of several folders that share a name are called by their folder too, and so are their replicate groups: two
    days are two campaigns. `most_samples`: where the logs hold more, means over samples are kept of the largest ones,
    see `Run.averaged`; None: everything is kept. Raises DataError if a path does not exist, is of another kind, a
    file is unreadable, two runs still share a name (the loop and its result tell runs apart by name), or nothing is
    found.
    """
    files = [file for path in paths for file in _files(path)]
    if not files:
        raise DataError("RUN", "no run was given", expected="MCAP or CSV files, or folders of them")
    distinct = list({file.resolve(): file for file in files}.values())
    for file in distinct:
        if re.search("[\\ud800-\\udfff]", file.name):
            raise DataError(ascii(file.name), "its name is not UTF-8", hint="Rename the file, and its sidecar.")
    counts = Counter(file.stem for file in distinct)
    runs: tuple[Run, ...] = ()
    for file in distinct:
        runs = (*runs, load_run(file, most_samples))
        while most_samples is not None and sum(map(_size, runs)) > most_samples:
            largest = max(runs, key=_size)
            runs = tuple(averaged(run) if run is largest else run for run in runs)
    if max(counts.values()) == 1:
        return runs
    runs = tuple(_called_by_folder(run, run.file.resolve().parent.name) for run in runs)
    twice = sorted(name for name, count in Counter(run.name for run in runs).items() if count > 1)
    if twice:
        where = ", ".join(str(run.file) for run in runs if run.name == twice[0])
        raise DataError(where, f"two runs are called '{twice[0]}'", hint="Rename one of the files.")
    return runs


def _size(run: Run) -> float:
    return size(len(run.time), len(run.signals) + len(run.auxiliary))


def _called_by_folder(run: Run, folder: str) -> Run:
    group = None if run.replicate is None else f"{folder}-{run.replicate}"
    return replace(run, name=f"{folder}-{run.name}", replicate=group)


def load_run(file: Path, most_samples: int | None = None) -> Run:
    """Read one file, MCAP or contract CSV; `most_samples` as for several. Raises DataError if it is unreadable."""
    reader = READERS.get(one_log(file).suffix.lower())
    if reader is None:
        raise DataError(
            str(file),
            f"'{file.suffix}' is no log",
            expected=".mcap, or .csv with a header like time[s],motor_position[rad]",
            hint="Bring other formats in with rig import --map.",
        )
    return reader(file, most_samples)


def one_log(path: Path) -> Path:
    """Give the path of what is to be opened as a single log. Raises DataError for a folder, naming logs in it."""
    if not path.is_dir():
        return path
    found = logs_in(path)
    names = ", ".join(file.name for file in found[:MOST_NAMED]) + (", ..." if len(found) > MOST_NAMED else "")
    raise DataError(
        str(path),
        f"this is a folder, with {counted(len(found), 'log')} in it" + (f": {names}" if names else ""),
        expected="one log",
        hint=f"Name one of them: {found[0]}" if found else "",
    )


def logs_in(folder: Path) -> list[Path]:
    """Give the logs directly in a folder, sorted by name, but for hidden files; none where there is no such folder."""
    if not folder.is_dir():
        return []
    shown = (file for file in folder.iterdir() if not file.name.startswith("."))
    return sorted(file for file in shown if file.suffix.lower() in READERS and file.is_file())


def _files(path: Path) -> list[Path]:
    if path.is_dir():
        found = logs_in(path)
        if not found:
            raise DataError(str(path), "the folder holds no run", expected="files *.mcap or *.csv")
        return found
    if not path.is_file():
        raise DataError(str(path), "there is no such file or folder")
    return [path]

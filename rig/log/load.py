"""Find and read the runs that a command line names."""

from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from drivers.errors import DataError
from rig.log.csv_file import read_csv
from rig.log.mcap_reader import read_mcap
from rig.log.run import Run

READERS = {".mcap": read_mcap, ".csv": read_csv}


def load_runs(paths: Iterable[Path]) -> tuple[Run, ...]:
    """Read files and folders; a folder stands for all `.mcap` and `.csv` files directly in it, sorted by name.

    Raises DataError if a path does not exist, is of another kind, a file is unreadable, two runs share a name
    (the loop and its result tell runs apart by name), or nothing is found.
    """
    files = [file for path in paths for file in _files(path)]
    if not files:
        raise DataError("RUN", "no run was given", expected="MCAP or CSV files, or folders of them")
    distinct = list({file.resolve(): file for file in files}.values())
    twice = sorted(name for name, count in Counter(file.stem for file in distinct).items() if count > 1)
    if twice:
        where = ", ".join(str(file) for file in distinct if file.stem == twice[0])
        raise DataError(where, f"two runs are called '{twice[0]}'", hint="Rename one of the files.")
    return tuple(load_run(file) for file in distinct)


def load_run(file: Path) -> Run:
    """Read one file, MCAP or contract CSV. Raises DataError if it is unreadable."""
    reader = READERS.get(file.suffix.lower())
    if reader is None:
        raise DataError(
            str(file),
            f"'{file.suffix}' is no log",
            expected=".mcap, or .csv with a header like time[s],motor_position[rad]",
            hint="Bring other formats in with rig import --map.",
        )
    return reader(file)


def _files(path: Path) -> list[Path]:
    if path.is_dir():
        found = sorted(file for file in path.iterdir() if file.suffix.lower() in READERS and file.is_file())
        if not found:
            raise DataError(str(path), "the folder holds no run", expected="files *.mcap or *.csv")
        return found
    if not path.is_file():
        raise DataError(str(path), "there is no such file or folder")
    return [path]

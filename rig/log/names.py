"""Names from files made fit for use as file names and as log fields."""

import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory

from drivers.errors import ConfigError, Mistake

NEXT_FOLDER = "next"
"""Folder of a further experiment, in that of the logs that asked for it; -2, -3 follow where it is taken."""

_MAX_LENGTH = 80
_RESERVED = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?", re.IGNORECASE)


def safe_name(text: str) -> str:
    """Give `text` as a plain file name: no folder, no leading dot, no character that a shell or HTML would notice."""
    name = re.sub(r"[^0-9A-Za-z._-]+", "_", text).strip("._-")[:_MAX_LENGTH].rstrip("._-") or "x"
    return f"x{name}" if _RESERVED.fullmatch(name) else name


def plain_name(text: str, taken: Iterable[str] = ()) -> str:
    """Give `text` as a name of letters, digits and underscores that is not `taken`; "x" where nothing is left."""
    name = re.sub(r"[^0-9A-Za-z_]+", "_", text).strip("_")[:_MAX_LENGTH] or "x"
    if name[0].isdigit():
        name = f"x{name}"
    used, free, count = set(taken), name, 2
    while free in used:
        free, count = f"{name}_{count}", count + 1
    return free


def writable_folder(folder: Path) -> None:
    """Make the folder if it is not there. Raises ConfigError if that cannot be."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        taken = isinstance(error, FileExistsError | NotADirectoryError)
        reason = "is a file or lies in one" if taken else f"cannot be made: {error.strerror or error}"
        raise ConfigError(
            "-o", [Mistake("-o", str(folder)[:80], reason)], hint="Choose another folder with -o."
        ) from error


@contextmanager
def gone_if_unused(folder: Path) -> Iterator[None]:
    """Make the folder; if what follows fails and left nothing there, what was made for it goes again.

    Raises ConfigError if the folder cannot be made.
    """
    made = [one for one in (folder, *folder.parents) if not one.exists()]
    writable_folder(folder)
    try:
        yield
    except BaseException:
        with suppress(OSError):  # something is in it
            for one in made:
                one.rmdir()
        raise


@contextmanager
def written_aside(folder: Path) -> Iterator[Path]:
    """Give a folder to write files into, which are moved to `folder` together when all of them are there.

    If writing fails or is interrupted, `folder` stays as it was. Raises ConfigError where it cannot be written.
    """
    writable_folder(folder)
    try:
        with TemporaryDirectory(prefix=".unfinished-", dir=folder) as aside:
            yield Path(aside)
            for file in sorted(Path(aside).iterdir()):
                file.replace(folder / file.name)
    except OSError as error:
        rule = f"cannot be written: {error.strerror or error}"
        raise ConfigError("-o", [Mistake("-o", str(folder), rule)], hint="Choose another folder with -o.") from error

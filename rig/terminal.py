"""What a person or a program sees of a command: errors as one paragraph on stderr, results as text or JSON."""

import json
import os
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress

from drivers.errors import AbortedError, ConfigError, RigError
from rig.interrupt import ignore_signals, raised_interrupt
from rig.outlets import NobodyReads

MAX_SHOWN = 60
"""Letters of a value, key or line that a message repeats."""


def tell(text: str) -> None:
    """Print a line for the person at the terminal (stderr, so that stdout holds results only)."""
    print(text, file=sys.stderr)


def emit(record: Mapping[str, object]) -> None:
    """Print one JSON document on stdout."""
    print(json.dumps(record, default=str, allow_nan=False))


def width_is_known() -> bool:
    """Tell whether a terminal or the environment variable COLUMNS says how wide a line may be."""
    told = os.environ.get("COLUMNS", "")
    return sys.stdout.isatty() or (told.isdecimal() and int(told) > 0)


def shortened(text: str, most: int = MAX_SHOWN) -> str:
    """Give a text short enough to be repeated in a message: `most` letters at most."""
    return text if len(text) <= most else f"{text[: most - 3]}..."


def counted(number: int, what: str) -> str:
    """Give a number of things that have an -s where they are several: 1 run, 2 runs."""
    return f"{number} {what}{'s' if number != 1 else ''}"


def carry_out(command: Callable[[], object], *, as_json: bool) -> int:
    """Give the exit code of a command: what it returned, 0 for nothing; an error of the tree is told first."""
    error: RigError
    try:
        code = command()
        sys.stdout.flush()
        return code if isinstance(code, int) else 0
    except NobodyReads:
        return 0
    except BaseException as caught:  # whatever became of Interrupted on its way
        by = raised_interrupt()
        if by is not None:
            ignore_signals()  # a second one must not cut the message short
            error = AbortedError(by)
        elif isinstance(caught, RigError):
            error = caught
        else:
            raise
    with suppress(NobodyReads, ConfigError):  # that stdout is lost as well, the exit code need not tell
        _report(error, as_json)
        sys.stdout.flush()
    return error.exit_code


def _report(error: RigError, as_json: bool) -> None:
    notes = getattr(error, "__notes__", [])
    tell(" ".join([f"{_title(error)}{error}", *notes]))
    if as_json:
        emit(
            {
                "error": {
                    "kind": type(error).__name__,
                    "message": error.message,
                    "hint": error.hint,
                    "notes": list(notes),
                    "exit_code": error.exit_code,
                    **{name: _plain(value) for name, value in error.facts.items()},
                }
            }
        )


def _title(error: RigError) -> str:
    if error.exit_code == AbortedError.exit_code:
        return ""  # the message begins with the word
    if error.facts.get("dry_run"):
        return "Dry run stopped: "
    return {2: "Wrong use: ", 3: "Bench stopped: ", 5: "Data: "}.get(error.exit_code, "Error: ")


def _plain(value: object) -> object:
    if isinstance(value, float) and value != value:
        return None
    return value if isinstance(value, str | int | float | bool | list | dict | None) else str(value)

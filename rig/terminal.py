"""What a person or a program sees of a command: errors as one paragraph on stderr, results as text or JSON."""

import json
import signal
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

import typer

from drivers.errors import AbortedError, RigError


def tell(text: str) -> None:
    """Print a line for the person at the terminal (stderr, so that stdout holds results only)."""
    typer.echo(text, err=True)


def emit(record: Mapping[str, object]) -> None:
    """Print one JSON document on stdout."""
    typer.echo(json.dumps(record, default=str, allow_nan=False))


@contextmanager
def reporting(as_json: bool = False) -> Iterator[None]:
    """Turn an error of the tree into its paragraph and its exit code."""
    try:
        yield
    except RigError as error:
        if error.exit_code == AbortedError.exit_code:
            signal.signal(signal.SIGINT, signal.SIG_IGN)  # a second one must not cut the message short
        _report(error, as_json)
        raise typer.Exit(error.exit_code) from error
    except KeyboardInterrupt as error:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # a second one must not cut the message short
        aborted = AbortedError("SIGINT")
        _report(aborted, as_json)
        raise typer.Exit(aborted.exit_code) from error
    except BrokenPipeError:
        sys.stderr.close()
        raise typer.Exit(0) from None


def _report(error: RigError, as_json: bool) -> None:
    notes = getattr(error, "__notes__", [])
    tell(" ".join([f"{_title(error)}: {error}", *notes]))
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
    return {2: "Wrong use", 3: "Bench stopped", 4: "Aborted", 5: "Data"}.get(error.exit_code, "Error")


def _plain(value: object) -> object:
    if isinstance(value, float) and value != value:
        return None
    return value if isinstance(value, str | int | float | bool | list | dict | None) else str(value)

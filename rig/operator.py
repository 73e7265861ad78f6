"""The person at the bench: questions in the terminal, and what answers where nobody can."""

import sys
from collections.abc import Callable
from typing import Protocol

from drivers.errors import AbortedError


class Operator(Protocol):
    """Somebody who can be asked to do something and to confirm it."""

    def confirm(self, request: str) -> None:
        """Return when the request was confirmed. Raises AbortedError if it was refused."""


class SimulatedOperator:
    """Does at once what is asked; the simulated bench needs no hands."""

    def confirm(self, request: str) -> None:
        """Confirm."""


class TerminalOperator:
    """Asks in the terminal; without a terminal nothing is confirmed."""

    def __init__(self, ask: Callable[[str], str] = input) -> None:
        self._ask = ask

    def confirm(self, request: str) -> None:
        """Ask until yes or no was typed."""
        if not sys.stdin.isatty():
            raise AbortedError(
                "nobody: there is no terminal to confirm in",
                phase=request,
                hint="Start it from a terminal, or say --yes if the bench is prepared for every step.",
            )
        while True:
            answer = self._ask(f"{request} [yes/no] ").strip().lower()
            if answer in ("y", "yes"):
                return
            if answer in ("n", "no"):
                raise AbortedError("the operator", phase=request)


class ConsentGiven:
    """Consent given beforehand with --yes; every request is printed and taken as done."""

    def __init__(self, tell: Callable[[str], None]) -> None:
        self._tell = tell

    def confirm(self, request: str) -> None:
        """Print the request."""
        self._tell(f"{request} (confirmed by --yes)")

"""The person at the bench: questions in the terminal, and what answers where nobody can.

A question never blocks: the control loop goes on (the drives' watchdogs want it) and asks for the answer each cycle.
"""

import sys
import threading
from collections.abc import Callable
from queue import Empty, SimpleQueue
from typing import Protocol

from drivers.errors import AbortedError

Answered = Callable[[], bool]
"""Tells whether a request was confirmed; raises AbortedError once it was refused."""


class Operator(Protocol):
    """Somebody who can be asked to do something and to confirm it."""

    def ask(self, request: str) -> Answered:
        """Put a request; look at what it returns until it is true."""


class SimulatedOperator:
    """Does at once what is asked; the simulated bench needs no hands."""

    def ask(self, request: str) -> Answered:
        """Confirm."""
        return lambda: True


class ConsentGiven:
    """Consent given beforehand with --yes; every request is printed and taken as done."""

    def __init__(self, tell: Callable[[str], None]) -> None:
        self._tell = tell

    def ask(self, request: str) -> Answered:
        """Print the request and confirm it."""
        self._tell(f"{request} (confirmed by --yes)")
        return lambda: True


class TerminalOperator:
    """Asks in the terminal; without a terminal nothing is confirmed."""

    def __init__(self, read_line: Callable[[str], str] = input) -> None:
        self._read_line = read_line

    def ask(self, request: str) -> Answered:
        """Ask for yes or no; anything else asks again. Raises AbortedError where there is no terminal."""
        if not sys.stdin.isatty():
            raise AbortedError(
                "nobody: there is no terminal to confirm in",
                phase=request,
                hint="Start it from a terminal, or say --yes if the bench is prepared for every step.",
            )
        answers: SimpleQueue[str] = SimpleQueue()
        threading.Thread(target=self._listen, args=(request, answers), daemon=True).start()

        def answered() -> bool:
            try:
                answer = answers.get_nowait()
            except Empty:
                return False
            if answer != "yes":
                raise AbortedError("the operator", phase=request)
            return True

        return answered

    def _listen(self, request: str, answers: SimpleQueue[str]) -> None:
        while True:
            try:
                answer = self._read_line(f"{request} [yes/no] ").strip().lower()
            except EOFError:
                answer = "no"
            if answer in ("y", "yes"):
                answers.put("yes")
                return
            if answer in ("n", "no"):
                answers.put("no")
                return

"""Who confirms a step that hands must do: a person in the terminal, --yes, or the simulated bench by itself."""

import sys
import threading
from collections.abc import Callable, Iterator

import pytest

from drivers.errors import AbortedError
from rig.operator import Answered, ConsentGiven, SimulatedOperator, TerminalOperator

REQUEST = "Lock the output."


def lines(*answers: str) -> Callable[[str], str]:
    left: Iterator[str] = iter(answers)
    return lambda _prompt: next(left)


def settled(answered: Answered) -> bool:
    """Wait until whoever listens has answered, as a control loop does by looking again and again."""
    for thread in threading.enumerate():
        if thread is not threading.current_thread() and thread.daemon and thread.name.endswith("(_listen)"):
            thread.join(timeout=10.0)
    return answered()


def test_without_a_terminal_nothing_is_confirmed(monkeypatch):
    monkeypatch.setattr(sys.stdin, "isatty", lambda: False, raising=False)
    with pytest.raises(AbortedError, match="no terminal") as caught:
        TerminalOperator(lines("yes")).ask(REQUEST)
    assert caught.value.exit_code == 4
    assert "--yes" in str(caught.value)


@pytest.mark.parametrize("answers", [("yes",), ("Y",), ("perhaps", "yes")])
def test_a_person_confirms_in_the_terminal_and_is_asked_again_if_unclear(monkeypatch, answers):
    monkeypatch.setattr(sys.stdin, "isatty", lambda: True, raising=False)
    assert settled(TerminalOperator(lines(*answers)).ask(REQUEST))


def test_a_person_who_says_no_aborts_the_run(monkeypatch):
    monkeypatch.setattr(sys.stdin, "isatty", lambda: True, raising=False)
    answered = TerminalOperator(lines("no")).ask(REQUEST)
    with pytest.raises(AbortedError, match="the operator"):
        settled(answered)


def test_consent_given_beforehand_is_told_and_confirms():
    told: list[str] = []
    assert ConsentGiven(told.append).ask(REQUEST)()
    assert told == [f"{REQUEST} (confirmed by --yes)"]


def test_the_simulated_bench_answers_by_itself():
    assert SimulatedOperator().ask(REQUEST)()

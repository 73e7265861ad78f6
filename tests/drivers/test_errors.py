"""The error tree: exit codes, messages, facts."""

import inspect
import json

import pytest

from drivers import errors
from drivers.errors import (
    AbortedError,
    ConfigError,
    CycleError,
    DataError,
    DriveFaultError,
    LimitError,
    Mistake,
    NotConnectedError,
    ReadingError,
    RigError,
    RigTimeoutError,
)

EXAMPLES = [
    (ConfigError("bench.toml", [Mistake("limits.torque", -1, "must be positive")]), 2, ["bench.toml", "limits.torque"]),
    (NotConnectedError({"motor": "node 1 on can0", "load": "node 2 on can0"}), 3, ["2 device(s)", "node 1 on can0"]),
    (
        DriveFaultError("motor", "left operation", state="fault", error_code=0x8611, error_register=0x20),
        3,
        ["'motor'", "fault", "0x8611", "0x20"],
    ),
    (ReadingError("output_encoder", "jumped to 7 rad", state=""), 3, ["Device 'output_encoder'", "7 rad"]),
    (LimitError("output_torque", 31.0, 30.0, "N*m", cycle=7), 3, ["output_torque", "31 N*m", "30 N*m", "cycle 7"]),
    (
        CycleError("Too slow", late=3, missing=1, worst_age=2e-3, limit=2),
        3,
        ["3 late", "1 missing", "2 ms", "2 cycles"],
    ),
    (RigTimeoutError("the boot-up", 0.5, last_seen="nothing"), 3, ["0.5 s", "the boot-up", "nothing"]),
    (AbortedError("SIGINT", phase="sweep"), 4, ["SIGINT", "sweep"]),
    (DataError("x.csv", "NaN found", column="output_torque", row=12), 5, ["x.csv", "'output_torque'", "row 12"]),
]


@pytest.mark.parametrize(("error", "code", "words"), EXAMPLES, ids=lambda value: type(value).__name__)
def test_each_leaf_has_its_exit_code_and_says_what_where_and_how_much(
    error: RigError, code: int, words: list[str]
) -> None:
    assert error.exit_code == code
    assert all(word in str(error) for word in words), str(error)


@pytest.mark.parametrize(("error", "code", "words"), EXAMPLES, ids=lambda value: type(value).__name__)
def test_the_facts_behind_a_message_can_be_written_as_json(error: RigError, code: int, words: list[str]) -> None:
    assert json.loads(json.dumps(error.facts)) == error.facts


def test_every_leaf_has_an_example_here() -> None:
    leaves = {cls for _, cls in inspect.getmembers(errors, inspect.isclass) if issubclass(cls, RigError)} - {RigError}
    assert leaves == {type(error) for error, _, _ in EXAMPLES}


def test_a_time_out_is_a_timeout_error_and_bad_data_a_value_error() -> None:
    assert issubclass(RigTimeoutError, TimeoutError)
    assert issubclass(DataError, ValueError)


def test_every_mistake_is_in_the_message_at_once() -> None:
    error = ConfigError("bench.toml", [Mistake("a", 1, "rule a"), Mistake("b.c", "x", "rule b")])
    assert "2 mistakes" in str(error)
    assert "a = 1: rule a" in str(error)
    assert "b.c = 'x': rule b" in str(error)


def test_the_hint_follows_the_message() -> None:
    assert str(RigError("It broke.", hint="Mend it.")) == "It broke. Mend it."


def test_a_drive_without_error_code_does_not_show_one() -> None:
    assert "Error code" not in str(DriveFaultError("motor", "refused", state="ready to switch on"))


def test_the_margin_of_a_limit_is_negative_beyond_it() -> None:
    assert LimitError("motor_torque", -0.3, 0.25, "N*m").facts["margin"] == pytest.approx(-0.05)

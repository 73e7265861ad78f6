"""The summary of a log."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from rig.log.mcap_reader import read_mcap
from rig.log.run import ENDINGS, Run, endings
from rig.log.show import describe
from rig.log.timeline import make_run
from rig.runner import Status
from tests.rig.log.samples import write_log


def test_the_summary_counts_samples_late_cycles_and_cycles_that_never_came(tmp_path: Path) -> None:
    run = make_run(
        tmp_path / "a.csv",
        np.array([0.0, 0.001, 0.002, 0.005]),
        {
            "cycle": np.array([0.0, 1.0, 2.0, 5.0]),
            "late": np.array([0.0, 1.0, 0.0, 1.0]),
            "motor_torque": np.array([3.0, -4.0, np.nan, 0.0]),
        },
        {},
        {},
        {},
    )
    summary = describe(run)
    assert (summary.samples, summary.late, summary.missing) == (4, 2, 2)
    assert summary.duration == 0.005
    assert summary.rate == pytest.approx(1000.0)
    torque = next(item for item in summary.signals if item.name == "motor_torque")
    assert (torque.unit, torque.minimum, torque.maximum, torque.missing) == ("N*m", -4.0, 3.0, 1)
    assert torque.rms == pytest.approx(math.sqrt(25 / 3))


def test_the_plain_form_goes_through_json(tmp_path: Path) -> None:
    write_log(tmp_path / "a.mcap", 50)
    summary = describe(read_mcap(tmp_path / "a.mcap"))
    plain = json.loads(json.dumps(summary.as_dict()))
    assert plain["name"] == "a"
    assert plain["procedure"] == "locked-output"
    assert plain["samples"] == 50
    assert plain["missing"] == 0
    assert plain["events"][1] == {"time": pytest.approx(0.02), "kind": "phase", "text": "sweep"}
    assert {item["name"] for item in plain["signals"] if item["auxiliary"]} == {"strain"}
    assert plain["metadata"]["operator"] == "Ada"


def ended(status: str, error: str = "", *, complete: bool = True) -> Run:
    metadata = {"outcome.status": status} | ({"outcome.error": error} if error else {})
    return make_run(Path("a.mcap"), np.arange(3.0), {}, {}, {}, metadata, complete=complete)


def test_a_closed_log_of_a_run_that_was_broken_off_says_so_with_the_reason() -> None:
    run = ended("aborted", "Aborted by SIGINT in 'sweep'. Reaction: ramp; the drives confirmed.")
    summary = describe(run)
    assert summary.complete
    assert (summary.status, summary.reason) == ("aborted", run.metadata["outcome.error"])
    assert run.ending == "the run was aborted (Aborted by SIGINT in 'sweep')"
    assert ended("limit").ending == "the run was ended by a limit"
    assert ended("wedged").ending == "the run ended as 'wedged'"
    assert len(ended("error", "x" * 1000).ending or "") < 200


def test_only_a_run_that_went_as_planned_or_does_not_tell_has_no_ending() -> None:
    assert ended("done").ending is None
    assert ended("").ending is None
    assert ended("done", complete=False).ending == "the log was cut off: how the run ended is not known"
    assert endings((ended("done"), ended("fault"))) == ("a: the run was ended by a fault.",)
    assert set(ENDINGS) == set(Status)


def test_a_log_without_samples_and_without_cycles_has_a_summary(tmp_path: Path) -> None:
    empty = make_run(tmp_path / "a.csv", np.empty(0), {"motor_torque": np.empty(0)}, {}, {}, {})
    summary = describe(empty)
    assert (summary.samples, summary.duration, summary.rate, summary.late, summary.missing) == (
        0,
        0.0,
        None,
        None,
        None,
    )
    assert summary.signals[0].rms is None


def test_values_whose_squares_are_no_numbers_have_an_rms(tmp_path: Path) -> None:
    run = make_run(tmp_path / "a.csv", np.arange(2.0), {"motor_torque": np.array([1e308, -1e308])}, {}, {}, {})
    assert describe(run).signals[0].rms == pytest.approx(1e308)
    zero = make_run(tmp_path / "a.csv", np.arange(2.0), {"motor_torque": np.zeros(2)}, {}, {}, {})
    assert describe(zero).signals[0].rms == 0.0


def test_a_step_too_short_to_have_a_rate_has_none(tmp_path: Path) -> None:
    run = make_run(tmp_path / "a.csv", np.array([0.0, 5e-324]), {"motor_torque": np.zeros(2)}, {}, {}, {})
    assert describe(run).rate is None

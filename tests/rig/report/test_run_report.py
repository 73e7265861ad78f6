"""`rig report` on logs: what each run measured, how it ended, what it recorded."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rig.config.dut import default_dut
from rig.log.run import Run, RunEvent
from rig.report.run_report import run_page, statement
from tests.rig.loop.runs import make_run
from tests.rig.report.folders import HOSTILE
from tests.rig.report.test_loop_report import Outline, rig

MEASURED = json.dumps(
    [{"name": "stiffness", "value": 9051.23, "unit": "N*m/rad", "uncertainty": 0.265, "meaning": "chord of the loop"}]
)


def sweep(name: str = "sweep", **metadata: str) -> Run:
    time = np.arange(0.0, 10.0, 0.004)
    torque = 12.0 * np.sin(time)
    motor = 0.012 * np.sign(np.cos(time)) + torque / 100.0
    signals = {
        "output_torque": torque,
        "motor_torque": motor,
        "motor_position": torque / 90.0,
        "output_position": 0.0 * time,
    }
    told = {"outcome.status": "done", "outcome.measurements": MEASURED, "operator": "Ada"}
    return make_run(name, "locked-output", time, signals, metadata={**told, **metadata})


def outline(*runs: Run) -> Outline:
    return Outline(run_page([(run, default_dut()[0]) for run in runs], "rig 1"))


def test_a_run_is_told_with_what_it_measured_and_where_it_comes_from() -> None:
    page = outline(sweep())
    assert page.open == []
    for told in (
        "sweep, locked-output: the run went as planned.",
        "stiffness", "9051.23", "0.27", "N·m/rad", "chord of the loop",
        "torsion over output_torque", "motor_torque over output_torque", "motor_position over time",
        "Run: sweep; 1200 of 2500 samples.", "Ada", "Report by rig 1.",
    ):  # fmt: skip
        assert told in page.text, told
    assert "output_position over time" not in page.text, "it did not move"


def test_the_torsion_is_that_of_both_angles() -> None:
    text = run_page([(sweep(), default_dut()[0])], "rig 1")
    low, high = map(float, re.search(r"torsion over output_torque in sweep: from (\S+) to (\S+) mrad", text).groups())
    assert (high - low) == pytest.approx(2.0 * 12.0 / 90.0 / 100.0 * 1e3, rel=1e-2)


def test_a_run_that_went_wrong_says_so_first() -> None:
    bad = sweep("bad", **{"outcome.status": "limit", "outcome.error": "output_torque reached 20 N*m. Reaction: ramp."})
    assert statement([bad]) == "bad, locked-output: the run was ended by a limit (output_torque reached 20 N*m)."
    assert statement([sweep(), bad]) == (
        "2 runs of locked-output; bad: the run was ended by a limit (output_torque reached 20 N*m)."
    )
    assert statement([sweep(), sweep("other")]) == "2 runs of locked-output, all as planned."


def test_how_a_run_ended_is_not_known_where_its_log_does_not_tell() -> None:
    told, untold = sweep(), sweep("csv", **{"outcome.status": ""})
    bad = sweep("bad", **{"outcome.status": "aborted"})
    assert statement([untold]) == "csv, locked-output: how the run ended was not recorded."
    assert "planned" not in outline(untold).text
    assert statement([untold, untold]) == "2 runs of locked-output; how they ended was not recorded."
    assert statement([told, untold, bad]) == (
        "3 runs of locked-output; bad: the run was aborted; how 1 of them ended was not recorded."
    )


@pytest.mark.parametrize("name", HOSTILE)
def test_no_name_from_a_log_becomes_markup(name: str) -> None:
    events = (RunEvent(1.0, name, name),)
    hostile = replace(
        sweep(
            name,
            operator=name,
            **{name: name, "outcome.measurements": json.dumps([{"name": name, "value": 1, "unit": name}])},
        ),
        events=events,
        warnings=(name,),
    )
    plain = replace(sweep("plain", x="x"), events=events, warnings=("a warning",))
    page = outline(hostile)
    assert page.tags == outline(plain).tags
    assert not any(attribute.startswith("on") or attribute in ("src", "style") for attribute, _ in page.attributes)


def test_gaps_missing_samples_and_odd_outcomes_do_not_stop_the_report() -> None:
    run = sweep(**{"outcome.measurements": "not JSON"})
    holes = {name: np.where(run.time < 5.0, np.nan, values) for name, values in run.signals.items()}
    one = make_run("one", "other", np.zeros(1), {"motor_torque": np.ones(1)})
    nothing = replace(run, name="nothing", signals={"motor_torque": np.full(run.time.size, np.nan)})
    page = outline(replace(run, signals=holes, gaps=(2.0,)), one, nothing)
    assert "The log holds no measurements." in page.text
    assert "A gap after 2.000 s." in page.text
    assert page.tags.count("figure") == 5


def test_the_report_of_a_log_lies_beside_it_and_that_of_a_folder_within(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("time[s],motor_torque[N*m]\n0,0\n1,1\n2,0.5\n")
    answer = rig("report", tmp_path / "a.csv", tmp_path)
    assert answer.exit_code == 0, answer.stderr
    assert answer.stdout.split() == [str(tmp_path / "a.html"), str(tmp_path / "report.html")]
    page = Outline((tmp_path / "a.html").read_text(encoding="utf-8"))
    assert "a, other: how the run ended was not recorded" in page.text


def test_an_unreadable_log_is_an_error_of_the_log(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("time[s],motor_torque[N*m]\n0,0\n1,x\n")
    answer = rig("report", tmp_path / "a.csv")
    assert answer.exit_code == 5
    assert "a.csv" in answer.stderr
    assert not (tmp_path / "a.html").exists()

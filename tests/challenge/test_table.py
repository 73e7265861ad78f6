"""What the table counts, and what it leaves out of which bar."""

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

from tests.challenge.cases import REPORT, UNSEEN
from tests.challenge.table import Bar, bars, report

ROOT = Path(__file__).parents[2]

PAGE, SEEDS_A_COUNT = ROOT / "docs" / "challenge.md", 100
"""Where counts are told, and how many seeds one may have looked at from the first that the page names."""


def line(family: str, naming: str, hidden: list[str] | None = None, **other: Any) -> dict[str, Any]:
    return {
        "family": family,
        "naming": naming,
        "seed": 1,
        "design": "rich",
        "noise": "white",
        "hidden": ["soft-windup"] if hidden is None else hidden,
        "wanted": 1.0,
        "sizes": [1.0],
        "found": ["soft-windup"] if naming == "right" else [],
        "added": ["soft-windup"] if hidden is None else [],
        "verdict": "named",
        "parameters": [],
        "after_over_oracle": {"torsion": 1.0},
        "after_over_without": {"torsion": 1.0},
        "after_over_before": {"torsion": 0.5},
        "seconds": 3.0,
        "samples": 1000,
        **other,
    }


def bar(lines: list[dict[str, Any]], text: str) -> Bar:
    return next(item for item in bars(lines) if item.text.startswith(text))


def counted(lines: list[dict[str, Any]], text: str) -> tuple[int, int]:
    rate = bar(lines, text).rate
    return rate.hits, rate.count


def test_a_wrong_answer_counts_against_the_bar():
    lines = [line("single", "right"), line("single", "wrong"), line("single", "extra"), line("single", "in set")]
    assert counted(lines, "one effect of the floor's size") == (1, 4)


def test_what_could_not_get_its_size_is_in_no_bar_but_is_told():
    lines = [line("single", "right"), line("single", "missed", sizes=[0.2], hidden=["torque-sensor-gain"])]
    assert counted(lines, "one effect of the floor's size") == (1, 1)
    assert counted(lines, "held-out error") == (1, 1)
    assert "| torque-sensor-gain | 1 | 0.2 | missed |" in report(lines)


def test_the_members_of_a_set_stay_in_one_cell():
    text = report([line("single", "in set", added=["ambiguous:backlash|soft-windup"])])
    assert "| ambiguous:backlash\\|soft-windup |" in text


def test_every_noise_kind_has_its_own_bar():
    lines = [line("none", "right", hidden=[]), line("none", "wrong", hidden=[], noise="ar1")]
    assert counted(lines, "nothing hidden, white") == (1, 1)
    assert counted(lines, "nothing hidden, ar1") == (0, 1)
    claimed = line("none", "wrong", hidden=[], added=["cogging"])
    assert counted([*lines, claimed], "nothing hidden, any noise: nothing added") == (2, 3)
    assert counted([*lines, claimed], "nothing hidden, any noise: silent") == (1, 3)


def test_one_of_two_effects_is_not_both():
    two = ["soft-windup", "cogging"]
    lines = [line("pair", "missed", hidden=two, sizes=[1.0, 1.0], added=["cogging"])]
    lines += [
        line("pair", "extra", hidden=two, sizes=[1.0, 1.0], added=["ambiguous:creep|soft-windup", "x", "cogging"])
    ]
    assert counted(lines, "two effects") == (1, 2)


def test_one_set_that_holds_both_effects_is_not_both():
    two = ["soft-windup", "cogging"]
    lines = [line("pair", "right", hidden=two, sizes=[1.0, 1.0], added=["ambiguous:cogging|soft-windup"])]
    assert counted(lines, "two effects") == (0, 1)


def test_a_right_answer_under_the_headline_of_another_statement_is_told_apart():
    lines = [line("single", "right"), line("single", "right", verdict="untraced")]
    assert counted(lines, "one effect of the floor's size") == (2, 2)
    assert counted(lines, "the same, and the headline says no more") == (1, 2)
    events = line("single", "right", hidden=["encoder-missed-counts"], verdict="uncontrolled")
    assert counted([events], "the same, and the headline says no more") == (1, 1)


def test_an_error_above_the_oracles_in_any_equation_counts():
    lines = [line("single", "right", after_over_oracle={"torsion": 1.0, "motor-torque": 1.06}), line("third", "right")]
    lines.append(line("third", "right", after_over_without={"torsion": 1.06}))
    assert counted(lines, "held-out error") == (2, 3)
    assert counted(lines, "those, <= 1.05 x the error of logs without") == (2, 3)


def test_physics_outside_the_catalogue_counts_in_the_error_and_apart_from_it():
    far = line("outside", "right", hidden=["gap"], added=["unnamed:time:static"], after_over_oracle={"torsion": 1.4})
    nothing = line("outside", "missed", hidden=["gap"], after_over_before={"torsion": 1.0})
    lines = [line("single", "right"), far, nothing]
    assert counted(lines, "held-out error") == (2, 3)
    assert counted(lines, "the same, effects of the catalogue alone") == (1, 1)
    assert counted(lines, "physics outside the catalogue: held-out") == (2, 2)
    assert counted(lines, "the same, where something was added") == (1, 1)
    assert "| gap | right | unnamed:time:static | 1.40 |" in report(lines)


def test_an_event_need_not_reach_the_oracle():
    assert counted([line("single", "right", hidden=["encoder-missed-counts"])], "held-out error") == (0, 0)


def test_a_refusal_is_no_right_answer_anywhere():
    ratios = {key: {} for key in ("after_over_oracle", "after_over_without", "after_over_before")}
    refused = {"error": "a leak", "added": [], **ratios}
    lines = [line("outside", "error", **refused), line("single", "error", **refused)]
    assert counted(lines, "physics outside the catalogue: held-out") == (0, 1)
    assert counted(lines, "held-out error") == (0, 2)
    assert "a leak" in report(lines)


def test_intervals_are_counted_over_all_cases_and_those_of_effects_and_base_apart():
    def interval(of: str, inside: bool) -> dict[str, Any]:
        return {"of": of, "name": "x", "truth": 1.0, "value": 1.5, "ci95": [1.0, 2.0], "inside": inside}

    lines = [line("single", "right", parameters=[interval("base", True), interval("soft-windup", False)])]
    assert counted(lines, "95 % intervals that hold the truth, all") == (1, 2)
    assert counted(lines, "95 % intervals that hold the truth, effects") == (0, 1)
    assert counted(lines, "95 % intervals that hold the truth, base") == (1, 1)


def test_of_less_than_five_hundred_intervals_nothing_is_said():
    def standing(count: int) -> str:
        interval = {"of": "base", "name": "x", "truth": 1.0, "value": 1.5, "ci95": [1.0, 2.0]}
        items = [{**interval, "inside": k % 20 > 0} for k in range(count)]
        lines = [line("single", "right", parameters=items)]
        return bar(lines, "95 % intervals that hold the truth, all").cells[-1]

    assert standing(480) == "undecided"
    assert standing(2000) == "met"


def test_a_reader_that_stops_early_is_no_error(tmp_path: Path) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    command = [sys.executable, "-m", "tests.challenge", "--table", tmp_path]
    done = subprocess.run(command, stdout=writing, stderr=subprocess.PIPE, text=True, cwd=ROOT, check=False)
    os.close(writing)
    assert (done.returncode, done.stderr) == (0, "")


def test_no_seed_that_is_taken_for_unseen_stands_in_a_figure_that_was_told():
    told = [int(seed) for seed in re.findall(r"seeds (\d{5}) on", PAGE.read_text(encoding="utf-8"))]
    assert len(told) > 3
    assert max(told) + SEEDS_A_COUNT <= UNSEEN.start
    assert UNSEEN.stop <= REPORT.stop

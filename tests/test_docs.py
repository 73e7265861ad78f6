"""The documents: links lead somewhere, file examples are valid, console examples run and print what they show."""

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

import pytest
from typer.testing import CliRunner

from rig.cli import app
from rig.config.bench import BenchFile
from rig.config.dut import Dut
from rig.config.toml_file import parse_toml
from rig.log.mapping import ImportMap
from rig.loop.result import MEANINGS, Verdict

ROOT = Path(__file__).resolve().parent.parent
PAGES = sorted([ROOT / "README.md", ROOT / "CHANGELOG.md", *(ROOT / "docs").rglob("*.md")])
NAMES = [str(page.relative_to(ROOT)) for page in PAGES]

SHORTER = {
    "locked-output": ("dwell=2", "rates=0.12", "start_angles=3", "replicate_pairs=0", "amplitudes=1,0.5"),
    "backdrive": ("dwell=2", "amplitudes=1", "start_angles=1", "repeats=2"),
    "free-run": ("dwell=2", "speeds=20,30", "turns=1"),
    "starting-torque": ("dwell=2", "repeats=1"),
}
"""Settings with which an example takes seconds, for every parameter that the example does not set itself."""

QUICKER = {
    "free-run.speeds=5,10,20,40,80,160": "free-run.speeds=40,80,160",
    "locked-output.rates=0.06,0.03,0.015": "locked-output.rates=0.12,0.06",
}
"""Settings of examples that would take minutes, and what is run in their place."""

DATA, MAPS = '"$HARMONIC_RIG_DATA"', "docs/examples"

NOT_RUN = {
    "$ rig run locked-output --bench bench.toml --dut dut.toml -o runs/wednesday": "moves a motor",
    "$ export HARMONIC_RIG_DATA=../shared/data": "a command of the shell",
    f"$ rig import {DATA}/kuka_iiwa_joint4/vel_*.csv --map {MAPS}/iiwa_joint4.toml -o runs/iiwa": ("measured data"),
    "$ rig loop runs/iiwa --held-out 'vel_p5*' --held-out 'vel_p2*' -o runs/iiwa/loop": "measured data",
    f"$ rig import {DATA}/motor_cogging_map/hold_sweep.csv --map {MAPS}/cogging_map.toml -o runs/cogging": (
        "measured data"
    ),
    "$ rig loop runs/cogging -o runs/cogging/loop": "measured data",
}
"""Console examples that a test cannot run, and what they need; tests/rig covers what they are about."""


@dataclass(frozen=True)
class Example:
    """A command line as a page shows it, and the lines of output below it; `...` stands for anything."""

    line: str
    output: tuple[str, ...]


def blocks(page: Path, kind: str) -> list[str]:
    return re.findall(rf"```{kind}\n(.*?)```", page.read_text(), flags=re.S)


def examples(page: Path) -> list[Example]:
    found = []
    for block in blocks(page, "console"):
        for part in re.split(r"^(?=\$ )", block, flags=re.M)[1:]:
            line, *output = part.splitlines()
            found.append(Example(line.partition("  #")[0].rstrip(), tuple(output)))
    return found


def arguments(line: str) -> list[str]:
    """Give the arguments of an example, with shorter settings for the procedures and experiments it runs."""
    words = [QUICKER.get(word, word) for word in shlex.split(line.removeprefix("$ rig "))]
    if words[0] == "papers":
        return [*words, "--quick"]
    if words[0] != "run":
        return words
    said = {word.partition("=")[0] for word in words}
    for name in set(words) & set(SHORTER):
        for setting in SHORTER[name]:
            if f"{name}.{setting.partition('=')[0]}" not in said:
                words += ["--set", f"{name}.{setting}"]
    return words


WITH_EXAMPLES = [page for page in PAGES if any(e.line not in NOT_RUN for e in examples(page))]


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_every_link_into_the_project_leads_somewhere(page):
    for target in re.findall(r"\]\(([^)#]+)", page.read_text()):
        if "://" not in target:
            assert (page.parent / target).exists(), target


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_nothing_is_left_to_fill_in(page):
    assert not re.findall(r"\b[A-Z]+_(?:BEFORE|AFTER|FOUND)\b|TODO|TBD", page.read_text())


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_every_example_of_a_command_is_in_a_block_that_is_run(page):
    outside = re.sub(r"```.*?```", "", page.read_text(), flags=re.S)
    assert not re.findall(r"^(?: {4}|\$ )rig .*", outside, flags=re.M)


@pytest.mark.timeout(600)  # the README walks through two campaigns and a loop: a minute on a quiet machine
@pytest.mark.parametrize("page", WITH_EXAMPLES, ids=[str(page.relative_to(ROOT)) for page in WITH_EXAMPLES])
def test_console_examples_run_and_print_what_is_shown(page, tmp_path, monkeypatch):
    bench, dut = blocks(ROOT / "docs/files.md", "toml")[:2]
    (tmp_path / "bench.toml").write_text(bench)
    (tmp_path / "dut.toml").write_text(dut)
    monkeypatch.chdir(tmp_path)
    for example in examples(page):
        if example.line in NOT_RUN:
            continue
        answer = CliRunner().invoke(app, arguments(example.line))
        assert answer.exit_code == 0, f"{example.line}\n{answer.output}"
        printed = "\n".join(" ".join(line.split()) for line in answer.output.splitlines())
        for line in example.output:
            pattern = re.escape(" ".join(line.split())).replace(r"\.\.\.", ".*")
            assert re.search(f"^{pattern}", printed, flags=re.M), f"{example.line}\nshows no line '{line}':\n{printed}"


def test_every_example_that_is_not_run_is_in_a_document():
    shown = {example.line for page in PAGES for example in examples(page)}
    assert set(NOT_RUN) <= shown
    assert len(shown) > 2 * len(NOT_RUN)
    assert all(any(setting in line for line in shown) for setting in QUICKER)


def test_the_file_examples_are_valid_files():
    bench, dut, sidecar = blocks(ROOT / "docs/files.md", "toml")
    assert parse_toml(bench, BenchFile, "docs/files.md").name == "bench-3"
    assert parse_toml(dut, Dut, "docs/files.md").name == "SHD-17-100"
    assert parse_toml(f"[run]\n{sidecar}", ImportMap, "docs/files.md").run.start_angle == 0.7


def test_the_page_of_the_loop_explains_every_verdict_as_it_is_printed():
    rows = dict(re.findall(r"^\| `(\w+)` \| (.+) \|$", (ROOT / "docs/loop.md").read_text(), flags=re.M))
    for verdict in Verdict:
        assert rows[verdict].startswith(MEANINGS[verdict])


def test_the_page_of_the_loop_explains_every_mark_and_column_that_is_printed():
    page = (ROOT / "docs/loop.md").read_text()
    printed = page[page.index("## What is printed") : page.index("## What is left out")]
    for word in ("| `=` |", "| `+` |", "| `?` |", "| `!` |", "`max after`", "`samples 79 %`", "`torsion_settling[1]`"):
        assert word in printed, word


def test_the_glossary_explains_every_verdict_and_no_word_twice():
    rows = re.findall(r"^\| (.+?) \| (.+) \|$", (ROOT / "docs/glossary.md").read_text(), flags=re.M)
    words = [word.strip() for left, _ in rows if left not in ("word", "---") for word in re.split("[,;]", left)]
    assert len(set(words)) == len(words)
    assert {left: right for left, right in rows if left.startswith("verdict `")} == {
        f"verdict `{verdict}`": MEANINGS[verdict] for verdict in Verdict
    }
    for word in ("wave generator", "flexspline", "circular spline", "torsion", "hysteresis loss", "starting torque"):
        assert word in words
    for word in (
        "backdriving torque",
        "kinematic error",
        "cogging",
        "control word",
        "heartbeat",
        "floor",
        "held-out run",
    ):
        assert word in words

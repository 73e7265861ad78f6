"""The documents: links lead somewhere, file examples are valid, Python examples hold, nothing is left to fill."""

import doctest
import re
from pathlib import Path

import pytest

from rig.config.bench import BenchFile
from rig.config.dut import Dut
from rig.config.toml_file import parse_toml

ROOT = Path(__file__).resolve().parent.parent
PAGES = sorted([ROOT / "README.md", ROOT / "CHANGELOG.md", *(ROOT / "docs").rglob("*.md")])
NAMES = [str(page.relative_to(ROOT)) for page in PAGES]


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_every_link_into_the_project_leads_somewhere(page):
    for target in re.findall(r"\]\(([^)#]+)", page.read_text()):
        if "://" not in target:
            assert (page.parent / target).exists(), target


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_nothing_is_left_to_fill_in(page):
    assert not re.findall(r"\b[A-Z]+_(?:BEFORE|AFTER|FOUND)\b|TODO|TBD", page.read_text())


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_examples_in_python_hold(page):
    assert doctest.testfile(str(page), module_relative=False).failed == 0


def test_the_file_examples_are_valid_files():
    blocks = re.findall(r"```toml\n(.*?)```", (ROOT / "docs/files.md").read_text(), flags=re.S)
    bench, dut = blocks[:2]
    assert parse_toml(bench, BenchFile, "docs/files.md").name == "bench-3"
    assert parse_toml(dut, Dut, "docs/files.md").name == "SHD-17-100"


def test_commands_of_the_readme_are_commands():
    from rig.cli import app

    known = {command.name or command.callback.__name__ for command in app.registered_commands}
    used = set(re.findall(r"^\$ rig ([a-z]+)", (ROOT / "README.md").read_text(), flags=re.M))
    assert used
    assert used <= known

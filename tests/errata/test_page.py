"""docs/errata.md: every test it names exists, every test of the errata is named, every row says how it is tested."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent.parent
PAGE = (ROOT / "docs/errata.md").read_text()
ROWS = [line for line in PAGE.splitlines() if line.startswith("| ") and not line.startswith("| where")]
NAMED = re.findall(r"`(tests/[\w/]+\.py)::(\w+)`", PAGE)


def functions_in(path: Path) -> set[str]:
    tree = ast.parse(path.read_text())
    return {node.name for node in tree.body if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")}


@pytest.mark.parametrize(("file", "name"), NAMED, ids=[name for _, name in NAMED])
def test_every_named_test_exists(file, name):
    assert name in functions_in(ROOT / file)


@pytest.mark.parametrize("paper", ["zhang2014", "castejon2009"])
def test_every_test_of_the_errata_is_named(paper):
    file = f"tests/errata/test_{paper}.py"
    assert functions_in(ROOT / file) <= {name for where, name in NAMED if where == file}


def test_every_row_names_a_test_or_says_why_there_is_none():
    assert len(ROWS) == 13 + 21
    for row in ROWS:
        cells = row.strip("| ").split(" | ")
        assert len(cells) == 4, row
        assert re.fullmatch(r"no test: [\w ]+|`tests/[\w/]+\.py::\w+`(, `tests/[\w/]+\.py::\w+`)*", cells[3]), row
    assert sum("no test: " in row for row in ROWS) == 4

"""The page with the second paper's results is what `rig papers` prints."""

import math
from pathlib import Path

import pytest

from rig.papers.item import Workbench
from rig.papers.registry import choose
from rig.papers.report import HEADINGS, cells, run_items

PAGE = Path(__file__).resolve().parents[3] / "docs/papers/castejon2009.md"
ROUNDING = 1e-8
"""Where nothing should be left, rounding and differences by numbers leave less than this, and never the same."""


def number(cell: str) -> float | None:
    try:
        return float(cell)
    except ValueError:
        return None


def test_the_table_is_the_one_that_the_command_writes(tmp_path):
    shown = [
        tuple(cell.strip() for cell in line.strip("|").split(" | "))
        for line in PAGE.read_text().splitlines()
        if line.startswith(("| castejon2009", "| both"))
    ]
    done = run_items(choose(["castejon2009", "both"]), Workbench(tmp_path, quick=True))
    expected = [cells(one, row) for one in done for row in one.outcome.rows]
    assert len(shown) == len(expected)
    obtained = HEADINGS.index("obtained")
    for ours, theirs in zip(shown, expected, strict=True):
        ours = tuple((*ours, "")[: len(HEADINGS)])
        assert ours[:obtained] + ours[obtained + 1 :] == theirs[:obtained] + theirs[obtained + 1 :]
        value = number(theirs[obtained])
        if value is None:
            assert ours[obtained] == theirs[obtained]
        elif ours[obtained - 1] == "0" or math.isclose(value, 0.0, abs_tol=ROUNDING * 1e-2):
            assert abs(float(ours[obtained])) < max(ROUNDING, 2.0 * abs(value))
        else:
            # `quick` sweeps the locked plant ten times faster: 0.3 % more of the viscous friction
            assert float(ours[obtained]) == pytest.approx(value, rel=5e-3), ours

"""The pages with the papers' results are what `rig papers` prints, and leave nothing of the papers out."""

import math

import pytest

from rig.papers.item import DEFINITION, DRAWING, Workbench
from rig.papers.registry import choose
from rig.papers.report import HEADINGS, cells, run_items
from tests.rig.papers.page import PAGES, rows_of_page

ROUNDING = 1e-8
"""Where nothing should be left, rounding and differences by numbers leave less than this, and never the same."""

PARTS = {
    "zhang2014": {*(f"eq. ({n})" for n in range(1, 37)), *(f"Fig. {n}" for n in range(1, 15))},
    "castejon2009": {
        *(f"eq. ({n})" for n in range(1, 41)),
        *(f"Fig. {n}" for n in range(1, 13)),
        "table 1",
        "table 2",
    },
}
"""Every numbered equation, figure and table; the first paper has no numbered table."""

NOT_NUMBERED = {
    "zhang2014": {"sec. V, T_fs", "sec. V, T_fb", "sec. V, parameters", "beyond"},
    "castejon2009": {"conclusions"},
}

NOT_COMPUTED = {
    "zhang2014": {DRAWING: {"Fig. 1", "Fig. 3", "Fig. 4", "Fig. 9"}, DEFINITION: {"eq. (18)", "eq. (20)"}},
    "castejon2009": {
        DRAWING: {f"Fig. {n}" for n in (1, 4, 5, 6, 7)},
        DEFINITION: {f"eq. ({n})" for n in (6, 7, 11, *range(20, 26), 33, 34, 37, 38)},
    },
}
"""Pictures, and equations that only give a thing its name."""

ITEM, OBTAINED, COMMAND = (HEADINGS.index(name) for name in ("item", "obtained", "command"))


def number(cell: str) -> float | None:
    try:
        return float(cell)
    except ValueError:
        return None


@pytest.mark.parametrize("paper", PARTS)
def test_every_numbered_equation_figure_and_table_has_a_row_of_its_own(paper):
    shown = {row[ITEM] for row in rows_of_page(paper)}
    assert PARTS[paper] - shown == set()
    assert shown - PARTS[paper] == NOT_NUMBERED[paper]


@pytest.mark.parametrize("paper", PARTS)
def test_every_row_has_something_computed_but_for_drawings_and_definitions(paper):
    for word, parts in NOT_COMPUTED[paper].items():
        assert {row[ITEM] for row in rows_of_page(paper) if row[OBTAINED] == word} == parts


@pytest.mark.parametrize("paper", [*PARTS, "both"])
def test_the_command_of_every_row_runs_the_item_that_gave_it(paper):
    rows = rows_of_page(paper)
    assert rows
    for row in rows:
        program, subcommand, name = row[COMMAND].split(" ")
        assert (program, subcommand) == ("rig", "papers")
        (item,) = choose([name])
        assert item.paper == paper
        assert item in choose([f"{paper}/{row[ITEM]}"])


@pytest.mark.parametrize("paper", ["castejon2009", "both"])
def test_the_table_is_the_one_that_the_command_writes(paper, tmp_path):
    shown = rows_of_page(paper)
    done = run_items(choose([paper]), Workbench(tmp_path, quick=True))
    expected = [cells(one, row) for one in done for row in one.outcome.rows]
    assert len(shown) == len(expected)
    for ours, theirs in zip(shown, expected, strict=True):
        assert len(ours) == len(HEADINGS)
        assert ours[:OBTAINED] + ours[OBTAINED + 1 :] == theirs[:OBTAINED] + theirs[OBTAINED + 1 :]
        value = number(theirs[OBTAINED])
        if value is None:
            assert ours[OBTAINED] == theirs[OBTAINED]
        elif ours[OBTAINED - 1] == "0" or math.isclose(value, 0.0, abs_tol=ROUNDING * 1e-2):
            assert abs(float(ours[OBTAINED])) < max(ROUNDING, 2.0 * abs(value))
        else:
            # `quick` sweeps the locked plant ten times faster: 0.3 % more of the viscous friction
            assert float(ours[OBTAINED]) == pytest.approx(value, rel=5e-3), ours
    if paper == "both":
        page = (PAGES / "both.md").read_text()
        for file in (file for one in done for file in one.files):
            assert f"(both/{file.name})" in page
            assert (PAGES / "both" / file.name).stat().st_size > 10_000

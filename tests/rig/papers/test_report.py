"""The frame of `rig papers`: which items a name means, and what is written."""

import json

import pytest
from rich.console import Console
from typer.testing import CliRunner

from drivers.errors import ConfigError
from rig.cli import app
from rig.commands.papers import grid_table, papers_command, rows_table
from rig.papers.figures import label, new_figure
from rig.papers.item import Grid, Item, Outcome, Row, Workbench
from rig.papers.registry import ITEMS, LONGEST_STEM, choose, command, file_name, report_stem
from rig.papers.report import Done, cells, run_items, to_json, to_markdown, write_report


def empty(_):
    return Outcome()


SOME = (
    Item("one2001", "Fig. 1", "", empty),
    Item("one2001", "Fig. 12", "", empty),
    Item("two2002", "eq. (31)-(35)", "", empty),
)


@pytest.mark.parametrize(
    ("names", "meant"),
    [
        ([], [0, 1, 2]),
        (["fig1"], [0]),
        (["FIG. 12"], [1]),
        (["fig"], [0, 1]),
        (["two2002"], [2]),
        (["two/eq31"], []),
        (["two2002/eq31"], [2]),
        (["two2002/eq31-35"], [2]),
        (["two2002/eq33"], [2]),
        (["eq (32)"], [2]),
        (["eq32-34"], [2]),
        (["two2002/eq36"], []),
        (["two2002/eq30"], []),
        (["two2002/eq3135"], []),
        (["two2002/fig33"], []),
        (["eq" + "3" * 5000], []),
        (["eq", "fig12"], [1, 2]),
    ],
)
def test_a_name_means_a_paper_or_an_item_or_how_one_begins(names, meant):
    if not meant:
        with pytest.raises(ConfigError):
            choose(names, SOME)
        return
    assert choose(names, SOME) == tuple(SOME[i] for i in meant)


@pytest.mark.parametrize("name", ["fig2", "", "--", "zhang"])
def test_a_name_that_means_nothing_is_refused_with_what_there_is(name):
    with pytest.raises(ConfigError, match="one2001 has fig1, fig12; two2002 has eq31 to eq35"):
        choose([name], SOME)


def test_every_item_has_a_name_and_a_file_of_its_own():
    assert len({file_name(item) for item in ITEMS}) == len(ITEMS)
    for item in ITEMS:
        assert item in choose([f"{item.paper}/{item.what}"])


def test_the_names_in_the_refusal_are_names():
    with pytest.raises(ConfigError) as refused:
        choose(["nothing"])
    chosen = set()
    for told in str(refused.value).split("unknown; ")[1].rstrip(".").split("; "):
        paper, parts = told.split(" has ")
        for part in parts.split(", "):
            first, last = (part.split(" to ") * 2)[:2]
            kind = first.rstrip("0123456789")
            numbers = first.removeprefix(kind), last.removeprefix(kind)
            names = [f"{kind}{n}" for n in range(int(numbers[0]), int(numbers[1]) + 1)] if numbers[0] else [kind]
            for name in names:
                (item,) = choose([f"{paper}/{name}"])
                chosen.add(item)
    assert chosen == set(ITEMS)


@pytest.mark.parametrize(
    ("name", "told"),
    [
        (
            "castejon2009/eq99",
            "unknown (did you mean castejon2009/eq9?); castejon2009 has eq1 to eq40, fig1 to fig12, "
            "table1, table2, conclusions",
        ),
        (
            "zhang2014/eq0",
            "zhang2014 has eq1 to eq36, fig1 to fig14, sec-v-t-fs, sec-v-t-fb, sec-v-parameters, beyond",
        ),
        ("both/two", "both has one-model"),
        ("castejon2009/conclusion-s", "unknown (did you mean castejon2009/conclusions?); castejon2009 has eq1 to eq40"),
    ],
)
def test_an_unknown_part_of_a_paper_is_answered_shortly_with_what_that_paper_has(name, told):
    with pytest.raises(ConfigError) as refused:
        choose([name])
    assert told in str(refused.value)
    assert len(str(refused.value)) < 220


def test_a_misspelt_name_is_answered_with_one_that_is_near():
    with pytest.raises(ConfigError, match=r"unknown \(did you mean castejon2009\?\)"):
        choose(["casteon2009"])
    with pytest.raises(ConfigError, match=r"unknown \(did you mean zhang2014/fig14"):
        choose(["zang2014/fig14"])


def test_a_row_s_command_names_its_own_part_of_the_item():
    *_, laws = SOME
    assert command(laws, Row("K", None, 1.0, item="eq. (33)")) == "rig papers two2002/eq33"
    assert command(laws, Row("K", None, 1.0)) == "rig papers two2002/eq31-35"
    section = Item("two2002", "sec. V, T_fs", "", empty)
    assert command(section, Row("T", None, 1.0)) == "rig papers two2002/sec-v-t-fs"
    assert choose(["two2002/sec-v-t-fs"], (*SOME, section)) == (section,)


@pytest.mark.parametrize("name", ["zhang2014/eq10", "zhang2014/eq28", "castejon2009/eq35", "castejon2009/eq6"])
def test_every_equation_of_a_paper_is_a_name(name):
    assert len(choose([name])) == 1


@pytest.mark.parametrize(
    ("names", "stem"),
    [
        ([], ""),
        (["zhang2014", "castejon2009", "both"], ""),
        (["both"], "both"),
        (["zhang"], "zhang2014"),
        (["castejon2009/eq35"], "castejon2009-eq35"),
        (["Castejon2009 eq. (35)"], "castejon2009-eq35"),
        (["table"], "castejon2009-table"),
        (["Table 1", "castejon2009/table1"], "castejon2009-table1"),
        (["fig12"], "zhang2014-castejon2009-fig12"),
        (["zhang2014/sec-v-t-fs", "castejon2009/fig9"], "zhang2014-sec-v-t-fs+castejon2009-fig9"),
    ],
)
def test_the_report_on_a_part_is_named_after_it(names, stem):
    assert report_stem(names, choose(names)) == stem


def test_the_report_on_many_parts_is_named_after_the_first_and_their_number():
    names = [f"zhang2014/eq{n}" for n in range(1, 37)]
    assert report_stem(names, choose(names)) == "zhang2014-eq1-and-35-more"
    assert len(report_stem(names[:7], choose(names[:7]))) <= LONGEST_STEM


def test_a_part_leaves_the_table_of_a_full_run_as_it_is(tmp_path):
    full = {tmp_path / name: f"full {name}" for name in ("table.md", "results.json")}
    for file, text in full.items():
        file.write_text(text)
    papers_command(("castejon2009/eq1", "table1"), tmp_path, quick=True, as_json=True)
    assert {file: file.read_text() for file in full} == full
    assert "castejon2009/eq1" in (tmp_path / "castejon2009-eq1+castejon2009-table1.md").read_text()
    assert json.loads((tmp_path / "castejon2009-eq1+castejon2009-table1.json").read_text())["items"]


def test_shared_work_is_done_once(tmp_path):
    done = []

    def work(bench):
        done.append(bench)
        return len(done)

    bench = Workbench(tmp_path)
    assert (bench.share(work), bench.share(work)) == (1, 1)
    assert Workbench(tmp_path).share(work) == 2


def test_figures_results_and_table_are_written(tmp_path):
    def draw(_):
        figure, (axes,) = new_figure("a")
        axes.plot([0, 1], [0, 1], label="line")
        label(axes, "x [s]", "y [rad]")
        rows = (Row("width", 2.0, 1.23456789, "rad", "a | b"), Row("name", None, "found", item="eq. (7)"))
        return Outcome(rows, {"": figure}, (Grid("Errors", ("plant", "rms"), (("arctan", "1"),)),))

    (done,) = run_items([Item("one2001", "Fig. 1", "An example", draw)], Workbench(tmp_path))
    results, table = write_report([done], tmp_path)
    assert (tmp_path / "one2001-fig-1.png").stat().st_size > 1000
    assert json.loads(results.read_text()) == json.loads(json.dumps(to_json([done])))
    assert json.loads(results.read_text())["items"][0]["rows"][0]["obtained"] == 1.23456789
    assert table.read_text() == to_markdown([done])
    again = "rig papers one2001/fig1"
    assert cells(done, done.outcome.rows[0]) == ("one2001", "Fig. 1", "width [rad]", "2", "1.235", "a | b", again)
    assert cells(done, done.outcome.rows[1])[1:5] == ("eq. (7)", "name", "-", "found")
    assert json.loads(results.read_text())["items"][0]["rows"][0]["command"] == again
    assert f"| `{again}` |" in table.read_text()
    assert "a \\| b" in table.read_text()
    assert "![An example](one2001-fig-1.png)" in table.read_text()


@pytest.mark.parametrize(("columns", "widest"), [("80", 80), ("100", 100), ("300", 120), ("", 120), ("0", 120)])
def test_a_table_that_is_piped_keeps_to_the_columns_that_the_environment_tells(columns, widest, tmp_path):
    runner = CliRunner(env={"COLUMNS": columns})
    answer = runner.invoke(app, ["papers", "castejon2009/eq26", "-o", str(tmp_path)])
    assert answer.exit_code == 0
    assert max(map(len, answer.stdout.splitlines())) == widest


LONG = "what stands beside a number and takes more room than a line of the table has left"


@pytest.mark.parametrize("width", [80, 100, 120])
def test_the_tables_keep_to_the_width_and_leave_every_number_and_command_whole(width):
    numbers = (-1.234e-05, 0.0001943, 123400.0)
    rows = tuple(Row(LONG, number, -number, "N*m/rad", LONG, f"eq. ({k + 26})") for k, number in enumerate(numbers))
    heads = ("bench", *(f"model {k} with a long name, as printed" for k in range(4)))
    grid = Grid("Errors", heads, ((LONG, *(f"12{k}.8 / 509" for k in range(4))),))
    done = Done(Item("castejon2009", "eq. (26)-(40)", "", empty), Outcome(rows, {}, (grid,)), ())
    console = Console(width=width)
    with console.capture() as capture:
        console.print(rows_table([done]), grid_table(grid), highlight=False, markup=False)
    printed = capture.get()
    assert max(map(len, printed.splitlines())) <= width
    told = ["-1.234e-05", "1.234e-05", "0.0001943", "-0.0001943", "1.234e+05", "120.8 / 509"]
    for text in (*told, "123.8 / 509", *(f"castejon2009/eq{k}" for k in (26, 27, 28))):
        assert f" {text} " in printed, text
    assert "…" not in printed

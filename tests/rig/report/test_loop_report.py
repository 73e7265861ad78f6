"""`rig report` on a folder of a loop: what stands in the file, and what is said of folders that hold none."""

import json
import re
from html.parser import HTMLParser
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from rig.cli import app
from tests.rig.report.folders import HOSTILE, loop_content, views_content, write_folder

TAGS = frozenset({
    "html", "head", "meta", "title", "style", "body", "header", "nav", "main", "section", "h1", "h2", "h3", "p", "ul",
    "li", "a", "b", "small", "i", "span", "div", "details", "summary", "table", "caption", "thead", "tbody", "tr", "th",
    "td", "dl", "dt", "dd", "figure", "figcaption", "svg", "clippath", "rect", "g", "path", "line", "text", "pre",
    "script",
})  # fmt: skip
"""Every element that a report is made of."""


class Outline(HTMLParser):
    """Collects elements, attributes and text of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str]] = []
        self.words: list[str] = []
        self.open: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += [(name, value or "") for name, value in attrs]
        if tag != "meta":
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] not in ("script", "style"):
            self.words.append(data)

    @property
    def text(self) -> str:
        return " ".join(self.words)


def rig(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def report(folder: Path) -> Outline:
    answer = rig("report", folder)
    assert answer.exit_code == 0, answer.stderr
    assert answer.stdout == f"{folder / 'report.html'}\n"
    return Outline((folder / "report.html").read_text(encoding="utf-8"))


def test_the_report_says_everything_a_loop_left(tmp_path: Path) -> None:
    page = report(write_folder(tmp_path / "loop", "SHD"))
    assert page.open == []
    for told in (
        "What is left of SHD, after adding kinematic-error, could not be traced to a cause",
        "24", "4", "3.9", "3.4 to 4.4", "83.3 %",
        "Output angle error periodic in the wave-generator angle",
        "34.12", "33.80 to 34.40", "µrad",
        "rig run free-run --set free-run.turns=2 # SHD",
        "expected separation 4.5 standard deviations; 3 minutes on the bench",
        "8330", "8200", "rejected", "A warning about SHD.", "Found, not added: SHD.",
        "harmonic-rig SHD", "12.3 s", "run SHD", "held out", "2026-01-01",
    ):  # fmt: skip
        assert told in page.text, told


def test_a_run_that_the_verdict_does_not_count_is_said_on_top_and_below_the_errors(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "loop", "x")
    assert "of another kind" not in report(folder).text
    views = views_content("x")
    for run in views["runs"]:
        run["counted"] = run["side"] != "held_out"
    names = [run["name"] for run in views["runs"] if not run["counted"]]
    assert names
    (folder / "views.json").write_text(json.dumps(views))
    text = " ".join(report(folder).text.split())
    assert text.count(f"not counting {' and '.join(names)}, of another kind") == 2
    assert f"With {' and '.join(names)}, of another kind, which the verdict does not count." in text


def test_every_plot_names_its_runs(tmp_path: Path) -> None:
    page = report(write_folder(tmp_path / "loop", "SHD"))
    assert page.tags.count("figure") == 4
    assert page.text.count("Held-out runs: run SHD, c") == 4


def test_headings_follow_each_other_and_links_lead_to_them(tmp_path: Path) -> None:
    page = report(write_folder(tmp_path / "loop"))
    ids = {value for name, value in page.attributes if name == "id"}
    links = [value for name, value in page.attributes if name == "href"]
    assert links
    assert {link.removeprefix("#") for link in links} <= ids
    assert page.tags.count("h1") == 1


def names_of_attributes(page: Outline) -> list[str]:
    """Give the names of all attributes; a class may depend on the length of a text."""
    return [name for name, _ in page.attributes if name != "class"]


@pytest.mark.parametrize("name", HOSTILE)
def test_no_name_from_a_file_becomes_markup(tmp_path: Path, name: str) -> None:
    page, plain = report(write_folder(tmp_path / "a", name)), report(write_folder(tmp_path / "b", "plain"))
    assert page.tags == plain.tags
    assert set(page.tags) <= TAGS
    assert names_of_attributes(page) == names_of_attributes(plain)
    assert not any(attribute.startswith("on") or attribute in ("src", "style") for attribute, _ in page.attributes)
    assert all(value.startswith("#") for attribute, value in page.attributes if attribute == "href")


def test_the_page_may_load_nothing(tmp_path: Path) -> None:
    page = report(write_folder(tmp_path / "loop"))
    (policy,) = (value for name, value in page.attributes if name == "content" and "default-src" in value)
    assert policy.startswith("default-src 'none';")
    assert "unsafe" not in policy


def test_what_others_add_to_the_result_is_passed_over_and_what_is_absent_is_left_out(tmp_path: Path) -> None:
    content = loop_content(later={"a": 1})
    content["steps"][0]["later"] = [1]
    del content["steps"][0]["candidates"], content["warnings"], content["elapsed_s"]
    page = report(write_folder(tmp_path / "loop", loop=content))
    assert "Warnings" not in page.text


def test_a_result_without_model_or_plots_is_still_a_report(tmp_path: Path) -> None:
    folder = write_folder(
        tmp_path / "loop", loop={"schema": "rig.loop/1", "verdict": "none"}, views={"schema": "rig.views/1"}
    )
    (folder / "model.json").unlink()
    page = report(folder)
    assert "figure" not in page.tags
    assert "There is no model.json beside the result" in page.text


def test_reports_of_several_folders_go_where_they_are_told(tmp_path: Path) -> None:
    folders = [write_folder(tmp_path / name) for name in ("monday", "tues day<x>")]
    answer = rig("report", *folders, "-o", tmp_path / "out", "--json")
    files = [Path(file) for file in json.loads(answer.stdout)["files"]]
    assert [file.name for file in files] == ["monday.html", "tues_day_x.html"]
    assert all(file.parent == tmp_path / "out" and file.is_file() for file in files)


def test_two_folders_of_one_name_do_not_overwrite_each_other(tmp_path: Path) -> None:
    folders = [write_folder(tmp_path / day / "loop") for day in ("monday", "tuesday")]
    answer = rig("report", *folders, "-o", tmp_path / "out")
    assert [Path(line).name for line in answer.stdout.split()] == ["loop.html", "loop-2.html"]


def broken(folder: Path, file: str, text: str) -> Path:
    (write_folder(folder) / file).write_text(text)
    return folder


WHOLE_VIEWS = json.dumps(views_content())


@pytest.mark.parametrize(
    ("file", "text", "told"),
    [
        ("loop.json", '{"schema": "rig.loop/1", "ver', "is no JSON, or was cut off"),
        ("loop.json", "[1, 2]", "does not say what a report needs"),
        ("loop.json", '{"schema": "rig.loop/2", "verdict": "none"}', "'rig.loop/1'"),
        ("loop.json", '{"schema": "rig.loop/1"}', "verdict"),
        ("loop.json", '{"schema": "rig.loop/1", "verdict": "none", "elapsed_s": NaN}', "NaN is no number"),
        ("loop.json", "[" * 100_000, "is no JSON, or was cut off"),
        ("loop.json", '{"schema": "rig.loop/1", "verdict": "none", "warnings": [1]}', "warnings.0"),
        ("views.json", WHOLE_VIEWS[:-300], "is no JSON, or was cut off"),
        ("views.json", WHOLE_VIEWS.replace("rig.views/1", "rig.views/9"), "rig.views/1"),
        ("model.json", "{}", "schema"),
    ],
)
def test_a_file_that_is_broken_is_named_with_what_is_wrong(tmp_path: Path, file: str, text: str, told: str) -> None:
    answer = rig("report", broken(tmp_path / "loop", file, text))
    assert answer.exit_code == 5
    assert answer.stderr.startswith(f"Data: {tmp_path / 'loop' / file}")
    assert told in answer.stderr
    assert "rig loop" in answer.stderr
    assert answer.stderr.count("\n") == 1
    assert not (tmp_path / "loop" / "report.html").exists()


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"verdict": "proven"}, "verdict = 'proven'"),
        ({"open": [{"verdict": "proven"}]}, "open.0.verdict = 'proven'"),
        ({"verdict": "none"}, "the verdict 'none' contradicts"),
        ({"verdict": "named", "steps": [], "open": []}, "open statements, which make 'none'"),
        ({"verdict": "ambiguous", "open": []}, "open statements, which make 'named'"),
    ],
)
def test_a_verdict_that_is_none_or_that_nothing_bears_out_is_refused(
    tmp_path: Path, changes: dict[str, object], told: str
) -> None:
    answer = rig("report", write_folder(tmp_path / "loop", loop=loop_content(**changes)))
    assert answer.exit_code == 5
    assert answer.stderr.startswith(f"Data: {tmp_path / 'loop' / 'loop.json'}")
    assert told in answer.stderr


def test_a_folder_without_views_is_refused_with_what_writes_them(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "loop")
    (folder / "views.json").unlink()
    answer = rig("report", folder)
    assert answer.exit_code == 5
    assert "there is no views.json" in answer.stderr
    assert "rig loop RUN... -o FOLDER" in answer.stderr


def test_series_of_unequal_length_are_refused(tmp_path: Path) -> None:
    views = views_content()
    views["residuals"][0]["before"].pop()
    answer = rig("report", write_folder(tmp_path / "loop", views=views))
    assert answer.exit_code == 5
    assert "residuals.0" in answer.stderr
    assert "199" in answer.stderr


def test_plots_and_model_of_another_loop_are_refused(tmp_path: Path) -> None:
    views = views_content()
    views["runs"][2]["name"] = "d"
    answer = rig("report", write_folder(tmp_path / "plots", views=views))
    assert answer.exit_code == 5
    assert "views.json" in answer.stderr
    assert "one alone has c among the held-out runs" in " ".join(answer.stderr.split())
    folder = write_folder(tmp_path / "model")
    model = json.loads((folder / "model.json").read_text())
    (folder / "model.json").write_text(json.dumps({**model, "runs": ["b", "another"]}))
    answer = rig("report", folder)
    assert answer.exit_code == 5
    assert "it was fitted to another, which loop.json does not have" in " ".join(answer.stderr.split())


def test_a_folder_with_nothing_to_report_is_refused(tmp_path: Path) -> None:
    for path, told in ((tmp_path, "neither a loop.json nor a log"), (tmp_path / "x", "no such file or folder")):
        answer = rig("report", path)
        assert answer.exit_code == 5
        assert told in answer.stderr
        assert "rig loop RUN... -o FOLDER" in answer.stderr


def test_a_report_that_cannot_be_written_is_wrong_use(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "loop")
    (folder / "report.html").mkdir()
    answer = rig("report", folder)
    assert answer.exit_code == 2
    assert "cannot be written" in answer.stderr


def test_rows_of_what_was_tried_say_their_order_and_one_of_them_was_added(tmp_path: Path) -> None:
    write_folder(tmp_path / "loop", "SHD")
    report(tmp_path / "loop")
    text = (tmp_path / "loop" / "report.html").read_text(encoding="utf-8")
    rows = [part for part in re.findall(r"<tr>.*?</tr>", text) if "order 2" in part]
    words = [re.sub(r"<[^>]+>", "|", part) for part in rows]
    assert [("added" in part, "rejected" in part) for part in words] == [(True, False), (False, True)]
    assert "order 2.5 of motor_position, torsion" in words[1]
    assert "||–||" in words[1]


@pytest.mark.parametrize("name", ["plain", *HOSTILE])
def test_the_report_of_silence_says_what_would_have_been_seen(tmp_path: Path, name: str) -> None:
    silence = {
        "replicates": [
            {"equation": "torsion", "procedure": name, "replicate_pairs": 2, "rho": -0.25, "ljung_box_per_lag": 1.125}
        ],
        "smallest": [
            {"effect": "kinematic-error", "amplitude": 5.1e-7, "unit": "rad"},
            {"effect": name, "amplitude": None, "unit": name},
        ],
    }
    content = loop_content(name, verdict="none", effects=[], steps=[], open=[], none=silence)
    page = report(write_folder(tmp_path / "loop", name, loop=content))
    assert set(page.tags) <= TAGS
    for told in ("What would have been seen", "kinematic-error", "510 nrad", "−0.25", "1.12"):
        assert told in page.text, told

"""The report of a loop: from the statement in one sentence to the provenance."""

from collections.abc import Sequence

from rig.loop.files.views_file import ResidualView
from rig.loop.result import FOUND_NOT_ADDED, MEANINGS
from rig.report.figures import cycle_figure, residual_figure, spectrum_figure
from rig.report.html import NOTHING, Markup, element, joined
from rig.report.loop_file import LoopFile
from rig.report.loop_sections import (
    badge,
    base_table,
    candidates_table,
    device_list,
    errors_table,
    listed_texts,
    next_box,
    next_experiments,
    open_panel,
    replicates_table,
    runs_table,
    smallest_table,
    step_panel,
)
from rig.report.page import page, section
from rig.report.reading import LoopRecord
from rig.report.sentences import floor_remark, listed, not_counting, statement
from rig.terminal import counted

BEFORE_AFTER = (
    "Before is the base model alone, after is base model and effects fitted together. The floor is what noise alone "
    "leaves. In the bars: before (upper), after (lower), the floor's 95 % interval (shaded)."
)
SPECTRUM = (
    "Least squares over the angle (each run with a mean of its own), not over time: what repeats with the angle stands "
    "at the same order at every speed. Each point is the highest amplitude of a small interval of orders."
)
TRIED = (
    "Each class alone, on top of what had been added before. The p-value counts all tests that were made; – where that "
    "bound reaches 1 and says nothing."
)
SEEN = (
    "Nothing was added. An effect of at least the amplitude given here passes the first tests in all but one case of "
    "twenty: no chance at the false-alarm probability asked for, and a large enough share of what is left. Smaller "
    "ones may be there."
)
ZOOM = "Zoom: drag a rectangle, or use the buttons or + and − in a plot; arrows or shift and drag move, 0 shows all."


def loop_page(record: LoopRecord, software: str) -> str:
    """Give the report as the text of an HTML file. `software`: what wrote the report."""
    loop = record.loop
    device = record.model.dut.name if record.model is not None and record.model.dut.name else record.name
    apart = record.views.apart
    sections = {
        "Before and after": ("errors", _errors(loop, apart)),
        "What was added": ("added", _added(loop)),
        "What stays open": ("open", _open(loop)),
        "What would have been seen": ("seen", _seen(loop)),
        "Residual before and after": ("residual", _residuals(record.views.residuals)),
        "Hysteresis loops": ("hysteresis", _cycles(record)),
        "Spectrum over the angle": ("spectrum", _spectra(record)),
        "Parameters of the base model": ("parameters", _base(record)),
        "Tried and rejected": ("tried", _tried(loop)),
        "Warnings": ("warnings", _warnings(loop)),
        "Provenance": ("provenance", _provenance(record, software)),
    }
    present = {heading: (name, content) for heading, (name, content) in sections.items() if content is not None}
    links = [element("li", element("a", heading, href=f"#{name}")) for heading, (name, _) in present.items()]
    body = [
        element("header", _head(loop, apart, device), element("nav", element("ul", *links), aria_label="Sections")),
        element("main", *(section(heading, name, content) for heading, (name, content) in present.items())),
    ]
    return page(f"{device}: {loop.verdict} – loop report", body)


def _head(loop: LoopFile, apart: Sequence[str], device: str) -> Markup:
    nexts = next_experiments(loop)
    box = element("div", element("h3", "Measure next"), *map(next_box, nexts), class_="panel") if nexts else NOTHING
    held = f"{counted(len(loop.runs.train), 'training run')}, {len(loop.runs.held_out)} held out{not_counting(apart)}"
    return joined(
        [
            element("p", f"Loop report, device under test {device} ", badge(loop.verdict)),
            element("h1", statement(loop, apart)),
            element("p", f"{loop.verdict}: {MEANINGS[loop.verdict]}. ", held, ".", class_="soft"),
            box,
        ]
    )


def _errors(loop: LoopFile, apart: Sequence[str]) -> Markup | None:
    held, train = errors_table(loop, "held_out"), errors_table(loop, "train")
    if held is None and train is None:
        return None
    remark = floor_remark(loop)
    fitted = element("details", element("summary", "The same on the fitted runs"), train) if held and train else train
    uncounted = f"With {listed(apart)}, of another kind, which the verdict does not count." if apart else ""
    below = [element("p", text) for text in (uncounted, remark) if text]
    return joined([element("p", BEFORE_AFTER), held, *below, fitted])


def _added(loop: LoopFile) -> Markup:
    if not loop.steps:
        return element("p", "Nothing: no effect of the catalogue and no repeating term passes the tests.")
    return joined(step_panel(number, step) for number, step in enumerate(loop.steps, start=1))


def _open(loop: LoopFile) -> Markup | None:
    units = {name: item.unit for name, item in loop.equations.items()}
    return joined(open_panel(item, units) for item in loop.open) if loop.open else None


def _seen(loop: LoopFile) -> Markup | None:
    if loop.none is None:
        return None
    return joined([element("p", SEEN), smallest_table(loop.none), replicates_table(loop.none)])


def _residuals(views: tuple[ResidualView, ...]) -> Markup:
    if not views:
        return element("p", "No equation of these runs has a residual to show.")
    # what was explained comes first
    ordered = sorted(views, key=lambda view: (not view.effects, view.rms_after / max(view.rms_before, 1e-300)))
    figures = [residual_figure(view, f"residual{number}") for number, view in enumerate(ordered)]
    return joined([element("p", ZOOM, class_="soft tools"), element("div", *figures, class_="figures")])


def _cycles(record: LoopRecord) -> Markup | None:
    figures = [cycle_figure(view, f"cycle{number}") for number, view in enumerate(record.views.cycles)]
    return element("div", *figures, class_="figures") if figures else None


def _spectra(record: LoopRecord) -> Markup | None:
    figures = [spectrum_figure(view, f"spectrum{number}") for number, view in enumerate(record.views.spectra)]
    return joined([element("p", SPECTRUM), element("div", *figures, class_="figures")]) if figures else None


def _base(record: LoopRecord) -> Markup:
    if record.model is None:
        return element("p", "There is no model.json beside the result: the parameters of the base model are not known.")
    shifts = record.loop.steps[-1].shift if record.loop.steps else {}
    return base_table(record.model, shifts)


def _tried(loop: LoopFile) -> Markup:
    tables = [candidates_table(number, step) for number, step in enumerate(loop.steps, start=1)]
    found = listed_texts([text for text in loop.warnings if text.startswith(FOUND_NOT_ADDED)])
    if not any(tables) and found is None:
        return element("p", "Nothing came near enough to be listed.")
    return joined([element("p", TRIED) if any(tables) else None, *tables, found])


def _warnings(loop: LoopFile) -> Markup | None:
    return listed_texts([text for text in loop.warnings if not text.startswith(FOUND_NOT_ADDED)])


def _provenance(record: LoopRecord, software: str) -> Markup:
    terms = {"result": f"folder {record.name}, {record.loop.schema_}"}
    if record.model is not None:
        terms |= {"fitted by": record.model.software, "base model": record.model.base.model}
    if record.loop.elapsed_s is not None:
        terms["time of the loop"] = f"{record.loop.elapsed_s:.1f} s"
    terms["report by"] = software
    listed = [part for name, value in terms.items() for part in (element("dt", name), element("dd", value))]
    return joined(
        [
            element("dl", *listed),
            runs_table(record.views.runs, record.loop),
            joined([element("h3", f"Device file: {record.model.dut.name}"), device_list(record.model)])
            if record.model is not None
            else None,
        ]
    )

"""The frame of a page: head, style, script, and a policy that lets the page load nothing and run this script only."""

import base64
import hashlib
from collections.abc import Sequence
from importlib.resources import files

from rig.report.html import Markup, element, joined

PARTS = files("rig.report")

LONG = 30
"""Letters from which a cell of a table is text that wants some width."""


def page(title: str, body: Sequence[Markup]) -> str:
    """Give the whole file."""
    style, script = _part("style.css"), _part("zoom.js")
    policy = (
        f"default-src 'none'; style-src '{_digest(style)}'; script-src '{_digest(script)}'; base-uri 'none'; "
        "form-action 'none'"
    )
    head = element(
        "head",
        element("meta", charset="utf-8"),
        element("meta", http_equiv="Content-Security-Policy", content=policy),
        element("meta", name_="viewport", content="width=device-width, initial-scale=1"),
        element("title", title),
        element("style", Markup(style)),
    )
    content = element("body", *body, element("script", Markup(script)))
    return "<!doctype html>\n" + element("html", head, content, lang="en").text + "\n"


def section(heading: str, name: str, *children: Markup | None) -> Markup:
    """Give a section with its heading; `name` is where a link leads."""
    return element("section", element("h2", heading, id=name), joined(children))


def table(caption: str, headings: Sequence[str], rows: Sequence[Markup], numbers: frozenset[int]) -> Markup:
    """Give a table that scrolls by itself where the page is narrow. `numbers`: columns that are right-aligned."""
    head = [
        element("th", text, scope="col", class_="number" if place in numbers else None)
        for place, text in enumerate(headings)
    ]
    content = element(
        "table",
        element("caption", caption),
        element("thead", element("tr", *head)),
        element("tbody", *rows),
    )
    return element("div", content, class_="scroll", tabindex=0, role="region", aria_label=caption)


def row(cells: Sequence[Markup | str], numbers: frozenset[int], kind: str | None = None) -> Markup:
    """Give a row whose first cell is its heading."""
    first = element("th", cells[0], scope="row")
    rest = [
        element("td", cell, class_="number" if place in numbers else "long" if _is_long(cell) else None)
        for place, cell in enumerate(cells[1:], start=1)
    ]
    return element("tr", first, *rest, class_=kind)


def _is_long(cell: Markup | str) -> bool:
    return isinstance(cell, str) and len(cell) > LONG


def _digest(text: str) -> str:
    return f"sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}"


def _part(name: str) -> str:
    return (PARTS / name).read_text(encoding="utf-8")

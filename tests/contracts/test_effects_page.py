"""docs/effects.md says of every effect what the registry says: a row for each, cell by cell."""

import inspect
import re
from pathlib import Path

import pytest

from sim_backend.model.effects import CATALOGUE, Effect, Enters

PAGE = Path(__file__).resolve().parents[2] / "docs" / "effects.md"


def rows() -> list[dict[str, str]]:
    """Every row of every table on the page, by heading; a bar in a cell is written `\\|`."""
    found, headings = [], []
    for line in PAGE.read_text("utf-8").splitlines():
        if not line.startswith("|"):
            headings = []
            continue
        cells = [cell.strip().replace(r"\|", "|") for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
        if not headings:
            headings = cells
        elif set(line) - set("|-: "):
            found.append(dict(zip(headings, cells, strict=True)))
    return found


def expected(effect: Effect) -> dict[str, str]:
    def parameter(name: str) -> str:
        (p,) = (p for p in effect.parameters if p.name == name)
        unit = "" if p.unit == "1" else f" {p.unit}"
        return f"{p.name} {p.typical:g}{unit}{' (given)' if p.known else ''}"

    return {
        "id": f"`{effect.id}`",
        "equation": f"`{effect.equation}`",
        "parameters, typical": "; ".join(parameter(p.name) for p in effect.parameters),
        "energy": "" if effect.enters is Enters.READING else str(effect.energy),
        "shows in": ", ".join(effect.shows),
        "taken for": ", ".join(effect.confusable),
        "told apart by": effect.separated_by,
    }


def row_of(effect: Effect) -> str:
    """The row as it belongs on the page, in the column order of the page."""
    return "| " + " | ".join(cell.replace("|", r"\|") for cell in expected(effect).values()) + " |"


@pytest.mark.parametrize("effect", CATALOGUE.values(), ids=CATALOGUE)
def test_the_page_says_of_the_effect_what_the_registry_says(effect: Effect):
    own = [row for row in rows() if row.get("id") == f"`{effect.id}`"]
    assert len(own) == 1, f"docs/effects.md needs one row for {effect.id}:\n{row_of(effect)}"
    for heading, text in expected(effect).items():
        assert own[0].get(heading) == text, f"docs/effects.md, {heading}; the row should begin:\n{row_of(effect)}"


def test_the_page_lists_the_effects_in_the_order_of_where_they_enter():
    named = [row["id"].strip("`") for row in rows() if "id" in row]
    assert named == [effect.id for enters in Enters for effect in CATALOGUE.values() if effect.enters is enters]


def test_every_group_has_its_section():
    sections = re.findall(r"^## (.*)$", PAGE.read_text("utf-8"), flags=re.M)
    for enters in Enters:
        assert any(section.lower() == str(enters) for section in sections), enters


def test_the_page_and_the_effects_files_say_alike_what_the_laws_leave_out():
    listed = {row["effect"]: row["left out"] for row in rows() if "left out" in row}
    said = {}
    for effect in CATALOGUE.values():
        text = " ".join((inspect.getmodule(effect.function).__doc__ or "").split())
        match = re.search(r"Left out: ([^.]*)\.", text)
        if match:
            said[effect.id] = match[1]
    assert listed == said

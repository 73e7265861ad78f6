"""The table of a page in docs/papers, as `rig papers` writes it."""

import re
from pathlib import Path

PAGES = Path(__file__).resolve().parents[3] / "docs/papers"


def rows_of_page(paper: str) -> list[tuple[str, ...]]:
    """Give the cells of every row of the paper's own table, in the order of `report.HEADINGS`, the command bare."""
    lines = PAGES.joinpath(f"{paper}.md").read_text().splitlines()
    rows = [line.removeprefix("| ").removesuffix(" |") for line in lines if line.startswith(f"| {paper} |")]
    return [tuple(cell.strip(" `").replace("\\|", "|") for cell in re.split(r" \| ?", f"{row} ")) for row in rows]


def without_numbers(text: str) -> str:
    """Give a note without the numbers in it."""
    return re.sub(r"[0-9][0-9.]*(e[-+]?[0-9]+)?", "#", text)

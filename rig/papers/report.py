"""Run items and write what they give: figures, and a report as Markdown and JSON."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from rig.papers.item import Grid, Item, Outcome, Row, Value, Workbench
from rig.papers.registry import command, file_name

HEADINGS = ("paper", "item", "quantity", "printed", "obtained", "note", "command")


@dataclass(frozen=True, slots=True)
class Done:
    """An item that was run, with the figures it wrote."""

    item: Item
    outcome: Outcome
    files: tuple[Path, ...]


def run_items(items: Sequence[Item], workbench: Workbench) -> tuple[Done, ...]:
    """Run every item and write its figures into the workbench's folder."""
    done = []
    for item in items:
        workbench.tell(f"{item.paper} {item.what}: {item.title}")
        outcome = item.run(workbench)
        files = []
        for end, figure in outcome.figures.items():
            file = workbench.folder / f"{file_name(item, end)}.png"
            figure.savefig(file, dpi=130)
            files.append(file)
        done.append(Done(item, outcome, tuple(files)))
    return tuple(done)


def write_report(done: Sequence[Done], folder: Path, stem: str = "") -> tuple[Path, Path]:
    """Write `results.json` and `table.md`, of a part `stem`.json and `stem`.md; give both paths."""
    results, table = folder / f"{stem or 'results'}.json", folder / f"{stem or 'table'}.md"
    results.write_text(json.dumps(to_json(done), indent=2, allow_nan=False) + "\n", encoding="utf-8")
    table.write_text(to_markdown(done), encoding="utf-8")
    return results, table


def to_json(done: Sequence[Done]) -> dict[str, object]:
    """Give everything obtained, in full precision and SI units."""
    return {
        "items": [
            {
                "paper": one.item.paper,
                "what": one.item.what,
                "title": one.item.title,
                "rows": [{**asdict(row), "command": command(one.item, row)} for row in one.outcome.rows],
                "tables": [asdict(grid) for grid in one.outcome.grids],
                "figures": [file.name for file in one.files],
            }
            for one in done
        ]
    }


def cells(one: Done, row: Row) -> tuple[str, ...]:
    """Give a row of the table as text, in the order of HEADINGS."""
    quantity = f"{row.quantity} [{row.unit}]" if row.unit else row.quantity
    part = row.item or one.item.what
    figures = shown(row.printed), shown(row.obtained)
    return (one.item.paper, part, quantity, *figures, row.note, command(one.item, row))


def shown(value: Value) -> str:
    """Give a value with as many digits as anyone compares."""
    if value is None:
        return "-"
    return value if isinstance(value, str) else f"{value:.4g}"


def to_markdown(done: Sequence[Done]) -> str:
    """Give all rows as one table in Markdown, further tables and the figures after it."""
    rows = [(*rest, f"`{again}`") for one in done for *rest, again in (cells(one, row) for row in one.outcome.rows)]
    parts = [_markdown_table(HEADINGS, rows)]
    for one in done:
        parts += [f"\n{grid.title}\n\n{_markdown_table(grid.headings, grid.cells)}" for grid in one.outcome.grids]
    parts += [f"\n![{one.item.title}]({file.name})\n" for one in done for file in one.files]
    return "".join(parts)


def grids(done: Sequence[Done]) -> tuple[Grid, ...]:
    """Give the further tables of all items."""
    return tuple(grid for one in done for grid in one.outcome.grids)


def _markdown_table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [headings, ["---"] * len(headings), *rows]
    return "".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |\n" for line in lines)

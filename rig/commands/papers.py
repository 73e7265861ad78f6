"""`rig papers`: reproduce the source papers and set what they print beside what comes out."""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table

from drivers.clock import RealClock
from drivers.errors import ConfigError, Mistake
from rig.log.names import writable_folder
from rig.papers.item import Grid, Workbench
from rig.papers.registry import COMMAND, choose, part, report_stem
from rig.papers.report import HEADINGS, Done, cells, grids, run_items, to_json, write_report
from rig.stages import Stages
from rig.terminal import emit, tell, width_is_known
from rig.wrapping import Wrapped

WIDTH = 120
"""Columns of the tables at most, and where neither a terminal nor COLUMNS says how many there are."""

LONGEST_NUMBER = len("-1.234e-05")
"""Columns that every number of the tables fits in; words may take several lines."""


def papers_command(names: tuple[str, ...], out: Path, quick: bool, as_json: bool) -> None:
    """Run the items, write figures and tables, print the table."""
    items = choose(names)
    writable_folder(out)
    try:
        with Stages(RealClock()) as stage:
            done = run_items(items, Workbench(out, quick=quick, tell=stage))
        written = write_report(done, out, report_stem(names, items))
    except OSError as error:
        raise ConfigError("-o", [Mistake("-o", str(out), f"cannot be written: {error.strerror or error}")]) from error
    if as_json:
        emit(to_json(done))
        return
    console = Console(width=min(Console().width, WIDTH) if width_is_known() else WIDTH)
    console.print(rows_table(done), highlight=False, markup=False)
    for grid in grids(done):
        console.print(grid_table(grid), highlight=False, markup=False)
    for file in (*(file for one in done for file in one.files), *written):
        tell(str(file))


def rows_table(done: Sequence[Done]) -> Table:
    """Give all rows as a table for the terminal; its first column is what `rig papers` runs again."""
    table = Table(box=None, padding=(0, 1), header_style="bold")
    _, _, quantity, printed, obtained, note, _ = HEADINGS
    table.add_column(COMMAND, no_wrap=True)
    table.add_column(quantity, overflow="fold", ratio=1)
    for heading in (printed, obtained):
        table.add_column(heading, overflow="fold", width=LONGEST_NUMBER)
    table.add_column(note, overflow="fold", ratio=1)
    for one in done:
        for row in one.outcome.rows:
            _, _, quantity, printed, obtained, note, _ = cells(one, row)
            table.add_row(part(one.item, row), Wrapped(quantity), printed, obtained, Wrapped(note))
    return table


def grid_table(grid: Grid) -> Table:
    """Give a table of numbers for the terminal: its headings may take several lines, its numbers stay whole."""
    table = Table(title=grid.title, title_justify="left", box=None, padding=(0, 1), header_style="bold")
    for number, heading in enumerate(grid.headings):
        longest = max((len(line[number]) for line in grid.cells), default=0)
        table.add_column(heading, overflow="fold", min_width=longest if number else None)
    for line in grid.cells:
        table.add_row(*line)
    return table

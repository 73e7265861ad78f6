"""`rig papers`: reproduce the source papers and set what they print beside what comes out."""

import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table

from drivers.errors import ConfigError, Mistake
from rig.log.names import writable_folder
from rig.papers.item import Workbench
from rig.papers.registry import choose
from rig.papers.report import HEADINGS, cells, grids, run_items, to_json, write_report
from rig.terminal import emit, tell

WIDTH = 180
"""Columns of the table where it does not go to a terminal."""

ROOM_FOR_COMMANDS = 140
"""Columns from which on the table has the command of each row."""


def papers_command(names: tuple[str, ...], out: Path, quick: bool, as_json: bool) -> None:
    """Run the items, write figures and tables, print the table."""
    items = choose(names)
    writable_folder(out)
    try:
        done = run_items(items, Workbench(out, quick=quick, tell=tell))
        written = write_report(done, out)
    except OSError as error:
        raise ConfigError("-o", [Mistake("-o", str(out), f"cannot be written: {error.strerror or error}")]) from error
    if as_json:
        emit(to_json(done))
        return
    console = Console(width=None if sys.stdout.isatty() else WIDTH)
    table = Table(box=None, padding=(0, 1), header_style="bold")
    # the command begins with the paper; a narrow terminal has the paper and the item, of which it is made
    shown_from, shown_to = (1, None) if console.width >= ROOM_FOR_COMMANDS else (0, -1)
    for heading in HEADINGS[shown_from:shown_to]:
        table.add_column(heading, overflow="fold", no_wrap=heading == HEADINGS[-1])
    for one in done:
        for row in one.outcome.rows:
            table.add_row(*cells(one, row)[shown_from:shown_to])
    console.print(table, highlight=False, markup=False)
    for grid in grids(done):
        shown = Table(title=grid.title, title_justify="left", box=None, padding=(0, 1), header_style="bold")
        for heading in grid.headings:
            shown.add_column(heading, overflow="fold")
        for line in grid.cells:
            shown.add_row(*line)
        console.print(shown, highlight=False, markup=False)
    for file in (*(file for one in done for file in one.files), *written):
        tell(str(file))

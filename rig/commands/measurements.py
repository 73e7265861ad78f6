"""What a run or a procedure measured, as a table for the terminal."""

from collections.abc import Sequence

from rich.markup import escape
from rich.table import Table

from procedures.intents import Measurement


def measurement_table(title: str, measurements: Sequence[Measurement]) -> Table:
    """Give measurements with uncertainty, unit and meaning as a table."""
    table = Table(title=title, title_justify="left", header_style="bold", box=None, padding=(0, 1))
    table.add_column("quantity", no_wrap=True)
    table.add_column("value", justify="right", no_wrap=True)
    table.add_column("±", justify="right", no_wrap=True)
    table.add_column("unit", no_wrap=True)
    table.add_column("meaning")
    for m in measurements:
        spread = f"{m.uncertainty:.2g}" if m.uncertainty is not None else ""
        table.add_row(escape(m.name), f"{m.value:.5g}", spread, escape(m.unit), escape(m.meaning))
    return table

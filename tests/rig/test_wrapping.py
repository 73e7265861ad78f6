"""Text in a narrow column: where words may break."""

import pytest
from rich.console import Console
from rich.table import Table

from rig.wrapping import Wrapped, lines_of

NAME = "see estimation.cubic_from_catalogue"


@pytest.mark.parametrize(
    ("width", "lines"),
    [
        (40, [NAME]),
        (31, ["see", "estimation.cubic_from_catalogue"]),
        (30, ["see estimation.cubic_from_", "catalogue"]),
        (20, ["see estimation.", "cubic_from_catalogue"]),
        (11, ["see", "estimation.", "cubic_from_", "catalogue"]),
        (9, ["see", "estimation.", "cubic_", "from_", "catalogue"]),
    ],
)
def test_a_word_breaks_at_its_dots_and_underscores_only_where_it_is_longer_than_the_line(width, lines):
    assert lines_of(NAME, width) == lines


def test_a_text_without_words_is_an_empty_line():
    assert lines_of("", 10) == [""]


@pytest.mark.parametrize("width", [12, 25, 60])
def test_a_table_keeps_to_its_width(width):
    table = Table.grid()
    table.add_row(Wrapped(NAME))
    console = Console(width=width)
    with console.capture() as capture:
        console.print(table)
    printed = capture.get()
    assert [line.rstrip() for line in printed.splitlines()] == lines_of(NAME, width)

"""Text in a column of a table that breaks a word too long for it behind a dot, underscore, slash or hyphen."""

import re
from collections.abc import Iterator
from typing import final

from rich.cells import cell_len
from rich.console import Console, ConsoleOptions
from rich.measure import Measurement
from rich.text import Text

_PIECE = re.compile(r"[^._/-]*[._/-]+|[^._/-]+")
"""What stays together of a word such as `estimation.cubic_from_catalogue`."""


@final
class Wrapped:
    """A text that is broken at blanks, and within a word only where the word is longer than a line."""

    def __init__(self, text: str) -> None:
        self.text = text

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterator[Text]:
        """Give the lines for the width of the column."""
        for line in lines_of(self.text, options.max_width):
            yield Text(line, overflow="fold")

    def __rich_measure__(self, console: Console, options: ConsoleOptions) -> Measurement:
        """Tell how narrow and how wide the column can well be."""
        pieces = [piece for word in self.text.split() for piece in _PIECE.findall(word)]
        return Measurement(max(map(cell_len, pieces), default=0), cell_len(self.text)).with_maximum(options.max_width)


def lines_of(text: str, width: int) -> list[str]:
    """Give the lines of `width` columns; only a piece of a word that is longer than that makes a longer one."""
    lines = [""]
    for word in text.split():
        pieces = [word] if cell_len(word) <= width else _PIECE.findall(word)
        for number, piece in enumerate(pieces):
            gap = " " if lines[-1] and not number else ""
            if lines[-1] and cell_len(lines[-1] + gap + piece) > width:
                lines.append(piece)
            else:
                lines[-1] += gap + piece
    return lines

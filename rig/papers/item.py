"""One item of a paper: what it printed, what comes out here, and the figures and tables that show it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from matplotlib.figure import Figure

T = TypeVar("T")

Value = float | str | None
"""A number in SI units, a word where there is no number, None where nothing was printed."""

DRAWING, DEFINITION = "drawing", "definition"
"""What is obtained from a picture and from an equation that gives a thing its name."""


@dataclass(frozen=True, slots=True)
class Row:
    """One quantity. `printed` is the paper's figure, `obtained` is computed here; `note` says why they differ.

    Where a part of the paper says nothing that can be computed, `obtained` is DRAWING or DEFINITION.
    item: the part of the paper where it is printed, such as "eq. (31)"; empty for the item's own.
    """

    quantity: str
    printed: Value
    obtained: Value
    unit: str = ""
    note: str = ""
    item: str = ""


@dataclass(frozen=True, slots=True)
class Grid:
    """A table of numbers with two headings, for example plants in rows and models in columns; every cell is text."""

    title: str
    headings: tuple[str, ...]
    cells: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, slots=True)
class Outcome:
    """What an item gives: rows, figures by the end of their file name ("" for the item's only one), and tables."""

    rows: tuple[Row, ...] = ()
    figures: Mapping[str, Figure] = field(default_factory=dict)
    grids: tuple[Grid, ...] = ()


class Workbench:
    """What items work with: whether to be quick, a folder for logs, and results which several items share."""

    def __init__(self, folder: Path, *, quick: bool = False, tell: Callable[[str], None] = lambda _: None) -> None:
        self.folder = folder
        self.quick = quick
        """Take a reduced version of whatever takes long; figures obtained this way are coarser."""
        self.tell = tell
        self._shared: dict[Callable[[Workbench], Any], Any] = {}

    def share(self, work: Callable[["Workbench"], T]) -> T:
        """Give what `work` gives for this workbench; it is done once, however many items ask for it."""
        if work not in self._shared:
            self._shared[work] = work(self)
        given: T = self._shared[work]
        return given


@dataclass(frozen=True, slots=True)
class Item:
    """One item. paper: its short name; what: "Fig. 12", "eq. (31)-(35)", "table 1"; `run` computes it."""

    paper: str
    what: str
    title: str
    run: Callable[[Workbench], Outcome]


def drawing(paper: str, number: int, title: str, note: str = "") -> Item:
    """Give the item of a figure that is a picture; note: where what it shows is to be found."""
    return Item(paper, f"Fig. {number}", title, lambda _: Outcome((Row(title, None, DRAWING, "", note),)))


def definition(equation: int, quantity: str, note: str = "") -> Row:
    """Give the row of an equation that gives a thing its name; note: what is made of it."""
    return Row(quantity, None, DEFINITION, "", note, f"eq. ({equation})")

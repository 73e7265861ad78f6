"""All items of all papers, how a person names them, and the command that runs one again."""

import re
from collections.abc import Sequence
from itertools import pairwise

from drivers.errors import ConfigError, Mistake
from drivers.spelling import did_you_mean
from rig.papers import both, castejon2009, zhang2014
from rig.papers.item import Item, Row
from rig.terminal import shortened

ITEMS: tuple[Item, ...] = (*zhang2014.ITEMS, *castejon2009.ITEMS, *both.ITEMS)

COMMAND = "rig papers"

LONGEST = 4
"""Digits of a number that can be an equation's or a figure's."""

LONGEST_STEM = 100
"""Letters of the names in the name of a report; where there are more, the first is named and the others are counted."""


def choose(names: Sequence[str], items: Sequence[Item] = ITEMS) -> tuple[Item, ...]:
    """Give the items which one of `names` names, in order; all of them for no name.

    A name is a paper ("zhang2014"), an item ("fig. 12"), a number within an item's range ("eq10" of "eq. (7)-(28)"), or
    both ("zhang2014/eq10"), or how one begins ("fig"); case, blanks and marks do not count. Raises ConfigError if a
    name names nothing.
    """
    unknown = [name for name in names if not any(_names(name, item) for item in items)]
    if unknown:
        raise ConfigError("NAME", [Mistake("NAME", shortened(name), _what_there_is(name, items)) for name in unknown])
    return tuple(item for item in items if not names or any(_names(name, item) for name in names))


def file_name(item: Item, end: str = "") -> str:
    """Give the stem of a file that an item writes."""
    words = re.sub(r"[^0-9a-z]+", "-", f"{item.paper} {item.what} {end}".lower())
    return words.strip("-")


def report_stem(names: Sequence[str], chosen: Sequence[Item]) -> str:
    """Give the stem of the report on the items that `names` chose; "" where they are all items there are.

    One part has one stem however it is typed: "Table 1" and "castejon2009/table1" give "castejon2009-table1".
    """
    if tuple(chosen) == ITEMS:
        return ""
    parts = list(dict.fromkeys(_part_stem(name, chosen) for name in names))
    stem = "+".join(parts)
    return stem if len(stem) <= LONGEST_STEM else f"{parts[0]}-and-{len(parts) - 1}-more"


def part(item: Item, row: Row) -> str:
    """Give the name under which a row is computed again, with its item: castejon2009/eq35."""
    return f"{item.paper}/{_short(row.item or item.what)}"


def command(item: Item, row: Row) -> str:
    """Give the command that computes a row again."""
    return f"{COMMAND} {part(item, row)}"


def _what_there_is(name: str, items: Sequence[Item]) -> str:
    """Say what is near to an unknown name, and what its paper has, or every paper where it names none."""
    parts = {paper: _parts(paper, items) for paper in dict.fromkeys(item.paper for item in items)}
    meant = [paper for paper in parts if _without_paper(name, paper) != _words(name)] or list(parts)
    with_paper = "/" in name or len(meant) < len(parts)
    near = [f"{paper}/{part}" if with_paper else part for paper in meant for part in _typed(parts[paper])]
    near += [] if with_paper else parts
    has = "; ".join(f"{paper} has {', '.join(_ranges(parts[paper]))}" for paper in meant)
    return f"unknown{did_you_mean(name, near)}; {has}"


def _parts(paper: str, items: Sequence[Item]) -> list[tuple[str, int | None]]:
    """Give the parts of a paper as kind and number, such as eq 7; what has no number as its name and None."""
    parts: dict[tuple[str, int | None], None] = {}
    for what in (_words(item.what) for item in items if item.paper == paper):
        if len(what) in (2, 3) and all(word.isdecimal() for word in what[1:]):
            parts |= dict.fromkeys((what[0], number) for number in range(int(what[1]), int(what[-1]) + 1))
        else:
            parts[_short(" ".join(what)), None] = None
    return list(parts)


def _typed(parts: Sequence[tuple[str, int | None]]) -> list[str]:
    """Give every part as it is typed."""
    return [kind if number is None else f"{kind}{number}" for kind, number in parts]


def _ranges(parts: Sequence[tuple[str, int | None]]) -> list[str]:
    """Give the parts shortly: "eq1 to eq40", "table1", "table2", "conclusions"."""
    told = []
    for kind in dict.fromkeys(kind for kind, _ in parts):
        numbers = sorted(number for one, number in parts if one == kind and number is not None)
        begins = [k for k, number in enumerate(numbers) if k == 0 or number > numbers[k - 1] + 1]
        for begin, end in pairwise([*begins, len(numbers)]):
            run = [f"{kind}{number}" for number in numbers[begin:end]]
            told += run if len(run) <= 2 else [f"{run[0]} to {run[-1]}"]
        if not numbers:
            told.append(kind)
    return told


def _names(name: str, item: Item) -> bool:
    """Tell whether `name` begins the item's name word by word, a number being a word: fig. 1 is not fig. 12.

    Where the item is a range, numbers within it are names, too.
    """
    if not _words(name):
        return False
    wanted, what = _without_paper(name, item.paper), _words(item.what)
    return wanted == what[: len(wanted)] or _within(wanted, what)


def _without_paper(name: str, paper: str) -> list[str]:
    """Give the words of `name` that follow the paper's name or its beginning, or all where it does not begin so."""
    wanted, words = _words(name), _words(paper)
    if wanted[: len(words)] == words:
        return wanted[len(words) :]
    return [] if wanted == words[: len(wanted)] else wanted


def _part_stem(name: str, items: Sequence[Item]) -> str:
    """Give the papers in which `name` names something, then the part."""
    papers = list(dict.fromkeys(item.paper for item in items if _names(name, item)))
    rest = _short(" ".join(_without_paper(name, papers[0])))
    return "-".join([*papers, *([rest] if rest else [])])


def _within(wanted: list[str], what: list[str]) -> bool:
    """Tell whether `wanted` is a kind and numbers, such as eq 10, within the range `what`, such as eq 7 28."""
    if len(what) != 3 or len(wanted) < 2 or wanted[0] != what[0]:
        return False
    if not all(number.isdecimal() and len(number) <= LONGEST for number in (*wanted[1:], *what[1:])):
        return False
    return all(int(what[1]) <= int(number) <= int(what[2]) for number in wanted[1:])


def _short(what: str) -> str:
    """Give a name to type: eq10, eq7-28, fig12, sec-v-t-fs."""
    return re.sub(r"(?<=[a-z])-(?=[0-9])", "", "-".join(_words(what)))


def _words(text: str) -> list[str]:
    return re.findall(r"[a-z]+|[0-9]+", text.lower())

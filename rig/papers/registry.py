"""All items of all papers, and how a person names them."""

import re
from collections.abc import Sequence

from drivers.errors import ConfigError, Mistake
from rig.papers import both, castejon2009, zhang2014
from rig.papers.item import Item

ITEMS: tuple[Item, ...] = (*zhang2014.ITEMS, *castejon2009.ITEMS, *both.ITEMS)


def choose(names: Sequence[str], items: Sequence[Item] = ITEMS) -> tuple[Item, ...]:
    """Give the items which one of `names` names, in order; all of them for no name.

    A name is a paper ("zhang2014"), an item ("fig. 12", "eq31") or both ("zhang2014/fig12"), or how one begins ("fig");
    case, blanks and marks do not count. Raises ConfigError if a name names nothing.
    """
    unknown = [name for name in names if not any(_names(name, item) for item in items)]
    if unknown:
        known = ", ".join(f"{item.paper}/{''.join(_words(item.what))}" for item in items)
        raise ConfigError("NAME", [Mistake("NAME", name[:60], f"expected one of {known}") for name in unknown])
    return tuple(item for item in items if not names or any(_names(name, item) for name in names))


def file_name(item: Item, end: str = "") -> str:
    """Give the stem of a file that an item writes."""
    words = re.sub(r"[^0-9a-z]+", "-", f"{item.paper} {item.what} {end}".lower())
    return words.strip("-")


def _names(name: str, item: Item) -> bool:
    """Tell whether `name` begins the item's name word by word, a number being a word: fig. 1 is not fig. 12.

    The whole name may be written without a blank between its words, as messages write it.
    """
    wanted, paper, what = _words(name), _words(item.paper), _words(item.what)
    wholes = (paper + what, what)
    begins = bool(wanted) and wanted in (whole[: len(wanted)] for whole in wholes)
    return begins or "".join(wanted) in ("".join(whole) for whole in wholes)


def _words(text: str) -> list[str]:
    return re.findall(r"[a-z]+|[0-9]+", text.lower())

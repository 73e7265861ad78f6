"""Names that a person typed, held against those that there are: what counts in them, and which were meant."""

import difflib
from collections.abc import Iterable

_MOST_NAMED, _SHORTEST_WORD = 3, 3
"""Names in a suggestion, and letters from which a part of a name counts."""

ALIKE, _AS_NEAR = 0.7, 0.02
"""How alike (1: the same) a name must be to be suggested, and by how much less than the one that is most alike."""


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Give ` (did you mean X or Y?)` with the known names that are spelled nearly so or hold the word, else nothing.

    Capitals do not count, nor whether words are joined by a blank, a hyphen or an underscore.
    """
    word, names = folded(name), list(known)
    holding = [each for each in names if len(word) >= _SHORTEST_WORD and word in folded(each)]
    found = list(dict.fromkeys([*near_names(name, names), *holding]))[:_MOST_NAMED]
    return f" (did you mean {' or '.join(found)}?)" if found else ""


def near_names(name: str, known: Iterable[str], least: float = ALIKE) -> list[str]:
    """Give the known names that are most alike `name`, and at least `least` (1: the same); the nearest first."""
    word = folded(name)
    alike = {each: difflib.SequenceMatcher(None, word, folded(each)).ratio() for each in known}
    enough = max(least, max(alike.values(), default=0.0) - _AS_NEAR)
    return sorted((each for each in alike if alike[each] >= enough), key=lambda each: -alike[each])


def folded(name: str) -> str:
    """Give a name without what does not count: capitals, and whether a blank, `_` or `-` joins its words."""
    return name.strip().lower().replace("_", "-").replace(" ", "-")

"""A list whose items stay where the work is done: what is asked of them travels there, and little comes back.

The unit is a run. Results come in the order of the items wherever they were worked out, so that sums over them, and
with them the loop's result, do not depend on where that was.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Concatenate, Generic, ParamSpec, TypeVar

T = TypeVar("T")
R = TypeVar("R")
P = ParamSpec("P")


class Held(ABC, Generic[T]):
    """Items that are worked on where they are. Functions and arguments must be picklable."""

    @abstractmethod
    def map(self, function: Callable[Concatenate[T, P], R], *args: P.args, **kwargs: P.kwargs) -> list[R]:
        """Give `function(item, ...)` of every item."""

    @abstractmethod
    def keep(self, function: Callable[Concatenate[T, P], R], *args: P.args, **kwargs: P.kwargs) -> "Held[R]":
        """Leave `function(item, ...)` of every item where the item is."""

    @abstractmethod
    def spread(
        self, function: Callable[Concatenate[T, P], Iterable[R]], *args: P.args, **kwargs: P.kwargs
    ) -> "Held[R]":
        """Leave all that `function(item, ...)` gives of every item where the item is, one after the other."""

    def gather(self) -> list[T]:
        """Give the items."""
        return self.map(_itself)


def _itself(item: T) -> T:
    return item


class Here(Held[T]):
    """Items of this process."""

    def __init__(self, items: Iterable[T]) -> None:
        self._items = tuple(items)

    def map(self, function: Callable[Concatenate[T, P], R], *args: P.args, **kwargs: P.kwargs) -> list[R]:
        """Give `function(item, ...)` of every item."""
        return [function(item, *args, **kwargs) for item in self._items]

    def keep(self, function: Callable[Concatenate[T, P], R], *args: P.args, **kwargs: P.kwargs) -> Held[R]:
        """Give the results as items."""
        return Here(self.map(function, *args, **kwargs))

    def spread(self, function: Callable[Concatenate[T, P], Iterable[R]], *args: P.args, **kwargs: P.kwargs) -> Held[R]:
        """Give all results as items."""
        return Here(result for results in self.map(function, *args, **kwargs) for result in results)


def shares(sizes: Sequence[float], count: int) -> list[list[int]]:
    """Divide items of these sizes among `count` workers, the largest first to whom has least; none is left empty."""
    load = [0.0] * min(count, len(sizes))
    found: list[list[int]] = [[] for _ in load]
    for item in sorted(range(len(sizes)), key=lambda k: (-sizes[k], k)):
        least = load.index(min(load))
        load[least] += max(sizes[item], 1e-9)
        found[least].append(item)
    return [sorted(share) for share in found]


def in_order(places: Sequence[Sequence[int]], results: Sequence[Sequence[R]]) -> list[R]:
    """Put what the workers gave, each for its `places`, into the order of the items."""
    by_place = {
        place: result
        for share, some in zip(places, results, strict=True)
        for place, result in zip(share, some, strict=True)
    }
    return [by_place[place] for place in sorted(by_place)]


def spread_places(places: Sequence[Sequence[int]], counts: Sequence[Sequence[int]]) -> list[list[int]]:
    """Give the places of what became of every item, of which the workers made `counts` each."""
    made = in_order(places, counts)
    first = [sum(made[:k]) for k in range(len(made))]
    return [[first[place] + k for place in share for k in range(made[place])] for share in places]


def every(items: list[Any], function: Callable[..., Any], args: Any, kwargs: Any) -> list[Any]:
    """Do the work of `map` and `keep` on one share."""
    return [function(item, *args, **kwargs) for item in items]


def lists(items: list[Any], function: Callable[..., Any], args: Any, kwargs: Any) -> list[list[Any]]:
    """Do the first part of `spread` on one share."""
    return [list(function(item, *args, **kwargs)) for item in items]


def counts_of(items: list[list[Any]]) -> list[int]:
    """Give how many results there are of every item."""
    return [len(some) for some in items]


def flat(items: list[list[Any]]) -> list[Any]:
    """Do the last part of `spread` on one share."""
    return [item for some in items for item in some]

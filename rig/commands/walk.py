"""What a dry run went through, as a table for the terminal: runs that go through the same phases in one row."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from rich.markup import escape
from rich.table import Table

from drivers.signals import BY_NAME


@dataclass(frozen=True, slots=True)
class Walk:
    """One run of a dry run: `duration` s, `phases` with their time (s), `margins`: signal, largest size, limit (SI)."""

    name: str
    procedure: str
    set_up: bool
    duration: float
    phases: tuple[tuple[float, str], ...]
    margins: tuple[tuple[str, float, float], ...]


def walk_table(walks: Sequence[Walk]) -> Table:
    """Give the runs; those through the same phases at the same times, and all set-up moves, once with their count."""
    table = Table(title="Dry run: nothing was moved", header_style="bold")
    for heading in ("run", "s", "phases", "largest, with its limit"):
        table.add_column(heading, overflow="fold")
    groups: dict[object, list[Walk]] = {}
    for walk in walks:
        same = "set-up" if walk.set_up else tuple((f"{time:.1f}", text) for time, text in walk.phases)
        groups.setdefault((walk.procedure, same), []).append(walk)
    for group in groups.values():
        first = group[0]
        name = first.name if len(group) == 1 else f"{first.name} and {len(group) - 1} more like it"
        lengths = dict.fromkeys((f"{min(w.duration for w in group):.1f}", f"{max(w.duration for w in group):.1f}"))
        told = ", ".join(f"{text} at {time:.1f}" for time, text in first.phases)
        extremes = ", ".join(f"{n} {v:.4g} of {b:.4g}" for n, v, b in _largest(group))
        table.add_row(escape(name), " to ".join(lengths), escape(told), extremes)
    return table


def nearest_limit(walks: Sequence[Walk]) -> str:
    """Say that all was within the limits, and which signal of which run came nearest to its own."""
    shares = [
        (value / limit, walk.name, name, value, limit)
        for walk in walks
        for name, value, limit in walk.margins
        if math.isfinite(limit) and limit > 0.0
    ]
    if not shares:
        return "All within limits"
    share, run, name, value, limit = max(shares, key=lambda item: item[0])
    unit = BY_NAME[name].unit if name in BY_NAME else "rad/s"  # the load's speed is taken from its positions
    return f"All within limits; nearest: {name} {value:.4g} of {limit:.4g} {unit} ({100.0 * share:.0f} %) in {run}"


def _largest(group: Sequence[Walk]) -> list[tuple[str, float, float]]:
    """Give each signal with its largest size in a group and its limit."""
    found: dict[str, tuple[str, float, float]] = {}
    for walk in group:
        for name, value, limit in walk.margins:
            if name not in found or value > found[name][1]:
                found[name] = (name, value, limit)
    return list(found.values())

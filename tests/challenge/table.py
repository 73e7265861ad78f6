"""The bars with counts, rates and intervals, and what was missed, from the lines of the cases."""

import itertools
import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.challenge.scoring import EXTRA, FAILED, NEAR_ORACLE, NOT_WORSE, RIGHT, can_reach_oracle
from tests.challenge.wilson import FEWEST, Rate
from tests.independent.instruments import NoiseKind

Line = dict[str, Any]

OF_CATALOGUE = ("single", "third", "pair")
"""Families that hide effects of the catalogue in a design that tells them."""

LONGEST = 120
"""Letters of an error that a row repeats."""

FEWEST_INTERVALS = 500
"""Intervals below which nothing is said of how many hold the truth: those of one campaign hang together."""

REACHED = 0.9
"""Share of the wanted size that counts as having it: what the base takes up nearly all of is told apart."""


@dataclass(frozen=True, slots=True)
class Bar:
    """What is to be reached: the share of right ones `least` to `most`."""

    text: str
    rate: Rate
    least: float
    most: float = 1.0
    fewest: int = FEWEST

    @property
    def cells(self) -> tuple[str, ...]:
        """What, bar, count, rate, interval and standing."""
        low, high = self.rate.interval
        bar = f">= {100 * self.least:g} %" if self.most >= 1.0 else f"{100 * self.least:g} to {100 * self.most:g} %"
        count = f"{self.rate.hits} of {self.rate.count}"
        if not self.rate.count:
            return self.text, bar, count, "-", "-", "not run"
        share = f"{100 * self.rate.hits / self.rate.count:.1f} %"
        standing = self.rate.standing(self.least, self.most, self.fewest).value
        return self.text, bar, count, share, f"{100 * low:.1f} to {100 * high:.1f} %", standing


def bars(lines: Sequence[Line]) -> list[Bar]:
    """Give every bar with what was counted for it."""
    large = [line for line in lines if _has_its_size(line)]
    found = [
        Bar("one effect of the floor's size: right, and alone", _rate(_of(large, "single"), _is_right), 0.95),
        Bar("the same, and the headline says no more", _rate(_of(large, "single"), _says_no_more), 0.95),
        Bar("one effect of a third of the floor: right, and alone", _rate(_of(large, "third"), _is_right), 0.90),
        Bar("the same, and the headline says no more (third)", _rate(_of(large, "third"), _says_no_more), 0.90),
        Bar("physics outside the catalogue: variable and shape", _rate(_of(large, "outside"), _describes), 0.90),
        Bar("physics outside the catalogue: held-out error not worse", _rate(_of(lines, "outside"), _not_worse), 0.98),
        Bar(
            "the same, where something was added",
            _rate([line for line in _of(lines, "outside") if line["added"]], _not_worse),
            0.98,
        ),
        Bar("two effects: both found", _rate(_of(large, "pair"), _both), 0.90),
    ]
    for kind in NoiseKind:
        quiet = [line for line in _of(lines, "none") if line["noise"] == kind.value]
        found.append(Bar(f"nothing hidden, {kind.value} noise: silent", _rate(quiet, _is_right), 0.98))
    found.append(Bar("nothing hidden, any noise: silent", _rate(_of(lines, "none"), _is_right), 0.98))
    found.append(Bar("nothing hidden, any noise: nothing added", _rate(_of(lines, "none"), _adds_nothing), 0.98))
    known = [line for line in large if line["family"] in OF_CATALOGUE and can_reach_oracle(line["hidden"])]
    reachable = [*known, *_of(large, "outside")]
    inside = [parameter for line in lines for parameter in line["parameters"]]
    effects = [p for p in inside if p["of"] != "base"]
    base = [p for p in inside if p["of"] == "base"]
    found += [
        Bar("designs that cannot tell: a set that holds the truth", _rate(_of(lines, "ambiguous"), _describes), 0.95),
        Bar(f"held-out error <= {NEAR_ORACLE} x the oracle's, outside included", _rate(reachable, _near_oracle), 0.95),
        Bar("the same, effects of the catalogue alone", _rate(known, _near_oracle), 0.95),
        Bar(f"those, <= {NEAR_ORACLE} x the error of logs without the effect", _rate(known, _near_without), 0.95),
        Bar("95 % intervals that hold the truth, all", _rate(inside, _inside), 0.93, 0.97, FEWEST_INTERVALS),
        Bar("95 % intervals that hold the truth, effects", _rate(effects, _inside), 0.93, 0.97),
        Bar("95 % intervals that hold the truth, base", _rate(base, _inside), 0.93, 0.97),
        Bar("simulated bench, one effect: right, and alone", _rate(_of(large, "bench"), _is_right), 0.95),
    ]
    return found


def report(lines: Sequence[Line]) -> str:
    """Give everything as Markdown: bars, what was missed effect by effect, intervals, what is too small, time."""
    parts = (_answered, _bars, _calls, _by_hidden, _misses, _coverage, _too_small, _seconds)
    return "\n\n".join(text for text in (part(lines) for part in parts) if text) + "\n"


def _answered(lines: Sequence[Line]) -> str:
    """Say which commits the answers are of."""
    counts = Counter(line.get("code") or "unknown" for line in lines)
    return "Answers of " + ", ".join(f"{code} ({count})" for code, count in counts.most_common()) + "." if lines else ""


def _of(lines: Iterable[Line], family: str) -> list[Line]:
    return [line for line in lines if line["family"] == family]


def _rate(items: Sequence[Line], hit: Callable[[Line], bool]) -> Rate:
    return Rate(sum(hit(item) for item in items), len(items))


def _has_its_size(line: Line) -> bool:
    wanted = line["wanted"]
    return wanted is None or all(size >= REACHED * wanted for size in line["sizes"])


def _is_right(line: Line) -> bool:
    return line["naming"] == RIGHT


def _adds_nothing(line: Line) -> bool:
    return line["naming"] != FAILED and not line["added"]


def _describes(line: Line) -> bool:
    """Whether what is hidden is told, or in a set; something that is not there may stand beside it."""
    return line["naming"] in (RIGHT, EXTRA)


def _says_no_more(line: Line) -> bool:
    """Whether a right answer has no headline about something that is not there."""
    events = line["hidden"] == ["encoder-missed-counts"]  # of these nothing more than `uncontrolled` can be said
    return _is_right(line) and (events or line["verdict"] not in ("untraced", "uncontrolled"))


def _both(line: Line) -> bool:
    """Whether each of the two hidden effects is found by a step of its own: one set of both is one finding."""
    one, other = line["hidden"]
    steps = [set(effect.removeprefix("ambiguous:").split("|")) for effect in line["added"]]
    return any(one in a and other in b for a, b in itertools.permutations(steps, 2))


def _not_worse(line: Line) -> bool:
    return line["naming"] != FAILED and all(ratio <= NOT_WORSE for ratio in line["after_over_before"].values())


def _near_oracle(line: Line) -> bool:
    return line["naming"] != FAILED and all(ratio <= NEAR_ORACLE for ratio in line["after_over_oracle"].values())


def _near_without(line: Line) -> bool:
    return line["naming"] != FAILED and all(ratio <= NEAR_ORACLE for ratio in line["after_over_without"].values())


def _inside(parameter: Line) -> bool:
    return bool(parameter["inside"])


def _table(headings: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """Give a Markdown table; nothing where it has no rows."""
    if not rows:
        return ""
    listed = [headings, ["---"] * len(headings), *rows]
    return "\n".join("| " + " | ".join(str(cell).replace("|", "\\|") for cell in row) + " |" for row in listed)


def _bars(lines: Sequence[Line]) -> str:
    headings = ("what", "bar", "count", "rate", "Wilson 95 %", "standing")
    return _table(headings, [bar.cells for bar in bars(lines)])


def _calls(lines: Sequence[Line]) -> str:
    """Give how the answers of every family are called."""
    families = list(dict.fromkeys(line["family"] for line in lines))
    calls = sorted({line["naming"] for line in lines}, key=lambda name: (name != RIGHT, name))
    counts = {family: Counter(line["naming"] for line in _of(lines, family)) for family in families}
    rows = [[family, *(counts[family][name] for name in calls)] for family in families]
    return _table(["family", *calls], rows)


def _by_hidden(lines: Sequence[Line]) -> str:
    """Give right answers by what was hidden, for the families with one hidden thing, where not all are right."""
    families = ("single", "third", "outside", "ambiguous", "bench")
    alone = [line for line in lines if line["family"] in families]
    rows = []
    for name in sorted({line["hidden"][0] for line in alone if line["hidden"]}):
        own = [line for line in alone if line["hidden"] == [name]]
        if not all(_is_right(line) for line in own):
            split = [_of(own, family) for family in families]
            rows.append([name, *(f"{sum(map(_is_right, some))}/{len(some)}" if some else "" for some in split)])
    return _table(["not always right", *families], rows)


def _misses(lines: Sequence[Line]) -> str:
    """Give one row for every answer that is not right, or whose held-out error is too large."""
    rows = []
    for line in lines:
        reachable = line["family"] in (*OF_CATALOGUE, "outside") and can_reach_oracle(line["hidden"])
        above = reachable and not _near_oracle(line)
        if line["naming"] == RIGHT and not above:
            continue
        ratios = line.get("after_over_oracle", {})
        rows.append(
            [
                f"{line['family']} {line['seed']}",
                f"{line['design']}, {line['noise']}",
                ", ".join(line["hidden"]),
                line["naming"],
                ", ".join(line.get("added", [])) or line.get("error", "-")[:LONGEST],
                f"{max(ratios.values()):.2f}" if ratios else "",
            ]
        )
    return _table(("case", "design, noise", "hidden", "called", "added", "after / oracle"), rows)


def _coverage(lines: Sequence[Line]) -> str:
    """Give the intervals by effect and parameter of which any misses the truth, and how far they are off."""
    groups: dict[tuple[str, str], list[Line]] = {}
    for line in lines:
        for item in line["parameters"]:
            groups.setdefault((item["of"], item["name"]), []).append(item)
    rows = []
    for (of, name), items in sorted(groups.items()):
        inside, off = sum(map(_inside, items)), [_half_widths(item) for item in items]
        if inside < len(items):
            rows.append([of, name, f"{inside} of {len(items)}", f"{np.median(off):+.1f}", f"{max(off, key=abs):+.1f}"])
    return _table(("interval of", "parameter", "hold the truth", "half widths off, median", "largest"), rows)


def _half_widths(item: Line) -> float:
    low, high = item["ci95"]
    off = item["value"] - item["truth"]
    if item["name"].startswith("phase"):
        off = math.remainder(off, 2.0 * math.pi)
    return off / max(0.5 * (high - low), 1e-300)


def _too_small(lines: Sequence[Line]) -> str:
    """Give what could not be made as large as wanted, and what came out; it is in no bar about sizes."""
    rows = [
        [
            f"{line['family']} {line['seed']}",
            line["design"],
            ", ".join(line["hidden"]),
            f"{line['wanted']:.2g}",
            ", ".join(f"{size:.2g}" for size in line["sizes"]),
            line["naming"],
        ]
        for line in lines
        if not _has_its_size(line)
    ]
    return _table(("cannot have its size", "design", "hidden", "floors wanted", "floors reached", "called"), rows)


def _seconds(lines: Sequence[Line]) -> str:
    rows = []
    for design in dict.fromkeys(line["design"] for line in lines):
        own = [line for line in lines if line["design"] == design and "seconds" in line]
        if own:
            seconds, samples = [line["seconds"] for line in own], [line["samples"] for line in own]
            rows.append(
                [design, len(own), f"{np.median(samples):.0f}", f"{np.median(seconds):.0f}", f"{max(seconds):.0f}"]
            )
    return _table(("design", "campaigns", "samples, median", "processor seconds, median", "largest"), rows)

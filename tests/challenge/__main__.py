"""Run the blind test, or print the table of what ran: `python -m tests.challenge --help`."""

import argparse
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from rig.outlets import NobodyReads, guard_outlets
from tests.challenge.cases import DEVELOPMENT, FAMILIES, UNSEEN
from tests.challenge.run import lines_in, run_all
from tests.challenge.table import report

COUNTS = {"single": 62, "third": 62, "pair": 24, "outside": 30, "none": 64, "ambiguous": 26, "bench": 8}
"""Cases of each family: two hours on two cores. Without a miss 73 decide a bar of 95 %, 189 one of 98 %: `--scale`."""

SMALL = {"single": 8, "third": 4, "pair": 2, "outside": 4, "none": 8, "ambiguous": 3, "bench": 1}
"""For a quick look, some minutes; far too few for a rate."""


def cases_of(counts: dict[str, int], seeds: range, families: Sequence[str]) -> list[tuple[str, int]]:
    """Give families and seeds, the families mixed, so that an interrupted run has something of each."""
    listed = [((k + 0.5) / counts[f], f, seeds[k]) for f in families for k in range(counts[f])]
    return [(family, seed) for _, family, seed in sorted(listed)]


def _seeds(text: str) -> range:
    first, _, last = text.partition(":")
    return range(int(first), int(last or int(first) + 1))


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.challenge", description=__doc__)
    parser.add_argument("--family", action="append", choices=list(FAMILIES), help="only this one; may be repeated")
    parser.add_argument("--seeds", type=_seeds, help="A:B, seeds from A to B - 1, of every family")
    parser.add_argument("--scale", type=float, default=1.0, help="times the default number of cases")
    parser.add_argument("--small", action="store_true", help="a few of each")
    parser.add_argument("--dev", action="store_true", help="seeds for development")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("-o", "--out", type=Path, default=Path("runs/challenge"))
    parser.add_argument("--table", type=Path, help="only print the table of what is in this folder")
    asked = parser.parse_args()
    if asked.table is None:
        families = asked.family or list(FAMILIES)
        seeds = asked.seeds or (DEVELOPMENT if asked.dev else UNSEEN)
        counts = {
            family: len(seeds)
            if asked.seeds
            else max(1, round(asked.scale * (SMALL if asked.small else COUNTS)[family]))
            for family in families
        }
        run_all(cases_of(counts, seeds, families), asked.out, asked.workers)
    print(report(lines_in(asked.table or asked.out)))


if __name__ == "__main__":
    guard_outlets()
    with suppress(NobodyReads):  # `| head` has read enough
        main()
        sys.stdout.flush()

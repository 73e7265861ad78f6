"""Choose the next experiment: of the menu's runs the one that settles most of what is open per minute of bench time.

A run settles a pair of rivals if it holds enough against the wrong one that the loop would no longer name both: the
loop keeps a rival which explains 90 % of what the best one does, over old and new runs together. More than that is
worth nothing; so a short run that suffices beats a long one that says more.
"""

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, replace

import numpy as np

from rig.config.dut import Dut
from rig.loop.experiment.menu import Offer
from rig.loop.experiment.rivals import Contest, Rival, rival_of
from rig.loop.experiment.separation import Coming, Forecast, apart, forecast, noise_to_come
from rig.loop.fitting.normal import Kind, Noise
from sim_backend.errors import ModelError

LEAST_SQUARES = 25.0
"""Squares (five standard deviations) that a run must hold against a rival, however little there was to explain."""

LEAST_SHARE = 0.2
"""Share of all that the truth explains by which the rival must fall behind: twice what the loop asks for."""

SETTLED = 0.5
"""Share of what is needed from which on a pair counts as told apart: what the loop itself asks for."""

REPEATS = (1, 2, 4)
"""How often a run may be repeated."""


@dataclass(frozen=True, slots=True)
class Plan:
    """An offer with its pieces to come."""

    offer: Offer
    coming: tuple[Coming, ...]


@dataclass(frozen=True, slots=True)
class Choice:
    """The run that was chosen, how often, which pairs it tells apart, and the least of them in standard deviations.

    `others`: pairs that other runs of the menu tell apart.
    """

    offer: Offer
    repeat: int
    pairs: tuple[tuple[str, str], ...]
    sigma: float
    others: frozenset[frozenset[str]] = frozenset()

    @property
    def minutes(self) -> float:
        """Bench time."""
        return self.repeat * self.offer.minutes

    @property
    def command(self) -> str:
        """What to type."""
        return self.offer.command(self.repeat)


def choose(found: Contest, plans: Sequence[Plan], dut: Dut, never: Set[frozenset[str]] = frozenset()) -> Choice | None:
    """Give the best run; None where none tells any two rivals apart. `never`: pairs that only a change by hand does.

    The truth is one of the rivals that the training runs leave in question; those that they refute count only where
    nothing else is left to compare with.
    """
    rivals = found.in_question()
    best: tuple[float, Choice] | None = None
    settled: set[frozenset[str]] = set()
    for plan in plans:
        noise = noise_to_come(found.without, [item.piece for item in plan.coming], dut)
        said = _forecasts((*rivals, rival_of("", found.without)), plan, noise)
        nothing = said.pop("", None)
        if nothing is None:
            continue
        for repeat in REPEATS:
            judged = _judged(found, plan.offer, repeat, said, nothing, never)
            if judged is None:
                continue
            settled |= {frozenset(pair) for pair in judged[1].pairs}
            if best is None or judged[0] > best[0] * (1.0 + 1e-9):
                best = judged
    if best is None:
        return None
    return replace(best[1], others=frozenset(settled - {frozenset(pair) for pair in best[1].pairs}))


def _forecasts(rivals: Iterable[Rival], plan: Plan, noise: Mapping[Kind, Noise]) -> dict[str, Forecast]:
    """Give what each rival says of a planned run; of one with which no drive could go through it nothing."""
    found = {}
    for rival in rivals:
        try:
            found[rival.effect] = forecast(rival, plan.coming, noise)
        except (ModelError, np.linalg.LinAlgError):  # beyond what was recorded it runs away
            continue
    return found


def _judged(
    found: Contest,
    offer: Offer,
    repeat: int,
    said: Mapping[str, Forecast],
    nothing: Forecast,
    never: Set[frozenset[str]],
) -> tuple[float, Choice] | None:
    """Give how much of what is open the run settles per minute; None where it settles nothing."""
    shares, squares = [], {}
    for truth, tested in itertools.permutations(said, 2):
        if frozenset((truth, tested)) in never:
            continue
        held = apart(said[truth], said[tested], repeat)
        if not math.isfinite(held):
            continue
        needed = max(LEAST_SQUARES, LEAST_SHARE * (found.gain(truth) + apart(said[truth], nothing, repeat)))
        shares.append(min(1.0, held / needed))
        if shares[-1] >= SETTLED:
            squares[truth, tested] = held
    both = {pair: min(held, squares[pair[::-1]]) for pair, held in squares.items() if pair[::-1] in squares}
    if not both:
        return None
    pairs = tuple(sorted(pair for pair in both if pair[0] < pair[1]))
    rate = sum(shares) / len(shares) / (repeat * offer.minutes)
    return rate, Choice(offer, repeat, pairs, math.sqrt(min(both.values())))

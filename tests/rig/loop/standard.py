"""What the standard campaign establishes of one effect of the catalogue: the loop's answer beside what was hidden.

Run as a module it goes through the catalogue and prints a table; the control without an effect is called `none`:
`python -m tests.rig.loop.standard [--seed N] [--noise KIND] [ID...]`.
"""

import argparse
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rig.loop.campaign import LoopOptions
from rig.loop.result import LoopResult, Verdict
from rig.loop.trace import trace
from sim_backend.model.effects import CATALOGUE, Enters
from tests.independent.campaign import STANDARD, Campaign
from tests.independent.effects import Effects, draw
from tests.independent.instruments import Instruments, NoiseKind
from tests.rig.loop.runs import dut, runs_of

RATE = 100.0
"""Samples a second."""

CONTROL = "none"
"""In place of an id: a campaign in which nothing is hidden."""

FREE_OF_PERIOD = frozenset({"phase"})


@dataclass(frozen=True, slots=True)
class Outcome:
    """One campaign: what was hidden, how the loop answered, and by how many half widths each parameter is off."""

    effect: str
    hidden: Mapping[str, float]
    result: LoopResult
    off: Mapping[str, float]

    @property
    def answer(self) -> str:
        """`named`, `named, and more`, `ambiguous`, `absorbed`, `wrong`, `uncontrolled`, `untraced` or `none`."""
        found = self.result.effects
        if self.effect in found:
            return "named" if len(found) == 1 else "named, and more"
        if any(self.effect in name.removeprefix("ambiguous:").split("|") for name in found):
            return "ambiguous" if len(found) == 1 else "ambiguous, and more"
        if found:
            return "wrong"
        groups = [item for item in self.result.open if item.verdict is Verdict.ABSORBED and self.effect in item.group]
        if groups:
            return "absorbed"
        if self.result.verdict is Verdict.UNCONTROLLED:
            return "uncontrolled"
        return "untraced" if self.result.open else "none"


def hidden_effects() -> tuple[str, ...]:
    """Give the ids that are no terms of the base model."""
    return tuple(effect.id for effect in CATALOGUE.values() if effect.enters is not Enters.BASE)


def establish(effect: str, seed: int, noise: NoiseKind = NoiseKind.WHITE) -> Outcome:
    """Record the standard campaign with the effect, drawn from `seed`, and let the loop trace it."""
    drawn = Effects() if effect == CONTROL else draw(effect, np.random.default_rng(seed))
    campaign = Campaign(seed, effects=drawn, instruments=Instruments(noise=noise), plan=STANDARD, rate=RATE)
    runs, held_out = runs_of(campaign)
    result = trace(runs, dut(), LoopOptions(held_out=held_out))
    hidden = {} if effect == CONTROL else _hidden(drawn, effect)
    step = next((item for item in result.steps if item.effect == effect), None)
    if step is not None and effect == "torque-sensor-nonlinearity":
        # the loop does not know the transducer's full scale and takes the campaign's largest torque
        shrunk = step.parameters["full_scale"].value / hidden["full_scale"]
        hidden = {"even": hidden["even"] * shrunk**2, "odd": hidden["odd"] * shrunk**3}
    off = {}
    for name, value in hidden.items():
        estimate = None if step is None else step.parameters.get(name)
        if estimate is not None and estimate.ci95 is not None:
            miss = estimate.value - value
            if name in FREE_OF_PERIOD:
                miss = math.remainder(miss, 2.0 * math.pi)
            off[name] = miss / max(0.5 * (estimate.ci95[1] - estimate.ci95[0]), 1e-300)
    return Outcome(effect, hidden, result, off)


def _hidden(drawn: Effects, effect: str) -> dict[str, float]:
    """Give the parameters of the largest instance of the effect."""
    return max((dict(values) for values in drawn.of(effect)), key=lambda values: abs(values.get("amplitude", 0.0)))


def main() -> None:
    """Print one line for every effect."""
    parser = argparse.ArgumentParser(prog="python -m tests.rig.loop.standard")
    parser.add_argument("--seed", type=int, default=8)
    parser.add_argument("--noise", type=NoiseKind, choices=list(NoiseKind), default=NoiseKind.WHITE)
    parser.add_argument("effects", nargs="*", default=hidden_effects())
    asked = parser.parse_args()
    for effect in asked.effects:
        outcome = establish(effect, asked.seed, asked.noise)
        off = ", ".join(f"{name} {value:+.1f}" for name, value in outcome.off.items())
        found = ", ".join(outcome.result.effects) or "-"
        print(f"{effect} | {outcome.answer} | {found} | {off} | {outcome.result.elapsed:.0f} s", flush=True)


if __name__ == "__main__":
    main()

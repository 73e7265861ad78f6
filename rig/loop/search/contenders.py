"""Which of several effects that explain nearly as much explains most once everything is fitted again with it.

A large effect that is missing bends the base model, and then the gain of a linearised trial favours whatever resembles
the bent model's residual. The contenders are compared by their own joint fits instead.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

from rig.loop.fitting.fit import Fit, fit, settled
from rig.loop.fitting.normal import noise_of
from rig.loop.model.equations import Piece
from rig.loop.search.acceptance import LARGE_SHARE
from rig.loop.search.shape_trials import ShapeTrial
from rig.loop.search.trial import Ground
from rig.loop.workers.held import Held

CONTENDS = 0.3
"""Share of the best gain from which on an effect is fitted before it is compared."""

MOST = 4
"""Effects that are fitted at most."""

PASSES = 10
"""Passes of a fit at most."""


def by_joint_fit(few: Held[Piece], ground: Ground, trials: Sequence[ShapeTrial], alpha: float) -> list[ShapeTrial]:
    """Order the contenders among `trials` by how far a joint fit with each lowers the residual; gains follow suit.

    The best contender gets the largest linearised gain among them, the others their share of it. As logarithms of the
    ratio of squares are compared, equation by equation, what removes nearly everything beats what removes most.
    `few`: the pieces with few samples. Nothing is fitted where all may be chance at the false-alarm rate `alpha`, and
    none is large.
    """
    if not any(item.trial.single_p * item.tests <= alpha or item.trial.share >= LARGE_SHARE for item in trials):
        return list(trials)
    most = max((item.trial.gain for item in trials), default=0.0)
    close = [item for item in trials if item.trial.gain >= CONTENDS * most][:MOST]
    if len(close) < 2:
        return list(trials)
    before = fit(few, ground.fit.model, ground.fit.noise, passes=PASSES, block=ground.fit.block)
    gained = [explained_by(before, _with(few, ground.fit, item)) for item in close]
    best = max(gained)
    if best <= 0.0:
        return list(trials)
    largest = max(item.trial.gain for item in close)
    compared = [
        replace(item, trial=replace(item.trial, gain=largest * max(share, 0.0) / best))
        for item, share in zip(close, gained, strict=True)
    ]
    rest = [item for item in trials if all(item is not other for other in close)]
    return sorted([*compared, *rest], key=lambda item: -item.trial.gain)


def _with(pieces: Held[Piece], ground: Fit, item: ShapeTrial) -> Fit:
    """Fit the contender with everything else; weights follow the residual."""
    model = replace(ground.model, shapes=(*ground.model.shapes, item.term))
    return settled(pieces, fit(pieces, model, ground.noise, passes=PASSES, block=ground.block), PASSES)


def explained_by(before: Fit, after: Fit) -> float:
    """Give how much less a fit leaves than another, below 0 where it leaves more.

    The sum of weighted squares times the logarithm of the ratio of squares, over the kinds of piece.
    """
    total = 0.0
    was, now = noise_of(before.about, before.linear), noise_of(after.about, after.linear)
    for kind, noise in was.items():
        squares = sum(
            part.squares for known, part in zip(before.about, before.parts, strict=True) if known.kind == kind
        )
        total += 2.0 * squares * math.log(noise.sigma / now[kind].sigma)
    return total

"""What a significant term must fulfil besides before it is added; training runs only."""

import numpy as np

from rig.loop.fitting.fit import Fit, with_noise
from rig.loop.fitting.normal import joined
from rig.loop.search.trial import Trial

FAMILIES = 4.0
"""Sorts of terms that share the false alarms alike, however many are tried of each: lines of free order, lines of fixed
order, other effects of the catalogue, curves. A class without a free order need not pay for the search of orders."""

LEAST_SHARE = 0.01
"""Share of an equation's squares below which a line is detected but not worth adding."""

LEAST_SHAPE_SHARE = 0.03
"""The same for an effect that is no line: a smoothed torque leaves a per cent of what follows it."""

LEAST_CURVE_SHARE = 0.1
"""The same for a shape without a name, which bends to whatever a law leaves, and for a line over the time."""

BESIDE_BENT_SHARE = 0.5
"""The same for a shape without a name where the output torque's reading errs: a sweep that is bent or late is followed
by straight pieces, and what that leaves, far below the noise of single samples, is no effect of its own."""

LARGE_SHARE = 0.1
"""Share of an equation's squares that is looked at again with shorter blocks: a slow, strong line looks like memory."""

LEAST_IMPROVED = 0.6
"""Share of the runs carrying the term that must be predicted better from the others."""

CHANGED, FEWEST_CHANGED = 0.2, 2
"""Share of the mean change of a run's squares from which on a term counts as acting in the run, and runs in which it
must."""

MOST_CLASSES = 3
"""Different terms that are added at most."""

BEST_SHARE = 0.95
"""Share of the best gain with which a name of the catalogue wins."""

COMPANION_SHARE, MOST_COMPANIONS = 0.1, 2
"""Share of a candidate's gain from which on another may be needed to see that it is there, and how many are tried."""

QUICK = 6
"""Passes of a fit that only tells whether a candidate is worth a whole one."""

NOT_EVERYWHERE = "it does not show under every condition that should show it"


def objection(share: float, least: float, *, room: bool) -> str:
    """Say why a significant term is not added, whatever the other runs say; empty if it may be.

    `share`: of the squares that it explains; `least`: below which it is not worth adding.
    """
    if not room:
        return f"more than {MOST_CLASSES} different terms"
    if share < least:
        return f"it explains {100 * share:.2g} % of the squares, less than {100 * least:.0f} %"
    return ""


def unpaid_by(trial: Trial) -> str:
    """Say that a line does not pay when runs are left out; empty if it does."""
    if trial.improved < LEAST_IMPROVED:
        return f"it improves {100 * trial.improved:.0f} % of the runs when they are left out"
    return "it makes the runs worse when they are left out, taken together" if trial.pays <= 0.0 else ""


def pays_jointly(before: Fit, joint: Fit, *, replicates_together: bool = False) -> bool:
    """Whether a refitted term pays in leave-one-run-out, both sides weighted alike.

    In the runs that it changes: where it does not act, chance decides which of both predicts a run better.
    `replicates_together`: they are left out as one, for what hardly changes within a run and is alike in them.
    """
    null = with_noise(before, joint.noise)
    sums = [null.normal, joint.normal]
    if replicates_together:
        names = {known.run: known.condition for known in joint.about}
        sums = [joined(one, [names[run] for run in one.runs]) for one in sums]
    without = sums[0].leave_one_out(null.prior, null.pull)
    left = sums[1].leave_one_out(joint.prior, joint.pull)
    changed = np.abs(left - without) >= CHANGED * np.mean(np.abs(left - without))
    if changed.sum() < FEWEST_CHANGED or left.sum() >= without.sum():
        return False
    return bool(np.mean(left[changed] < without[changed]) >= LEAST_IMPROVED)

"""Operators that several effects share: what an effect's function may call besides `math` and builtins.

Scalar code; the generated modules hold the source of those which their effects use.
"""

import math


def lag(lagging: float, before: float, now: float, step: float, time_constant: float) -> float:
    """Give what lags behind a signal, tau dx/dt + x = u, one `step` (s) on: exact where the signal runs straight.

    lagging: x before the step. before, now: the signal at both ends of it. time_constant: s; 0: the signal itself.
    """
    if time_constant <= 0.0:
        return now
    part = step / time_constant
    settled = -math.expm1(-part)
    return lagging + (settled * (before - lagging) + (1.0 - settled / part) * (now - before))


def play(before: float, now: float, radius: float) -> float:
    """Give the play that was at `before` when its input comes to `now`: it follows at a distance of up to `radius`."""
    return min(max(before, now - radius), now + radius)

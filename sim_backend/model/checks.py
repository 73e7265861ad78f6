"""Checks of numbers that a model is made of: possible or refused with the equation that needs them."""

import math

from sim_backend.errors import ModelError


def require(
    name: str,
    value: float,
    unit: str,
    equation: str,
    *,
    low: float = -math.inf,
    above: float = -math.inf,
    high: float = math.inf,
) -> None:
    """Raise ModelError unless `value` is finite, >= low, > above and <= high; `equation` says what needs it."""
    if math.isfinite(value) and above < value and low <= value <= high:
        return
    wanted = f"at least {low:g}" if math.isfinite(low) else f"above {above:g}" if math.isfinite(above) else "finite"
    if math.isfinite(high):
        wanted += f" and at most {high:g}"
    shown, bounds = f"{name} = {value!r} {unit}".rstrip(), f"{wanted} {unit}".rstrip()
    raise ModelError(f"{shown} is not possible: it must be {bounds}; {equation} needs it.")

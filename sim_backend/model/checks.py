"""Checks of numbers that a model is made of: possible or refused with the equation that needs them."""

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

from sim_backend.errors import ParameterError


def require(
    name: str,
    value: float,
    unit: str,
    equation: str,
    *,
    low: float = -math.inf,
    above: float = -math.inf,
    high: float = math.inf,
    below: float = math.inf,
) -> None:
    """Raise ParameterError unless `value` is finite, >= low, > above, <= high, < below; `equation` needs it."""
    if math.isfinite(value) and above < value < below and low <= value <= high:
        return
    limits = (("at least", low), ("above", above), ("at most", high), ("below", below))
    wanted = [f"{word} {limit:.6g}" for word, limit in limits if math.isfinite(limit)]
    bounds = f"{_listed(wanted)} {unit}".rstrip() if wanted else "finite"
    if not math.isfinite(value) and wanted:
        bounds = f"finite{', ' if len(wanted) > 1 else ' and '}{bounds}"
    raise ParameterError(name, value, unit, f"must be {bounds}; {equation} needs it")


def require_all(
    name: str, values: "ArrayLike", unit: str, equation: str, *, low: float = -math.inf, above: float = -math.inf
) -> None:
    """Raise ParameterError as `require` for the first of `values` that is not possible, with its place if any."""
    import numpy as np  # heavy, and single numbers do without it

    array = np.asarray(values, dtype=np.float64)
    wrong = ~(np.isfinite(array) & (array >= low) & (array > above))
    if not wrong.any():
        return
    place = tuple(int(index) for index in np.argwhere(wrong)[0])
    at = f"[{', '.join(map(str, place))}]" if place else ""
    require(f"{name}{at}", float(array[place]), unit, equation, low=low, above=above)


def _listed(words: list[str]) -> str:
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)

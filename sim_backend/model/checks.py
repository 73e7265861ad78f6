"""Checks of numbers that a model is made of: possible or refused with the equation that needs them."""

import math
import sys
from collections.abc import Sequence
from numbers import Real
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

from sim_backend.errors import ModelError, ParameterError, shown


def is_series(values: object) -> bool:
    """Tell whether these are several values, such as a tuple, a list or a numpy array, and no text or bytes."""
    if isinstance(values, str | bytes | bytearray | memoryview):
        return False
    return isinstance(values, Sequence) or getattr(values, "ndim", 0) > 0


def require(
    name: str,
    value: object,
    unit: str,
    equation: str,
    *,
    low: float = -math.inf,
    above: float = -math.inf,
    high: float = math.inf,
    below: float = math.inf,
) -> None:
    """Raise ModelError unless `value` is a number, finite, >= low, > above, <= high, < below; `equation` needs it.

    What is a number but none of these is a ParameterError.
    """
    number = _number_of(value)
    if number is not None and math.isfinite(number) and above < number < below and low <= number <= high:
        return
    too_large = number is not None and math.isinf(number) and value != number  # finite, but for no float
    # where the caller sets no bound on that side, the largest float is one
    if too_large and number == min(high, below):
        high = sys.float_info.max
    elif too_large and number == max(low, above):
        low = -sys.float_info.max
    limits = (("at least", low), ("above", above), ("at most", high), ("below", below))
    wanted = [f"{word} {limit:.6g}" for word, limit in limits if math.isfinite(limit)]
    bounds = f"{_listed(wanted)} {unit}".rstrip() if wanted else "finite"
    if number is None:
        what = f"{name} = {shown(value)} is no number: it must be one, {bounds}"
        raise ModelError(f"{what if wanted else f'{what} {unit}'.rstrip()}; {equation} needs it.")
    if not (math.isfinite(number) or too_large) and wanted:
        bounds = f"finite{', ' if len(wanted) > 1 else ' and '}{bounds}"
    raise ParameterError(name, value, unit, f"must be {bounds}; {equation} needs it")


def require_all(
    name: str,
    values: "ArrayLike",
    unit: str,
    equation: str,
    *,
    low: float = -math.inf,
    above: float = -math.inf,
    high: float = math.inf,
) -> None:
    """Raise ModelError as `require` for the first of `values` that is not possible, with its place if any."""
    import numpy as np  # heavy, and single numbers do without it

    try:
        array = np.asarray(values)
        if array.dtype == np.float64 and array.size:
            least, most = float(array.min()), float(array.max())  # either is not finite where one value is not
            if math.isfinite(least) and math.isfinite(most) and above < least and low <= least and most <= high:
                return
        if array.dtype.kind in "fiu":
            array = array.astype(np.float64)
            wrong = ~(np.isfinite(array) & (array >= low) & (array > above) & (array <= high))
        else:  # among them something that is no number, or an integer too large for an array: each as it was given
            array = np.array(values, dtype=np.object_)
            wrong = np.ones(array.shape, dtype=np.bool_)
    except ValueError:
        what = f"{name} = {shown(values)} is no series of numbers: it must be rows of one length"
        raise ModelError(f"{what}, {unit}".rstrip(", ") + f"; {equation} needs it.") from None
    for place in np.argwhere(wrong).tolist():
        at = f"[{', '.join(map(str, place))}]" if place else ""
        require(f"{name}{at}", array.item(*place), unit, equation, low=low, above=above, high=high)


def _number_of(value: object) -> float | None:
    """Give a number as a float, infinite where it is too large for one; None for anything else, and for True."""
    if isinstance(value, bool) or not isinstance(value, Real):
        return None
    try:
        return float(value)
    except OverflowError:
        return -math.inf if value < 0 else math.inf


def _listed(words: list[str]) -> str:
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)

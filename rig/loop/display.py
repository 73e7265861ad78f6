"""How numbers of the loop are shown to people: units of errors, intervals, labels of axes."""

import math
from collections.abc import Mapping
from types import MappingProxyType

SCALES: Mapping[str, tuple[str, float]] = MappingProxyType(
    {"rad": ("urad", 1e6), "N*m": ("mN*m", 1e3), "A": ("mA", 1e3)}
)
"""Units in which errors are shown, with what one SI unit is in them; files keep SI."""

MOST_DIGITS = 15
"""Decimal digits that a 64-bit number holds whatever its value."""

MOST_SHOWN = 7
"""Digits of a value that a table shows at most."""


def interval_text(low: float, high: float, digits: int = 3) -> str:
    """Give an interval with at least so many significant digits, up to 15 where its ends differ in later ones.

    The width shows with two digits or more.
    """
    largest, width = max(abs(low), abs(high)), abs(high - low)
    if width > 0.0 and math.isfinite(largest):
        digits = max(digits, math.floor(math.log10(largest)) - math.floor(math.log10(width)) + 2)
    digits = min(digits, MOST_DIGITS)
    return f"{low:.{digits}g} to {high:.{digits}g}"


def rounded(value: float, half: float) -> str:
    """Give a value to two digits of its half width: at least two digits, and 7 at most or without a width."""
    digits = MOST_SHOWN
    if half > 0.0 and math.isfinite(half) and value != 0.0:
        digits = math.floor(math.log10(abs(value))) - math.floor(math.log10(half)) + 2
    return f"{value:.{min(max(digits, 2), MOST_SHOWN)}g}"


def axis_label(variable: str, unit: str, order: float | None) -> str:
    """Give the label of an axis that shows a variable, folded into a turn or a part of one where `order` is given."""
    shown = f"{variable} [{unit}]" if unit else variable
    if order is None:
        return shown
    return f"{shown}, within {'a turn' if order == 1.0 else f'1/{order:.6g} of a turn'}"

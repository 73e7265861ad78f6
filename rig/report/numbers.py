"""Numbers and units as a reader wants them: prefixes instead of exponents, as many digits as the interval allows."""

import math
from dataclasses import dataclass

from rig.loop.display import MOST_DIGITS, SCALES
from rig.report.loop_file import Pair

UNKNOWN = "–"
"""Stands where a value is not known."""

LARGEST_PLAIN, SMALLEST_PLAIN, MOST_DECIMALS = 1e7, 1e-3, 9
"""Sizes and decimals beyond which a number is written with an exponent."""

_PREFIXES = ((1.0, ""), (1e3, "m"), (1e6, "µ"), (1e9, "n"))
_PREFIXED = ("rad", "N*m", "A")
_PLAIN = frozenset({"phase"})
"""Parameters that are compared in whole units, however small they are."""


def unit_text(unit: str) -> str:
    """Give a unit as it is printed: µrad, N·m, kg·m²; a pure number has none."""
    text = unit.replace("urad", "µrad").replace("*", "·").replace("^2", "²").replace("^-1", "⁻¹")
    return "" if text == "1" else text.replace("degC", "°C")


def error_scale(unit: str) -> tuple[str, float]:
    """Give the unit in which errors are shown, and how much of it one SI unit is."""
    shown, scale = SCALES.get(unit, (unit, 1.0))
    return unit_text(shown), scale


def scaled(value: float | None, scale: float, digits: int = 4) -> str:
    """Give a value times a scale with so many significant digits."""
    return UNKNOWN if value is None else signed(significant(value * scale, digits))


def significant(number: float, digits: int) -> str:
    """Give a number with so many significant digits, without an exponent as long as it is below ten million."""
    text = f"{number:.{digits}g}"
    return f"{float(text):.0f}" if "e+0" in text and abs(number) < LARGEST_PLAIN else text


def prefix_of(name: str, size: float, unit: str) -> tuple[str, float]:
    """Give the unit with the prefix in which a value of this size reads best, and how much of it one SI unit is."""
    if unit in _PREFIXED and name.split("_")[0] not in _PLAIN:
        for scale, prefix in _PREFIXES:
            if abs(size) * scale >= 1.0:
                return prefix + unit_text(unit), scale
    return unit_text(unit), 1.0


@dataclass(frozen=True, slots=True)
class Shown:
    """How an estimate is printed: in which unit, how much of it one SI unit is, with how many decimals.

    `decimals` None: seven digits, whatever they are.
    """

    unit: str
    scale: float
    decimals: int | None

    def text(self, value: float | None) -> str:
        """Give a value in SI as it is printed."""
        if value is None:
            return UNKNOWN
        number = value * self.scale
        if self.decimals is None:
            return signed(f"{number:.7g}")
        if number == 0.0 or (SMALLEST_PLAIN <= abs(number) < LARGEST_PLAIN and self.decimals <= MOST_DECIMALS):
            return signed(f"{round(number, self.decimals) + 0.0:.{max(self.decimals, 0)}f}")
        digits = math.floor(math.log10(abs(number))) + 1 + self.decimals
        return signed(f"{number:.{min(max(digits, 1), MOST_DIGITS)}g}")


def shown_as(name: str, value: float | None, ci95: Pair | None, unit: str) -> Shown:
    """Say how an estimate is printed: to the second digit of the half width of its interval."""
    low, high = ci95 or (None, None)
    if value is None or low is None or high is None or not high > low:
        return Shown(*prefix_of(name, value or 0.0, unit), decimals=None)
    half = 0.5 * (high - low)
    shown, scale = prefix_of(name, max(abs(value), half), unit)
    return Shown(shown, scale, decimals=1 - math.floor(math.log10(half * scale)))


def interval_in(shown: Shown, ci95: Pair | None) -> str:
    """Give an interval as its estimate is printed."""
    if ci95 is None or ci95[0] is None or ci95[1] is None:
        return UNKNOWN
    return f"{shown.text(ci95[0])} to {shown.text(ci95[1])}"


def signed(text: str) -> str:
    """Give numbers with the sign that is as wide as a plus."""
    return text.replace("-", "−")


def probability_text(p: float | None) -> str:
    """Give a probability with one digit; what a number cannot hold is below 1e-300."""
    if p is None:
        return UNKNOWN
    return "< 1e-300" if p < 1e-300 else f"{p:.1g}"


def change_text(before: float | None, after: float | None) -> str:
    """Give how much of an error was removed, in %; a minus where it grew."""
    if before is None or after is None or before <= 0.0:
        return UNKNOWN
    return signed(f"{round(100.0 * (1.0 - after / before), 1) + 0.0:g} %")

"""A rate from a count, with Wilson's interval: E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209-212."""

import math
from dataclasses import dataclass
from enum import StrEnum

Z = 1.959963984540054
"""Standard deviations of a normal variable between which it lies with 95 %."""

FEWEST = 10
"""Counted cases below which nothing is said: Wilson's interval of a few is too narrow on the far side."""


class Standing(StrEnum):
    """What a count says of a bar: the whole interval is on one side of it, or it is not."""

    MET = "met"
    NOT_MET = "not met"
    UNDECIDED = "undecided"


@dataclass(frozen=True, slots=True)
class Rate:
    """`hits` of `count`."""

    hits: int
    count: int

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's 95 % interval of the rate; everything where nothing was counted."""
        n = self.count
        if not n:
            return 0.0, 1.0
        p, z2 = self.hits / n, Z * Z
        centre = (p + z2 / (2 * n)) / (1 + z2 / n)
        half = Z / (1 + z2 / n) * math.sqrt(p * (1 - p) / n + z2 / (4 * n * n))
        return max(0.0, centre - half), min(1.0, centre + half)

    def standing(self, least: float, most: float = 1.0, fewest: int = FEWEST) -> Standing:
        """Give whether the rate lies between two bars, beside them, or whether the count cannot tell.

        `fewest`: count below which nothing is said.
        """
        low, high = self.interval
        if self.count < fewest:
            return Standing.UNDECIDED
        if high < least or low > most:
            return Standing.NOT_MET
        # a rate that is to be at least something has no upper bar to keep clear of
        if low >= least and (most >= 1.0 or high <= most):
            return Standing.MET
        return Standing.UNDECIDED

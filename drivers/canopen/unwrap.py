"""An endless angle from a counter that wraps.

    d = ((new - old + R/2) mod R) - R/2

is the shortest way from the old to the new raw value of a counter with range R. It is right as long as the true
step is below R/2; steps above R/4, or above what the shaft can do, are called implausible, so that a jump or a lost
sample is noticed before it is misread.
"""


class Unwrapper:
    """Counts without wraps, from raw values 0 .. `span` - 1 (or the same range shifted).

    `most`: counts that the shaft can turn from one value to the next, None where nobody said.
    """

    def __init__(self, span: int, most: int | None = None) -> None:
        self.span = span
        self._most = span // 4 if most is None else min(most, span // 4)
        self.counts = 0
        self.plausible = True
        self._half = span // 2
        self._raw = 0

    def start(self, raw: int) -> None:
        """Begin at a raw value; the count is that value, or the one below zero that shows the same."""
        self._raw = raw
        self.counts = (raw + self._half) % self.span - self._half
        self.plausible = True

    def step(self, raw: int) -> None:
        """Take the next raw value."""
        moved = (raw - self._raw + self._half) % self.span - self._half
        self.counts += moved
        self._raw = raw
        self.plausible = -self._most <= moved <= self._most

"""What a plan refuses before any motion: every value that a limit of the bench or its equipment forbids, at once."""

import math

from drivers.errors import ConfigError, Mistake

HEADROOM = 0.95
"""Share of a bench limit that a setpoint may use: noise, overshoot and ripple of what is measured need the rest."""


class Checks:
    """Collects the mistakes of one procedure's parameters; `raise_if_any` reports them together."""

    def __init__(self, procedure: str) -> None:
        self._procedure = procedure
        self._mistakes: list[Mistake] = []

    def at_most(self, parameter: str, value: float, limit: float, unit: str, what: str) -> None:
        """Demand value <= limit; `what` names the limit."""
        if not value <= limit * (1.0 + 1e-9):
            self.refuse(parameter, f"{value:.6g} {unit}", f"exceeds {what} = {limit:.6g} {unit}")

    def within(self, parameter: str, value: float, limit: float, unit: str, what: str) -> None:
        """Demand value <= 95 % of a limit that is watched on the measured signal; `what` names the limit."""
        if not value <= HEADROOM * limit * (1.0 + 1e-9):
            self.refuse(
                parameter,
                f"{value:.6g} {unit}",
                f"must be at most {HEADROOM * limit:.6g} {unit}, {HEADROOM:.0%} of {what} = {limit:.6g} {unit}; "
                "noise and overshoot need the rest",
            )

    def positive(self, parameter: str, value: float, unit: str) -> None:
        """Demand a finite value above zero."""
        if not (math.isfinite(value) and value > 0.0):
            self.refuse(parameter, f"{value:.6g} {unit}", f"must be a number of {unit} above zero")

    def demand(self, met: bool, parameter: str, value: object, rule: str) -> None:
        """Demand a condition; `rule` says what it is."""
        if not met:
            self.refuse(parameter, value, rule)

    def refuse(self, parameter: str, value: object, rule: str) -> None:
        """Note one mistake."""
        self._mistakes.append(Mistake(f"{self._procedure}.{parameter}", value, rule))

    def raise_if_any(self) -> None:
        """Raise ConfigError with everything that was refused."""
        if self._mistakes:
            raise ConfigError(
                f"plan of {self._procedure}",
                self._mistakes,
                hint="Nothing was moved. Change the parameter with --set or the limit in the bench file.",
            )

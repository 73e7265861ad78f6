"""What a procedure may ask of the bench. Each intent is data; only the runner carries it out.

A procedure is a generator: it yields an intent and receives the sample of the cycle that followed. It returns how
its result is computed, not the result: that takes longer than a cycle, and is done when the bench is safe.
`Command` takes exactly one control cycle; the others return the latest sample, after as many cycles as they need.
"""

from collections.abc import Callable, Generator
from dataclasses import dataclass

from drivers.types import Sample, Setpoint


@dataclass(frozen=True, slots=True)
class Command:
    """One control cycle with these setpoints; None releases the axis (drive disabled, no torque)."""

    motor: Setpoint | None = None
    load: Setpoint | None = None


@dataclass(frozen=True, slots=True)
class Mark:
    """A named phase begins (dwell, sweep, reversal, ...). `duration` (s) is its expected length, for progress."""

    phase: str
    duration: float | None = None


@dataclass(frozen=True, slots=True)
class SetLock:
    """Lock the output to the frame, or release it. Refused unless both axes are released (zero torque)."""

    locked: bool


@dataclass(frozen=True, slots=True)
class Tare:
    """Zero the torque sensor. Refused unless both axes are released."""


@dataclass(frozen=True, slots=True)
class Ask:
    """Ask the operator to do something and to confirm it."""

    text: str


Intent = Command | Mark | SetLock | Tare | Ask
"""Every intent there is."""


@dataclass(frozen=True, slots=True)
class Measurement:
    """One measured quantity: `value` and its standard `uncertainty` (None: unknown) in `unit`, and what it means."""

    name: str
    value: float
    unit: str
    uncertainty: float | None = None
    meaning: str = ""


@dataclass(frozen=True, slots=True)
class Result:
    """What one run measured."""

    measurements: tuple[Measurement, ...] = ()


Evaluation = Callable[[], Result]
"""Computes a run's result from what the procedure recorded."""

Steps = Generator[Intent, Sample, Evaluation]
"""A running procedure: yields intents, receives samples, returns how its result is computed."""

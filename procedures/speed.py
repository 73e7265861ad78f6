"""Speed of the motor from its angle, for drives that report no velocity."""

from collections import deque

from drivers.types import Sample
from procedures.recording import measured
from procedures.waveforms import TURN, cycles

SPAN = 0.01
"""Time over which a speed is taken from the angle, s: one count per cycle is no speed."""


class MotorSpeed:
    """Mean speed over the last 10 ms; see every sample of a motion, then read `value`."""

    def __init__(self, cycle_time: float) -> None:
        self._cycle_time = cycle_time
        self._past: deque[float] = deque(maxlen=cycles(SPAN, cycle_time) + 1)

    def see(self, sample: Sample) -> None:
        """Take one sample in. Raises DataError if it has no motor angle."""
        self._past.append(measured(sample.motor_position, "motor_position"))

    @property
    def value(self) -> float | None:
        """Speed, rad/s; None until samples of the whole span were seen."""
        past = self._past
        if len(past) < (past.maxlen or 0):
            return None
        return (past[-1] - past[0]) / ((len(past) - 1) * self._cycle_time)


def resolvable(counts: int) -> float:
    """Give the speed (rad/s) that an encoder of `counts` per turn tells from rest: two counts within the span."""
    return 2.0 * TURN / counts / SPAN

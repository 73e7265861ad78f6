"""The limit check of every cycle: setpoints before they are sent, samples as they come in."""

import math
import sys
from collections import deque
from operator import itemgetter

from drivers.errors import LimitError
from drivers.signals import BY_NAME
from drivers.types import Axis, Limits, Mode, Sample, Setpoint

SPEED_WINDOW = 10
"""Cycles over which the speed is averaged; one encoder count per cycle would be too coarse."""

WATCHED = ("motor_torque", "output_torque", "load_torque", "temperature", "motor_temperature")
"""Signals bounded by magnitude as they are; speed and travel are derived from the positions."""

_watched_values = itemgetter(*map(Sample._fields.index, WATCHED))

_FINITE = sys.float_info.max
"""Bound of a setpoint without a limit of its own: it must be a number and finite."""

_UNITS = {Mode.TORQUE: "N*m", Mode.VELOCITY: "rad/s", Mode.POSITION: "rad"}

HINT = "Check the set-up and the procedure's parameters before raising the limit in the bench file."


class LimitWatch:
    """Compares one run's samples with the bench's limits and keeps the largest magnitudes seen."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._travel_bounded = math.isfinite(limits.motor_travel) or math.isfinite(limits.output_travel)
        self._bounds = (
            limits.motor_torque,
            limits.output_torque,
            limits.load_torque,
            limits.temperature,
            limits.temperature,
        )
        self._setpoint_bounds = {(axis, mode): _FINITE for axis in Axis for mode in Mode} | {
            (Axis.MOTOR, Mode.TORQUE): min(limits.motor_torque, _FINITE),
            (Axis.MOTOR, Mode.VELOCITY): min(limits.motor_velocity, _FINITE),
            (Axis.LOAD, Mode.TORQUE): min(limits.load_torque, _FINITE),
        }
        self._largest = [-1.0] * len(WATCHED)
        self._fastest = -1.0
        self._beyond = False
        self._start: Sample | None = None
        self._positions: deque[tuple[float, float]] = deque(maxlen=SPEED_WINDOW + 1)
        self._speed = 0.0

    @property
    def extremes(self) -> dict[str, float]:
        """Largest magnitude of each signal seen so far, in its SI unit."""
        largest = [*zip(WATCHED, self._largest, strict=True), ("motor_velocity", self._fastest)]
        return {name: value for name, value in largest if value >= 0.0}

    def start_travel(self) -> None:
        """Count the travel from the next sample on: locking or releasing the output starts a new position."""
        self._start = None
        self._positions.clear()
        self._speed = 0.0

    def check_setpoint(self, axis: Axis, setpoint: Setpoint, cycle: int) -> None:
        """Raise LimitError if the setpoint is above a limit, or not a finite number."""
        mode, value = setpoint
        bound = self._setpoint_bounds[axis, mode]
        if not -bound <= value <= bound:  # said so that it holds for what is not a number, too
            signal = f"{axis}_{mode}_command"
            raise LimitError(signal, value, bound, _UNITS[mode], cycle=cycle, hint="The setpoint was not sent.")

    def observe(self, sample: Sample) -> None:
        """Take one sample in: extremes, recent positions, start of the travel."""
        if self._start is None:
            self._start = sample
        largest = self._largest
        for place, value in enumerate(_watched_values(sample)):
            if value is not None and (magnitude := abs(value)) > largest[place]:
                largest[place] = magnitude
                if magnitude > self._bounds[place]:
                    self._beyond = True
        position = sample.motor_position
        if position is not None:
            positions, time = self._positions, sample.time
            positions.append((time, position))
            if len(positions) > SPEED_WINDOW:
                before, start = positions[0]
                self._speed = (position - start) / (time - before) if time > before else 0.0
                self._fastest = max(self._fastest, abs(self._speed))

    def check(self, sample: Sample) -> None:
        """Raise LimitError for the first limit that this sample, the latest one observed, breaks."""
        if self._beyond:  # as long as no maximum is above its limit, no sample is
            for name, value, bound in zip(WATCHED, _watched_values(sample), self._bounds, strict=True):
                if value is not None and abs(value) > bound:
                    raise _reached(name, value, bound, sample.cycle)
        if abs(self._speed) > self._limits.motor_velocity:
            raise _reached("motor_velocity", self._speed, self._limits.motor_velocity, sample.cycle)
        if self._start is not None and self._travel_bounded:
            start = self._start
            _check_travel(
                "motor_position", sample.motor_position, start.motor_position, self._limits.motor_travel, sample.cycle
            )
            _check_travel(
                "output_position",
                sample.output_position,
                start.output_position,
                self._limits.output_travel,
                sample.cycle,
            )


def _reached(signal: str, value: float, bound: float, cycle: int) -> LimitError:
    return LimitError(signal, value, bound, BY_NAME[signal].unit, cycle=cycle, hint=HINT)


def _check_travel(signal: str, value: float | None, start: float | None, bound: float, cycle: int) -> None:
    if value is None or start is None or abs(value - start) <= bound:
        return
    travelled = value - start
    raise LimitError(
        signal,
        travelled,
        bound,
        "rad",
        cycle=cycle,
        what=f"{signal} travelled {travelled:.6g} rad from the run's start; the limit is {bound:.6g} rad.",
        hint=HINT,
    )

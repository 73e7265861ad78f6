"""The limit check of every cycle: setpoints before they are sent, samples as they come in."""

import math
from collections import deque
from operator import attrgetter

from drivers.errors import LimitError
from drivers.signals import BY_NAME
from drivers.types import Axis, Limits, Mode, Sample, Setpoint

SPEED_WINDOW = 10
"""Cycles over which the speed is averaged; one encoder count per cycle would be too coarse."""

WATCHED = ("motor_torque", "output_torque", "load_torque", "temperature", "motor_temperature")
"""Signals bounded by magnitude as they are; speed and travel are derived from the positions."""

_watched_values = attrgetter(*WATCHED)

HINT = "Check the set-up and the procedure's parameters before raising the limit in the bench file."


class LimitWatch:
    """Compares one run's samples with the bench's limits and keeps the largest magnitudes seen."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._travel_bounded = math.isfinite(limits.motor_travel) or math.isfinite(limits.output_travel)
        self._bounds = tuple(
            zip(
                WATCHED,
                (
                    limits.motor_torque,
                    limits.output_torque,
                    limits.load_torque,
                    limits.temperature,
                    limits.temperature,
                ),
                strict=True,
            )
        )
        self._start: Sample | None = None
        self._positions: deque[tuple[float, float]] = deque(maxlen=SPEED_WINDOW + 1)
        self._speed = 0.0
        self.extremes: dict[str, float] = {}

    def start_travel(self) -> None:
        """Count the travel from the next sample on: locking or releasing the output starts a new position."""
        self._start = None
        self._positions.clear()
        self._speed = 0.0

    def check_setpoint(self, axis: Axis, setpoint: Setpoint, cycle: int) -> None:
        """Raise LimitError if the setpoint is above a limit."""
        mode = setpoint.mode
        if mode is Mode.TORQUE:
            bound = self._limits.motor_torque if axis is Axis.MOTOR else self._limits.load_torque
        elif mode is Mode.VELOCITY and axis is Axis.MOTOR:
            bound = self._limits.motor_velocity
        else:
            return
        if abs(setpoint.value) > bound:
            signal, unit = f"{axis}_{mode}_command", "N*m" if mode is Mode.TORQUE else "rad/s"
            raise LimitError(signal, setpoint.value, bound, unit, cycle=cycle, hint="The setpoint was not sent.")

    def observe(self, sample: Sample) -> None:
        """Take one sample in: extremes, recent positions, start of the travel."""
        if self._start is None:
            self._start = sample
        extremes = self.extremes
        for name, value in zip(WATCHED, _watched_values(sample), strict=True):
            if value is not None and abs(value) > extremes.get(name, -1.0):
                extremes[name] = abs(value)
        if sample.motor_position is not None:
            positions = self._positions
            positions.append((sample.time, sample.motor_position))
            if len(positions) > SPEED_WINDOW:
                (t0, p0), (t1, p1) = positions[0], positions[-1]
                self._speed = (p1 - p0) / (t1 - t0) if t1 > t0 else 0.0
                if abs(self._speed) > extremes.get("motor_velocity", -1.0):
                    extremes["motor_velocity"] = abs(self._speed)

    def check(self, sample: Sample) -> None:
        """Raise LimitError for the first limit that this sample breaks."""
        for value, (name, bound) in zip(_watched_values(sample), self._bounds, strict=True):
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

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


LEAST_STEP = 2e-3
"""rad by which a position setpoint may always differ from the position before: a few counts of a coarse encoder."""


class _Shaft:
    """The speed of one shaft (rad/s), from its positions over the last cycles; 0 until there are enough of them."""

    __slots__ = ("_recent", "fastest", "speed")

    def __init__(self) -> None:
        self._recent: deque[tuple[float, float]] = deque(maxlen=SPEED_WINDOW + 1)
        self.speed = 0.0
        self.fastest = -1.0

    def observe(self, time: float, position: float) -> None:
        recent = self._recent
        recent.append((time, position))
        if len(recent) > SPEED_WINDOW:
            before, start = recent[0]
            self.speed = (position - start) / (time - before) if time > before else 0.0
            self.fastest = max(self.fastest, abs(self.speed))

    def start(self) -> None:
        self._recent.clear()
        self.speed = 0.0


class LimitWatch:
    """Compares one run's samples with the bench's limits and keeps the largest magnitudes seen.

    `cycle_time` s is how far apart two setpoints of an axis are.
    """

    def __init__(self, limits: Limits, cycle_time: float) -> None:
        self._limits = limits
        self._travels = tuple(
            (name, bound)
            for name, bound in (
                ("motor_position", limits.motor_travel),
                ("output_position", limits.output_travel),
                ("load_position", limits.load_travel),
            )
            if math.isfinite(bound)
        )
        self._bounds: tuple[float, ...] = (
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
            (Axis.LOAD, Mode.VELOCITY): min(limits.load_velocity, _FINITE),
        }
        self._steps = {
            Axis.MOTOR: max(limits.motor_velocity * cycle_time, LEAST_STEP),
            Axis.LOAD: max(limits.load_velocity * cycle_time, LEAST_STEP),
        }
        self._largest = [-1.0] * len(WATCHED)
        self._beyond = False
        self._start: Sample | None = None
        self._latest: Sample | None = None
        self._motor, self._load = _Shaft(), _Shaft()

    @property
    def extremes(self) -> dict[str, float]:
        """Largest magnitude of each signal seen so far, in its SI unit."""
        speeds = (("motor_velocity", self._motor.fastest), ("load_velocity", self._load.fastest))
        largest = [*zip(WATCHED, self._largest, strict=True), *speeds]
        return {name: value for name, value in largest if value >= 0.0}

    def start_travel(self) -> None:
        """Count the travel from the next sample on: locking or releasing the output starts a new position."""
        self._start = None
        self._motor.start()
        self._load.start()

    def speed(self, axis: Axis) -> float:
        """Give the speed of a shaft, rad/s, as the limits see it."""
        return (self._motor if axis is Axis.MOTOR else self._load).speed

    def tolerate(self, error: LimitError) -> None:
        """Let a torque or temperature that broke its limit stand a tenth higher, so that it can be ramped down."""
        if error.signal in WATCHED:
            place = WATCHED.index(error.signal)
            bound = max(self._bounds[place], 1.1 * abs(error.value))
            self._bounds = (*self._bounds[:place], bound, *self._bounds[place + 1 :])

    def check_setpoint(self, axis: Axis, setpoint: Setpoint, cycle: int) -> None:
        """Raise LimitError if the setpoint is above a limit, or not a finite number."""
        mode, value = setpoint
        bound = self._setpoint_bounds[axis, mode]
        if not -bound <= value <= bound:  # said so that it holds for what is not a number, too
            signal = f"{axis}_{mode}_command"
            raise LimitError(signal, value, bound, _UNITS[mode], cycle=cycle, hint="The setpoint was not sent.")

    def check_step(self, axis: Axis, target: float, present: Setpoint | None, cycle: int) -> None:
        """Raise LimitError if a position setpoint (rad) is further away than the axis may go in one cycle.

        It is counted from the `present` setpoint of the axis if that is a position, else from where the axis is.
        """
        if present is not None and present.mode is Mode.POSITION:
            origin: float | None = present.value
        else:
            latest = self._latest
            origin = latest and (latest.motor_position if axis is Axis.MOTOR else latest.load_position)
        bound = self._steps[axis]
        if origin is None or abs(target - origin) <= bound:
            return
        signal, step = f"{axis}_position_command", target - origin
        raise LimitError(
            signal,
            step,
            bound,
            "rad",
            cycle=cycle,
            what=f"{signal} steps by {step:.6g} rad in cycle {cycle}; at the limit of the {axis}'s speed one cycle "
            f"takes it {bound:.6g} rad.",
            hint="The setpoint was not sent.",
        )

    def observe(self, sample: Sample) -> None:
        """Take one sample in: extremes, recent positions, start of the travel."""
        if self._start is None:
            self._start = sample
        self._latest = sample
        largest = self._largest
        for place, value in enumerate(_watched_values(sample)):
            if value is not None and (magnitude := abs(value)) > largest[place]:
                largest[place] = magnitude
                if magnitude > self._bounds[place]:
                    self._beyond = True
        if sample.motor_position is not None:
            self._motor.observe(sample.time, sample.motor_position)
        if sample.load_position is not None:
            self._load.observe(sample.time, sample.load_position)

    def check(self, sample: Sample) -> None:
        """Raise LimitError for the first limit that this sample, the latest one observed, breaks."""
        if self._beyond:  # as long as no maximum is above its limit, no sample is
            for name, value, bound in zip(WATCHED, _watched_values(sample), self._bounds, strict=True):
                if value is not None and abs(value) > bound:
                    raise _reached(name, value, bound, sample.cycle)
        if abs(self._motor.speed) > self._limits.motor_velocity:
            raise _too_fast("motor_velocity", self._motor.speed, self._limits.motor_velocity, sample.cycle)
        if abs(self._load.speed) > self._limits.load_velocity:
            raise _too_fast("load_velocity", self._load.speed, self._limits.load_velocity, sample.cycle)
        for name, bound in self._travels:
            _check_travel(name, getattr(sample, name), getattr(self._start, name), bound, sample.cycle)


def _reached(signal: str, value: float, bound: float, cycle: int) -> LimitError:
    return LimitError(signal, value, bound, BY_NAME[signal].unit, cycle=cycle, hint=HINT)


def _too_fast(signal: str, value: float, bound: float, cycle: int) -> LimitError:
    return LimitError(signal, value, bound, "rad/s", cycle=cycle, hint=HINT)


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

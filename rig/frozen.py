"""Readings that stay the same, to the last bit, although something acts on them.

A device may repeat its reading for as long as nothing happens: an encoder at rest does, and so does a torque in per
mille. Silence is therefore judged against what must be seen:

    device          while                 must change when
    motor, load     the axis is driven    its setpoint changes (not at its own torque limit), or another shaft turns
    output encoder  always                the load drive turns, or the motor by a whole turn
    torque sensor   always                the motor's or the load's torque changes and is held by something

The bounds are far above what a quantised or filtered reading hides and what the gear's torsion takes up: a share of
the bench's limit, and never less than three steps of the drive's torque. No gear
ratio is needed: no drive winds up by a turn of its motor, nor by a degree at its output.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from operator import attrgetter

from drivers.errors import ReadingError
from drivers.signals import BY_NAME
from drivers.types import Axis, Limits, Mode, Sample, Setpoint

STATUS_WORD = {Axis.MOTOR: "status_word", Axis.LOAD: "load_status_word"}
INTERNAL_LIMIT = 1 << 11
"""Bit of the CiA 402 status word."""

CHECK_TIME = 0.01
"""s between two looks."""
DRIVE_LOOKS, SENSOR_LOOKS = 3, 20
"""Looks in a row at the same reading until it counts as frozen; sensors may average or lag by 0.2 s."""

TORQUE_SHARE = 0.02
"""Change of a torque setpoint that a drive must show, as a share of the torque limit."""
COMMANDED_TRAVEL = 0.05
"""rad that a drive must turn, or show in its torque, once it was told to."""
OUTPUT_TRAVEL = 0.02
"""rad at the output, ten times what a drive of this kind yields under its rated torque."""
MOTOR_TRAVEL = math.tau
"""rad at the motor that no torsion takes up."""
HELD_MOTOR_SHARE, HELD_LOAD_SHARE = 0.25, 0.05
"""Change of a torque that reaches the torque sensor, as a share of the torque limit."""
LEAST_STEPS = 3
"""Steps of a drive's torque resolution within which a change is none, however small the bench's limit is beside it."""
HELD_TRAVEL = 0.1
"""rad at the load within which its torque is held rather than spent on turning it."""


@dataclass(frozen=True, slots=True)
class Cause:
    """A signal whose change by `bound` must be seen; not if `shaft` has turned by more than `held` rad meanwhile."""

    signal: str
    bound: float
    shaft: str = "time"
    held: float = math.inf


class FrozenWatch:
    """Looks at one run's samples every `CHECK_TIME` and raises ReadingError for a frozen reading.

    `resolutions`: N*m that the drive of an axis shows and takes in one step; one that is not told counts as zero.
    """

    def __init__(self, limits: Limits, resolutions: Mapping[Axis, float]) -> None:
        motor, load = (LEAST_STEPS * resolutions.get(axis, 0.0) for axis in (Axis.MOTOR, Axis.LOAD))
        shafts = {
            "motor_position": Cause("motor_position", MOTOR_TRAVEL),
            "output_position": Cause("output_position", OUTPUT_TRAVEL),
            "load_position": Cause("load_position", OUTPUT_TRAVEL),
        }

        def turning(*names: str) -> tuple[Cause, ...]:
            return tuple(shafts[name] for name in names)

        held = (
            Cause("motor_torque", max(HELD_MOTOR_SHARE * limits.motor_torque, motor), "motor_position", MOTOR_TRAVEL),
            Cause("load_torque", max(HELD_LOAD_SHARE * limits.load_torque, load), "load_position", HELD_TRAVEL),
        )
        self._motor = _Device(
            "motor",
            ("motor_position", "motor_torque", "status_word"),
            turning("output_position", "load_position"),
            DRIVE_LOOKS,
        )
        self._load = _Device(
            "load",
            ("load_position", "load_torque", "load_status_word"),
            turning("output_position", "motor_position"),
            DRIVE_LOOKS,
        )
        self._sensors = (
            _Device("output_encoder", ("output_position",), turning("motor_position", "load_position"), SENSOR_LOOKS),
            _Device("torque_sensor", ("output_torque",), held, SENSOR_LOOKS),
        )
        self._drives = (
            (self._motor, Axis.MOTOR, _Command(max(TORQUE_SHARE * limits.motor_torque, motor))),
            (self._load, Axis.LOAD, _Command(max(TORQUE_SHARE * limits.load_torque, load))),
        )

    def look(self, sample: Sample, setpoints: Mapping[Axis, Setpoint | None]) -> None:
        """Take one sample, with what each axis is told. Raises ReadingError."""
        for device, axis, command in self._drives:
            setpoint = setpoints[axis]
            if setpoint is None:
                device.start(sample)
                command.start(None, sample.time)
                continue
            if device.changed(sample):
                command.start(setpoint, sample.time)
                continue
            told = command.follow(setpoint, sample.time)
            # a drive at its own torque limit shows one torque whatever it is told
            device.judge(sample, "" if _limited(getattr(sample, STATUS_WORD[axis])) else told)
        for sensor in self._sensors:
            if not sensor.changed(sample):
                sensor.judge(sample, "")


class _Command:
    """How far an axis was told to go since its reading last changed: N*m in torque mode, else rad."""

    def __init__(self, torque_bound: float) -> None:
        self._bounds = {Mode.TORQUE: torque_bound, Mode.VELOCITY: COMMANDED_TRAVEL, Mode.POSITION: COMMANDED_TRAVEL}
        self.start(None, 0.0)

    def start(self, setpoint: Setpoint | None, time: float) -> None:
        self._first, self._time, self._travel = setpoint, time, 0.0

    def follow(self, setpoint: Setpoint, time: float) -> str:
        """Say what the axis was told that must have been seen, "" if nothing was."""
        first = self._first
        if first is None or first.mode is not setpoint.mode:
            self.start(setpoint, time)
            return ""
        self._travel += setpoint.value * (time - self._time)
        self._time = time
        mode = setpoint.mode
        told = self._travel if mode is Mode.VELOCITY else setpoint.value - first.value
        if abs(told) <= self._bounds[mode]:
            return ""
        return f"its {mode} setpoint asks for a change of {told:.3g} {'N*m' if mode is Mode.TORQUE else 'rad'}"


class _Device:
    """One device: its reading, what it was when that last changed, and how often the change of a cause went unseen."""

    def __init__(self, name: str, signals: tuple[str, ...], causes: tuple[Cause, ...], looks: int) -> None:
        self._name = name
        self._reading = attrgetter(*signals)
        self._causes = causes
        self._looks = looks
        self._then: Sample | None = None
        self._unseen = 0

    def start(self, sample: Sample) -> None:
        """Compare with this sample from now on."""
        self._then = sample
        self._unseen = 0

    def changed(self, sample: Sample) -> bool:
        """Tell whether the reading is another one than at the last look that differed, and start anew if so."""
        if self._then is not None and self._reading(sample) == self._reading(self._then):
            return False
        self.start(sample)
        return True

    def judge(self, sample: Sample, told: str) -> None:
        """Raise ReadingError if a cause, or what the device was `told`, went unseen for too long."""
        what = told or self._unseen_cause(sample)
        self._unseen = self._unseen + 1 if what else 0
        then = self._then
        if self._unseen < self._looks or then is None:
            return
        raise ReadingError(
            self._name,
            f"has repeated one reading for {sample.time - then.time:.3g} s although {what}: it is frozen, stuck, or "
            "not coupled to what moves it",
            state="",
            hint="Check its process data, its mounting and coupling, and whether the bench file names the right node.",
        )

    def _unseen_cause(self, sample: Sample) -> str:
        then = self._then
        if then is None or self._reading(sample) in (None, (None, None, None)):
            return ""
        for cause in self._causes:
            change = _change(cause.signal, then, sample)
            if abs(change) <= cause.bound:
                continue
            if abs(_change(cause.shaft, then, sample)) > cause.held:
                self.start(sample)
                return ""
            return f"{cause.signal} changed by {change:.3g} {BY_NAME[cause.signal].unit}"
        return ""


def _limited(word: int | None) -> bool:
    return word is not None and bool(word & INTERNAL_LIMIT)


def _change(signal: str, then: Sample, now: Sample) -> float:
    before, after = getattr(then, signal), getattr(now, signal)
    return 0.0 if before is None or after is None else after - before

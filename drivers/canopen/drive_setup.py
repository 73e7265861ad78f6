"""What is read from and set in a drive before it may be enabled: units, limits, watchdog.

Source: CiA 402 objects 0x6007, 0x605A, 0x6072, 0x6076, 0x6080, 0x608F, 0x60A9; CiA 301 objects 0x1016 and 0x1029.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from drivers.canopen.errors import SdoAbortError
from drivers.canopen.node import CanopenNode
from drivers.canopen.objects import (
    ABORT_CONNECTION_OPTION,
    ENCODER_INCREMENTS,
    ERROR_BEHAVIOUR,
    HEARTBEAT_CONSUMER,
    MAX_MOTOR_SPEED,
    MAX_TORQUE,
    MOTOR_REVOLUTIONS,
    QUICK_STOP_OPTION,
    RATED_TORQUE,
    VELOCITY_UNIT,
    ObjectRef,
)
from drivers.canopen.options import DriveOptions
from drivers.canopen.profiles import COUNTS_PER_SECOND, REVOLUTIONS_PER_MINUTE, DriveProfile, velocity_scale
from drivers.devices import DeviceConfig
from drivers.errors import ConfigError, DriveFaultError, Mistake
from drivers.types import Mode

QUICK_STOP_WHEN_LOST = 3
"""0x6007: quick stop when the bench's heartbeat is missing."""

PRE_OPERATIONAL_WHEN_LOST = 0
"""0x1029:1: leave NMT operational when the bench's heartbeat is missing, so that no setpoint acts any more."""

LIMIT_MARGIN = 1.1
"""What the drive keeps over what the bench keeps: the bench acts first, the drive where the bench is blind."""

_STATED_UNITS = {0x00B44700: REVOLUTIONS_PER_MINUTE, 0x00B50300: COUNTS_PER_SECOND}
"""0x60A9 of known drives; other words say nothing here."""


@dataclass(frozen=True, slots=True)
class DriveUnits:
    """SI per count with the channel's sign: N*m, rad, rad/s. `rated_torque` N*m; `counts` per motor turn."""

    torque: float
    position: float
    velocity: float
    rated_torque: float
    counts: float

    def scale(self, mode: Mode) -> float:
        """Give the SI value of one count of a mode's setpoint."""
        return {Mode.TORQUE: self.torque, Mode.POSITION: self.position, Mode.VELOCITY: self.velocity}[mode]


def read_units(config: DeviceConfig, profile: DriveProfile, node: CanopenNode) -> DriveUnits:
    """Read rated torque and encoder resolution. Raises DriveFaultError if they are zero or contradict the profile."""
    objects = node.objects
    rated = objects.read(RATED_TORQUE) * profile.rated_torque_unit
    increments, revolutions = objects.read(ENCODER_INCREMENTS), objects.read(MOTOR_REVOLUTIONS)
    if not (rated and increments and revolutions):
        raise DriveFaultError(
            config.name,
            f"has no usable units: rated torque {rated:g} N*m (0x6076), {increments} encoder increments per "
            f"{revolutions} revolutions (0x608F)",
            state="",
            hint="Set the motor data in the drive.",
        )
    stated = _STATED_UNITS.get(objects.find(VELOCITY_UNIT) or 0)
    if stated is not None and stated != profile.velocity_unit:
        raise DriveFaultError(
            config.name,
            f"states speeds in {stated} (0x60A9), profile '{config.profile}' takes {profile.velocity_unit}",
            state="",
            hint="Name the right profile in the bench file.",
        )
    counts = increments / revolutions
    position_sign, torque_sign = _sign(config.sign, "_position"), _sign(config.sign, "_torque")
    return DriveUnits(
        torque=torque_sign * rated / 1000.0,
        position=position_sign * 2.0 * math.pi / counts,
        velocity=position_sign * velocity_scale(profile.velocity_unit, counts),
        rated_torque=rated,
        counts=counts,
    )


def set_limits(
    config: DeviceConfig, options: DriveOptions, profile: DriveProfile, node: CanopenNode, units: DriveUnits
) -> tuple[float, tuple[str, ...]]:
    """Set the limits that the drive itself keeps; give the largest torque (N*m) it will produce, and warnings.

    An option is set as it is. Without it the drive gets the bench's limit with `LIMIT_MARGIN`, unless it keeps a
    lower one already. Raises ConfigError if an option does not fit the drive's number format, or is refused.
    """
    torque = _Limit(MAX_TORQUE, "max_torque", units.rated_torque / 1000.0, "per mille of rated torque")
    speed_unit = velocity_scale(profile.max_speed_unit, units.counts)
    speed = _Limit(MAX_MOTOR_SPEED, "max_velocity", speed_unit, profile.max_speed_unit)
    warnings = (
        *_set_limit(node, torque, options.max_torque, config.max_torque),
        *_set_limit(node, speed, options.max_velocity, config.max_velocity),
    )
    largest = node.objects.find(MAX_TORQUE)
    return units.rated_torque * (largest if largest is not None else 1000) / 1000.0, warnings


def set_watchdog(
    options: DriveOptions, profile: DriveProfile, node: CanopenNode, watchdog_time: float
) -> tuple[str, tuple[str, ...]]:
    """Make the drive stop by itself when the bench's heartbeat is missing for `watchdog_time` (s).

    Gives the reason why it cannot (empty: it can), and warnings for the operator.
    """
    warnings: list[str] = []
    if node.objects.find(QUICK_STOP_OPTION) is None:
        warnings.append(f"it has no {QUICK_STOP_OPTION}: how it stops is up to the device")
    else:
        option = options.quick_stop_option
        if option is None:
            node.change(QUICK_STOP_OPTION, profile.quick_stop_option)
        else:
            _order(node, QUICK_STOP_OPTION, option, "quick_stop_option", option)
    try:
        node.change(HEARTBEAT_CONSUMER, options.master_id << 16 | round(watchdog_time * 1000))
        node.change(ABORT_CONNECTION_OPTION, QUICK_STOP_WHEN_LOST)
        if node.objects.find(ERROR_BEHAVIOUR) is not None:  # without it, CiA 301 says pre-operational
            node.change(ERROR_BEHAVIOUR, PRE_OPERATIONAL_WHEN_LOST)
    except DriveFaultError as error:
        consequence = "an external watchdog is declared" if options.external_watchdog else "it will not be enabled"
        return str(error), (*warnings, f"it has no watchdog, {consequence}: {error}")
    return "", tuple(warnings)


@dataclass(frozen=True, slots=True)
class _Limit:
    """A limit that a drive keeps: its object, the option of that name, and the SI value of one `unit`."""

    ref: ObjectRef
    option: str
    scale: float
    unit: str


def _set_limit(node: CanopenNode, limit: _Limit, asked: float | None, declared: float | None) -> tuple[str, ...]:
    """Set what an option `asked` for, else what the bench's limits `declared`; give warnings."""
    ref = limit.ref
    if asked is not None:
        raw, largest = math.floor(asked / limit.scale), (1 << 8 * ref.size) - 1
        if not 1 <= raw <= largest:
            rule = f"gives {raw} {limit.unit} for {ref}, which takes 1 to {largest}"
            raise _wrong_option(node, limit.option, asked, rule)
        _order(node, ref, raw, limit.option, asked)
        return ()
    if declared is None:
        return ()
    try:
        wanted = max(1, math.floor(LIMIT_MARGIN * declared / limit.scale))
        if wanted < node.objects.read(ref):
            node.change(ref, wanted)
    except SdoAbortError as error:
        return (f"it keeps no limit of {declared:g} by itself, only the bench does: {error.message}",)
    return ()


def _order(node: CanopenNode, ref: ObjectRef, raw: int, option: str, value: float) -> None:
    """Set what an option of the bench file asks for. Raises ConfigError naming the option if the drive refuses it."""
    try:
        node.change(ref, raw)
    except SdoAbortError as error:
        raise _wrong_option(node, option, value, f"refused by the drive: {error.message}") from error


def _wrong_option(node: CanopenNode, option: str, value: float, rule: str) -> ConfigError:
    return ConfigError("bench", [Mistake(f"devices.{node.name}.options.{option}", value, rule)])


def _sign(signs: Mapping[str, int], suffix: str) -> int:
    return next((sign for signal, sign in signs.items() if signal.endswith(suffix)), 1)

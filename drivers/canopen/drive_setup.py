"""What is read from and set in a drive before it may be enabled: units, limits, watchdog.

Source: CiA 402 objects 0x6007, 0x605A, 0x6072, 0x6076, 0x6080, 0x608F, 0x60A9; CiA 301 object 0x1016.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from drivers.canopen.errors import SdoAbortError
from drivers.canopen.node import CanopenNode
from drivers.canopen.objects import (
    ABORT_CONNECTION_OPTION,
    ENCODER_INCREMENTS,
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


def set_limits(options: DriveOptions, profile: DriveProfile, node: CanopenNode, units: DriveUnits) -> float:
    """Set the limits that the drive itself keeps; give the largest torque (N*m) it will produce.

    Raises ConfigError if a limit does not fit the drive's number format.
    """
    if options.max_torque is not None:
        permille = math.floor(1000.0 * options.max_torque / units.rated_torque)
        _set_limit(node, MAX_TORQUE, permille, "max_torque", options.max_torque, "per mille of rated torque")
    if options.max_velocity is not None:
        speed = math.floor(options.max_velocity / velocity_scale(profile.max_speed_unit, units.counts))
        _set_limit(node, MAX_MOTOR_SPEED, speed, "max_velocity", options.max_velocity, profile.max_speed_unit)
    largest = node.objects.find(MAX_TORQUE)
    return units.rated_torque * (largest if largest is not None else 1000) / 1000.0


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
    except DriveFaultError as error:
        consequence = "an external watchdog is declared" if options.external_watchdog else "it will not be enabled"
        return str(error), (*warnings, f"it has no watchdog, {consequence}: {error}")
    return "", tuple(warnings)


def _set_limit(node: CanopenNode, ref: ObjectRef, raw: int, option: str, value: float, unit: str) -> None:
    largest = (1 << 8 * ref.size) - 1
    if not 1 <= raw <= largest:
        rule = f"gives {raw} {unit} for {ref}, which takes 1 to {largest}"
        raise _wrong_option(node, option, value, rule)
    _order(node, ref, raw, option, value)


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

"""What the bench file may say under `options` of a CANopen device, checked all at once.

Keys that begin with `can_` go to python-can without that prefix, for adapters that need more than a channel.
"""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from drivers.canopen.profiles import TORQUE_UNITS
from drivers.devices import OptionValue
from drivers.errors import Mistake
from drivers.spelling import did_you_mean

PASSED_THROUGH = "can_"


def _option(default: Any, low: float, high: float) -> Any:
    return dataclasses.field(default=default, metadata={"low": low, "high": high})


def _text(*choices: str) -> Any:
    """Give an optional text; without `choices` any but an empty one."""
    return dataclasses.field(default=None, metadata={"choices": choices})


@dataclass(frozen=True, slots=True)
class CommonOptions:
    """For every device. `bitrate` bit/s; `master_id` node id of the bench's heartbeat; `sdo_timeout` s.

    `eds`: file that describes the device (EDS or DCF), against which device and driver are checked.
    """

    eds: str | None = _text()
    bitrate: int = _option(1_000_000, 10_000, 1_000_000)
    master_id: int = _option(127, 1, 127)
    sdo_timeout: float = _option(0.3, 0.001, 10.0)


@dataclass(frozen=True, slots=True)
class DriveOptions(CommonOptions):
    """For a drive.

    `max_torque` N*m (0x6072) and `max_velocity` rad/s (0x6080) are set in the drive; if not given, the bench's limits
    with a tenth more, unless the drive keeps lower ones. `quick_stop_option`
    is 0x605A, the profile's if not given. `external_watchdog`: something else takes the torque away when the bench
    dies, so a drive without heartbeat watchdog may be enabled. `state_timeout` s for each change of state and
    `mode_timeout` s for a change of mode; while enabling, both end at half the watchdog time.
    `standstill_velocity` rad/s below which the mode may change.
    """

    max_torque: float | None = _option(None, 1e-9, 1e6)
    max_velocity: float | None = _option(None, 1e-9, 1e5)
    quick_stop_option: int | None = _option(None, -128, 127)
    external_watchdog: bool = _option(False, 0, 1)
    state_timeout: float = _option(0.5, 0.001, 30.0)
    mode_timeout: float = _option(0.2, 0.001, 30.0)
    standstill_velocity: float = _option(0.5, 1e-6, 1e5)


@dataclass(frozen=True, slots=True)
class EncoderOptions(CommonOptions):
    """For an encoder. `max_velocity` rad/s: the fastest it will turn, the bench's limit of its shaft if not given."""

    max_velocity: float | None = _option(None, 1e-9, 1e5)


@dataclass(frozen=True, slots=True)
class TorqueOptions(CommonOptions):
    """For a torque transducer.

    `unit` of its process value (see `TORQUE_UNITS`; the profile's if not given); `full_scale` N*m beyond which a
    reading is not valid; `tare_timeout` s. While it waits for a tare no heartbeat of the bench is sent.
    """

    unit: str | None = _text(*TORQUE_UNITS)
    full_scale: float | None = _option(None, 1e-9, 1e9)
    tare_timeout: float = _option(0.3, 0.001, 30.0)


Options = TypeVar("Options", bound=CommonOptions)

_OPTIONAL_KINDS: Mapping[str, type] = {"unit": str, "eds": str, "quick_stop_option": int}
"""Type of the options whose default None does not tell it; the others are float."""


def read_options(kind: type[Options], options: Mapping[str, OptionValue], path: str) -> tuple[Options, list[Mistake]]:
    """Give the options of one device with defaults filled in, and every mistake found under `path`."""
    known = {field.name: field for field in dataclasses.fields(kind)}
    values: dict[str, Any] = {}
    mistakes: list[Mistake] = []
    for name, value in options.items():
        if name.startswith(PASSED_THROUGH):
            continue
        where = f"{path}.{name}"
        field = known.get(name)
        if field is None:
            mistakes.append(
                Mistake(where, value, f"no such option{did_you_mean(name, known)}; there are {', '.join(known)}")
            )
            continue
        default_kind = float if field.default is None else type(field.default)
        rule = _broken_rule(value, _OPTIONAL_KINDS.get(name, default_kind), field.metadata)
        if rule:
            mistakes.append(Mistake(where, value, rule))
        else:
            values[name] = value
    return kind(**values), mistakes


def _broken_rule(value: OptionValue, kind: type, bounds: Mapping[str, Any]) -> str:
    if kind is str:
        choices = bounds["choices"]
        if choices:
            return "" if value in choices else f"expected one of {', '.join(choices)}"
        return "" if isinstance(value, str) and value else "expected a text"
    if kind is bool:
        return "" if isinstance(value, bool) else "expected true or false"
    accepted = (int,) if kind is int else (int, float)
    if isinstance(value, bool) or not isinstance(value, accepted):
        return f"expected a {'whole number' if kind is int else 'number'}"
    if not (math.isfinite(value) and bounds["low"] <= value <= bounds["high"]):
        return f"out of range {bounds['low']:g} to {bounds['high']:g}"
    return ""

"""Vendor profiles as data: units and behaviour that the CiA texts leave to the device. One file per profile.

`[cia402]`: `rated_torque_unit` is N*m per count of 0x6076; `velocity_unit` that of 0x606C and 0x60FF,
`max_speed_unit` that of 0x6080 (see `VELOCITY_UNITS`); `quick_stop_option` the value of 0x605A.
`[cia404]`: `unit` of the process value, one of `TORQUE_UNITS`.
"""

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from types import MappingProxyType
from typing import Any

COUNTS_PER_SECOND = "counts/s"
REVOLUTIONS_PER_MINUTE = "rpm"
VELOCITY_UNITS = (COUNTS_PER_SECOND, REVOLUTIONS_PER_MINUTE)

TORQUE_UNITS: Mapping[str, float] = MappingProxyType(
    {"N*m": 1.0, "mN*m": 1e-3, "kN*m": 1e3, "lbf*in": 0.1129848290276167, "lbf*ft": 1.3558179483314004}
)
"""N*m per unit; the pound-force is exactly 4.4482216152605 N and the inch 0.0254 m."""


@dataclass(frozen=True, slots=True)
class DriveProfile:
    """Units and behaviour of a CiA 402 drive."""

    rated_torque_unit: float
    velocity_unit: str
    max_speed_unit: str
    quick_stop_option: int


@dataclass(frozen=True, slots=True)
class TorqueProfile:
    """Unit of a CiA 404 torque transducer."""

    unit: str


def profile_names() -> tuple[str, ...]:
    """List the profiles there are."""
    found = (entry.name for entry in files(__package__).iterdir())
    return tuple(sorted(name.removesuffix(".toml") for name in found if name.endswith(".toml")))


def drive_profile(name: str) -> DriveProfile:
    """Read the `[cia402]` part of a profile that `profile_names` lists."""
    part = _read(name)["cia402"]
    return DriveProfile(
        rated_torque_unit=float(part["rated_torque_unit"]),
        velocity_unit=str(part["velocity_unit"]),
        max_speed_unit=str(part["max_speed_unit"]),
        quick_stop_option=int(part["quick_stop_option"]),
    )


def torque_profile(name: str) -> TorqueProfile:
    """Read the `[cia404]` part of a profile that `profile_names` lists."""
    return TorqueProfile(unit=str(_read(name)["cia404"]["unit"]))


def velocity_scale(unit: str, counts_per_revolution: float) -> float:
    """Give rad/s per `unit`, one of `VELOCITY_UNITS`."""
    if unit == COUNTS_PER_SECOND:
        return 2.0 * math.pi / counts_per_revolution
    if unit == REVOLUTIONS_PER_MINUTE:
        return 2.0 * math.pi / 60.0
    raise ValueError(f"velocity unit '{unit}' is none of {', '.join(VELOCITY_UNITS)}")


def _read(name: str) -> dict[str, Any]:
    return tomllib.loads(files(__package__).joinpath(f"{name}.toml").read_text(encoding="utf-8"))

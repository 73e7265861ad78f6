"""Which drivers there are: the built-in ones below, and third-party ones by the entry-point group `rig.drivers`.

Adding a driver is one file and one line here; a third party's entry point loads to a `DriverEntry`.
"""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from importlib import import_module
from importlib.metadata import entry_points
from typing import cast

from drivers.devices import BusFactory


class Kind(StrEnum):
    """What a device is to the bench."""

    DRIVE = "drive"
    ENCODER = "encoder"
    TORQUE_SENSOR = "torque sensor"


@dataclass(frozen=True, slots=True)
class DriverEntry:
    """One driver. `bus` is `module:function` of its `BusFactory`, imported only when a bench uses it.

    `cycle_frames`: data bytes of each frame which one device sends or receives in every control cycle, SYNC
    apart; the bench file's check computes the bus load from it. Empty where no CAN bus is shared.
    """

    name: str
    kind: Kind
    bus: str
    summary: str
    cycle_frames: tuple[int, ...] = ()

    def load(self) -> BusFactory:
        """Import the bus factory."""
        module, _, function = self.bus.partition(":")
        return cast(BusFactory, getattr(import_module(module), function))


BUILT_IN: tuple[DriverEntry, ...] = (
    DriverEntry(
        "cia402", Kind.DRIVE, "drivers.canopen.bus:open_bus", "CANopen drive, CiA 402, cyclic synchronous", (6, 8)
    ),
    DriverEntry("cia406", Kind.ENCODER, "drivers.canopen.bus:open_bus", "CANopen encoder, CiA 406", (4,)),
    DriverEntry(
        "cia404", Kind.TORQUE_SENSOR, "drivers.canopen.bus:open_bus", "CANopen torque transducer, CiA 404", (4,)
    ),
)

ENTRY_POINT_GROUP = "rig.drivers"


def all_drivers() -> Mapping[str, DriverEntry]:
    """Give every driver by name. A plug-in that cannot be loaded, or takes a name, warns and is left out."""
    found = {entry.name: entry for entry in BUILT_IN}
    for point in entry_points(group=ENTRY_POINT_GROUP):
        try:
            entry = point.load()
        except Exception as error:
            warnings.warn(f"driver plug-in '{point.name}' ({point.value}) was left out: {error}", stacklevel=2)
            continue
        if not isinstance(entry, DriverEntry) or entry.name in found:
            warnings.warn(
                f"driver plug-in '{point.name}' ({point.value}) was left out: no DriverEntry, or its name is taken",
                stacklevel=2,
            )
            continue
        found[entry.name] = entry
    return found

"""All CANopen devices on one bus: one owner of the transport, one exchange per control cycle.

    late frames are routed -> heartbeat of the bench (when due) -> setpoints -> SYNC -> feedback of this SYNC

Every device samples at the SYNC and every setpoint acts from the same SYNC on. Nothing here runs by itself: no
thread, no cyclic sender. Heartbeat and setpoints come from `exchange` only, so they stop with the control loop.
A late frame of the previous SYNC is routed before the next one is sent, and then counts as one cycle old.
Source: CiA 301, SYNC 0x080, heartbeat 0x700.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import can

from drivers.canopen.drive import Cia402Drive
from drivers.canopen.eds import load_description
from drivers.canopen.encoder import Cia406Encoder
from drivers.canopen.errors import raise_together
from drivers.canopen.heartbeat import BenchHeartbeat
from drivers.canopen.link import Link
from drivers.canopen.node import CanopenNode
from drivers.canopen.options import (
    PASSED_THROUGH,
    CommonOptions,
    DriveOptions,
    EncoderOptions,
    TorqueOptions,
    read_options,
)
from drivers.canopen.profiles import drive_profile, profile_names, torque_profile
from drivers.canopen.torque import Cia404TorqueSensor
from drivers.clock import Clock
from drivers.devices import DeviceConfig
from drivers.errors import ConfigError, Mistake, NotConnectedError, RigError
from drivers.types import DeviceEvent

COLLECT_SHARE = 0.4
"""Share of the cycle time within which the feedback of a SYNC must have come."""
HIGHEST_NODE = 127
REFUSED_INTERFACE = "udp_multicast"
"""It hears its own frames, which would overwrite setpoints, and loses others."""

CanopenDevice = Cia402Drive | Cia406Encoder | Cia404TorqueSensor

_OPTIONS: dict[str, type[CommonOptions]] = {
    "cia402": DriveOptions,
    "cia406": EncoderOptions,
    "cia404": TorqueOptions,
}


def open_bus(configs: Sequence[DeviceConfig], clock: Clock, transport: can.BusABC | None = None) -> "CanopenBus":
    """Open the CANopen bus that `configs` share.

    `transport`: an open python-can bus to use; its owner closes it. Without it, `interface` and `channel` are opened
    with the options of the first device. Raises ConfigError with every mistake, NotConnectedError if the adapter
    cannot be opened.
    """
    options = _checked_options(configs)
    if transport is not None:
        return CanopenBus(configs, options, clock, transport, owned=False)
    adapter = _open_adapter(configs[0], options[configs[0].name])
    return CanopenBus(configs, options, clock, adapter, owned=True)


class CanopenBus:
    """One CANopen bus; see `open_bus`."""

    def __init__(
        self,
        configs: Sequence[DeviceConfig],
        options: dict[str, CommonOptions],
        clock: Clock,
        transport: can.BusABC,
        *,
        owned: bool,
    ) -> None:
        first = configs[0]
        self._configs = {config.name: config for config in configs}
        self._options = options
        self._clock = clock
        self._transport = transport
        self._owned = owned
        self._closed = False
        self._window = COLLECT_SHARE * first.cycle_time
        self._link = Link(transport, clock, f"{first.interface} '{first.channel}'", tuple(self._configs))
        watchdog_time = min(config.heartbeat_time for config in configs)
        self._heartbeat = BenchHeartbeat(self._link, options[first.name].master_id, watchdog_time)
        self._sync = can.Message(arbitration_id=0x080, is_extended_id=False)
        self._devices: dict[str, CanopenDevice] = {}
        self._parts: tuple[tuple[CanopenDevice, CanopenNode], ...] = ()
        self._drives: list[Cia402Drive] = []
        self._look_again = 0.0
        """Instant (s) before which no heartbeat can be missing."""
        self._events: list[DeviceEvent] = []
        self._error_frames = 0

    def attach(self, config: DeviceConfig) -> CanopenDevice:
        """Make the driver for one of the devices that the bus was opened for; nothing is sent yet.

        Raises ConfigError also if the device's description cannot be read.
        """
        if self._configs.get(config.name) != config or config.name in self._devices:
            rule = "not one of the devices that this bus was opened for, or attached already"
            raise ConfigError("devices", [Mistake(config.name, config.driver, rule)])
        options = self._options[config.name]
        node = CanopenNode(config, self._link, self._clock, self._events.append, options.sdo_timeout)
        if options.eds is not None:
            node.describe(load_description(Path(options.eds), config.address, f"devices.{config.name}.options.eds"))
        device = self._make(config, options, node)
        self._devices[config.name] = device
        self._parts = (*self._parts, (device, node))
        self._look_again = 0.0
        if isinstance(device, Cia402Drive):
            self._drives.append(device)
        return device

    def exchange(self) -> None:
        """Run one cycle. A reading that did not come raises nothing: its age grows.

        Raises DriveFaultError if a drive left operation enabled by itself, and, while any drive is armed, if a
        device reported an emergency or restarted; also if process data has a wrong length. Raises
        NotConnectedError if the heartbeat of a device or the transport is lost. Each is raised once, with whatever
        else was found as notes; a drive concerned takes no more setpoints until it is enabled again, unless it is
        still in operation, so that it can be ramped down.
        """
        link, now = self._link, self._clock.now()
        link.drain()
        awaited = 0
        for device, node in self._parts:
            device.age += 1
            awaited += node.watched
        self._heartbeat.beat(now)
        for drive in self._drives:
            if drive.queued is not None:
                link.send_message(drive.queued)
                drive.queued = None
        link.send_message(self._sync)
        link.collect(awaited, self._window)
        for drive in self._drives:
            if drive.armed:
                drive.check()
        if now > self._look_again:
            self._look_again = min(node.check_alive(now) for _, node in self._parts)
        noted = link.error_frames != self._error_frames
        for _, node in self._parts:
            if node.incidents or node.failures:
                noted = True
        if noted:
            self._raise_what_counts()

    def listen(self) -> None:
        """Route what has arrived and send nothing: no SYNC, no heartbeat. Raises NotConnectedError."""
        self._link.drain()

    def events(self) -> Sequence[DeviceEvent]:
        """Give what the devices reported by themselves since the last call."""
        if not self._events:
            return ()
        events = tuple(self._events)
        self._events.clear()
        return events

    def close(self) -> None:
        """Close every device that is still open and, if it was opened here, the adapter; allowed in any condition."""
        if self._closed:
            return
        self._closed = True
        problems: list[RigError] = []
        for device in self._devices.values():
            try:
                device.close()
            except RigError as error:
                problems.append(error)
        if self._owned:
            try:
                self._transport.shutdown()
            except (can.CanError, OSError) as error:
                problems.append(NotConnectedError(dict.fromkeys(self._configs, f"closing the adapter: {error}")))
        raise_together(problems)

    def _make(self, config: DeviceConfig, options: CommonOptions, node: CanopenNode) -> CanopenDevice:
        match options:
            case DriveOptions():
                profile = drive_profile(config.profile)
                return Cia402Drive(config, options, profile, node, self._link, self._clock, self._heartbeat)
            case EncoderOptions():
                return Cia406Encoder(config, options, node)
            case TorqueOptions():
                return Cia404TorqueSensor(config, options, torque_profile(config.profile), node)
            case _:
                raise ConfigError("devices", [Mistake(config.name, config.driver, "no CANopen driver")])

    def _raise_what_counts(self) -> None:
        armed = any(drive.armed for drive in self._drives)
        errors: list[RigError] = []
        if self._link.error_frames != self._error_frames:
            count = self._link.error_frames - self._error_frames
            self._error_frames = self._link.error_frames
            text = f"communication disturbed: the adapter reported {count} error frame(s)"
            self._events.append(DeviceEvent("bus", self._clock.now(), text))
            if armed:
                errors.append(NotConnectedError(dict.fromkeys(self._configs, text)))
        for device in self._devices.values():
            node = device.node
            found = [*node.failures, *(node.incidents if armed else ())]
            if found and isinstance(device, Cia402Drive):
                device.stand_down(blind=bool(node.failures))
            node.failures.clear()
            node.incidents.clear()
            errors.extend(found)
        raise_together(errors)


def _checked_options(configs: Sequence[DeviceConfig]) -> dict[str, CommonOptions]:
    """Check everything that can be checked without a device. Raises ConfigError with every mistake."""
    if not configs:
        raise ConfigError("devices", [Mistake("devices", "none", "a bus needs at least one device")])
    mistakes: list[Mistake] = []
    options: dict[str, CommonOptions] = {}
    for config in configs:
        path = f"devices.{config.name}"
        kind = _OPTIONS.get(config.driver)
        if kind is None:
            mistakes.append(Mistake(f"{path}.driver", config.driver, f"none of {', '.join(_OPTIONS)}"))
            continue
        options[config.name], wrong = read_options(kind, config.options, f"{path}.options")
        mistakes += wrong + _device_mistakes(config, path, options[config.name])
    mistakes += _shared_mistakes(configs, options)
    if mistakes:
        raise ConfigError("bench", mistakes)
    return options


def _device_mistakes(config: DeviceConfig, path: str, options: CommonOptions) -> list[Mistake]:
    mistakes = []
    if config.interface == REFUSED_INTERFACE:
        rule = "refused: it hears its own frames, which overwrite setpoints, and it loses others"
        mistakes.append(Mistake(f"{path}.interface", config.interface, rule))
    if not 1 <= config.address <= HIGHEST_NODE or config.address == options.master_id:
        rule = f"expected a node id from 1 to {HIGHEST_NODE} other than the bench's own, {options.master_id}"
        mistakes.append(Mistake(f"{path}.address", config.address, rule))
    if config.profile not in profile_names():
        mistakes.append(Mistake(f"{path}.profile", config.profile, f"none of {', '.join(profile_names())}"))
    if not 4 * config.cycle_time <= config.heartbeat_time <= 65.0:
        rule = f"expected 4 cycles ({4 * config.cycle_time:g} s) to 65 s"
        mistakes.append(Mistake(f"{path}.heartbeat_time", config.heartbeat_time, rule))
    mistakes += [
        Mistake(f"{path}.sign.{name}", sign, "expected 1 or -1")
        for name, sign in config.sign.items()
        if sign not in (1, -1)
    ]
    return mistakes


def _shared_mistakes(configs: Sequence[DeviceConfig], options: dict[str, CommonOptions]) -> list[Mistake]:
    mistakes = []
    first = configs[0]
    if len({config.name for config in configs}) < len(configs):
        names = sorted(config.name for config in configs)
        mistakes.append(Mistake("devices", ", ".join(names), "two devices have the same name"))
    for config in configs[1:]:
        path = f"devices.{config.name}"
        if config.address in {other.address for other in configs if other is not config}:
            mistakes.append(Mistake(f"{path}.address", config.address, "shared with another device of this bus"))
        for key in ("interface", "channel", "cycle_time"):
            if getattr(config, key) != getattr(first, key):
                mistakes.append(Mistake(f"{path}.{key}", getattr(config, key), f"differs from '{first.name}'"))
    for key in ("bitrate", "master_id"):
        if len({getattr(option, key) for option in options.values()}) > 1:
            mistakes.append(Mistake(f"devices.*.options.{key}", "", "differs between devices of one bus"))
    return mistakes


def _open_adapter(config: DeviceConfig, options: CommonOptions) -> can.BusABC:
    extra: dict[str, Any] = {
        name.removeprefix(PASSED_THROUGH): value
        for name, value in config.options.items()
        if name.startswith(PASSED_THROUGH)
    }
    try:
        # without ignore_config, settings from the user's home directory and environment are merged into the call
        return can.Bus(
            interface=config.interface,
            channel=config.channel,
            bitrate=options.bitrate,
            ignore_config=True,
            **extra,
        )
    except NotImplementedError as error:
        if isinstance(error, can.CanError):
            raise _not_opened(config, options, error) from error
        rule = "python-can has no such interface, and the bench provides no bus of that name"
        raise ConfigError("bench", [Mistake(f"devices.{config.name}.interface", config.interface, rule)]) from error
    except (can.CanError, OSError, ImportError, ValueError, TypeError) as error:
        raise _not_opened(config, options, error) from error


def _not_opened(config: DeviceConfig, options: CommonOptions, error: Exception) -> NotConnectedError:
    tried = f"opening {config.interface} '{config.channel}' at {options.bitrate} bit/s: {error}"
    return NotConnectedError({config.name: tried}, hint="Check the adapter's name, driver and rights.")

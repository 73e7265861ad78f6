"""What every CANopen device of the bench has in common.

Identity, NMT state, heartbeat, emergency messages, and the list of parameters that were changed and must be
restored. Frames that arrive at any moment are only noted here; `CanopenBus.exchange` decides what to raise, so that
taking the torque away is never interrupted by news. Source: CiA 301.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

from drivers.canopen.eds import DeviceDescription
from drivers.canopen.emergency import Emergency, parse_emergency
from drivers.canopen.errors import DeviceFaultError, raise_together
from drivers.canopen.link import Handler, Link
from drivers.canopen.objects import (
    DEVICE_TYPE,
    HEARTBEAT_PRODUCER,
    IDENTITY,
    IDENTITY_COUNT,
    ObjectRef,
)
from drivers.canopen.pdo import (
    NO_RTR,
    NOT_VALID,
    Direction,
    Pdo,
    PdoSetting,
    cob_id_object,
    read_setting,
    verify_setting,
    write_setting,
)
from drivers.canopen.sdo import ObjectAccess
from drivers.clock import Clock
from drivers.devices import DeviceConfig
from drivers.errors import ConfigError, Mistake, NotConnectedError, RigError, RigTimeoutError
from drivers.types import DeviceEvent

NMT_START = 0x01
NMT_PRE_OPERATIONAL = 0x80

BOOT_UP, STOPPED, OPERATIONAL, PRE_OPERATIONAL = 0x00, 0x04, 0x05, 0x7F
_NMT_NAMES = {BOOT_UP: "boot-up", STOPPED: "stopped", OPERATIONAL: "operational", PRE_OPERATIONAL: "pre-operational"}

LOST_AFTER = 3
"""Heartbeat periods without a heartbeat until a device counts as lost."""
START_TIMEOUT = 1.0
"""s until a started node must say that it is operational; some rebuild their process data first."""
PDO_COUNT = 4
"""PDOs per direction in the predefined connection set."""


@dataclass(frozen=True, slots=True)
class Change:
    """One altered parameter: which, its value before and after as text, and how to put it back."""

    what: str
    old: str
    new: str
    undo: Callable[[], None]


class CanopenNode:
    """One device on the bus, whatever its profile.

    `incidents` are errors to raise while a drive is armed; `failures` are errors to raise in any case.
    """

    def __init__(
        self,
        config: DeviceConfig,
        link: Link,
        clock: Clock,
        report: Callable[[DeviceEvent], None],
        sdo_timeout: float,
    ) -> None:
        self.name = config.name
        self.node_id = config.address
        self.objects = ObjectAccess(config.name, config.address, link, clock, sdo_timeout)
        self.where = f"node {config.address} on {config.interface} '{config.channel}'"
        self.heartbeat_period = max(0.01, round(config.heartbeat_time / 4, 3))
        self.incidents: list[RigError] = []
        self.failures: list[RigError] = []
        self.emergency: Emergency | None = None
        self.watched = False
        self.restarted = False
        self.nmt_state: int | None = None
        self.last_heard = 0.0
        self._link = link
        self._clock = clock
        self._report = report
        self._changes: list[Change] = []
        self._description: DeviceDescription | None = None
        self._lost = False
        link.route(0x080 + self.node_id, self._on_emergency)
        link.route(0x700 + self.node_id, self._on_heartbeat)

    @property
    def changed(self) -> tuple[tuple[str, str, str], ...]:
        """Give every parameter that was altered and not restored: object, old value, new value."""
        return tuple((change.what, change.old, change.new) for change in self._changes)

    @property
    def operational(self) -> bool:
        """Tell whether the last heartbeat said so."""
        return self.nmt_state == OPERATIONAL

    def receive(self, pdo: Pdo, handler: Handler) -> None:
        """Give the frames of one TPDO to `handler`."""
        self._link.route(pdo.can_id(self.node_id), handler)

    def identify(self, profile: int) -> tuple[tuple[str, str], ...]:
        """Bring the node to pre-operational and read who it is; `profile` is the number it must follow (402, ...).

        Raises NotConnectedError if it does not answer, ConfigError if it is another kind of device.
        """
        self._link.drain()
        self.restarted = False
        self.command_nmt(NMT_PRE_OPERATIONAL)
        try:
            device_type = self.objects.read(DEVICE_TYPE)
        except RigTimeoutError as error:
            tried = f"{self.where}: no answer to reading {DEVICE_TYPE} within {error.waited:g} s"
            raise NotConnectedError({self.name: tried}) from error
        if device_type & 0xFFFF != profile:
            found = f"{device_type & 0xFFFF} (device type 0x{device_type:08X})"
            raise ConfigError(
                f"device '{self.name}'",
                [Mistake("address", self.node_id, f"{self.where} follows profile {found}, the driver needs {profile}")],
                hint="Check node ids and drivers in the bench file.",
            )
        count = self.objects.find(IDENTITY_COUNT) or 0
        entries = [("device type", f"0x{device_type:08X}")]
        for ref in IDENTITY[:count]:
            value = self.objects.find(ref)
            if value is not None:
                entries.append((ref.name, f"0x{value:08X}"))
                self._compare(ref.name, value)
        if self._description is not None:
            entries.append(("description", self._description.source))
        return tuple(entries)

    def describe(self, description: DeviceDescription) -> None:
        """Hold what the driver does with the device, and what it says of itself, against its description."""
        self._description = self.objects.description = description

    def _compare(self, name: str, value: int) -> None:
        """Raise ConfigError if the device says another vendor or product than its description."""
        told = self._description
        wanted = None if told is None else {"vendor": told.vendor, "product": told.product}.get(name)
        if told is not None and wanted and wanted != value:
            rule = f"describes {name} 0x{wanted:08X}, but {self.where} is 0x{value:08X}"
            raise ConfigError(
                f"device '{self.name}'",
                [Mistake("options.eds", told.source, rule)],
                hint="Check which device is connected, or take the file that belongs to it.",
            )

    def change(self, ref: ObjectRef, wanted: int) -> None:
        """Set a parameter, read it back and remember the old value. Raises DeviceFaultError if it is not kept."""
        old = self.objects.read(ref)
        if old == wanted:
            return
        # noted before it is written: a write whose answer is lost may have been carried out
        self._changes.append(Change(str(ref), str(old), str(wanted), lambda: self.objects.write_verified(ref, old)))
        self.objects.write_verified(ref, wanted)

    def map_pdos(self, direction: Direction, pdos: tuple[Pdo, ...]) -> None:
        """Give the device exactly these PDOs in one direction, all others off, and read everything back."""
        for number in range(1, PDO_COUNT + 1):
            wanted = next((pdo for pdo in pdos if pdo.number == number), None)
            if wanted is None:
                self._switch_off(direction, number)
            else:
                self._map(wanted)

    def start_heartbeat(self) -> None:
        """Make the device produce its own heartbeat, by which it is watched."""
        self.change(HEARTBEAT_PRODUCER, round(self.heartbeat_period * 1000))

    def start(self, timeout: float) -> None:
        """Bring the node to operational and wait (s) for a heartbeat that says so.

        Raises RigTimeoutError if none comes, DeviceFaultError if the device has restarted since it was identified.
        """
        self._link.drain()
        self.nmt_state = None
        self.command_nmt(NMT_START)
        deadline = self._clock.now() + timeout
        while not self.operational:
            remaining = deadline - self._clock.now()
            if remaining <= 0 or not self._link.pump(remaining):
                raise RigTimeoutError(
                    f"a heartbeat of '{self.name}' ({self.where}) that says operational",
                    timeout,
                    last_seen=_nmt_name(self.nmt_state),
                    hint="Without it the device sends no process data and cannot be watched.",
                )
        if self.restarted:
            raise self.fault("restarted by itself (boot-up) while it was set up; its configuration is lost")
        self.last_heard = self._clock.now()
        self.watched, self._lost = True, False
        self.incidents.clear()
        self.failures.clear()

    def command_nmt(self, command: int) -> None:
        """Send an NMT command to this node."""
        self._link.send(0x000, bytes((command, self.node_id)))

    def check_alive(self, now: float) -> float:
        """Note a failure, once, if the heartbeats have stopped; give when (s) to look again. `now` in s."""
        silent, allowed = now - self.last_heard, LOST_AFTER * self.heartbeat_period
        if not self.watched or self._lost:
            return now + allowed  # nothing can be lost within this time, even if watching begins at once
        if silent <= allowed:
            return self.last_heard + allowed
        self._lost = True
        text = f"{self.where}: no heartbeat for {silent * 1e3:.3g} ms; its period is {self.heartbeat_period * 1e3:g} ms"
        self.report(f"heartbeat lost: {text}")
        self.failures.append(NotConnectedError({self.name: text}))
        return now + allowed

    def report(self, text: str, emergency: Emergency | None = None) -> None:
        """Add an event to what the bus hands out."""
        now = self._clock.now()
        if emergency is None:
            self._report(DeviceEvent(self.name, now, text))
        else:
            self._report(DeviceEvent(self.name, now, text, emergency.code, emergency.register, emergency.data))

    def fault(self, what: str, state: str = "") -> DeviceFaultError:
        """Make an error that carries the last emergency message."""
        told = self.emergency
        return DeviceFaultError(
            self.name,
            what,
            state=state,
            error_code=told.code if told is not None else 0,
            error_register=told.register if told is not None else 0,
        )

    def wrong_length(self, pdo: Pdo, size: int, data: bytes) -> None:
        """Note that a TPDO does not have the length it was given; one note until it is raised."""
        if not self.failures:
            found = f"{len(data)} bytes ({data.hex(' ') or 'empty'})"
            self.failures.append(
                self.fault(f"sent {pdo.direction}{pdo.number} with {found} instead of {size}: it is not a value")
            )

    def shut_down(self) -> None:
        """Leave the node pre-operational with every changed parameter put back, the latest first.

        What the device refuses is collected, what follows is still tried; a device that does not answer is left
        alone. Raises the first error, with the others as notes.
        """
        self.watched = False
        self.command_nmt(NMT_PRE_OPERATIONAL)
        problems: list[RigError] = []
        while self._changes:
            change = self._changes.pop()
            try:
                change.undo()
            except (RigTimeoutError, NotConnectedError) as error:
                error.add_note(f"Not restored on '{self.name}': {_names([change, *reversed(self._changes)])}.")
                self._changes.clear()
                problems.append(error)
            except RigError as error:
                error.add_note(f"Not restored on '{self.name}': {change.what}, wanted {change.old}.")
                problems.append(error)
        raise_together(problems)

    def abandon(self, error: RigError) -> None:
        """Leave the node as it is, with every changed parameter as it was set; `error`, the reason, is told so."""
        self.watched = False
        if self._changes:
            error.add_note(f"Not restored on '{self.name}': {_names([*reversed(self._changes)])}.")
        self._changes.clear()

    def _map(self, pdo: Pdo) -> None:
        direction, number, wanted = pdo.direction, pdo.number, pdo.setting(self.node_id)
        old = read_setting(self.objects, direction, number)
        if old is None:
            raise DeviceFaultError(self.name, f"has no {direction}{number}, which the bench needs", state="")
        if old.matches(wanted):
            return
        wanted = replace(wanted, cob_id=wanted.cob_id | old.cob_id & NO_RTR)
        self._changes.append(Change(f"{direction}{number}", str(old), str(wanted), lambda: self._remap(pdo, old)))
        self._remap(pdo, wanted)

    def _remap(self, pdo: Pdo, setting: PdoSetting) -> None:
        write_setting(self.objects, pdo.direction, pdo.number, setting)
        verify_setting(self.name, self.objects, pdo.direction, pdo.number, setting)

    def _switch_off(self, direction: Direction, number: int) -> None:
        ref = cob_id_object(direction, number)
        cob_id = self.objects.find(ref)
        if cob_id is not None and not cob_id & NOT_VALID:
            self.change(ref, cob_id | NOT_VALID)

    def _on_heartbeat(self, data: bytearray) -> bool:
        if len(data) != 1:
            return False
        state = data[0] & 0x7F
        self.last_heard = self._clock.now()
        self._lost = False
        if state == BOOT_UP:
            self.restarted = True
        if state != self.nmt_state and self.watched:
            self._on_nmt_change(state)
        self.nmt_state = state
        return False

    def _on_nmt_change(self, state: int) -> None:
        if state == BOOT_UP:
            self.report("boot-up: the device restarted by itself")
            self.incidents.append(self.fault("restarted by itself (boot-up); its configuration is lost"))
        elif state != OPERATIONAL:
            self.report(f"NMT state {_nmt_name(state)}")
            self.incidents.append(self.fault(f"left NMT operational by itself: it is {_nmt_name(state)}"))

    def _on_emergency(self, data: bytearray) -> bool:
        told = parse_emergency(bytes(data))
        if told is None:
            self.report(f"unreadable emergency frame {bytes(data).hex(' ') or '(empty)'}")
            return False
        self.emergency = told if told.code >> 8 else None
        self.report(told.text, told)
        if self.watched and told.code >> 8:
            self.incidents.append(self.fault(f"reported {told.text}"))
        return False


def _nmt_name(state: int | None) -> str:
    if state is None:
        return "no heartbeat"
    return _NMT_NAMES.get(state, f"unknown NMT state 0x{state:02X}")


def _names(changes: list[Change]) -> str:
    return ", ".join(f"{change.what} (was {change.old})" for change in changes)

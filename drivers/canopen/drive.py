"""A CANopen drive: CiA 402, cyclic synchronous torque, velocity and position.

States are changed by SDO and read back; while enabled, setpoints go out as one RPDO per cycle, and one TPDO with
status word, position and torque comes back at every SYNC. A change of state takes some tens of object accesses, a
few milliseconds in all; no heartbeat of the bench is sent meanwhile, and if that ever takes half the drives'
watchdog time an event says so.
"""

import math
import struct
from functools import partial

import can

from drivers.canopen import cia402
from drivers.canopen.drive_setup import DriveUnits, read_units, set_limits, set_watchdog
from drivers.canopen.heartbeat import BenchHeartbeat
from drivers.canopen.link import Link
from drivers.canopen.node import START_TIMEOUT, CanopenNode
from drivers.canopen.objects import (
    CONTROL_WORD,
    POSITION,
    STATUS_WORD,
    TARGET_POSITION,
    TARGET_TORQUE,
    TARGET_VELOCITY,
    TORQUE,
    VELOCITY,
)
from drivers.canopen.options import DriveOptions
from drivers.canopen.pdo import Direction, Pdo, layout
from drivers.canopen.power import PowerStage
from drivers.canopen.profiles import DriveProfile
from drivers.clock import Clock
from drivers.devices import DeviceConfig
from drivers.errors import DriveFaultError, LimitError, RigError
from drivers.types import DeviceInfo, DriveReading, DriveState, Mode

PROFILE = 402
FEEDBACK = Pdo(Direction.TPDO, 1, (STATUS_WORD, POSITION, TORQUE))
SETPOINTS = {
    Mode.TORQUE: Pdo(Direction.RPDO, 1, (CONTROL_WORD, TARGET_TORQUE)),
    Mode.POSITION: Pdo(Direction.RPDO, 2, (CONTROL_WORD, TARGET_POSITION)),
    Mode.VELOCITY: Pdo(Direction.RPDO, 3, (CONTROL_WORD, TARGET_VELOCITY)),
}

_NOT_MEASURED = (None,) * 4
"""Velocity, current, temperature and voltage of a reading: they are not mapped into the feedback."""
_new_reading = partial(tuple.__new__, DriveReading)
"""Make a reading of all its fields in half the time of `DriveReading(...)`: one per drive and cycle."""
_ENABLE = cia402.ENABLE_OPERATION
_HALF, _MASK = 1 << 31, 0xFFFFFFFF
_UNITS_OF_MODE = {Mode.TORQUE: "N*m", Mode.VELOCITY: "rad/s", Mode.POSITION: "rad"}
_LAYOUTS = {mode: layout(pdo.objects) for mode, pdo in SETPOINTS.items()}
_FEEDBACK_LAYOUT = layout(FEEDBACK.objects)
_UNKNOWN_UNITS = DriveUnits(math.nan, math.nan, math.nan, math.nan, math.nan)


class Cia402Drive:
    """One drive on a CANopen bus; made by `CanopenBus.attach`.

    `age` counts cycles since the last reading, `queued` is the setpoint frame of the coming cycle, `armed` says
    that the drive is in operation enabled by order of the bench.
    """

    def __init__(
        self,
        config: DeviceConfig,
        options: DriveOptions,
        profile: DriveProfile,
        node: CanopenNode,
        link: Link,
        clock: Clock,
        heartbeat: BenchHeartbeat,
    ) -> None:
        self.name = config.name
        self.node = node
        self.armed = False
        self.age = 1
        self.queued: can.Message | None = None
        self._config = config
        self._options = options
        self._profile = profile
        self._clock = clock
        self._heartbeat = heartbeat
        self._power = PowerStage(node, options, link, clock, heartbeat.watchdog_time)
        self._open = False
        self._no_watchdog = ""
        self._mode: Mode | None = None
        self._scale = 1.0
        self._pack_setpoint = _LAYOUTS[Mode.TORQUE].pack_into
        # one message per mode, filled anew for each cycle: an adapter takes its bytes in `send`
        self._setpoint = can.Message()
        self._last_setpoint: float | None = None
        self._units = _UNKNOWN_UNITS
        self._unpack = _FEEDBACK_LAYOUT.unpack
        self._size = _FEEDBACK_LAYOUT.size
        self._status = 0
        self._raw_position = 0
        self._counts = 0
        self._raw_torque = 0
        node.receive(FEEDBACK, self.on_feedback)

    def connect(self) -> DeviceInfo:
        """Identify the drive, set and read back its units, limits, watchdog and process data; leave it disabled.

        Raises NotConnectedError if it does not answer, ConfigError if it is another device or cannot be set as
        the bench file says, DriveFaultError if it refuses or does not keep a parameter.
        """
        node, objects = self.node, self.node.objects
        identity = node.identify(PROFILE)
        self._open = True
        warnings: tuple[str, ...] = ()
        state = self._power.state()
        if state is DriveState.FAULT:
            warnings = (f"it is in fault and must be reset first: {self._power.fault_text()}",)
        elif state is not DriveState.SWITCH_ON_DISABLED:
            self.disable()
        self._units = read_units(self._config, self._profile, node)
        full_scale, unlimited = set_limits(self._config, self._options, self._profile, node, self._units)
        watchdog_time = self._heartbeat.watchdog_time
        self._no_watchdog, more = set_watchdog(self._options, self._profile, node, watchdog_time)
        node.map_pdos(Direction.TPDO, (FEEDBACK,))
        node.map_pdos(Direction.RPDO, tuple(SETPOINTS.values()))
        node.start_heartbeat()
        node.start(START_TIMEOUT)
        self._status = objects.read(STATUS_WORD)
        self._raw_position = self._counts = objects.read(POSITION)
        self._raw_torque = objects.read(TORQUE)
        return DeviceInfo(
            name=self.name,
            driver=self._config.driver,
            address=node.where,
            identity=identity,
            resolution=abs(self._units.torque),
            full_scale=full_scale,
            changed=node.changed,
            warnings=warnings + unlimited + more,
        )

    def enable(self, mode: Mode) -> None:
        """Clear the targets, switch the mode and verify it, then energise step by step, reading each state back.

        In operation already: changes the mode at standstill. Raises DriveFaultError if the drive is in fault,
        refuses, turns, or has no watchdog running, RigTimeoutError if a state does not come. After a failure the
        voltage is disabled again.
        """
        self._require_ready()
        begin = self._clock.now()
        state = self._power.state()
        if state in (DriveState.FAULT, DriveState.FAULT_REACTION):
            raise self._power.fault_error("cannot be enabled", state)
        if state is DriveState.ENABLED and self.armed:
            if mode is self._mode:
                return
            self._require_standstill(mode)
        elif state.energised:
            self.disable()
        self.queued = None
        self.node.incidents.clear()
        try:
            self._power.clear_targets()
            self._power.switch_mode(mode)
            self._power.energise(mode)
        except RigError as error:
            self._back_off(error)
            raise
        self._scale = self._units.scale(mode)
        setpoint, data = SETPOINTS[mode], bytes(_LAYOUTS[mode].size)
        self._pack_setpoint = _LAYOUTS[mode].pack_into
        self._setpoint = can.Message(arbitration_id=setpoint.can_id(self.node.node_id), data=data, is_extended_id=False)
        self._mode, self._last_setpoint, self.armed = mode, None, True
        self._report_if_slow(self._clock.now() - begin)

    def write(self, value: float) -> None:
        """Queue the setpoint of the active mode (N*m, rad/s or rad) for the next exchange.

        Raises DriveFaultError if the drive is not enabled, LimitError if its number format does not hold the value.
        """
        mode = self._mode
        if not self.armed or mode is None:
            raise DriveFaultError(
                self.name,
                f"is not enabled, so the setpoint {value:g} was not sent",
                state=self._state_name(),
                hint="Enable the drive first.",
            )
        frame = self._setpoint
        try:
            raw = round(value / self._scale)
            if mode is Mode.POSITION:
                raw = ((raw + _HALF) & _MASK) - _HALF
            self._pack_setpoint(frame.data, 0, _ENABLE, raw)
        except (struct.error, ValueError, OverflowError) as error:
            raise self._too_large(mode, value) from error
        self.queued = frame
        self._last_setpoint = value

    def read(self) -> DriveReading:
        """Give position (rad), torque (N*m) and state of the last SYNC. Raises DriveFaultError on a bad status word."""
        word = self._status
        state = cia402.STATE_OF[word & cia402.STATE_MASK]
        if state is None:
            described = cia402.describe_status(word)
            raise DriveFaultError(self.name, f"reports an impossible state: {described}")
        units = self._units
        return _new_reading(
            (
                self._counts * units.position,
                self._raw_torque * units.torque,
                state,
                word,
                word & cia402.INTERNAL_LIMIT != 0,
                self.age,
                *_NOT_MEASURED,
            )
        )

    def disable(self) -> DriveState:
        """Take the torque away and give the state read back. Raises RigTimeoutError if the drive stays energised.

        Disable voltage is the one command that ends in a state which no setpoint frame can leave, not even one
        that the drive still holds for the next SYNC.
        """
        self.disarm()
        return self._power.disable_voltage()

    def quick_stop(self) -> DriveState:
        """Stop by the drive's quick-stop ramp and give the state read back.

        With option codes 1 to 4 quick stop active is over before it can be seen, so switch-on disabled counts too.
        Raises RigTimeoutError if the drive stays in operation enabled.
        """
        self.disarm()
        return self._power.command(cia402.QUICK_STOP, lambda state: state is not DriveState.ENABLED, "quick stop")

    def fault_reset(self) -> DriveState:
        """Reset a fault by the rising edge of bit 7 and give the state read back; never goes further than that.

        A node that left NMT operational, as it may when the bench's heartbeat was missing, is started again.
        Raises DriveFaultError if the cause is still there or if the drive has restarted.
        """
        self.disarm()
        state = self._power.state()
        if state is DriveState.FAULT:
            state = self._power.reset_fault()
            self.node.emergency = None
        if self.node.restarted:
            raise DriveFaultError(
                self.name, "has restarted and lost its configuration", state=str(state), hint="Connect the bench again."
            )
        if not self.node.operational:
            self.node.start(START_TIMEOUT)
        return state

    def close(self) -> None:
        """Take the torque away, restore every changed parameter, leave the node pre-operational.

        A drive that does not confirm that it is without torque keeps what was set in it, its watchdog above all, and
        the bench's heartbeat ends, so that the drive stops by itself; the error says so.
        """
        if not self._open:
            return
        self._open = False
        try:
            self.disable()
        except RigError as error:
            self._heartbeat.cease()
            self.node.abandon(error)
            raise
        self.node.shut_down()

    def on_feedback(self, data: bytearray) -> bool:
        """Take one TPDO; True if it is the first of its cycle. A wrong length is noted as a failure."""
        if len(data) != self._size:
            self.node.wrong_length(FEEDBACK, self._size, bytes(data))
            return False
        self._status, position, self._raw_torque = self._unpack(data)
        # modular difference: the drive's 32-bit counter wraps
        self._counts += ((position - self._raw_position + _HALF) & _MASK) - _HALF
        self._raw_position = position
        first = self.age > 0
        self.age = 0
        return first

    def check(self) -> None:
        """Note an incident if the drive has left operation enabled by itself. For `CanopenBus.exchange`."""
        if not self.armed or self.age or self._status & cia402.STATE_MASK == cia402.ENABLED_BITS:
            return
        told = self.node.emergency
        heard = told.text if told is not None else "it sent no emergency message"
        self.node.incidents.append(
            DriveFaultError(
                self.name,
                f"left operation enabled by itself: {cia402.describe_status(self._status)}; {heard}",
                state=self._state_name(),
                error_code=told.code if told is not None else 0,
                error_register=told.register if told is not None else 0,
                last_setpoint=self._last_setpoint,
                hint="Find the cause before the fault is reset.",
            )
        )

    def disarm(self) -> None:
        """Drop the queued setpoint and accept no more of them."""
        self.armed = False
        self.queued = None
        self._mode = None

    def stand_down(self, *, blind: bool) -> None:
        """After an error: accept no more setpoints, unless the drive is still in operation and can be ramped down.

        `blind`: what it reports is no longer known.
        """
        in_operation = self._status & cia402.STATE_MASK == cia402.ENABLED_BITS and self.node.operational
        if blind or not in_operation:
            self.disarm()

    def _require_ready(self) -> None:
        """Raise DriveFaultError unless the drive is connected and running and its watchdog is fed."""
        silence = self._heartbeat.silence(self._clock.now())
        watchdog_time = self._heartbeat.watchdog_time
        if not self._open:
            reason, hint = "is not connected", "Connect it first."
        elif self.node.restarted:
            reason, hint = "has restarted and lost its configuration", "Connect the bench again."
        elif not self.node.operational:
            reason, hint = "has left NMT operational", "Reset the fault, or connect the bench again."
        elif self._no_watchdog and not self._options.external_watchdog:
            reason = f"has no watchdog that stops it when the bench dies: {self._no_watchdog}"
            hint = "Take a drive with a heartbeat consumer; options.external_watchdog only if the bench has one."
        elif silence > watchdog_time:
            heard = "never heard the bench's heartbeat" if math.isinf(silence) else f"last heard it {silence:.3g} s ago"
            reason = f"is not watched: it {heard}, and waits for it no longer than {watchdog_time:g} s"
            hint = "Run control cycles before enabling, and do not pause them."
        else:
            return
        raise DriveFaultError(self.name, f"was not enabled: it {reason}", state=self._state_name(), hint=hint)

    def _require_standstill(self, mode: Mode) -> None:
        raw = self.node.objects.find(VELOCITY)
        limit = self._options.standstill_velocity
        speed = math.inf if raw is None else abs(raw * self._units.velocity)
        if speed > limit:
            raise DriveFaultError(
                self.name,
                f"turns at {speed:.3g} rad/s, so its mode was not changed to {mode} (limit {limit:g} rad/s)",
                state=str(DriveState.ENABLED),
                last_setpoint=self._last_setpoint,
                hint="Bring it to rest first, or disable it.",
            )

    def _back_off(self, error: RigError) -> None:
        """Disable voltage after a failed enable; if that fails too, the first error says so."""
        try:
            self.disable()
        except RigError as second:
            error.add_note(f"Disabling it again failed too: {second}")

    def _too_large(self, mode: Mode, value: float) -> LimitError:
        unit = _UNITS_OF_MODE[mode]
        largest = abs(self._units.scale(mode)) * (0x7FFF if mode is Mode.TORQUE else 0x7FFFFFFF)
        return LimitError(
            f"{self.name}_{mode}_command",
            value,
            largest,
            unit,
            what=f"{self.name} {mode} setpoint {value:g} {unit} exceeds what the drive's number format holds, "
            f"{largest:.6g} {unit}; it was not sent.",
        )

    def _state_name(self) -> str:
        try:
            return str(cia402.decode_state(self._status))
        except ValueError:
            return "unknown"

    def _report_if_slow(self, elapsed: float) -> None:
        watchdog_time = self._heartbeat.watchdog_time
        if elapsed > watchdog_time / 2:
            self.node.report(
                f"enabling took {elapsed:.3g} s without a heartbeat of the bench; "
                f"the drives stop by themselves after {watchdog_time:g} s"
            )

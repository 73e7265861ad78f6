"""A CANopen torque transducer: CiA 404, process value 0x9130 at every SYNC, zeroed by autozero.

The process value is an integer with 10^-digits of a unit which the device does not tell reliably, so the unit
comes from the profile or the bench file; the raw unit word 0x6131 is kept with the identity.
Source: CiA 404 objects 0x6125, 0x6131, 0x6132, 0x9124, 0x9130, as vendor manuals show them.
"""

from drivers.canopen.errors import DeviceFaultError, SdoAbortError
from drivers.canopen.node import START_TIMEOUT, CanopenNode
from drivers.canopen.objects import AUTOZERO, DECIMAL_DIGITS, OFFSET, PHYSICAL_UNIT, PROCESS_VALUE
from drivers.canopen.options import TorqueOptions
from drivers.canopen.pdo import Direction, Pdo, layout
from drivers.canopen.profiles import TORQUE_UNITS, TorqueProfile
from drivers.canopen.sdo import ABORTED_BY_TIMEOUT
from drivers.devices import DeviceConfig
from drivers.errors import RigTimeoutError
from drivers.types import DeviceInfo, SensorReading

PROFILE = 404
FEEDBACK = Pdo(Direction.TPDO, 1, (PROCESS_VALUE,))
ZERO_COMMAND = 0x6F72657A
"""The letters "zero", as CiA 404 wants them."""
MOST_DIGITS = 9
"""More decimal digits than a 32-bit integer has."""

_LARGEST, _SMALLEST = 0x7FFFFFFF, -0x80000000


class Cia404TorqueSensor:
    """One torque transducer on a CANopen bus; made by `CanopenBus.attach`."""

    def __init__(
        self,
        config: DeviceConfig,
        options: TorqueOptions,
        profile: TorqueProfile,
        node: CanopenNode,
    ) -> None:
        self.name = config.name
        self.node = node
        self.age = 1
        self._config = config
        self._options = options
        self._unit = options.unit if options.unit is not None else profile.unit
        self._sign = next(iter(config.sign.values()), 1)
        self._open = False
        self._digits = 0
        self._scale = 0.0
        self._raw = 0
        self._unpack = layout(FEEDBACK.objects).unpack
        self._size = layout(FEEDBACK.objects).size
        node.receive(FEEDBACK, self.on_feedback)

    def connect(self) -> DeviceInfo:
        """Identify the transducer, read its scale, put its value on SYNC and read that back.

        Raises NotConnectedError if it does not answer, ConfigError if it is another device, DriveFaultError if it
        refuses.
        """
        identity = self.node.identify(PROFILE)
        self._open = True
        objects = self.node.objects
        self._digits = objects.read(DECIMAL_DIGITS)
        if self._digits > MOST_DIGITS:
            raise DeviceFaultError(self.name, f"declares {self._digits} decimal digits (0x6132)", state="")
        self._scale = self._sign * TORQUE_UNITS[self._unit] * 10.0**-self._digits
        unit_word = objects.find(PHYSICAL_UNIT)
        if unit_word is not None:
            identity = (*identity, ("unit word", f"0x{unit_word:08X}"))
        self.node.map_pdos(Direction.TPDO, (FEEDBACK,))
        self.node.start_heartbeat()
        self.node.start(START_TIMEOUT)
        self._raw = objects.read(PROCESS_VALUE)
        return DeviceInfo(
            name=self.name,
            driver=self._config.driver,
            address=self.node.where,
            identity=identity,
            resolution=abs(self._scale),
            full_scale=self._options.full_scale,
            changed=self.node.changed,
        )

    def read(self) -> SensorReading:
        """Give the torque (N*m) of the last SYNC; not valid at the end of the number format or of full scale."""
        value = self._raw * self._scale
        full_scale = self._options.full_scale
        clipped = self._raw in (_LARGEST, _SMALLEST) or (full_scale is not None and abs(value) >= full_scale)
        return SensorReading(value, self.age, not clipped)

    def tare(self) -> float:
        """Zero the sensor at the present load; give the torque (N*m) it showed before, minus what it shows after.

        Both values come from the process value. Raises RigTimeoutError if the device refuses by silence or by its
        time-out abort, DriveFaultError if it refuses otherwise; the offset it kept is read again and named.
        """
        objects = self.node.objects
        digits = objects.read(DECIMAL_DIGITS)
        if digits != self._digits:
            raise DeviceFaultError(
                self.name,
                f"changed its decimal digits from {self._digits} to {digits}: readings are rescaled",
                state="",
            )
        old_offset, before = objects.find(OFFSET), objects.read(PROCESS_VALUE)
        try:
            objects.write(AUTOZERO, ZERO_COMMAND, self._options.tare_timeout)
        except RigTimeoutError as error:
            raise self._refused(f"no answer ({error})", before) from error
        except SdoAbortError as error:
            if error.abort_code != ABORTED_BY_TIMEOUT:
                raise
            raise self._refused(str(error), before) from error
        new_offset, after = objects.find(OFFSET), objects.read(PROCESS_VALUE)
        removed = (before - after) * self._scale
        self.node.report(f"zeroed: removed {removed:.6g} N*m; offset object {old_offset} -> {new_offset}")
        return removed

    def close(self) -> None:
        """Restore what was changed and leave the node pre-operational; allowed in any condition."""
        if self._open:
            self._open = False
            self.node.shut_down()

    def on_feedback(self, data: bytearray) -> bool:
        """Take one TPDO; True if it is the first of its cycle. A wrong length is noted as a failure."""
        if len(data) != self._size:
            self.node.wrong_length(FEEDBACK, self._size, bytes(data))
            return False
        (self._raw,) = self._unpack(data)
        first = self.age > 0
        self.age = 0
        return first

    def _refused(self, how: str, before: int) -> RigTimeoutError:
        offset = self.node.objects.find(OFFSET)
        return RigTimeoutError(
            f"torque sensor '{self.name}' to zero itself",
            self._options.tare_timeout,
            last_seen=f"{how}; it shows {before * self._scale:.6g} N*m and its offset object is {offset}",
            hint="The old zero still holds. Unload the sensor; the load may be outside its tare range.",
        )

"""Access to a device's objects by SDO: replies matched to their request, nothing retried, exact lengths.

`canopen.SdoClient` builds and reads the frames of expedited and segmented transfers. Its own waiting is replaced:
it would take the late acknowledgement of one write for that of another, and it blocks on wall-clock time. Here a
reply counts only if it answers this kind of request for this object; aborts likewise; waiting pumps the bus, so
that process data, heartbeats and emergency messages keep flowing. A read whose answer was late is not protected
by the protocol, so everything received before a request is thrown away first. Source: CiA 301, SDO protocol.
"""

from collections import deque

from canopen import ObjectDictionary
from canopen.sdo.client import SdoClient
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError, SdoError

from drivers.canopen.eds import DeviceDescription
from drivers.canopen.errors import DeviceFaultError, SdoAbortError
from drivers.canopen.link import Link
from drivers.canopen.objects import ObjectRef
from drivers.clock import Clock
from drivers.errors import ConfigError, Mistake, RigTimeoutError

OBJECT_MISSING = 0x06020000
SUB_INDEX_MISSING = 0x06090011
ABORTED_BY_TIMEOUT = 0x05040000

_COMMAND = 0xE0
"""Upper three bits of the first byte: the kind of request or answer."""
_INITIATE_DOWNLOAD, _INITIATE_UPLOAD, _ABORT = 0x20, 0x40, 0x80
_ANSWERS = {0x20: 0x60, 0x40: 0x40, 0x00: 0x20, 0x60: 0x00}
"""Kind of request to kind of answer: initiate download, initiate upload, download segment, upload segment."""
_EXPEDITED_AND_SIZE, _EXPEDITED_WITHOUT_SIZE = 0x03, 0x02
"""Lowest two bits of the answer to an upload request; without size the object's own length holds."""


class PumpedSdoClient(SdoClient):
    """`canopen.SdoClient` that waits by pumping the link, `timeout` s by the injected clock for each answer."""

    def __init__(self, node_id: int, link: Link, clock: Clock, timeout: float) -> None:
        # an empty dictionary: with a filled one the library cuts answers to the declared length without a word
        SdoClient.__init__(self, 0x600 + node_id, 0x580 + node_id, ObjectDictionary())
        self._link = link
        self._clock = clock
        self.timeout = timeout
        self.length_told = True
        self._multiplexor = bytes(3)
        self._replies: deque[bytes] = deque()
        link.route(0x580 + node_id, self._keep)

    def request_response(self, sdo_request: bytes) -> bytes:
        """Send one request and give its answer (8 bytes).

        Raises SdoAbortedError, SdoCommunicationError after the time-out, NotConnectedError if the bus fails.
        """
        kind = sdo_request[0] & _COMMAND
        initiate = kind in (_INITIATE_DOWNLOAD, _INITIATE_UPLOAD)
        if initiate:
            self._multiplexor = bytes(sdo_request[1:4])
        self._link.drain()
        self._replies.clear()
        self._link.send(self.rx_cobid, bytes(sdo_request))
        deadline = self._clock.now() + self.timeout
        while True:
            while self._replies:
                reply = self._replies.popleft()
                if reply[0] == _ABORT and reply[1:4] == self._multiplexor:
                    raise SdoAbortedError(int.from_bytes(reply[4:8], "little"))
                if reply[0] & _COMMAND == _ANSWERS[kind] and (not initiate or reply[1:4] == self._multiplexor):
                    if kind == _INITIATE_UPLOAD:
                        self.length_told = reply[0] & _EXPEDITED_AND_SIZE != _EXPEDITED_WITHOUT_SIZE
                    return reply
            remaining = deadline - self._clock.now()
            if remaining <= 0 or not self._link.pump(remaining):
                self.abort(ABORTED_BY_TIMEOUT)
                raise SdoCommunicationError("no answer in time")

    def abort(self, abort_code: int = 0x08000000) -> None:
        """Tell the device that the transfer is over, naming the object."""
        self._link.send(self.rx_cobid, bytes([_ABORT]) + self._multiplexor + abort_code.to_bytes(4, "little"))

    def _keep(self, data: bytearray) -> bool:
        if len(data) == 8:
            self._replies.append(bytes(data))
        return False


class ObjectAccess:
    """The objects of one device, as integers. `timeout` in s for each request.

    `description`: what a file says of the device; an object that it does not have, or gives another type, is refused.
    Every method raises ConfigError then, SdoAbortError if the device refuses, RigTimeoutError if it does not answer,
    and NotConnectedError if the bus fails.
    """

    def __init__(self, device: str, node_id: int, link: Link, clock: Clock, timeout: float) -> None:
        self._device = device
        self._where = f"'{device}' (node {node_id})"
        self._timeout = timeout
        self._client = PumpedSdoClient(node_id, link, clock, timeout)
        self.description: DeviceDescription | None = None

    def read(self, ref: ObjectRef) -> int:
        """Give the value of an object. Raises DeviceFaultError if it has another length than its type."""
        self._require_agreement(ref)
        try:
            data = self._client.upload(ref.index, ref.sub)
        except SdoError as error:
            raise self._translated(error, f"reading {ref}") from error
        try:
            return ref.decode(data if self._client.length_told else data[: ref.size])
        except ValueError as error:
            raise DeviceFaultError(self._device, f"answered with a wrong length: {error}", state="") from error

    def find(self, ref: ObjectRef) -> int | None:
        """Give the value of an object, None if the device, or its description, has no such object."""
        if self.description is not None and (ref.index, ref.sub) not in self.description.codes:
            return None
        try:
            return self.read(ref)
        except SdoAbortError as error:
            if error.abort_code in (OBJECT_MISSING, SUB_INDEX_MISSING):
                return None
            raise

    def write(self, ref: ObjectRef, value: int, timeout: float | None = None) -> None:
        """Write an object once; a time-out (s, the usual one if None) leaves open whether the device took it."""
        self._require_agreement(ref)
        self._client.timeout = self._timeout if timeout is None else timeout
        try:
            self._client.download(ref.index, ref.sub, ref.encode(value))
        except SdoError as error:
            raise self._translated(error, f"writing {value} to {ref}") from error
        finally:
            self._client.timeout = self._timeout

    def write_verified(self, ref: ObjectRef, value: int) -> None:
        """Write an object and read it back. Raises DeviceFaultError if the device keeps another value."""
        self.write(ref, value)
        kept = self.read(ref)
        if kept != value:
            raise DeviceFaultError(
                self._device,
                f"did not keep {ref}: wanted {value} (0x{value & 0xFFFFFFFF:X}), got {kept} (0x{kept & 0xFFFFFFFF:X})",
                state="",
                hint="Check the device's manual for what blocks this object.",
            )

    def _require_agreement(self, ref: ObjectRef) -> None:
        """Raise ConfigError if the device's description disagrees with what the driver holds of the object."""
        rule = "" if self.description is None else self.description.disagreement(ref)
        if self.description is not None and rule:
            raise ConfigError(
                f"device '{self._device}'",
                [Mistake("options.eds", self.description.source, rule)],
                hint="Take the file that belongs to the device, or another driver or profile.",
            )

    def _translated(self, error: SdoError, doing: str) -> RigTimeoutError | SdoAbortError:
        if isinstance(error, SdoAbortedError):
            return SdoAbortError(self._device, f"refused {doing}: SDO abort {error}", abort_code=error.code)
        return RigTimeoutError(
            f"the answer of {self._where} to {doing}",
            self._client.timeout,
            last_seen=str(error),
            hint="Check that the device is on and not stopped.",
        )

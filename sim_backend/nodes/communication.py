"""The communication half of a simulated CANopen device: NMT, SYNC, SDO, PDO, EMCY and heartbeats (CiA 301).

What the device does beyond that is a `Device` (drive, encoder, transducer) behind it. The frames that matter in
the present NMT state are the keys of one table: in STOPPED there is no SDO because its identifier is not in it.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import partial
from typing import Protocol

from sim_backend.errors import ModelError
from sim_backend.nodes.emergency import Emergency, emergency_specs
from sim_backend.nodes.frame import NO_FRAMES, Frame
from sim_backend.nodes.heartbeat import HeartbeatConsumer, HeartbeatProducer, heartbeat_specs
from sim_backend.nodes.object_dictionary import AbortCode, Access, DataType, ObjectDictionary, ObjectSpec, array
from sim_backend.nodes.pdo import PDO_COUNT, PdoDefault, ReceivePdo, TransmitPdo, pdo_specs
from sim_backend.nodes.sdo_server import SdoServer

TIME_TOLERANCE = 1e-6
"""s. A deadline this close counts as reached, so that rounding of simulated time costs no tick."""

HEARTBEAT_LOST = 0x8130
SYNC_LENGTH = 0x8240
PDO_TOO_SHORT = 0x8210
PDO_TOO_LONG = 0x8220

_NMT, _SYNC, _SDO_REQUEST, _SDO_RESPONSE, _HEARTBEAT = 0x000, 0x080, 0x600, 0x580, 0x700
_COMMUNICATION_AREA = (0x1000, 0x1FFF)
_EVERYTHING = (0x1000, 0xFFFF)


class NmtState(IntEnum):
    """NMT states, as a heartbeat prints them."""

    INITIALISING = 0x00
    STOPPED = 0x04
    OPERATIONAL = 0x05
    PRE_OPERATIONAL = 0x7F


_NMT_COMMANDS = {0x01: NmtState.OPERATIONAL, 0x02: NmtState.STOPPED, 0x80: NmtState.PRE_OPERATIONAL}
_RESET_NODE, _RESET_COMMUNICATION = 0x81, 0x82


@dataclass(frozen=True, slots=True)
class DeviceType:
    """What a kind of device is: 0x1000, name, product code, its objects and the PDOs it is shipped with."""

    profile: int
    name: str
    product_code: int
    objects: tuple[ObjectSpec, ...]
    receive: tuple[PdoDefault, ...] = ()
    transmit: tuple[PdoDefault, ...] = ()


@dataclass(frozen=True, slots=True)
class NodeOptions:
    """How devices of different make differ on the bus.

    `boot_time`: s from a reset to the boot-up message (0 at power-on: a bench is found running).
    `change_while_valid`: abort code for changing a PDO that is in use. `hidden`: objects this make does not have.
    """

    boot_time: float = 0.02
    change_while_valid: AbortCode = AbortCode.DEVICE_STATE
    hidden: frozenset[int] = frozenset()


class Device(Protocol):
    """The application half of a device."""

    @property
    def device_type(self) -> DeviceType:
        """What it is, with its table of objects."""

    @property
    def moves(self) -> bool:
        """Whether it has a state that moves with time, so that `tick` must be called at every tick."""

    def attach(self, node: "CanopenNode") -> None:
        """Bind to the node's dictionary and emergency producer; called once."""

    def start(self) -> None:
        """Go to the condition after power-on or reset."""

    def tick(self, time: float) -> None:
        """Let time (s) pass."""

    def connection_lost(self) -> None:
        """React to the loss of the master."""


class CanopenNode:
    """One device on the bus. Frames go in by `on_frame`, time by `tick`; both give the frames it sends."""

    def __init__(self, node_id: int, device: Device, options: NodeOptions | None = None) -> None:
        if not 1 <= node_id <= 127:
            raise ModelError(f"node id {node_id} of a simulated device is outside 1 to 127")
        options = options or NodeOptions()
        kind = device.device_type
        self.node_id = node_id
        self.device = device
        self.time = 0.0
        self.state = NmtState.INITIALISING
        self.dictionary = ObjectDictionary(_node_specs(node_id, kind), options.hidden)
        self.emergency = Emergency(self.dictionary, node_id, self._send_emergency)
        self._options = options
        self._out: list[Frame] = []
        self.accepts: dict[int, Callable[[bytes], None]] = {}
        self.accepts_changed: Callable[[], None] = _nobody_listens
        self._boot_due = 0.0
        self._deadline = 0.0
        self.due = 0.0
        self._sdo = SdoServer(self.dictionary)
        self._producer = HeartbeatProducer(self.dictionary)
        self._consumer = HeartbeatConsumer(self.dictionary, self._listen)
        self._receive = [
            ReceivePdo(self.dictionary, n, options.change_while_valid, partial(self._receive_pdo_changed, n))
            for n in range(PDO_COUNT)
        ]
        self._transmit = [
            TransmitPdo(self.dictionary, n, options.change_while_valid, partial(self._transmit_pdo_changed, n))
            for n in range(PDO_COUNT)
        ]
        self._sync_receive: tuple[ReceivePdo, ...] = ()
        self._at_sync: tuple[Callable[[], Frame | None], ...] = ()
        self._event_transmit: tuple[TransmitPdo, ...] = ()
        self._wrong_length: set[ReceivePdo] = set()
        self._sync_length = self.dictionary[0x1019, 0]
        self._reaction = self.dictionary[0x1029, 1]
        self.dictionary[0x1017, 0].changed = lambda _: self._restart_heartbeat()
        device.attach(self)
        self._compile()
        device.start()

    def on_frame(self, time: float, can_id: int, data: bytes) -> Sequence[Frame]:
        """Hear one frame at `time` (s); give the frames it makes the device send."""
        handler = self.accepts.get(can_id)
        if handler is None:
            return NO_FRAMES
        self.time = time
        handler(data)
        out = self._out
        if not out:
            return NO_FRAMES
        self._out = []
        return out

    def tick(self, time: float) -> Sequence[Frame]:
        """Let simulated time reach `time` (s); give the frames that are due."""
        self.time = time
        if time >= self._deadline:
            self._serve_deadlines(time)
        self.device.tick(time)
        for pdo in self._event_transmit:
            frame = pdo.at_tick(time + TIME_TOLERANCE)
            if frame is not None:
                self._out.append(frame)
        out = self._out
        if not out:
            return NO_FRAMES
        self._out = []
        self._plan()
        return out

    def reboot(self) -> None:
        """Restart as after a power failure: everything back to its default, boot-up after the boot time."""
        self._restart(_EVERYTHING)
        self.device.start()

    def _send(self, can_id: int, data: bytes) -> None:
        self._out.append(Frame(can_id, data))
        self.due = -math.inf  # what was not caused by a frame leaves with the next tick

    def _send_emergency(self, can_id: int, data: bytes) -> None:
        if self.state in (NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL):
            self._send(can_id, data)

    def _serve_deadlines(self, time: float) -> None:
        now = time + TIME_TOLERANCE
        if now >= self._boot_due:
            self._boot()
        if now >= self._producer.due:
            self._send(_HEARTBEAT + self.node_id, bytes([self.state]))
            self._producer.next_period()
        if now >= self._consumer.due and self._consumer.lost(now):
            self._lose_connection()
        self._plan()

    def _plan(self) -> None:
        self._deadline = min(self._boot_due, self._producer.due, self._consumer.due) - TIME_TOLERANCE
        self.due = -math.inf if self.device.moves or self._event_transmit else self._deadline

    def _restart(self, area: tuple[int, int]) -> None:
        self.dictionary.reset(*area)
        self._sdo.reset()
        self.emergency.reset()
        self._wrong_length.clear()
        self.state = NmtState.INITIALISING
        self._boot_due = self.time + self._options.boot_time
        self._producer.due = math.inf
        self._consumer.configure()
        self._compile()
        self._plan()

    def _boot(self) -> None:
        self._boot_due = math.inf
        self._send(_HEARTBEAT + self.node_id, bytes([NmtState.INITIALISING]))
        self._producer.start(self.time)
        self._enter(NmtState.PRE_OPERATIONAL)

    def _enter(self, state: NmtState) -> None:
        previous, self.state = self.state, state
        if state is NmtState.OPERATIONAL and previous is not state:
            for pdo in self._transmit:
                pdo.start(self.time)
            for pending in self._receive:
                pending.pending = None
        self._listen()

    def _on_nmt(self, data: bytes) -> None:
        if len(data) != 2 or data[1] not in (0, self.node_id):
            return
        command = data[0]
        if command == _RESET_NODE:
            self.reboot()
        elif command == _RESET_COMMUNICATION:
            self.device.connection_lost()
            self._restart(_COMMUNICATION_AREA)
        elif command in _NMT_COMMANDS:
            state = _NMT_COMMANDS[command]
            if state is NmtState.STOPPED and self.state is not state:
                # CiA 402 counts a stopped node as a lost connection
                self.device.connection_lost()
            self._enter(state)

    def _on_sdo(self, request: bytes) -> None:
        response = self._sdo.answer(request)
        if response is not None:
            self._send(_SDO_RESPONSE + self.node_id, response)

    def _on_sync(self, data: bytes) -> None:
        if len(data) != (1 if self._sync_length.value else 0):
            self.emergency.raise_error(SYNC_LENGTH)
            return
        # inputs are sampled before outputs change: both belong to this SYNC
        for at_sync in self._at_sync:
            frame = at_sync()
            if frame is not None:
                self._out.append(frame)
        for setpoint in self._sync_receive:
            pending = setpoint.pending
            if pending is not None:
                setpoint.pending = None
                setpoint.apply(pending)

    def _on_receive_pdo(self, pdo: ReceivePdo, data: bytes) -> None:
        if len(data) != pdo.size:
            self._wrong_length.add(pdo)
            if len(data) < pdo.size:
                self.emergency.raise_error(PDO_TOO_SHORT)
                return
            self.emergency.raise_error(PDO_TOO_LONG)
        elif pdo in self._wrong_length:
            self._wrong_length.discard(pdo)
            if not self._wrong_length:
                self.emergency.clear_error(PDO_TOO_SHORT)
                self.emergency.clear_error(PDO_TOO_LONG)
        if pdo.transmission <= 240:
            pdo.pending = data
        else:
            pdo.apply(data)

    def _on_heartbeat(self, node_id: int, data: bytes) -> None:
        if self._consumer.hear(node_id, data, self.time):
            self.emergency.clear_error(HEARTBEAT_LOST)
            self._plan()

    def _lose_connection(self) -> None:
        self.emergency.raise_error(HEARTBEAT_LOST)
        reaction = self._reaction.value
        if reaction == 0 and self.state is NmtState.OPERATIONAL:
            self._enter(NmtState.PRE_OPERATIONAL)
        elif reaction == 2:
            self._enter(NmtState.STOPPED)
        self.device.connection_lost()

    def _restart_heartbeat(self) -> None:
        self._producer.start(self.time)
        self._plan()

    def _compile(self) -> None:
        for pdo in (*self._receive, *self._transmit):
            pdo.compile()
        self._listen()

    def _receive_pdo_changed(self, number: int) -> None:
        self._receive[number].pending = None
        self._receive[number].compile()
        self._listen()

    def _transmit_pdo_changed(self, number: int) -> None:
        self._transmit[number].compile()
        self._transmit[number].start(self.time)
        self._listen()

    def _listen(self) -> None:
        """Work out which frames matter now, and what SYNC and ticks move."""
        self.accepts = {}
        self.accepts_changed()
        self._sync_receive = self._at_sync = self._event_transmit = ()
        if self.state is NmtState.INITIALISING:
            return
        self._add(_NMT, self._on_nmt)
        for node_id in self._consumer.watched:
            self._add(_HEARTBEAT + node_id, partial(self._on_heartbeat, node_id))
        if self.state is not NmtState.STOPPED:
            self._add(_SDO_REQUEST + self.node_id, self._on_sdo)
        if self.state is NmtState.OPERATIONAL:
            self._add(_SYNC, self._on_sync)
            receive = [pdo for pdo in self._receive if pdo.valid and pdo.size]
            transmit = [pdo for pdo in self._transmit if pdo.valid and pdo.size]
            for pdo in receive:
                self._add(pdo.can_id, partial(self._on_receive_pdo, pdo))
            self._sync_receive = tuple(pdo for pdo in receive if pdo.synchronous)
            self._at_sync = tuple(pdo.at_sync for pdo in transmit if pdo.synchronous)
            self._event_transmit = tuple(pdo for pdo in transmit if not pdo.synchronous)
        self._plan()

    def _add(self, can_id: int, handler: Callable[[bytes], None]) -> None:
        earlier = self.accepts.get(can_id)
        if earlier is None:
            self.accepts[can_id] = handler
            return

        def both(data: bytes) -> None:
            earlier(data)
            handler(data)

        self.accepts[can_id] = both


def _nobody_listens() -> None:
    """Stand in for the bus until the device is on one."""


def _node_specs(node_id: int, kind: DeviceType) -> list[ObjectSpec]:
    identity = [
        ObjectSpec(0x1018, 1, "Vendor id", DataType.U32),
        ObjectSpec(0x1018, 2, "Product code", DataType.U32, default=kind.product_code),
        ObjectSpec(0x1018, 3, "Revision number", DataType.U32, default=0x00010000),
        ObjectSpec(0x1018, 4, "Serial number", DataType.U32, default=node_id),
    ]
    error_behaviour = ObjectSpec(0x1029, 1, "Communication error", DataType.U8, Access.RW, high=2)
    common = [
        ObjectSpec(0x1000, 0, "Device type", DataType.U32, Access.CONST, kind.profile),
        *emergency_specs(node_id),
        ObjectSpec(0x1005, 0, "COB-ID SYNC", DataType.U32, Access.CONST, _SYNC),
        ObjectSpec(0x1006, 0, "Communication cycle period (us)", DataType.U32, Access.RW),
        ObjectSpec(0x1008, 0, "Device name", DataType.VISIBLE_STRING, Access.CONST, kind.name.encode("ascii")),
        *heartbeat_specs(),
        *array(0x1018, "Identity", identity),
        ObjectSpec(0x1019, 0, "Synchronous counter overflow value", DataType.U8, Access.RW, high=240),
        *array(0x1029, "Error behaviour", [error_behaviour]),
    ]
    return [*common, *kind.objects, *pdo_specs(node_id, kind.receive, kind.transmit, kind.objects)]

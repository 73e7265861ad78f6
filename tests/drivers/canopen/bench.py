"""Drivers on the simulated devices, with a tap in between that sees, adds and replaces frames."""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import can

from drivers.canopen.bus import CanopenBus, open_bus
from drivers.canopen.drive import Cia402Drive
from drivers.canopen.encoder import Cia406Encoder
from drivers.canopen.torque import Cia404TorqueSensor
from drivers.clock import VirtualClock
from drivers.devices import DeviceConfig
from sim_backend.nodes.bench import LOAD_DRIVE, MOTOR_DRIVE, OUTPUT_ENCODER, TORQUE_TRANSDUCER, bench_nodes
from sim_backend.nodes.communication import CanopenNode, NodeOptions
from sim_backend.nodes.drive402 import Drive402
from sim_backend.nodes.drive402_objects import DriveConfig
from sim_backend.nodes.encoder406 import EncoderConfig
from sim_backend.nodes.torque404 import TorqueConfig
from sim_backend.ports import AxisMode, PlantReading
from sim_backend.world import World

CYCLE_TIME = 1e-3
HEARTBEAT_TIME = 0.1


class StillPlant:
    """A plant that stands where it is put and remembers what it was told."""

    def __init__(self) -> None:
        self.time = 0.0
        self.reading = PlantReading(1.0, 0.0, 0.02, 0.5, 0.0, 2.0, 0.25, 3.0, 20.0, 20.0)
        self.commands: dict[str, tuple[AxisMode, float]] = {}
        self.limited = False

    def advance_to(self, time: float) -> None:
        self.time = time

    def command(self, axis: str, mode: AxisMode, target: float) -> None:
        self.commands[axis] = (mode, target)

    def set_torque_limit(self, axis: str, limit: float) -> None:
        pass

    def torque_limited(self, axis: str) -> bool:
        return self.limited

    def read(self) -> PlantReading:
        return self.reading

    def set_lock(self, locked: bool) -> None:
        pass

    def set(self, **values: float) -> None:
        self.reading = self.reading._replace(**values)


class Target(Protocol):
    def send(self, message: can.Message) -> None: ...
    def recv(self, timeout: float) -> can.Message | None: ...


class Tap:
    """A bus in front of the bus: `sent` lists what the bench sent, `inject` adds what it receives next."""

    def __init__(self, target: Target) -> None:
        self.target = target
        self.sent: list[tuple[int, bytes]] = []
        self.broken: Exception | None = None
        self._extra: deque[can.Message] = deque()

    def send(self, message: can.Message) -> None:
        if self.broken is not None:
            raise self.broken
        self.sent.append((message.arbitration_id, bytes(message.data)))
        self.target.send(message)

    def recv(self, timeout: float) -> can.Message | None:
        if self.broken is not None:
            raise self.broken
        return self._extra.popleft() if self._extra else self.target.recv(timeout)

    def inject(self, message: can.Message) -> None:
        self._extra.append(message)

    def sent_to(self, can_id: int) -> list[bytes]:
        return [data for sent_id, data in self.sent if sent_id == can_id]


@dataclass
class SimulatedBench:
    """Everything a test may want to touch."""

    plant: StillPlant
    world: World
    clock: VirtualClock
    tap: Tap
    bus: CanopenBus
    devices: dict[str, Any]

    @property
    def motor(self) -> Cia402Drive:
        return self.devices["motor"]

    @property
    def load(self) -> Cia402Drive:
        return self.devices["load"]

    @property
    def encoder(self) -> Cia406Encoder:
        return self.devices["output_encoder"]

    @property
    def torque(self) -> Cia404TorqueSensor:
        return self.devices["torque_sensor"]

    def connect(self) -> "SimulatedBench":
        for device in self.devices.values():
            device.connect()
        self.cycles(1)
        return self

    def cycles(self, count: int, each: Callable[[], None] = lambda: None) -> None:
        for _ in range(count):
            self.clock.sleep_until(self.clock.now() + CYCLE_TIME)
            each()
            self.bus.exchange()

    def node(self, node_id: int) -> CanopenNode:
        node = self.world.node(node_id)
        assert isinstance(node, CanopenNode)
        return node

    def drive_node(self, node_id: int = 1) -> Drive402:
        device = self.node(node_id).device
        assert isinstance(device, Drive402)
        return device

    def value(self, node_id: int, index: int, sub: int = 0) -> int:
        return int(self.node(node_id).dictionary[index, sub].value)


def device_config(name: str, driver: str, address: int, **changes: Any) -> DeviceConfig:
    """Give a valid configuration, changed as a test needs it."""
    config = DeviceConfig(
        name=name,
        driver=driver,
        interface="simulated",
        channel="bench",
        address=address,
        profile="generic",
        cycle_time=CYCLE_TIME,
        heartbeat_time=HEARTBEAT_TIME,
    )
    return replace(config, **changes)


MOTOR = device_config("motor", "cia402", 1)
LOAD = device_config("load", "cia402", 2)
ENCODER = device_config("output_encoder", "cia406", 3)
TORQUE = device_config("torque_sensor", "cia404", 4)


def simulated_bench(
    *configs: DeviceConfig,
    motor: DriveConfig = MOTOR_DRIVE,
    load: DriveConfig = LOAD_DRIVE,
    encoder: EncoderConfig = OUTPUT_ENCODER,
    torque: TorqueConfig = TORQUE_TRANSDUCER,
    options: NodeOptions | None = None,
) -> SimulatedBench:
    """Give drivers for `configs` (default: all four devices) on simulated devices, attached but not connected."""
    wanted: Sequence[DeviceConfig] = configs or (MOTOR, LOAD, ENCODER, TORQUE)
    plant = StillPlant()
    world = World(plant, bench_nodes(plant, motor=motor, load=load, encoder=encoder, torque=torque, options=options))
    clock = VirtualClock(world, epoch_ns=0)
    tap = Tap(world.bus)
    bus = open_bus(wanted, clock, tap)
    devices = {config.name: bus.attach(config) for config in wanted}
    return SimulatedBench(plant, world, clock, tap, bus, devices)

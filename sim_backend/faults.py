"""Named faults of the simulated bench. Adding one is one function and one line in `FAULTS`."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from sim_backend.buses.hooks import corrupt, drop, from_node, process_data_of
from sim_backend.errors import ModelError
from sim_backend.nodes.communication import CanopenNode
from sim_backend.nodes.drive402 import Drive402
from sim_backend.nodes.frame import Frame
from sim_backend.world import World

OVER_CURRENT = 0x2310
SHORT_LENGTH = 3
"""Bytes that are left of a shortened PDO."""


@dataclass(frozen=True, slots=True)
class Fault:
    """One way in which a device can go wrong, from the given instant on."""

    name: str
    summary: str
    act: Callable[[World, int], None]

    def inject(self, world: World, node_id: int, time: float) -> None:
        """Let it happen to a node at simulated `time` (s). Raises ModelError if there is no such node."""
        world.node(node_id)
        world.schedule(time, lambda: self.act(world, node_id))


def _refuse_mode(world: World, node_id: int) -> None:
    drive = _drive(world, node_id)
    drive.refuse_modes(frozenset(drive.config.modes))


def _drive_fault(world: World, node_id: int) -> None:
    _drive(world, node_id).fault(OVER_CURRENT)


def _ignore_control_word(world: World, node_id: int) -> None:
    _drive(world, node_id).ignore_control_words()


def _mute(world: World, node_id: int) -> None:
    world.bus.add_hook(drop(from_node(node_id)))


def _reboot(world: World, node_id: int) -> None:
    _canopen_node(world, node_id).reboot()


def _short_pdo(world: World, node_id: int) -> None:
    world.bus.add_hook(corrupt(process_data_of(node_id), lambda frame: Frame(frame.can_id, frame.data[:SHORT_LENGTH])))


def _freeze_pdo(world: World, node_id: int) -> None:
    last: dict[int, Frame] = {}
    world.bus.add_hook(corrupt(process_data_of(node_id), lambda frame: last.setdefault(frame.can_id, frame)))


def _canopen_node(world: World, node_id: int) -> CanopenNode:
    node = world.node(node_id)
    if not isinstance(node, CanopenNode):
        raise ModelError(f"node {node_id} is no simulated CANopen device")
    return node


def _drive(world: World, node_id: int) -> Drive402:
    device = _canopen_node(world, node_id).device
    if not isinstance(device, Drive402):
        raise ModelError(f"node {node_id} is no drive, so this fault does not apply to it")
    return device


FAULTS: Mapping[str, Fault] = {
    fault.name: fault
    for fault in (
        Fault("refuse-mode", "the drive refuses every mode of operation asked for from now on", _refuse_mode),
        Fault("drive-fault", "the drive reports over-current and goes to fault", _drive_fault),
        Fault("ignore-control-word", "the drive keeps its state whatever it is told", _ignore_control_word),
        Fault("mute", "the device stops sending", _mute),
        Fault("reboot", "the device restarts: settings lost, one boot-up message", _reboot),
        Fault("short-pdo", "the device's PDOs lose their last bytes", _short_pdo),
        Fault("freeze-pdo", "the device's PDOs repeat their last values", _freeze_pdo),
    )
}
"""Every fault by name."""

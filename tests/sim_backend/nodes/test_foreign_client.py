"""The SDO server against somebody else's client: the SDO part of the `canopen` package."""

import can
import canopen
import pytest

from sim_backend.nodes.bench import bench_nodes
from sim_backend.world import World
from tests.sim_backend.fake_plant import FakePlant


class LockstepNetwork(canopen.Network):
    """The package's own extension point, without its threads."""

    def __init__(self, world: World) -> None:
        super().__init__()
        self._world = world

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        self._world.bus.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=False))
        while (received := self._world.bus.recv(0)) is not None:
            self.notify(received.arbitration_id, bytearray(received.data), received.timestamp)


@pytest.fixture
def node() -> canopen.RemoteNode:
    plant = FakePlant()
    network = LockstepNetwork(World(plant, bench_nodes(plant)))
    node = canopen.RemoteNode(1, canopen.ObjectDictionary())
    network.add_node(node)
    return node


def test_expedited_and_segmented_uploads_arrive_whole(node: canopen.RemoteNode) -> None:
    assert node.sdo.upload(0x1000, 0) == bytes.fromhex("92010200")
    assert node.sdo.upload(0x1008, 0) == b"simulated CiA 402 drive"


def test_expedited_and_segmented_downloads_are_stored(node: canopen.RemoteNode) -> None:
    node.sdo.download(0x1017, 0, b"\x64\x00")
    assert node.sdo.upload(0x1017, 0) == b"\x64\x00"
    node.sdo.download(0x607A, 0, b"\x01\x02\x03\x04", force_segment=True)
    assert node.sdo.upload(0x607A, 0) == b"\x01\x02\x03\x04"


def test_aborts_are_understood(node: canopen.RemoteNode) -> None:
    with pytest.raises(canopen.SdoAbortedError) as caught:
        node.sdo.download(0x6060, 0, b"\x01")
    assert caught.value.code == 0x06090030


def test_block_transfer_is_refused_by_the_code_for_unknown_commands(node: canopen.RemoteNode) -> None:
    with pytest.raises(canopen.SdoAbortedError) as caught:
        node.sdo.open(0x1008, 0, "rb", block_transfer=True)
    assert caught.value.code == 0x05040001

"""The lock-step bus as a python-can user sees it."""

import can
import pytest

from sim_backend.buses.hooks import corrupt, delay, drop, duplicate, from_node, process_data_of, refuse
from sim_backend.buses.lockstep import BITRATE, CASCADE_LIMIT, SILENCE_LIMIT, _message, frame_bits
from sim_backend.nodes.bench import bench_nodes
from sim_backend.nodes.frame import Frame
from sim_backend.world import World
from tests.sim_backend.fake_plant import FakePlant

READ_TYPE = "40 00 10 00 00 00 00 00"


def message(can_id: int, data: str = "") -> can.Message:
    return can.Message(arbitration_id=can_id, is_extended_id=False, data=bytes.fromhex(data))


def drain(world: World) -> list[tuple[int, str]]:
    found = []
    while (received := world.bus.recv(0)) is not None:
        found.append((received.arbitration_id, received.data.hex(" ")))
    return found


@pytest.fixture
def world() -> World:
    world = World(FakePlant(), bench_nodes(FakePlant()))
    assert drain(world) == [(0x701, "00"), (0x702, "00"), (0x703, "00"), (0x704, "00")]
    return world


def capture_ready(world: World) -> None:
    """The capture set-up of a bench: one packed TPDO per drive, encoder and torque node, all on SYNC."""
    drain(world)
    for node, entries in (
        (1, (0x60410010, 0x60640020, 0x60770010)),
        (2, (0x60410010, 0x60640020, 0x60770010)),
        (3, (0x60040020,)),
        (4, (0x91300120,)),
    ):
        for index, sub, value, size in (
            (0x1800, 1, 0xC0000180 + node, 4),
            (0x1A00, 0, 0, 1),
            *((0x1A00, n, entry, 4) for n, entry in enumerate(entries, 1)),
            (0x1A00, 0, len(entries), 1),
            (0x1800, 2, 1, 1),
            (0x1800, 1, 0x40000180 + node, 4),
        ):
            head = (0x2F if size == 1 else 0x23, index & 0xFF, index >> 8, sub)
            world.bus.send(message(0x600 + node, (bytes(head) + value.to_bytes(4, "little")).hex()))
            reply = world.bus.recv(0.1)
            assert reply is not None
            assert reply.data[0] == 0x60
    world.bus.send(message(0x000, "01 00"))


def test_answers_wait_in_the_queue_with_simulated_time(world: World) -> None:
    world.advance_to(0.25)
    world.bus.send(message(0x601, READ_TYPE))
    reply = world.bus.recv(1.0)
    assert reply is not None
    assert (reply.arbitration_id, reply.data.hex(" ")) == (0x581, "43 00 10 00 92 01 02 00")
    assert (reply.timestamp, reply.is_extended_id) == (0.25, False)
    assert world.time == 0.25  # no time passes while an answer is waiting


def test_a_time_out_passes_in_simulated_time(world: World) -> None:
    assert world.bus.recv(0.5) is None
    assert world.time == 0.5
    assert world.bus.recv(0.0) is None
    assert world.time == 0.5


def test_waiting_lets_the_devices_act(world: World) -> None:
    world.bus.send(message(0x603, "2B 17 10 00 0A 00 00 00"))  # encoder heartbeat 10 ms
    drain(world)
    beat = world.bus.recv(1.0)
    assert beat is not None
    assert (beat.arbitration_id, beat.timestamp) == (0x703, 0.01)
    assert world.time == pytest.approx(0.01)


def test_waiting_for_ever_ends_with_an_error_instead_of_a_hang(world: World) -> None:
    with pytest.raises(can.CanOperationError, match="60 s"):
        world.bus.recv()
    assert world.time == pytest.approx(SILENCE_LIMIT)


def test_filters_of_python_can_work(world: World) -> None:
    world.bus.set_filters([{"can_id": 0x582, "can_mask": 0x7FF}])
    world.bus.send(message(0x601, READ_TYPE))
    world.bus.send(message(0x602, READ_TYPE))
    assert [can_id for can_id, _ in drain(world)] == [0x582]


def test_the_sender_does_not_hear_itself(world: World) -> None:
    world.bus.send(message(0x123, "01"))
    assert drain(world) == []


def test_devices_hear_each_other(world: World) -> None:
    world.bus.send(message(0x601, "23 16 10 01 19 00 03 00"))  # node 1 watches the encoder's heartbeat, 25 ms
    world.bus.send(message(0x603, "2B 17 10 00 0A 00 00 00"))
    world.advance_to(0.1)
    world.bus.send(message(0x603, "2B 17 10 00 00 00 00 00"))
    world.advance_to(0.2)
    assert (0x081, "30 81 11 00 00 00 00 00") in drain(world)


@pytest.mark.parametrize(
    "odd",
    [
        can.Message(arbitration_id=0x601, is_extended_id=True, data=bytes.fromhex(READ_TYPE)),
        can.Message(arbitration_id=0x601, is_extended_id=False, is_remote_frame=True, dlc=8),
        can.Message(arbitration_id=0x601, is_error_frame=True),
    ],
    ids=["extended", "remote", "error"],
)
def test_other_kinds_of_frames_reach_no_device(world: World, odd: can.Message) -> None:
    world.bus.send(odd)
    assert drain(world) == []


def test_can_fd_and_cyclic_senders_are_refused(world: World) -> None:
    with pytest.raises(can.CanOperationError, match="CAN FD"):
        world.bus.send(can.Message(arbitration_id=1, is_extended_id=False, is_fd=True))
    with pytest.raises(can.CanInterfaceNotImplementedError):
        world.bus.send_periodic(message(0x080), 0.01)


def test_a_closed_bus_says_so_and_the_devices_live_on(world: World) -> None:
    world.bus.shutdown()
    with pytest.raises(can.CanOperationError, match="shut down"):
        world.bus.send(message(0x080))
    with pytest.raises(can.CanOperationError, match="shut down"):
        world.bus.recv(0)
    world.advance_to(0.01)
    assert world.time == 0.01


@pytest.mark.parametrize(("size", "bits"), [(0, 55), (8, 135)])
def test_bits_of_a_frame_are_those_of_the_worst_case(size: int, bits: int) -> None:
    # at 1 Mbit/s an empty SYNC takes up to 55 us and a full frame up to 135 us
    assert frame_bits(size) == bits


def test_the_bus_load_of_a_capture_is_the_sum_of_its_frames(world: World) -> None:
    capture_ready(world)
    before = world.bus.bits
    for cycle in range(1, 101):
        world.bus.send(message(0x201, "00 00"))
        world.bus.send(message(0x080))
        world.advance_to(cycle * 1e-3)
        # of the shipped set-up only what changes is sent, and nothing changes here
        assert len(drain(world)) >= 4
    per_cycle = frame_bits(2) + frame_bits(0) + 2 * frame_bits(8) + 2 * frame_bits(4)
    assert world.bus.bits - before == 100 * per_cycle
    assert world.bus.load(0.1) == world.bus.bits / (0.1 * BITRATE)
    with pytest.raises(ValueError, match="positive"):
        world.bus.load(0.0)


def sync(world: World) -> list[tuple[int, str]]:
    world.bus.send(message(0x080))
    return drain(world)


def test_hooks_drop_duplicate_and_corrupt_what_they_match_and_can_be_removed(world: World) -> None:
    capture_ready(world)
    drain(world)
    plain = sync(world)
    assert [can_id for can_id, _ in plain] == [0x181, 0x182, 0x183, 0x184]
    hooks = [
        drop(from_node(2)),
        duplicate(process_data_of(3)),
        corrupt(process_data_of(4), lambda frame: Frame(frame.can_id, frame.data[:1])),
    ]
    for hook in hooks:
        world.bus.add_hook(hook)
    assert sync(world) == [plain[0], plain[2], plain[2], (0x184, "00")]
    for hook in hooks:
        world.bus.remove_hook(hook)
    assert sync(world) == plain


def test_a_delayed_frame_comes_later_and_is_stamped_with_its_arrival(world: World) -> None:
    world.bus.add_hook(delay(from_node(1), 0.0105))
    world.bus.send(message(0x601, READ_TYPE))
    assert world.bus.recv(0.005) is None
    reply = world.bus.recv(1.0)
    assert reply is not None
    assert reply.timestamp == pytest.approx(0.011)  # the first tick after 10.5 ms


def test_a_delayed_request_is_answered_when_it_arrives(world: World) -> None:
    world.bus.add_hook(delay(lambda sender, frame: sender == 0 and frame.can_id == 0x601, 0.01))
    world.bus.send(message(0x601, READ_TYPE))
    assert drain(world) == []
    world.advance_to(0.01)
    assert [can_id for can_id, _ in drain(world)] == [0x581]


def test_an_adapter_that_has_gone_raises_in_send_and_recv(world: World) -> None:
    world.bus.send(message(0x603, "2B 17 10 00 0A 00 00 00"))
    drain(world)
    world.bus.add_hook(refuse(lambda _sender, _frame: True, "adapter unplugged"))
    with pytest.raises(can.CanOperationError, match="adapter unplugged"):
        world.bus.send(message(0x080))
    with pytest.raises(can.CanOperationError, match="adapter unplugged"):
        world.bus.recv(1.0)


class Echo:
    """A device that answers every frame with a frame."""

    accepts = range(0x800)
    time = due = 0.0

    def __init__(self, node_id: int) -> None:
        self.node_id = node_id
        self.accepts_changed = lambda: None

    def on_frame(self, _time: float, can_id: int, data: bytes) -> list[Frame]:
        return [Frame(can_id, data)]

    def tick(self, _time: float) -> list[Frame]:
        return []


def test_devices_that_answer_each_other_for_ever_are_an_overload_not_a_hang() -> None:
    world = World(FakePlant(), [Echo(1), Echo(2)])
    with pytest.raises(can.CanOperationError, match=f"overload: more than {CASCADE_LIMIT}"):
        world.bus.send(message(0x100))


def test_the_bus_is_a_python_can_bus_and_a_context_manager(world: World) -> None:
    with world.bus as bus:
        assert isinstance(bus, can.BusABC)
        assert "lock-step" in str(bus)


def test_a_received_message_is_what_the_constructor_would_make() -> None:
    made = _message(1.5, 0x181, b"1234567")
    wanted = can.Message(1.5, 0x181, is_extended_id=False, data=b"1234567")
    for name in can.Message.__slots__:
        if name != "__weakref__":
            assert getattr(made, name) == getattr(wanted, name), name
            assert type(getattr(made, name)) is type(getattr(wanted, name)), name

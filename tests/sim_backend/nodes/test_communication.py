"""NMT, heartbeats, emergency and SYNC of a simulated device."""

import pytest

from sim_backend.errors import ModelError
from sim_backend.nodes.bench import MOTOR_DRIVE, OUTPUT_ENCODER
from sim_backend.nodes.communication import CanopenNode, NodeOptions
from sim_backend.nodes.drive402 import Drive402, drive_node
from sim_backend.nodes.encoder406 import Encoder406, encoder_node
from sim_backend.ports import AxisMode
from tests.sim_backend.fake_plant import FakePlant
from tests.sim_backend.nodes.wire import AbortedError, Wire

READ_NMT = "601 40 00 10 00 00 00 00 00"


@pytest.fixture
def plant() -> FakePlant:
    return FakePlant()


@pytest.fixture
def drive(plant: FakePlant) -> Wire:
    return Wire(drive_node(MOTOR_DRIVE, plant))


def enable_torque(wire: Wire) -> None:
    wire.write(0x6060, 0, 10, 1)
    wire.tick(3)
    for word in (0x06, 0x07, 0x0F):
        wire.write(0x6040, 0, word, 2)


def heartbeats(frames: list[str]) -> list[str]:
    return [frame for frame in frames if frame.startswith("701")]


def test_boot_up_is_one_zero_byte_once(drive: Wire) -> None:
    assert drive.boot == ["701 00"]
    assert drive.tick(100) == []


def test_a_reset_gives_one_boot_up_after_the_boot_time_and_restores_the_defaults(drive: Wire) -> None:
    drive.write(0x1017, 0, 10, 2)
    drive.write(0x605A, 0, 6, 2)
    assert drive.send("000 81 01") == []
    assert drive.send(READ_NMT) == []  # nobody at home while booting
    assert drive.tick(19) == []
    assert drive.tick(1) == ["701 00"]
    assert drive.tick(100) == []
    assert drive.read(0x1017) == 0
    assert drive.read(0x605A) == 2


def test_reset_communication_keeps_the_profile_area(drive: Wire) -> None:
    drive.write(0x1017, 0, 10, 2)
    drive.write(0x605A, 0, 6, 2)
    drive.send("000 82 00")
    assert drive.tick(20) == ["701 00"]
    assert drive.read(0x1017) == 0
    assert drive.read(0x605A) == 6


@pytest.mark.parametrize(
    ("command", "byte"),
    [("000 01 01", "05"), ("000 02 01", "04"), ("000 80 01", "7F"), ("000 01 00", "05"), ("000 01 02", "7F")],
)
def test_the_heartbeat_shows_the_nmt_state_that_the_master_commanded(drive: Wire, command: str, byte: str) -> None:
    drive.write(0x1017, 0, 5, 2)
    drive.send(command)
    assert heartbeats(drive.tick(5)) == [f"701 {byte}"]


def test_the_heartbeat_keeps_its_period_over_a_long_time(drive: Wire) -> None:
    drive.write(0x1017, 0, 7, 2)
    assert len(drive.tick(70_000)) == 10_000


def test_a_heartbeat_time_of_zero_stops_the_heartbeat(drive: Wire) -> None:
    drive.write(0x1017, 0, 5, 2)
    drive.write(0x1017, 0, 0, 2)
    assert drive.tick(50) == []


def test_there_is_no_sdo_in_stopped_and_nmt_still_works(drive: Wire) -> None:
    drive.send("000 02 01")
    assert drive.send(READ_NMT) == []
    drive.send("000 80 01")
    assert len(drive.send(READ_NMT)) == 1


def test_malformed_nmt_commands_are_ignored(drive: Wire) -> None:
    for frame in ("000", "000 01", "000 01 01 00", "000 55 01"):
        assert drive.send(frame) == []
    drive.write(0x1017, 0, 5, 2)
    assert drive.tick(5) == ["701 7F"]


@pytest.mark.parametrize(
    ("reaction", "state_word", "mode"),
    [
        (0, 0x1237, AxisMode.TORQUE),  # nothing: still enabled, still following
        (1, 0x0218, AxisMode.OFF),  # fault
        (2, 0x0250, AxisMode.OFF),  # disable voltage: switch-on disabled
        (3, 0x0250, AxisMode.OFF),  # quick stop, option code 2: ends in switch-on disabled
    ],
)
def test_a_lost_master_triggers_the_abort_connection_option(
    drive: Wire, plant: FakePlant, reaction: int, state_word: int, mode: AxisMode
) -> None:
    enable_torque(drive)
    drive.write(0x6071, 0, 100, 2)
    drive.write(0x6007, 0, reaction, 2)
    drive.write(0x1016, 1, 0x7F0032, 4)  # node 127 within 50 ms
    drive.operational()
    drive.send("77F 05")
    assert drive.tick(40) == ["181 37 12"]  # the shipped TPDO1 shows the status word once
    drive.send("77F 05")
    assert drive.tick(49) == []
    assert plant.commands["motor"] == (AxisMode.TORQUE, pytest.approx(0.0188))
    frames = drive.tick(2)  # its time, plus one tick
    assert frames == ["081 30 81 11 00 00 00 00 00"]  # heartbeat lost; generic and communication bits
    assert plant.commands["motor"][0] is mode
    assert drive.read(0x6041) == state_word
    assert drive.read(0x603F) == 0x8130
    assert drive.read(0x1003, 1) == 0x8130


def test_a_master_that_was_never_heard_is_not_missed(drive: Wire) -> None:
    drive.write(0x1016, 1, 0x7F0032, 4)
    assert drive.tick(200) == []


def test_boot_up_or_garbage_does_not_start_the_watch(drive: Wire) -> None:
    drive.write(0x1016, 1, 0x7F0032, 4)
    for frame in ("77F 00", "77F", "77F 05 05", "77F 33"):
        drive.send(frame)
    assert drive.tick(200) == []


def test_the_error_goes_when_the_master_comes_back_to_an_idle_drive(drive: Wire) -> None:
    drive.write(0x1016, 1, 0x7F0032, 4)
    drive.send("77F 05")
    assert drive.tick(60) == ["081 30 81 11 00 00 00 00 00"]
    assert drive.read(0x6041) == 0x0250  # a drive without power has nothing to make safe
    assert drive.send("77F 05") == ["081 00 00 00 00 00 00 00 00"]
    assert drive.read(0x1001) == 0


@pytest.mark.parametrize(("behaviour", "byte"), [(0, "7F"), (1, "05"), (2, "04")])
def test_the_nmt_state_after_a_loss_follows_the_error_behaviour(drive: Wire, behaviour: int, byte: str) -> None:
    drive.write(0x1029, 1, behaviour, 1)
    drive.write(0x1016, 1, 0x7F0032, 4)
    drive.operational()
    drive.send("77F 05")
    drive.tick(60)
    if behaviour != 2:
        drive.write(0x1017, 0, 5, 2)
        assert heartbeats(drive.tick(5)) == [f"701 {byte}"]
    else:
        assert drive.send(READ_NMT) == []


def test_stopping_an_enabled_drive_counts_as_a_lost_connection(drive: Wire, plant: FakePlant) -> None:
    enable_torque(drive)
    drive.operational()
    drive.send("000 02 01")
    assert plant.commands["motor"][0] is not AxisMode.TORQUE
    drive.tick(2)
    assert plant.commands["motor"] == (AxisMode.OFF, 0.0)


def test_the_error_history_keeps_the_newest_first_and_is_cleared_by_zero(drive: Wire) -> None:
    device = drive.node.device
    assert isinstance(device, Drive402)
    device.fault(0x2310)
    device.fault(0x4310)
    assert [drive.read(0x1003, n) for n in (0, 1, 2)] == [2, 0x4310, 0x2310]
    assert drive.read(0x1001) == 0x01 | 0x02 | 0x08  # generic, current, temperature
    with pytest.raises(AbortedError, match="06090030"):
        drive.write(0x1003, 0, 1, 1)
    drive.write(0x1003, 0, 0, 1)
    assert drive.read(0x1003, 0) == 0


def test_the_error_history_forgets_the_oldest(drive: Wire) -> None:
    for code in range(0x3001, 0x300B):
        drive.node.emergency.raise_error(code)
    assert drive.read(0x1003, 0) == 8
    assert drive.read(0x1003, 8) == 0x3003


def test_a_sync_of_unexpected_length_is_reported_once_and_not_used(drive: Wire) -> None:
    drive.remap(0x1800, 0x181, 1, 0x60640020)
    drive.operational()
    assert drive.send("080 01") == ["081 40 82 11 00 00 00 00 00"]
    assert drive.send("080 02") == []
    assert drive.sync() == ["181 00 00 00 00"]


def test_a_sync_counter_is_expected_once_it_is_configured(drive: Wire) -> None:
    drive.write(0x1019, 0, 10, 1)
    drive.remap(0x1800, 0x181, 1, 0x60640020)
    drive.operational()
    assert drive.send("080 01") == ["181 00 00 00 00"]


def test_every_device_tells_who_it_is(drive: Wire) -> None:
    encoder = Wire(encoder_node(OUTPUT_ENCODER, FakePlant()))
    assert encoder.boot == ["703 00"]
    assert encoder.read(0x1000) == 0x00020196
    assert [drive.read(0x1018, n) for n in range(5)] == [4, 0, 0x402, 0x00010000, 1]


@pytest.mark.parametrize("node_id", [0, 128])
def test_an_impossible_node_id_is_an_error(node_id: int) -> None:
    with pytest.raises(ModelError, match="1 to 127"):
        CanopenNode(node_id, Encoder406(OUTPUT_ENCODER, FakePlant()))


def test_the_boot_time_is_an_option() -> None:
    wire = Wire(encoder_node(OUTPUT_ENCODER, FakePlant(), NodeOptions(boot_time=0.2)))
    assert wire.boot == ["703 00"]  # found running
    wire.send("000 81 00")
    assert wire.tick(199) == []
    assert wire.tick(1) == ["703 00"]

"""Process data: shipped set-up, mapping procedure with its refusals, SYNC, events, wrong lengths."""

import pytest

from sim_backend.nodes.bench import MOTOR_DRIVE, OUTPUT_ENCODER, TORQUE_TRANSDUCER
from sim_backend.nodes.communication import NodeOptions
from sim_backend.nodes.drive402 import drive_node
from sim_backend.nodes.encoder406 import encoder_node
from sim_backend.nodes.object_dictionary import AbortCode
from sim_backend.nodes.torque404 import torque_node
from sim_backend.ports import AxisMode
from tests.sim_backend.fake_plant import FakePlant
from tests.sim_backend.nodes.wire import AbortedError, Wire

STATUS, POSITION, TORQUE = 0x60410010, 0x60640020, 0x60770010
CONTROL, TARGET_TORQUE, TARGET_POSITION = 0x60400010, 0x60710010, 0x607A0020


@pytest.fixture
def plant() -> FakePlant:
    return FakePlant()


@pytest.fixture
def drive(plant: FakePlant) -> Wire:
    return Wire(drive_node(MOTOR_DRIVE, plant))


def enabled(wire: Wire) -> None:
    """Mode 10, packed TPDO1, RPDO1 with control word and target torque, operation enabled, all on SYNC."""
    wire.write(0x6060, 0, 10, 1)
    wire.remap(0x1800, 0x40000181, 1, STATUS, POSITION, TORQUE)
    wire.remap(0x1400, 0x201, 1, CONTROL, TARGET_TORQUE)
    wire.tick(3)
    wire.operational()
    for word in ("06", "07", "0F"):
        wire.send(f"201 {word} 00 00 00")
        wire.sync()


def test_the_packed_tpdo_has_status_position_and_torque_in_8_bytes(drive: Wire, plant: FakePlant) -> None:
    enabled(drive)
    plant.show(motor_position=-0.001, motor_torque=0.0188)
    # status 0x1237; floor(-0.001 * 16384 / 2 pi) = floor(-2.6) = -3; 100 per mille of 0.188 N*m
    assert drive.sync() == ["181 37 12 FD FF FF FF 64 00"]


def test_tpdo_values_are_those_of_the_sync_not_of_the_tick_before(drive: Wire, plant: FakePlant) -> None:
    enabled(drive)
    plant.show(motor_torque=0.094)
    drive.tick()
    plant.show(motor_torque=0.188)
    assert drive.sync() == ["181 37 12 00 00 00 00 E8 03"]


def test_a_synchronous_rpdo_takes_effect_at_the_next_sync(drive: Wire, plant: FakePlant) -> None:
    enabled(drive)
    drive.send("201 0F 00 64 00")  # 100 per mille
    drive.tick(5)
    assert plant.commands["motor"] == (AxisMode.TORQUE, 0.0)
    assert drive.read(0x6071) == 0
    drive.sync()
    assert plant.commands["motor"] == (AxisMode.TORQUE, pytest.approx(0.0188))
    assert drive.read(0x6071) == 100


def test_only_the_last_rpdo_before_a_sync_counts(drive: Wire, plant: FakePlant) -> None:
    enabled(drive)
    drive.send("201 0F 00 64 00")
    drive.send("201 0F 00 CE FF")  # -50 per mille
    drive.sync()
    assert plant.commands["motor"] == (AxisMode.TORQUE, pytest.approx(-0.0094))


def test_an_rpdo_of_type_255_takes_effect_at_once(drive: Wire) -> None:
    drive.operational()
    drive.send("201 06 00")  # the shipped RPDO1 is the control word
    assert drive.read(0x6041) == 0x0231


def test_there_are_no_pdos_outside_operational(drive: Wire) -> None:
    enabled(drive)
    drive.send("000 80 01")
    assert drive.sync() == []
    drive.send("201 00 00 00 00")
    drive.operational()
    drive.sync()
    assert drive.read(0x6041) == 0x1237


def test_what_waited_for_a_sync_is_forgotten_when_the_device_was_not_operational(drive: Wire) -> None:
    enabled(drive)
    drive.send("201 00 00 00 00")
    drive.send("000 80 01")
    drive.operational()
    drive.sync()
    assert drive.read(0x6041) == 0x1237


def test_type_n_sends_on_every_nth_sync(drive: Wire) -> None:
    drive.remap(0x1800, 0x181, 3, POSITION)
    drive.operational()
    assert [len(drive.sync()) for _ in range(9)] == [0, 0, 1, 0, 0, 1, 0, 0, 1]


def test_type_0_sends_at_the_sync_after_a_change_only(drive: Wire, plant: FakePlant) -> None:
    drive.remap(0x1800, 0x181, 0, POSITION)
    drive.operational()
    assert [len(drive.sync()) for _ in range(3)] == [1, 0, 0]
    plant.show(motor_position=1.0)
    assert drive.tick(3) == []
    assert [len(drive.sync()) for _ in range(3)] == [1, 0, 0]


def test_type_255_sends_on_change_and_not_before_the_inhibit_time(drive: Wire, plant: FakePlant) -> None:
    drive.write(0x1800, 1, 0x80000181, 4)
    drive.write(0x1800, 3, 50, 2)  # 5 ms
    drive.remap(0x1800, 0x181, 255, POSITION)
    drive.operational()
    assert drive.tick() == ["181 00 00 00 00"]
    plant.show(motor_position=1.0)
    assert drive.tick(4) == []
    assert drive.tick(1) == ["181 2F 0A 00 00"]  # floor(16384 / 2 pi) = 2607
    assert drive.tick(20) == []


def test_the_event_timer_repeats_an_unchanged_value(drive: Wire) -> None:
    drive.remap(0x1800, 0x181, 254, POSITION)
    drive.write(0x1800, 5, 10, 2)
    drive.operational()
    drive.tick()
    assert len(drive.tick(100)) == 10


@pytest.mark.parametrize(
    ("wire", "shipped", "can_id"),
    [
        (Wire(encoder_node(OUTPUT_ENCODER, FakePlant())), 0x60040020, 0x183),
        (Wire(torque_node(TORQUE_TRANSDUCER, FakePlant())), 0x91300120, 0x184),
    ],
    ids=["encoder", "torque"],
)
def test_sensors_are_shipped_with_an_event_driven_and_an_unused_synchronous_pdo(
    wire: Wire, shipped: int, can_id: int
) -> None:
    assert [wire.read(0x1A00 + n, 1) for n in (0, 1)] == [shipped, shipped]
    assert [wire.read(0x1800 + n, 2) for n in (0, 1)] == [254, 1]
    assert [wire.read(0x1800 + n, 1) for n in (0, 1)] == [0x40000000 | can_id, 0xC0000000 | can_id + 0x100]


def test_a_mapping_is_refused_while_the_pdo_is_in_use(drive: Wire) -> None:
    drive.remap(0x1800, 0x181, 1, POSITION)
    for sub, value, size in ((0, 0, 1), (1, STATUS, 4)):
        with pytest.raises(AbortedError, match="08000022"):
            drive.write(0x1A00, sub, value, size)
    with pytest.raises(AbortedError, match="08000022"):
        drive.write(0x1800, 1, 0x182, 4)  # another identifier
    with pytest.raises(AbortedError, match="08000022"):
        drive.write(0x1800, 3, 10, 2)


def test_the_code_for_changing_a_pdo_in_use_differs_by_make(plant: FakePlant) -> None:
    wire = Wire(drive_node(MOTOR_DRIVE, plant, NodeOptions(change_while_valid=AbortCode.ACCESS)))
    with pytest.raises(AbortedError, match="06010000"):
        wire.write(0x1A00, 0, 0, 1)


def test_entries_are_refused_until_their_number_is_zero(drive: Wire) -> None:
    drive.write(0x1800, 1, 0x80000181, 4)
    with pytest.raises(AbortedError, match="06010003"):
        drive.write(0x1A00, 1, POSITION, 4)


@pytest.mark.parametrize(
    ("parameters", "entry", "code"),
    [
        (0x1800, 0x20000010, "06020000"),  # no such object
        (0x1800, 0x60410110, "06020000"),  # no such sub-index
        (0x1800, 0x605A0010, "06040041"),  # not mappable
        (0x1800, 0x60410020, "06040041"),  # wrong number of bits
        (0x1400, 0x60410010, "06040041"),  # a read-only object cannot be received
    ],
)
def test_impossible_entries_are_refused(drive: Wire, parameters: int, entry: int, code: str) -> None:
    can_id = 0x181 if parameters == 0x1800 else 0x201
    with pytest.raises(AbortedError, match=code):
        drive.remap(parameters, can_id, 1, entry)


def test_more_than_64_bits_are_refused(drive: Wire) -> None:
    with pytest.raises(AbortedError, match="06040042"):
        drive.remap(0x1800, 0x181, 1, STATUS, POSITION, 0x606C0020)


def test_more_than_8_entries_and_empty_entries_are_refused(drive: Wire) -> None:
    drive.write(0x1800, 1, 0x80000181, 4)
    drive.write(0x1A00, 0, 0, 1)
    with pytest.raises(AbortedError, match="06090031"):
        drive.write(0x1A00, 0, 9, 1)
    with pytest.raises(AbortedError, match="06020000"):
        drive.write(0x1A00, 0, 2, 1)  # the second entry is empty


@pytest.mark.parametrize("can_id", [0x000, 0x07F, 0x101, 0x601, 0x701, 0x20000181, 0x00000881])
def test_reserved_and_extended_identifiers_are_refused(drive: Wire, can_id: int) -> None:
    with pytest.raises(AbortedError, match="06090030"):
        drive.write(0x1800, 1, 0x80000000 | can_id, 4)


@pytest.mark.parametrize("transmission", [241, 251, 252, 253])
def test_reserved_and_remote_transmission_types_are_refused(drive: Wire, transmission: int) -> None:
    with pytest.raises(AbortedError, match="06090030"):
        drive.write(0x1800, 2, transmission, 1)


def test_a_short_rpdo_is_reported_once_and_ignored_until_a_good_one_comes(drive: Wire, plant: FakePlant) -> None:
    enabled(drive)
    assert drive.send("201 0F 00 64") == ["081 10 82 11 00 00 00 00 00"]
    assert drive.send("201 0F 00 64") == []
    drive.sync()
    assert plant.commands["motor"] == (AxisMode.TORQUE, 0.0)
    assert drive.send("201 0F 00 64 00") == ["081 00 00 00 00 00 00 00 00"]
    drive.sync()
    assert plant.commands["motor"] == (AxisMode.TORQUE, pytest.approx(0.0188))


def test_a_long_rpdo_is_reported_and_its_first_bytes_are_used(drive: Wire, plant: FakePlant) -> None:
    enabled(drive)
    assert drive.send("201 0F 00 64 00 FF") == ["081 20 82 11 00 00 00 00 00"]
    drive.sync()
    assert plant.commands["motor"] == (AxisMode.TORQUE, pytest.approx(0.0188))


def test_a_value_that_an_object_refuses_leaves_the_rest_of_the_pdo_valid(drive: Wire) -> None:
    drive.remap(0x1400, 0x201, 255, 0x60600008, TARGET_TORQUE)
    drive.operational()
    drive.send("201 01 64 00")  # mode 1 is not supported
    assert drive.read(0x6060) == 0
    assert drive.read(0x6071) == 100


def test_two_rpdos_may_share_an_identifier(drive: Wire) -> None:
    drive.remap(0x1400, 0x201, 255, CONTROL)
    drive.remap(0x1401, 0x201, 255, TARGET_TORQUE)
    drive.operational()
    drive.send("201 06 00")
    assert (drive.read(0x6040), drive.read(0x6071)) == (6, 6)


def test_a_disabled_pdo_is_silent_and_deaf(drive: Wire) -> None:
    enabled(drive)
    drive.write(0x1800, 1, 0x80000181, 4)
    drive.write(0x1400, 1, 0x80000201, 4)
    drive.send("201 00 00 00 00")
    assert drive.sync() == []
    assert drive.read(0x6041) == 0x1237

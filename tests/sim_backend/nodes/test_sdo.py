"""SDO server, frame by frame."""

import pytest

from sim_backend.errors import ModelError
from sim_backend.nodes.bench import MOTOR_DRIVE, TORQUE_TRANSDUCER
from sim_backend.nodes.communication import NodeOptions
from sim_backend.nodes.drive402 import drive_node
from sim_backend.nodes.object_dictionary import AbortCode, AbortError, Access, DataType, ObjectDictionary, ObjectSpec
from sim_backend.nodes.sdo_server import MAX_STRING, SdoServer
from sim_backend.nodes.torque404 import torque_node
from tests.sim_backend.fake_plant import FakePlant
from tests.sim_backend.nodes.wire import Wire

NAME = "simulated CiA 402 drive"


@pytest.fixture
def drive() -> Wire:
    return Wire(drive_node(MOTOR_DRIVE, FakePlant()))


def talk(wire: Wire, dialogue: list[tuple[str, str]]) -> None:
    for request, expected in dialogue:
        assert wire.send(f"601 {request}") == [f"581 {expected}"], request


def test_expedited_uploads_name_the_length_in_the_command_byte(drive: Wire) -> None:
    talk(
        drive,
        [
            ("40 00 10 00 00 00 00 00", "43 00 10 00 92 01 02 00"),  # 4 bytes: device type of a servo drive
            ("40 17 10 00 00 00 00 00", "4B 17 10 00 00 00 00 00"),  # 2 bytes: heartbeat time
            ("40 01 10 00 00 00 00 00", "4F 01 10 00 00 00 00 00"),  # 1 byte: error register
        ],
    )


def test_expedited_downloads_of_1_2_and_4_bytes_are_acknowledged_and_read_back(drive: Wire) -> None:
    talk(
        drive,
        [
            ("2F 60 60 00 0A 00 00 00", "60 60 60 00 00 00 00 00"),  # mode 10, 1 byte
            ("40 60 60 00 00 00 00 00", "4F 60 60 00 0A 00 00 00"),
            ("2B 17 10 00 64 00 00 00", "60 17 10 00 00 00 00 00"),  # heartbeat 100 ms, 2 bytes
            ("40 17 10 00 00 00 00 00", "4B 17 10 00 64 00 00 00"),
            ("23 7A 60 00 FE FF FF FF", "60 7A 60 00 00 00 00 00"),  # target position -2, 4 bytes
            ("40 7A 60 00 00 00 00 00", "43 7A 60 00 FE FF FF FF"),
        ],
    )


def test_a_download_without_size_takes_the_length_of_the_object(drive: Wire) -> None:
    talk(
        drive,
        [
            ("22 17 10 00 64 00 FF FF", "60 17 10 00 00 00 00 00"),  # the two high bytes are not part of a U16
            ("40 17 10 00 00 00 00 00", "4B 17 10 00 64 00 00 00"),
        ],
    )


def test_the_autozero_of_a_public_404_manual_is_taken_as_printed() -> None:
    plant = FakePlant()
    plant.show(output_torque=1.5)
    wire = Wire(torque_node(TORQUE_TRANSDUCER, plant))
    assert wire.send("604 22 25 61 01 7A 65 72 6F") == ["584 60 25 61 01 00 00 00 00"]
    assert wire.read(0x9130, 1) == 0


def test_a_long_value_is_uploaded_in_segments_with_alternating_toggle(drive: Wire) -> None:
    parts = [NAME[i : i + 7].encode().hex(" ").upper() for i in range(0, len(NAME), 7)]
    talk(
        drive,
        [
            ("40 08 10 00 00 00 00 00", "41 08 10 00 17 00 00 00"),  # 23 bytes follow
            ("60 00 00 00 00 00 00 00", "00 " + parts[0]),
            ("70 00 00 00 00 00 00 00", "10 " + parts[1]),
            ("60 00 00 00 00 00 00 00", "00 " + parts[2]),
            ("70 00 00 00 00 00 00 00", "1B " + parts[3] + " 00 00 00 00 00"),  # 2 bytes, 5 unused, last
        ],
    )


def test_a_segmented_download_is_stored_when_its_last_segment_has_come(drive: Wire) -> None:
    talk(
        drive,
        [
            ("21 7A 60 00 04 00 00 00", "60 7A 60 00 00 00 00 00"),  # 4 bytes announced
            ("0A 11 22 00 00 00 00 00", "20 00 00 00 00 00 00 00"),  # 2 bytes, toggle 0
            ("40 7A 60 00 00 00 00 00", "43 7A 60 00 00 00 00 00"),  # unfinished: old value, and given up
            ("21 7A 60 00 04 00 00 00", "60 7A 60 00 00 00 00 00"),
            ("0A 11 22 00 00 00 00 00", "20 00 00 00 00 00 00 00"),
            ("1B 33 44 00 00 00 00 00", "30 00 00 00 00 00 00 00"),  # 2 bytes, toggle 1, last
            ("40 7A 60 00 00 00 00 00", "43 7A 60 00 11 22 33 44"),
        ],
    )


ABORTS = {
    "no such object": ("40 00 20 00 00 00 00 00", "80 00 20 00 00 00 02 06"),
    "no such sub-index": ("40 18 10 09 00 00 00 00", "80 18 10 09 11 00 09 06"),
    "write of a read-only object": ("2B 41 60 00 00 00 00 00", "80 41 60 00 02 00 01 06"),
    "write of a constant": ("23 00 10 00 00 00 00 00", "80 00 10 00 02 00 01 06"),
    "too long": ("23 17 10 00 64 00 00 00", "80 17 10 00 12 00 07 06"),
    "too short": ("2F 17 10 00 64 00 00 00", "80 17 10 00 13 00 07 06"),
    "announced too long": ("21 7A 60 00 05 00 00 00", "80 7A 60 00 12 00 07 06"),
    "announced too short": ("21 7A 60 00 03 00 00 00", "80 7A 60 00 13 00 07 06"),
    "value not allowed": ("2F 60 60 00 01 00 00 00", "80 60 60 00 30 00 09 06"),  # profile position
    "value too high": ("2B 5A 60 00 09 00 00 00", "80 5A 60 00 31 00 09 06"),
    "value too low": ("2B 5A 60 00 FF FF 00 00", "80 5A 60 00 32 00 09 06"),
    "device state": ("2F 00 1A 00 00 00 00 00", "80 00 1A 00 22 00 00 08"),  # mapping of a PDO in use
    "block upload": ("A0 08 10 00 7F 00 00 00", "80 08 10 00 01 00 04 05"),
    "block download": ("C2 7A 60 00 04 00 00 00", "80 7A 60 00 01 00 04 05"),
    "unknown command": ("E0 00 00 00 00 00 00 00", "80 00 00 00 01 00 04 05"),
    "segment without transfer (up)": ("60 00 00 00 00 00 00 00", "80 00 00 00 01 00 04 05"),
    "segment without transfer (down)": ("00 00 00 00 00 00 00 00", "80 00 00 00 01 00 04 05"),
    "same node watched twice": ("23 16 10 02 64 00 7F 00", "80 16 10 02 43 00 04 06"),
    "empty slot of the history": ("40 03 10 01 00 00 00 00", "80 03 10 01 24 00 00 08"),
}


@pytest.mark.parametrize("case", ABORTS)
def test_refused_transfers_are_aborted_with_the_code_of_the_standard(drive: Wire, case: str) -> None:
    drive.write(0x1016, 1, 0x7F0064, 4)
    request, answer = ABORTS[case]
    talk(drive, [(request, answer)])


def test_upload_of_a_write_only_object_is_aborted() -> None:
    wire = Wire(torque_node(TORQUE_TRANSDUCER, FakePlant()))
    assert wire.send("604 40 25 61 01 00 00 00 00") == ["584 80 25 61 01 01 00 01 06"]


def test_a_wrong_toggle_ends_the_transfer(drive: Wire) -> None:
    talk(
        drive,
        [
            ("40 08 10 00 00 00 00 00", "41 08 10 00 17 00 00 00"),
            ("70 00 00 00 00 00 00 00", "80 08 10 00 00 00 03 05"),  # first segment must have toggle 0
            ("60 00 00 00 00 00 00 00", "80 00 00 00 01 00 04 05"),  # nothing left to continue
        ],
    )


def test_more_or_fewer_bytes_than_announced_are_a_length_error(drive: Wire) -> None:
    begin = ("21 7A 60 00 04 00 00 00", "60 7A 60 00 00 00 00 00")
    talk(drive, [begin, ("01 11 22 33 44 55 66 77", "80 7A 60 00 10 00 07 06")])  # 7 bytes
    talk(drive, [begin, ("0B 11 22 00 00 00 00 00", "80 7A 60 00 10 00 07 06")])  # 2 bytes, last


def test_a_download_of_unknown_size_cannot_grow_without_bound(drive: Wire) -> None:
    talk(drive, [("20 7A 60 00 00 00 00 00", "60 7A 60 00 00 00 00 00")])
    for number in range(MAX_STRING // 7):
        toggle = number % 2
        talk(drive, [(f"{toggle}0 AA AA AA AA AA AA AA", f"{2 + toggle}0 00 00 00 00 00 00 00")])
    assert drive.send("601 00 AA AA AA AA AA AA AA") == ["581 80 7A 60 00 12 00 07 06"]


def test_an_abort_from_the_client_ends_the_transfer_silently(drive: Wire) -> None:
    talk(drive, [("40 08 10 00 00 00 00 00", "41 08 10 00 17 00 00 00")])
    assert drive.send("601 80 08 10 00 00 00 04 05") == []
    talk(drive, [("60 00 00 00 00 00 00 00", "80 00 00 00 01 00 04 05")])


@pytest.mark.parametrize("request_frame", ["601", "601 40", "601 40 00 10 00 00 00 00"])
def test_frames_shorter_than_8_bytes_are_ignored(drive: Wire, request_frame: str) -> None:
    assert drive.send(request_frame) == []


def test_strings_can_be_written_in_segments() -> None:
    spec = ObjectSpec(0x2000, 0, "label", DataType.VISIBLE_STRING, Access.RW, b"")
    objects = ObjectDictionary([spec])
    server = SdoServer(objects)
    assert server.answer(bytes.fromhex("2100200009000000")) == bytes.fromhex("6000200000000000")
    assert server.answer(b"\x00abcdefg") == bytes.fromhex("2000000000000000")
    assert server.answer(b"\x1bhi\0\0\0\0\0") == bytes.fromhex("3000000000000000")
    assert objects.upload(0x2000, 0) == b"abcdefghi"


def test_a_real32_is_not_accepted_if_it_is_no_number() -> None:
    objects = ObjectDictionary([ObjectSpec(0x2000, 0, "gain", DataType.REAL32, Access.RW, 1.0, 0.0, 2.0)])
    with pytest.raises(AbortError) as caught:
        objects.download(0x2000, 0, bytes.fromhex("0000C07F"))
    assert caught.value.code is AbortCode.VALUE
    objects.download(0x2000, 0, bytes.fromhex("0000003F"))
    assert objects[0x2000, 0].get() == 0.5


def test_hidden_objects_answer_as_if_they_did_not_exist() -> None:
    wire = Wire(drive_node(MOTOR_DRIVE, FakePlant(), NodeOptions(hidden=frozenset({0x6072}))))
    assert wire.send("601 40 72 60 00 00 00 00 00") == ["581 80 72 60 00 00 00 02 06"]
    assert 0x6072 not in {spec.index for spec in wire.node.dictionary}


@pytest.mark.parametrize(("kind", "value"), [(DataType.U32, 2**32), (DataType.U8, -1), (DataType.I16, 1.5)])
def test_a_value_that_its_type_cannot_carry_is_refused_when_the_device_is_made(kind: DataType, value: float) -> None:
    with pytest.raises(ModelError, match=r"0x2000:0 \('gain'\) .* does not fit its type"):
        ObjectDictionary([ObjectSpec(0x2000, 0, "gain", kind, default=value)])

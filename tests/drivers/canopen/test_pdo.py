"""Process data: layout, and the remapping procedure on the wire."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.canopen.errors import DeviceFaultError, SdoAbortError
from drivers.canopen.link import Link
from drivers.canopen.objects import ObjectRef
from drivers.canopen.pdo import Direction, Pdo, PdoSetting, layout, read_setting, verify_setting, write_setting
from drivers.canopen.sdo import ObjectAccess
from tests.drivers.canopen.wire import Line, ManualClock, ScriptedBus

STATUS_AND_POSITION = Pdo(
    Direction.TPDO, 1, (ObjectRef(0x6041, 0, "H", "status word"), ObjectRef(0x6064, 0, "i", "position"))
)
SIZES = {"b": 1, "B": 1, "h": 2, "H": 2, "i": 4, "I": 4}


@st.composite
def objects_with_values(draw: st.DrawFn) -> list[tuple[ObjectRef, int]]:
    found = []
    for code in draw(st.lists(st.sampled_from(sorted(SIZES)), min_size=1, max_size=8)):
        bits = 8 * SIZES[code]
        low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if code.islower() else (0, (1 << bits) - 1)
        ref = ObjectRef(draw(st.integers(0x2000, 0x9FFF)), draw(st.integers(0, 254)), code, "object")
        found.append((ref, draw(st.integers(low, high))))
    return found


@given(objects_with_values())
def test_a_layout_is_the_little_endian_bytes_of_its_objects_without_gaps(pairs: list[tuple[ObjectRef, int]]) -> None:
    objects = tuple(ref for ref, _ in pairs)
    expected = b"".join(v.to_bytes(SIZES[ref.code], "little", signed=ref.code.islower()) for ref, v in pairs)
    if len(expected) > 8:
        with pytest.raises(ValueError, match="1 to 8 bytes"):
            layout(objects)
        return
    made = layout(objects)
    assert made.pack(*(value for _, value in pairs)) == expected
    assert made.unpack(expected) == tuple(value for _, value in pairs)


@given(objects_with_values())
def test_an_object_reads_back_what_it_wrote_and_no_other_length(pairs: list[tuple[ObjectRef, int]]) -> None:
    for ref, value in pairs:
        data = ref.encode(value)
        assert ref.decode(data) == value
        with pytest.raises(ValueError, match=f"has {SIZES[ref.code]} bytes"):
            ref.decode(data + b"\x00")
        with pytest.raises(ValueError, match="does not fit"):
            ref.encode(value + (1 << 8 * SIZES[ref.code]))


def test_an_empty_layout_is_refused() -> None:
    with pytest.raises(ValueError, match="1 to 8 bytes"):
        layout(())


@pytest.mark.parametrize(
    ("direction", "number", "can_id"),
    [
        (Direction.TPDO, 1, 0x185),
        (Direction.TPDO, 4, 0x485),
        (Direction.RPDO, 1, 0x205),
        (Direction.RPDO, 3, 0x405),
    ],
)
def test_identifiers_are_those_of_the_predefined_connection_set(direction: Direction, number: int, can_id: int) -> None:
    assert Pdo(direction, number, ()).can_id(5) == can_id


class Wire:
    def __init__(self, script: list[Line]) -> None:
        clock = ManualClock()
        self.bus = ScriptedBus(script, clock)
        self.objects = ObjectAccess("motor", 1, Link(self.bus, clock, "test", ("motor",)), clock, 0.3)


REMAP: list[Line] = [
    (">", 0x601, "23 00 18 01 81 01 00 80", "1800:1 = 0x80000181: off"),
    ("<", 0x581, "60 00 18 01 00 00 00 00", "done"),
    (">", 0x601, "2f 00 1a 00 00 00 00 00", "1A00:0 = 0: mapping empty"),
    ("<", 0x581, "60 00 1a 00 00 00 00 00", "done"),
    (">", 0x601, "23 00 1a 01 10 00 41 60", "1A00:1 = 0x60410010"),
    ("<", 0x581, "60 00 1a 01 00 00 00 00", "done"),
    (">", 0x601, "23 00 1a 02 20 00 64 60", "1A00:2 = 0x60640020"),
    ("<", 0x581, "60 00 1a 02 00 00 00 00", "done"),
    (">", 0x601, "2f 00 1a 00 02 00 00 00", "1A00:0 = 2: two objects"),
    ("<", 0x581, "60 00 1a 00 00 00 00 00", "done"),
    (">", 0x601, "2f 00 18 02 01 00 00 00", "1800:2 = 1: at every SYNC"),
    ("<", 0x581, "60 00 18 02 00 00 00 00", "done"),
    (">", 0x601, "23 00 18 01 81 01 00 00", "1800:1 = 0x181: on"),
    ("<", 0x581, "60 00 18 01 00 00 00 00", "done"),
]


def read_back(position_entry: str = "20 00 64 60") -> list[Line]:
    return [
        (">", 0x601, "40 00 18 01 00 00 00 00", "read 1800:1"),
        ("<", 0x581, "43 00 18 01 81 01 00 40", "0x40000181: on, no remote requests"),
        (">", 0x601, "40 00 1a 00 00 00 00 00", "read 1A00:0"),
        ("<", 0x581, "4f 00 1a 00 02 00 00 00", "2"),
        (">", 0x601, "40 00 1a 01 00 00 00 00", "read 1A00:1"),
        ("<", 0x581, "43 00 1a 01 10 00 41 60", "0x60410010"),
        (">", 0x601, "40 00 1a 02 00 00 00 00", "read 1A00:2"),
        ("<", 0x581, f"43 00 1a 02 {position_entry}", "second entry"),
        (">", 0x601, "40 00 18 02 00 00 00 00", "read 1800:2"),
        ("<", 0x581, "4f 00 18 02 01 00 00 00", "1"),
    ]


def test_remapping_follows_the_order_of_the_standard() -> None:
    wire = Wire(REMAP)
    write_setting(wire.objects, Direction.TPDO, 1, STATUS_AND_POSITION.setting(1))
    wire.bus.finish()


def test_a_mapping_that_reads_back_is_accepted_whatever_the_remote_request_bit() -> None:
    wire = Wire(read_back())
    verify_setting("motor", wire.objects, Direction.TPDO, 1, STATUS_AND_POSITION.setting(1))
    wire.bus.finish()


def test_a_mapping_that_reads_back_otherwise_is_an_error_that_shows_both() -> None:
    wire = Wire(read_back("20 00 6c 60"))
    with pytest.raises(DeviceFaultError, match=r"did not keep TPDO1: wanted .*60640020; got .*606C0020"):
        verify_setting("motor", wire.objects, Direction.TPDO, 1, STATUS_AND_POSITION.setting(1))
    wire.bus.finish()


def test_any_refusal_while_remapping_is_raised() -> None:
    refused: list[Line] = [*REMAP[:5], ("<", 0x581, "80 00 1a 01 41 00 04 06", "abort 06040041: not mappable")]
    wire = Wire(refused)
    with pytest.raises(SdoAbortError, match="0x06040041"):
        write_setting(wire.objects, Direction.TPDO, 1, STATUS_AND_POSITION.setting(1))
    wire.bus.finish()


def test_a_pdo_that_the_device_does_not_have_is_none() -> None:
    wire = Wire(
        [
            (">", 0x601, "40 03 18 01 00 00 00 00", "read 1803:1"),
            ("<", 0x581, "80 03 18 01 00 00 02 06", "abort 06020000: no such object"),
        ]
    )
    assert read_setting(wire.objects, Direction.TPDO, 4) is None
    wire.bus.finish()


def test_two_settings_that_are_both_off_mean_the_same() -> None:
    assert PdoSetting(0x80000181, 255, (1,)).matches(PdoSetting(0xC0000281, 1, ()))
    assert not PdoSetting(0x80000181, 1, (1,)).matches(PdoSetting(0x181, 1, (1,)))

"""Emergency frames."""

from hypothesis import given
from hypothesis import strategies as st

from drivers.canopen.emergency import code_text, parse_emergency


def test_a_following_error_as_a_faulhaber_drive_sends_it() -> None:
    told = parse_emergency(bytes.fromhex("11 86 20 02 00 00 00 00"))
    assert told is not None
    assert (told.code, told.register, told.data) == (0x8611, 0x20, bytes.fromhex("02 00 00 00 00"))
    assert told.text == "emergency 0x8611 (following error)"


def test_code_zero_says_that_the_error_is_gone() -> None:
    told = parse_emergency(bytes(8))
    assert told is not None
    assert told.text == "error reset or no error"


@given(st.binary(max_size=8))
def test_a_short_frame_is_read_as_far_as_it_goes(data: bytes) -> None:
    told = parse_emergency(data)
    if len(data) < 2:
        assert told is None
    else:
        assert told is not None
        assert told.code == data[0] + 256 * data[1]
        assert told.data == data[3:]


def test_an_unknown_code_keeps_the_name_of_its_class() -> None:
    assert code_text(0x2399) == "current"
    assert code_text(0x3333) == "voltage"
    assert code_text(0x0042) == "unknown class"

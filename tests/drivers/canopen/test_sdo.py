"""SDO on the wire: every frame is listed."""

import pytest

from drivers.canopen.errors import DeviceFaultError, SdoAbortError
from drivers.canopen.link import Link
from drivers.canopen.objects import CONTROL_WORD, RATED_TORQUE, STATUS_WORD, TARGET_TORQUE
from drivers.canopen.sdo import ObjectAccess
from drivers.errors import RigTimeoutError
from tests.drivers.canopen.wire import Line, ManualClock, ScriptedBus

TIMEOUT = 0.3


class Wire:
    """Object access to node 1 over a script."""

    def __init__(self, script: list[Line]) -> None:
        self.clock = ManualClock()
        self.bus = ScriptedBus(script, self.clock)
        self.link = Link(self.bus, self.clock, "test", ("motor",))
        self.objects = ObjectAccess("motor", 1, self.link, self.clock, TIMEOUT)


def test_an_expedited_read_gives_the_value() -> None:
    wire = Wire(
        [
            (">", 0x601, "40 41 60 00 00 00 00 00", "read 0x6041:00"),
            ("<", 0x581, "4b 41 60 00 37 12 00 00", "two bytes: 0x1237"),
        ]
    )
    assert wire.objects.read(STATUS_WORD) == 0x1237
    wire.bus.finish()


def test_a_signed_value_is_read_with_its_sign() -> None:
    wire = Wire(
        [
            (">", 0x601, "40 71 60 00 00 00 00 00", "read 0x6071:00"),
            ("<", 0x581, "4b 71 60 00 fe ff 00 00", "two bytes: -2"),
        ]
    )
    assert wire.objects.read(TARGET_TORQUE) == -2
    wire.bus.finish()


def test_an_expedited_write_is_sent_with_the_length_of_the_object() -> None:
    wire = Wire(
        [
            (">", 0x601, "2b 40 60 00 0f 00 00 00", "write two bytes 0x000F to 0x6040:00"),
            ("<", 0x581, "60 40 60 00 00 00 00 00", "done"),
        ]
    )
    wire.objects.write(CONTROL_WORD, 0x000F)
    wire.bus.finish()


def test_an_answer_that_does_not_tell_its_length_has_that_of_the_object() -> None:
    wire = Wire(
        [
            (">", 0x601, "40 41 60 00 00 00 00 00", "read 0x6041:00"),
            ("<", 0x581, "42 41 60 00 37 12 ff ff", "data without size: two bytes count"),
        ]
    )
    assert wire.objects.read(STATUS_WORD) == 0x1237
    wire.bus.finish()


def test_a_segmented_answer_is_joined() -> None:
    wire = Wire(
        [
            (">", 0x601, "40 76 60 00 00 00 00 00", "read 0x6076:00"),
            ("<", 0x581, "41 76 60 00 04 00 00 00", "four bytes in segments"),
            (">", 0x601, "60 00 00 00 00 00 00 00", "next segment, toggle 0"),
            ("<", 0x581, "07 bc 00 00 00 00 00 00", "last segment, four bytes: 188"),
        ]
    )
    assert wire.objects.read(RATED_TORQUE) == 188
    wire.bus.finish()


def test_an_abort_names_object_and_reason() -> None:
    wire = Wire(
        [
            (">", 0x601, "2b 71 60 00 e8 03 00 00", "write 1000 to 0x6071:00"),
            ("<", 0x581, "80 71 60 00 31 00 09 06", "abort 06090031: value too high"),
        ]
    )
    with pytest.raises(
        SdoAbortError, match=r"refused writing 1000 to 0x6071:00 \(target torque\).*0x06090031"
    ) as error:
        wire.objects.write(TARGET_TORQUE, 1000)
    assert error.value.abort_code == 0x06090031
    wire.bus.finish()


def test_the_late_acknowledgement_of_another_write_is_not_taken() -> None:
    wire = Wire(
        [
            (">", 0x601, "2b 71 60 00 64 00 00 00", "write 100 to 0x6071:00"),
            (">", 0x601, "80 71 60 00 00 00 04 05", "no answer: the transfer is aborted"),
            (">", 0x601, "2b 40 60 00 06 00 00 00", "write 6 to 0x6040:00"),
            ("<", 0x581, "60 71 60 00 00 00 00 00", "late: the write to 0x6071 is done"),
            (">", 0x601, "80 40 60 00 00 00 04 05", "that was no answer to 0x6040"),
        ]
    )
    with pytest.raises(RigTimeoutError, match="0x6071:00"):
        wire.objects.write(TARGET_TORQUE, 100)
    with pytest.raises(RigTimeoutError, match="0x6040:00"):
        wire.objects.write(CONTROL_WORD, 6)
    wire.bus.finish()


def test_the_abort_of_another_transfer_is_not_taken() -> None:
    wire = Wire(
        [
            (">", 0x601, "40 41 60 00 00 00 00 00", "read 0x6041:00"),
            ("<", 0x581, "80 71 60 00 31 00 09 06", "abort of 0x6071"),
            ("<", 0x581, "4b 41 60 00 50 02 00 00", "the answer"),
        ]
    )
    assert wire.objects.read(STATUS_WORD) == 0x0250
    wire.bus.finish()


def test_the_late_acknowledgement_of_a_write_is_no_answer_to_reading_the_same_object() -> None:
    wire = Wire(
        [
            (">", 0x601, "40 71 60 00 00 00 00 00", "read 0x6071:00"),
            ("<", 0x581, "60 71 60 00 00 00 00 00", "late: an earlier write is done"),
            ("<", 0x581, "4b 71 60 00 05 00 00 00", "the answer"),
        ]
    )
    assert wire.objects.read(TARGET_TORQUE) == 5
    wire.bus.finish()


def test_an_answer_from_before_the_request_is_thrown_away() -> None:
    wire = Wire(
        [
            ("<", 0x581, "4b 41 60 00 37 12 00 00", "stale: an answer that came too late"),
            (">", 0x601, "40 41 60 00 00 00 00 00", "read 0x6041:00"),
            ("<", 0x581, "4b 41 60 00 50 02 00 00", "the answer"),
        ]
    )
    assert wire.objects.read(STATUS_WORD) == 0x0250
    wire.bus.finish()


def test_silence_ends_after_the_time_out_and_nothing_is_sent_twice() -> None:
    wire = Wire(
        [
            (">", 0x601, "2b 40 60 00 06 00 00 00", "write 6 to 0x6040:00"),
            (">", 0x601, "80 40 60 00 00 00 04 05", "abort: time-out"),
        ]
    )
    with pytest.raises(RigTimeoutError, match=r"'motor' \(node 1\)") as error:
        wire.objects.write(CONTROL_WORD, 6)
    assert error.value.waited == TIMEOUT
    assert wire.clock.now() == pytest.approx(TIMEOUT)
    wire.bus.finish()


def test_other_frames_are_routed_while_an_answer_is_awaited() -> None:
    wire = Wire(
        [
            (">", 0x601, "40 41 60 00 00 00 00 00", "read 0x6041:00"),
            ("<", 0x181, "37 12", "process data in between"),
            ("<", 0x701, "05", "a heartbeat in between"),
            ("<", 0x581, "4b 41 60 00 50 02 00 00", "the answer"),
        ]
    )
    seen: list[bytes] = []
    wire.link.route(0x181, lambda data: bool(seen.append(bytes(data))))
    wire.link.route(0x701, lambda data: bool(seen.append(bytes(data))))
    assert wire.objects.read(STATUS_WORD) == 0x0250
    assert seen == [b"\x37\x12", b"\x05"]
    wire.bus.finish()


@pytest.mark.parametrize(
    "answer",
    [
        pytest.param("4f 41 60 00 37 00 00 00", id="one byte"),
        pytest.param("43 41 60 00 37 12 00 00", id="four bytes"),
    ],
)
def test_an_answer_of_another_length_than_the_object_is_an_error(answer: str) -> None:
    wire = Wire([(">", 0x601, "40 41 60 00 00 00 00 00", "read 0x6041:00"), ("<", 0x581, answer, "wrong length")])
    with pytest.raises(DeviceFaultError, match=r"0x6041:00 \(status word\) has 2 bytes"):
        wire.objects.read(STATUS_WORD)
    wire.bus.finish()


def test_a_short_sdo_frame_is_ignored() -> None:
    wire = Wire(
        [
            (">", 0x601, "40 41 60 00 00 00 00 00", "read 0x6041:00"),
            ("<", 0x581, "4b 41 60 00", "a torn frame"),
            ("<", 0x581, "4b 41 60 00 50 02 00 00", "the answer"),
        ]
    )
    assert wire.objects.read(STATUS_WORD) == 0x0250
    wire.bus.finish()


def test_a_missing_object_is_told_apart_from_a_refusal() -> None:
    wire = Wire(
        [
            (">", 0x601, "40 76 60 00 00 00 00 00", "read 0x6076:00"),
            ("<", 0x581, "80 76 60 00 00 00 02 06", "abort 06020000: no such object"),
            (">", 0x601, "40 76 60 00 00 00 00 00", "read 0x6076:00"),
            ("<", 0x581, "80 76 60 00 22 00 00 08", "abort 08000022: device state"),
        ]
    )
    assert wire.objects.find(RATED_TORQUE) is None
    with pytest.raises(SdoAbortError, match="08000022"):
        wire.objects.find(RATED_TORQUE)
    wire.bus.finish()


def test_a_write_that_is_not_kept_names_wanted_and_got() -> None:
    wire = Wire(
        [
            (">", 0x601, "2b 71 60 00 64 00 00 00", "write 100 to 0x6071:00"),
            ("<", 0x581, "60 71 60 00 00 00 00 00", "done"),
            (">", 0x601, "40 71 60 00 00 00 00 00", "read back"),
            ("<", 0x581, "4b 71 60 00 32 00 00 00", "50"),
        ]
    )
    with pytest.raises(DeviceFaultError, match=r"0x6071:00 \(target torque\): wanted 100 .* got 50"):
        wire.objects.write_verified(TARGET_TORQUE, 100)
    wire.bus.finish()

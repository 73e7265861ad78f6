"""The CiA 402 power state machine, walked command by command against the printed tables."""

import itertools

import pytest

from sim_backend.nodes.drive402 import Drive402, drive_node
from sim_backend.nodes.drive402_objects import DriveConfig
from sim_backend.nodes.power_states import PowerState, decode
from tests.sim_backend.fake_plant import FakePlant
from tests.sim_backend.nodes.wire import Wire

# state: (mask, value of 0x6041, control words that lead there from switch-on disabled)
STATES = {
    "switch-on disabled": (0x4F, 0x40, ()),
    "ready to switch on": (0x6F, 0x21, (0x06,)),
    "switched on": (0x6F, 0x23, (0x06, 0x07)),
    "operation enabled": (0x6F, 0x27, (0x06, 0x07, 0x0F)),
    "quick stop active": (0x6F, 0x07, (0x06, 0x07, 0x0F, 0x02)),
    "fault": (0x4F, 0x08, ()),
}
COMMANDS = {  # command: (mask, value of 0x6040)
    "shutdown": (0x87, 0x06),
    "switch on": (0x8F, 0x07),
    "enable operation": (0x8F, 0x0F),
    "disable voltage": (0x82, 0x00),
    "quick stop": (0x86, 0x02),
}
NEXT = {  # transitions 2 to 12 and 16; what is not listed is ignored
    ("switch-on disabled", "shutdown"): "ready to switch on",  # 2
    ("ready to switch on", "switch on"): "switched on",  # 3
    ("ready to switch on", "enable operation"): "operation enabled",  # 3, 4
    ("ready to switch on", "disable voltage"): "switch-on disabled",  # 7
    ("ready to switch on", "quick stop"): "switch-on disabled",  # 7
    ("switched on", "enable operation"): "operation enabled",  # 4
    ("switched on", "shutdown"): "ready to switch on",  # 6
    ("switched on", "disable voltage"): "switch-on disabled",  # 10
    ("switched on", "quick stop"): "switch-on disabled",  # 10
    ("operation enabled", "switch on"): "switched on",  # 5
    ("operation enabled", "shutdown"): "ready to switch on",  # 8
    ("operation enabled", "disable voltage"): "switch-on disabled",  # 9
    ("operation enabled", "quick stop"): "quick stop active",  # 11
    ("quick stop active", "disable voltage"): "switch-on disabled",  # 12
    ("quick stop active", "enable operation"): "operation enabled",  # 16
}


def make(quick_stop: int = 6) -> tuple[Wire, Drive402]:
    node = drive_node(DriveConfig(), FakePlant())
    wire = Wire(node)
    wire.write(0x605A, 0, quick_stop, 2)
    wire.write(0x605C, 0, 0, 2)  # no ramp on disable operation: states follow at once
    assert isinstance(node.device, Drive402)
    return wire, node.device


def bring(wire: Wire, drive: Drive402, state: str) -> None:
    for word in STATES[state][2]:
        wire.write(0x6040, 0, word, 2)
    if state == "fault":
        drive.fault(0x2310)
    assert shown(wire) == state


def shown(wire: Wire) -> str:
    word = wire.read(0x6041)
    (name,) = [name for name, (mask, value, _) in STATES.items() if word & mask == value]
    return name


def command_in(word: int) -> str | None:
    found = [name for name, (mask, value) in COMMANDS.items() if word & mask == value]
    assert len(found) <= 1
    return found[0] if found else None


@pytest.mark.parametrize(("state", "command"), list(itertools.product(STATES, COMMANDS)))
def test_every_command_in_every_state_does_what_the_table_says(state: str, command: str) -> None:
    wire, drive = make()
    bring(wire, drive, state)
    wire.write(0x6040, 0, COMMANDS[command][1], 2)
    assert shown(wire) == NEXT.get((state, command), state)


def test_all_low_bytes_decode_by_mask_and_value() -> None:
    for word in range(0x100):
        command = decode(word)
        assert (None if command is None else command.value) == command_in(word), hex(word)


@pytest.mark.parametrize("state", STATES)
def test_the_level_of_bit_7_moves_nothing_but_a_fault(state: str) -> None:
    wire, drive = make()
    bring(wire, drive, state)
    wire.write(0x6040, 0, 0x8F, 2)
    assert shown(wire) == ("switch-on disabled" if state == "fault" else state)


def test_a_fault_is_reset_by_the_rising_edge_only_and_does_not_enable() -> None:
    wire, drive = make()
    wire.write(0x6040, 0, 0x80, 2)
    drive.fault(0x2310)
    wire.write(0x6040, 0, 0x80, 2)  # still high: no edge
    assert shown(wire) == "fault"
    wire.write(0x6040, 0, 0x0F, 2)
    assert shown(wire) == "fault"
    assert wire.write(0x6040, 0, 0x8F, 2) == ["081 00 00 00 00 00 00 00 00"]
    assert shown(wire) == "switch-on disabled"
    wire.write(0x6040, 0, 0x8F, 2)
    assert shown(wire) == "switch-on disabled"


def test_a_fault_whose_cause_stays_cannot_be_reset() -> None:
    wire, drive = make()
    drive.fault(0x4310, cause_stays=True)
    for word in (0x00, 0x80):
        wire.write(0x6040, 0, word, 2)
    assert shown(wire) == "fault"
    drive.remove_cause()
    for word in (0x00, 0x80):
        wire.write(0x6040, 0, word, 2)
    assert shown(wire) == "switch-on disabled"


def test_quick_stop_codes_1_to_4_cannot_be_taken_back() -> None:
    wire, drive = make(quick_stop=2)
    bring(wire, drive, "quick stop active")
    wire.write(0x6040, 0, 0x0F, 2)
    assert shown(wire) == "quick stop active"
    wire.tick(2)
    assert shown(wire) == "switch-on disabled"


def test_quick_stop_codes_5_to_8_stay_until_told_otherwise() -> None:
    wire, drive = make(quick_stop=6)
    bring(wire, drive, "quick stop active")
    wire.tick(2000)
    assert shown(wire) == "quick stop active"
    assert wire.read(0x6041) & 0x0400  # standstill reached


def test_quick_stop_code_0_switches_off_at_once() -> None:
    wire, drive = make(quick_stop=0)
    bring(wire, drive, "operation enabled")
    wire.write(0x6040, 0, 0x02, 2)
    assert shown(wire) == "switch-on disabled"


def test_the_status_word_says_voltage_and_remote_in_every_state() -> None:
    for state in STATES:
        wire, drive = make()
        bring(wire, drive, state)
        assert wire.read(0x6041) & 0x0210 == 0x0210
        assert drive.state is not PowerState.NOT_READY

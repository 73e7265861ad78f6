"""The state table against a second reading of the standard, for every status word."""

from functools import cache

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.canopen.cia402 import MODE_CODES, decode_state, describe_modes, describe_status, step_to_enabled
from drivers.types import DriveState, Mode

# CiA 402 prints status words as bit patterns, bits 6 5 . 3 2 1 0; x: any
PATTERNS = {
    "0x-0000": DriveState.NOT_READY,
    "1x-0000": DriveState.SWITCH_ON_DISABLED,
    "01-0001": DriveState.READY,
    "01-0011": DriveState.SWITCHED_ON,
    "01-0111": DriveState.ENABLED,
    "00-0111": DriveState.QUICK_STOP,
    "0x-1111": DriveState.FAULT_REACTION,
    "0x-1000": DriveState.FAULT,
}

# Control words as CiA 402 prints them, bits 7 3 2 1 0
COMMANDS = {
    "0x110": "shutdown",
    "00111": "switch on",
    "01111": "enable operation",
    "0xx0x": "disable voltage",
    "0x01x": "quick stop",
}
TRANSITIONS = {
    (DriveState.SWITCH_ON_DISABLED, "shutdown"): DriveState.READY,
    (DriveState.READY, "switch on"): DriveState.SWITCHED_ON,
    (DriveState.READY, "disable voltage"): DriveState.SWITCH_ON_DISABLED,
    (DriveState.SWITCHED_ON, "enable operation"): DriveState.ENABLED,
    (DriveState.SWITCHED_ON, "shutdown"): DriveState.READY,
    (DriveState.SWITCHED_ON, "disable voltage"): DriveState.SWITCH_ON_DISABLED,
    (DriveState.ENABLED, "disable voltage"): DriveState.SWITCH_ON_DISABLED,
    (DriveState.QUICK_STOP, "disable voltage"): DriveState.SWITCH_ON_DISABLED,
    (DriveState.QUICK_STOP, "enable operation"): DriveState.ENABLED,
}


def fits(bits: str, pattern: str) -> bool:
    return all(p in ("x", "-", b) for b, p in zip(bits, pattern, strict=True))


@cache
def _state_of_bits(bits: str) -> DriveState | None:
    return next((state for pattern, state in PATTERNS.items() if fits(bits, pattern)), None)


def state_by_pattern(word: int) -> DriveState | None:
    return _state_of_bits(f"{word & 0x7F:07b}")


def follow(state: DriveState, control_word: int) -> DriveState:
    bits = f"{control_word >> 7 & 1}{control_word & 0xF:04b}"
    command = next(name for pattern, name in COMMANDS.items() if fits(bits, pattern))
    return TRANSITIONS.get((state, command), state)


def test_every_status_word_is_read_as_the_standard_prints_it() -> None:
    for word in range(0x10000):
        expected = state_by_pattern(word)
        if expected is not None:
            assert decode_state(word) is expected, f"0x{word:04X}"


@pytest.mark.parametrize("bits", [bits for bits in range(0x80) if state_by_pattern(bits) is None])
def test_bits_that_the_standard_does_not_print_are_no_state(bits: int) -> None:
    with pytest.raises(ValueError, match=f"0x12{bits | 0x80:02X} is no state"):
        decode_state(0x1280 | bits)


@given(st.sampled_from([state for state in DriveState if state is not DriveState.FAULT]))
def test_each_step_is_one_transition_and_the_way_ends_in_operation_enabled(start: DriveState) -> None:
    state = start
    for _ in range(4):
        step = step_to_enabled(state)
        if step is None:
            break
        assert follow(state, step.control_word) is step.leads_to
        state = step.leads_to
    assert state in (DriveState.ENABLED, start)
    waits_for_the_drive = (DriveState.NOT_READY, DriveState.FAULT_REACTION)
    assert (state is DriveState.ENABLED) is (start not in waits_for_the_drive)


def test_no_way_leads_out_of_a_fault() -> None:
    with pytest.raises(ValueError, match="without a fault reset"):
        step_to_enabled(DriveState.FAULT)


def test_quick_stop_is_left_by_way_of_switch_on_disabled() -> None:
    step = step_to_enabled(DriveState.QUICK_STOP)
    assert step is not None
    assert step.leads_to is DriveState.SWITCH_ON_DISABLED


@given(st.sampled_from(list(DriveState)))
def test_no_step_towards_operation_carries_the_fault_reset_bit(state: DriveState) -> None:
    if state is not DriveState.FAULT:
        step = step_to_enabled(state)
        assert step is None or not step.control_word & 0x80


def test_modes_are_the_cyclic_synchronous_ones() -> None:
    assert MODE_CODES == {Mode.POSITION: 8, Mode.VELOCITY: 9, Mode.TORQUE: 10}


@given(st.integers(0, 0xFFFF))
def test_any_status_word_can_be_described(word: int) -> None:
    text = describe_status(word)
    assert f"0x{word:04X}" in text
    assert ("internal limit" in text) is bool(word & 0x0800)
    assert ("not remote" in text) is not bool(word & 0x0200)


def test_supported_modes_are_named() -> None:
    # 0x3A5 is what an EPOS4 reports: no profile torque
    text = describe_modes(0x3A5)
    assert "cyclic torque" in text
    assert "profile torque" not in text
    assert describe_modes(0) == "0x00000000 (none)"

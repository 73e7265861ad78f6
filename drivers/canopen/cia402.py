"""The CiA 402 power state machine as a table, without any I/O.

State is decoded from the status word 0x6041; a `Step` is one control word 0x6040 and the state it must lead to.
Nothing here leaves a fault: a fault reset is a command of its own and ends in switch-on disabled.
Source: CiA 402 status and control word tables, as printed in vendor manuals.
"""

from dataclasses import dataclass

from drivers.types import DriveState, Mode

SHUTDOWN = 0x0006
SWITCH_ON = 0x0007
ENABLE_OPERATION = 0x000F
DISABLE_VOLTAGE = 0x0000
QUICK_STOP = 0x0002
FAULT_RESET = 0x0080
"""Acts on the rising edge of bit 7, so a control word without it must come before."""

STATE_MASK = 0x6F
ENABLED_BITS = 0x27
"""`status_word & STATE_MASK` of a drive in operation enabled."""

INTERNAL_LIMIT = 0x0800
"""Status word bit 11: a limit of the drive acts, commanded and actual value part."""

MODE_CODES = {Mode.POSITION: 8, Mode.VELOCITY: 9, Mode.TORQUE: 10}
"""Object 0x6060: cyclic synchronous position, velocity, torque."""

_STATES = (
    (0x4F, 0x00, DriveState.NOT_READY),
    (0x4F, 0x40, DriveState.SWITCH_ON_DISABLED),
    (0x6F, 0x21, DriveState.READY),
    (0x6F, 0x23, DriveState.SWITCHED_ON),
    (0x6F, ENABLED_BITS, DriveState.ENABLED),
    (0x6F, 0x07, DriveState.QUICK_STOP),
    (0x4F, 0x0F, DriveState.FAULT_REACTION),
    (0x4F, 0x08, DriveState.FAULT),
)

_BITS = {
    4: "voltage enabled",
    7: "warning",
    9: "remote",
    10: "target reached",
    11: "internal limit active",
}

_MODE_NAMES = {
    0: "profile position",
    1: "velocity",
    2: "profile velocity",
    3: "profile torque",
    5: "homing",
    6: "interpolated position",
    7: "cyclic position",
    8: "cyclic velocity",
    9: "cyclic torque",
}


@dataclass(frozen=True, slots=True)
class Step:
    """One transition: the control word to write and the state that must follow."""

    control_word: int
    leads_to: DriveState


_TO_ENABLED = {
    DriveState.SWITCH_ON_DISABLED: Step(SHUTDOWN, DriveState.READY),
    DriveState.READY: Step(SWITCH_ON, DriveState.SWITCHED_ON),
    DriveState.SWITCHED_ON: Step(ENABLE_OPERATION, DriveState.ENABLED),
    # by way of switch-on disabled, so that the targets of before the stop are never resumed
    DriveState.QUICK_STOP: Step(DISABLE_VOLTAGE, DriveState.SWITCH_ON_DISABLED),
}


def decode_state(status_word: int) -> DriveState:
    """Give the state of a status word (U16). Raises ValueError if its bits are no state of CiA 402."""
    state = STATE_OF[status_word & STATE_MASK]
    if state is None:
        raise ValueError(f"status word 0x{status_word:04X} is no state of CiA 402")
    return state


def step_to_enabled(state: DriveState) -> Step | None:
    """Give the next step from `state` towards operation enabled.

    None where there is nothing to do or the drive moves on by itself (not ready, fault reaction).
    Raises ValueError in a fault: it must be reset first, by a command of its own.
    """
    if state is DriveState.FAULT:
        raise ValueError("no way leads from fault to operation enabled without a fault reset")
    return _TO_ENABLED.get(state)


def describe_status(status_word: int) -> str:
    """Say in words what a status word (U16) tells, for messages."""
    state = STATE_OF[status_word & STATE_MASK]
    bits = [text for bit, text in _BITS.items() if status_word >> bit & 1]
    notes = bits if bits else ["no further bit set"]
    if not status_word >> 9 & 1:
        notes.append("not remote: the control word may be ignored")
    return f"{state or 'no state of CiA 402'}, status word 0x{status_word:04X} ({', '.join(notes)})"


def describe_modes(supported: int) -> str:
    """Say which modes object 0x6502 (U32) declares."""
    names = [name for bit, name in _MODE_NAMES.items() if supported >> bit & 1]
    return f"0x{supported:08X} ({', '.join(names) or 'none'})"


def _decoded() -> tuple[DriveState | None, ...]:
    def find(bits: int) -> DriveState | None:
        return next((state for mask, value, state in _STATES if bits & mask == value), None)

    return tuple(find(bits) for bits in range(STATE_MASK + 1))


STATE_OF = _decoded()
"""State by `status_word & STATE_MASK`; None where the bits are no state of CiA 402."""

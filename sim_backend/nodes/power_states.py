"""The CiA 402 power state machine as a table: states, commands and the numbered transitions between them."""

from collections.abc import Mapping
from enum import IntEnum, StrEnum


class PowerState(IntEnum):
    """States; the value is the state's part of the statusword 0x6041 (with bit 5 where the mask contains it)."""

    NOT_READY = 0x00
    SWITCH_ON_DISABLED = 0x40
    READY = 0x21
    SWITCHED_ON = 0x23
    ENABLED = 0x27
    QUICK_STOP = 0x07
    FAULT_REACTION = 0x0F
    FAULT = 0x08


class Command(StrEnum):
    """What a control word 0x6040 asks for. Fault reset is not here: it is an edge, not a level."""

    SHUTDOWN = "shutdown"
    SWITCH_ON = "switch on"
    ENABLE_OPERATION = "enable operation"
    DISABLE_VOLTAGE = "disable voltage"
    QUICK_STOP = "quick stop"


FAULT_RESET = 0x80
"""Bit 7 of the control word; acts on its rising edge only."""

HALT = 0x100
"""Bit 8 of the control word."""

POWERED = frozenset((PowerState.ENABLED, PowerState.QUICK_STOP, PowerState.FAULT_REACTION))
"""States in which the motor may carry torque."""

TRANSITIONS: Mapping[tuple[PowerState, Command], tuple[int, ...]] = {
    (PowerState.SWITCH_ON_DISABLED, Command.SHUTDOWN): (2,),
    (PowerState.READY, Command.SWITCH_ON): (3,),
    (PowerState.READY, Command.ENABLE_OPERATION): (3, 4),
    (PowerState.READY, Command.DISABLE_VOLTAGE): (7,),
    (PowerState.READY, Command.QUICK_STOP): (7,),
    (PowerState.SWITCHED_ON, Command.ENABLE_OPERATION): (4,),
    (PowerState.SWITCHED_ON, Command.SHUTDOWN): (6,),
    (PowerState.SWITCHED_ON, Command.DISABLE_VOLTAGE): (10,),
    (PowerState.SWITCHED_ON, Command.QUICK_STOP): (10,),
    (PowerState.ENABLED, Command.SWITCH_ON): (5,),
    (PowerState.ENABLED, Command.SHUTDOWN): (8,),
    (PowerState.ENABLED, Command.DISABLE_VOLTAGE): (9,),
    (PowerState.ENABLED, Command.QUICK_STOP): (11,),
    (PowerState.QUICK_STOP, Command.DISABLE_VOLTAGE): (12,),
    (PowerState.QUICK_STOP, Command.ENABLE_OPERATION): (16,),
}
"""Transitions that a command causes. 0, 1, 13 and 14 are automatic, 15 needs the edge of bit 7."""

TARGETS: Mapping[int, PowerState] = {
    2: PowerState.READY,
    3: PowerState.SWITCHED_ON,
    4: PowerState.ENABLED,
    5: PowerState.SWITCHED_ON,
    6: PowerState.READY,
    7: PowerState.SWITCH_ON_DISABLED,
    8: PowerState.READY,
    9: PowerState.SWITCH_ON_DISABLED,
    10: PowerState.SWITCH_ON_DISABLED,
    11: PowerState.QUICK_STOP,
    12: PowerState.SWITCH_ON_DISABLED,
    15: PowerState.SWITCH_ON_DISABLED,
    16: PowerState.ENABLED,
}
"""Where a transition leads."""


def decode(control_word: int) -> Command | None:
    """Give the command in a control word, by mask and value of the standard; None while bit 7 is set."""
    if control_word & 0x80:
        return None
    if not control_word & 0x02:
        return Command.DISABLE_VOLTAGE
    if not control_word & 0x04:
        return Command.QUICK_STOP
    if not control_word & 0x01:
        return Command.SHUTDOWN
    return Command.ENABLE_OPERATION if control_word & 0x08 else Command.SWITCH_ON

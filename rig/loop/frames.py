"""Between the frame of the log and the sense `opposed` in which everything is computed.

For rotation `same` the motor signals are negated on entry, so that the phases of lines must be turned on exit; each
turn is its own inverse.
"""

import math
from dataclasses import replace

from rig.config.dut import Dut, Rotation
from rig.loop.terms import Entry, Line


def turned(line: Line, dut: Dut) -> Line:
    """Give the line in the other frame: from computing to log, or back."""
    if dut.gear.rotation is not Rotation.SAME:
        return line
    phase = _turned_phase(line)
    return replace(line, sine=line.amplitude * math.cos(phase), cosine=line.amplitude * math.sin(phase))


def _turned_phase(line: Line) -> float:
    negated_torque = line.kind.entry is Entry.MOTOR
    negated_sign = line.kind.entry in (Entry.MOTOR_AGAINST_MOTION, Entry.OUTPUT_AGAINST_MOTION)
    if line.kind.variable == "motor_position":
        # sin(phase - k x) = sin(k x + pi - phase)
        angle = math.pi - line.phase
        return angle + math.pi if negated_torque or line.kind.entry is Entry.OUTPUT_AGAINST_MOTION else angle
    return line.phase + math.pi if negated_torque or (negated_sign and line.kind.entry.is_angle) else line.phase


def wrapped(angle: float) -> float:
    """Give the angle within -pi to pi, rad."""
    return math.remainder(angle, 2.0 * math.pi)

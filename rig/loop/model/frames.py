"""Between the frame of the log and the sense `opposed` in which everything is computed.

For rotation `same` the motor signals are negated on entry, so that the phases of lines must be turned on exit; each
turn is its own inverse.
"""

import math
from dataclasses import replace

import numpy as np

from rig.config.dut import Dut, Rotation
from rig.loop.model.curves import Curve, mirrored
from rig.loop.model.shapes import Place, ShapeTerm, addition, place_of
from rig.loop.model.terms import Entry, Line
from sim_backend.model.effects import Enters

NEGATED = frozenset({"motor_position", "motor_velocity", "motor_torque", "motor_current"})
"""Signals whose sign the frames turn."""


def turned(line: Line, dut: Dut) -> Line:
    """Give the line in the other frame: from computing to log, or back."""
    if dut.gear.rotation is not Rotation.SAME:
        return line
    phase = _turned_phase(line)
    return replace(line, sine=line.amplitude * math.cos(phase), cosine=line.amplitude * math.sin(phase))


def _turned_phase(line: Line) -> float:
    # sin(phase - k x) = sin(k x + pi - phase)
    angle = math.pi - line.phase if line.kind.variable == "motor_position" else line.phase
    # against motion: that of the motor, which is negated; at the motor its torque is as well
    negated = line.kind.entry in (Entry.MOTOR, Entry.MOTOR_ANGLE, Entry.OUTPUT_AGAINST_MOTION)
    return angle + math.pi if negated else angle


def turned_shape(term: ShapeTerm, dut: Dut) -> ShapeTerm:
    """Give an effect that is no line in the other frame: a constant in a negated torque changes its sign."""
    if dut.gear.rotation is Rotation.SAME and isinstance(term.effect, Curve):
        curve = term.effect
        odd_factor = curve.factor in NEGATED and curve.enters is not Enters.FRICTION
        added = odd_factor != (place_of(curve) is Place.MOTOR)
        return ShapeTerm(*mirrored(curve, term.values, variable=curve.variable in NEGATED, added=added))
    if isinstance(term.effect, Curve):
        return term
    constant = term.effect.reads == "motor_torque" and term.effect.linear and "motor_current" not in term.effect.signals
    if dut.gear.rotation is not Rotation.SAME or not constant:
        return term
    one, other = (addition(term, {name: np.full(2, sign) for name in term.effect.signals}, 1.0) for sign in (1.0, -1.0))
    if one is None or other is None or not np.array_equal(one, other):
        return term
    negated = [
        -value if parameter.name in term.effect.amplitudes else value
        for parameter, value in zip(term.effect.parameters, term.values, strict=True)
    ]
    return ShapeTerm(term.effect, tuple(negated))


def wrapped(angle: float) -> float:
    """Give the angle within -pi to pi, rad."""
    return math.remainder(angle, 2.0 * math.pi)

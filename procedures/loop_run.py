"""Evaluates the largest loop of a torque sweep: what locked-output and backdrive have in common."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from procedures.hysteresis import gap_at_zero, stiffness
from procedures.intents import Measurement, Result
from procedures.plan import BenchFacts
from procedures.recording import Recording

Floats = NDArray[np.float64]

FALLING, RISING = 1, 2
"""Legs of `waveforms.nested_triangles` that close the largest loop."""

NAMES = ("output_torque", "motor_torque", "motor_position", "output_position")
"""Signals that are recorded; an absent one gives NaN."""


@dataclass(frozen=True, slots=True)
class Driven:
    """Which side drives a loop.

    `order` is +1 where the rising branch lies higher at zero torque (locked output), -1 where the falling one does
    (held input). `friction` names the friction level of that side, `friction_gain` turns a motor torque into it.
    """

    order: float
    friction: str
    friction_gain: float
    friction_meaning: str


def loop_recordings() -> dict[int, Recording]:
    """Give an empty recording for each of the two branches."""
    return {FALLING: Recording(*NAMES), RISING: Recording(*NAMES)}


def evaluate_loop(legs: dict[int, Recording], driven: Driven, facts: BenchFacts) -> Result:
    """Give hysteresis loss, stiffness and friction level of the largest loop, as far as the sensors allow.

    All three need the output torque. A bench without an output encoder has the output at rest.
    """
    if not facts.has_torque_sensor:
        return Result()
    sense = 1.0 if facts.opposed else -1.0
    torque, motor, torsion = {}, {}, {}
    for leg in (FALLING, RISING):
        output_torque, motor_torque, motor_position, output_position = legs[leg].columns()
        output = output_position if facts.has_output_encoder else np.zeros_like(motor_position)
        torque[leg], motor[leg] = output_torque, sense * motor_torque
        torsion[leg] = output + sense * motor_position / facts.ratio
    loss = gap_at_zero((torque[RISING], torsion[RISING]), (torque[FALLING], torsion[FALLING]))
    width = gap_at_zero((torque[RISING], motor[RISING]), (torque[FALLING], motor[FALLING]))
    slope = stiffness(np.concatenate(list(torque.values())), np.concatenate(list(torsion.values())))
    scale = 0.5 * driven.order * driven.friction_gain
    return Result(
        (
            Measurement(
                "hysteresis_loss",
                driven.order * loss.value,
                "rad",
                loss.uncertainty,
                "width of the torsion loop at zero output torque, at the output",
            ),
            Measurement("stiffness", slope.value, "N*m/rad", slope.uncertainty, "chord of the largest torsion loop"),
            Measurement(
                driven.friction, scale * width.value, "N*m", abs(scale) * width.uncertainty, driven.friction_meaning
            ),
        )
    )

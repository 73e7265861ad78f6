"""Evaluates the largest loop of a torque sweep: what locked-output and backdrive have in common."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from procedures.checks import Checks
from procedures.hysteresis import FEWEST_SAMPLES, NEAR_ZERO, gap_at_zero, stiffness
from procedures.intents import Measurement, Result
from procedures.plan import BenchFacts
from procedures.recording import Recording

Floats = NDArray[np.float64]

FALLING, RISING = 1, 2
"""Legs of `waveforms.nested_triangles` that close the largest loop."""

NAMES = ("output_torque", "motor_torque", "motor_position", "output_position", "load_position")
"""Signals that are recorded; an absent one gives NaN."""

SLIDING = 1.25
"""Peak of the largest loop in friction levels: below 1 the teeth never slide, just above it noise hides the loop."""

SAFE_SAMPLES = 2 * FEWEST_SAMPLES
"""Samples near zero torque to plan for: noise and swinging take some of them away."""

STEADY = 12.0
"""Least time near zero torque in radians of the rotor's swinging. On the simulated drive the friction level reads
0.5 % low at 16, 1.6 % at 12 and 5 % at 8."""


@dataclass(frozen=True, slots=True)
class Driven:
    """Which side drives a loop.

    `order` is +1 where the rising branch lies higher at zero torque (locked output), -1 where the falling one does
    (held input). `friction` names the friction level of that side, `friction_gain` turns a motor torque into it.
    `output_held`: the output is locked, so that without an encoder it counts as being at rest.
    """

    order: float
    friction: str
    friction_gain: float
    friction_meaning: str
    output_held: bool


@dataclass(frozen=True, slots=True)
class Friction:
    """What a loop must overcome: the level (N*m at the side that drives) and the dut's key that states it.

    `lost` is how much of the driving torque friction keeps from the output torque, N*m at the side that drives.
    """

    level: float
    key: str
    lost: float


def check_loop(
    check: Checks,
    peak: float,
    amplitudes: Sequence[float],
    rates: Sequence[float],
    friction: Friction,
    facts: BenchFacts,
) -> None:
    """Refuse sweeps that hold no loop to evaluate: the teeth never slide, or zero torque is crossed too fast.

    `peak` N*m, `amplitudes` in shares of it, `rates` N*m/s, all at the side that drives.
    """
    largest = max(amplitudes, default=0.0) * peak
    least = SLIDING * friction.level
    if largest < least:
        check.refuse(
            "peak_torque" if peak < least else "amplitudes",
            f"{largest:.6g} N*m in the largest loop",
            f"is too little: the mesh never slides below {friction.key} = {friction.level:.6g} N*m, and a loop that "
            f"can be evaluated needs {least:.6g} N*m. Raise it, or correct {friction.key} in the dut file",
        )
        return
    if not facts.has_torque_sensor:
        return
    crossed = 2.0 * NEAR_ZERO * (largest - friction.lost)
    least_time = max(SAFE_SAMPLES * facts.cycle_time, STEADY / facts.rotor_swing)
    for rate in rates:
        if rate * least_time > crossed * (1.0 + 1e-9):
            check.refuse(
                "rates",
                f"{rate:.6g} N*m/s",
                f"is too fast, at most {crossed / least_time:.4g} N*m/s: the loop's width is read while the output "
                f"torque crosses zero ({crossed:.4g} N*m), which must last {SAFE_SAMPLES} cycles and {STEADY:g} rad of "
                f"the rotor's swinging at {facts.rotor_swing / math.tau:.3g} Hz, so {least_time:.3g} s. "
                "Lower the rate or raise the peak",
            )


def loop_recordings() -> dict[int, Recording]:
    """Give an empty recording for each of the two branches."""
    return {FALLING: Recording(*NAMES), RISING: Recording(*NAMES)}


def evaluate_loop(legs: dict[int, Recording], driven: Driven, facts: BenchFacts) -> Result:
    """Give hysteresis loss, stiffness and friction level of the largest loop, as far as the sensors allow.

    All three need the output torque. Without an output encoder a locked output counts as being at rest, and one that
    moves is seen by the load drive.
    """
    if not facts.has_torque_sensor:
        return Result()
    sense = 1.0 if facts.opposed else -1.0
    torque, motor, torsion = {}, {}, {}
    for leg in (FALLING, RISING):
        output_torque, motor_torque, motor_position, output_position, load_position = legs[leg].columns()
        output = np.zeros_like(motor_position) if driven.output_held else load_position
        output = output_position if facts.has_output_encoder else output
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

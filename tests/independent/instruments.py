"""What the instruments make of the true signals: quantised encoders with unknown zeros, noisy torques."""

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Floats = NDArray[np.float64]


class NoiseKind(StrEnum):
    """Distribution and colour of the torque and current noise; the rms is the same for all."""

    WHITE = "white"
    AR1 = "ar1"
    STUDENT_T = "student-t"
    TORQUE_PROPORTIONAL = "torque-proportional"


AR1_POLE = 0.97
STUDENT_DEGREES = 3
PROPORTIONAL_REST = 0.25
"""Share of the noise that is there without load, where it grows with the torque."""


@dataclass(frozen=True, slots=True)
class Instruments:
    """Counts per revolution, N*m rms; `dither`: the output encoder has half a count of uniform dither.

    `output_zero_spread`: rad, standard deviation of the output encoder's zero between runs. The motor encoder finds
    its index pulse to one count, but not on which turn it stands.
    """

    motor_counts: int = 16384
    output_counts: int = 524288
    output_torque_noise: float = 0.02
    motor_torque_noise: float = 2e-4
    noise: NoiseKind = NoiseKind.WHITE
    dither: bool = False
    output_zero_spread: float = 2e-3
    largest_turn: int = 3
    torque_constant: float = 0.321
    rated_torque: float = 16.0


@dataclass(frozen=True, slots=True)
class Truth:
    """True signals of one run, each of shape (n,): rad, rad, N*m, N*m, degC."""

    motor_position: Floats
    output_position: Floats
    motor_torque: Floats
    output_torque: Floats
    temperature: Floats


def measure(
    truth: Truth, instruments: Instruments, ratio: float, rng: np.random.Generator
) -> tuple[dict[str, Floats], dict[str, float]]:
    """Give what the log holds, by contract name, and the encoder zeros of the run (rad)."""
    motor_count = 2.0 * math.pi / instruments.motor_counts
    output_count = 2.0 * math.pi / instruments.output_counts
    turns = int(rng.integers(-instruments.largest_turn, instruments.largest_turn + 1))
    zeros = {
        "motor_position": 2.0 * math.pi * turns + motor_count * float(rng.uniform()),
        "output_position": float(rng.normal(0.0, instruments.output_zero_spread)),
    }
    dither = rng.uniform(-0.5, 0.5, truth.output_position.size) if instruments.dither else 0.0
    n = truth.output_torque.size
    of_cell = _noise(instruments.noise, np.abs(truth.output_torque) / instruments.rated_torque, n, rng)
    of_drive = _noise(instruments.noise, ratio * np.abs(truth.motor_torque) / instruments.rated_torque, n, rng)
    motor_torque = truth.motor_torque + instruments.motor_torque_noise * of_drive
    measured = {
        "motor_position": motor_count * np.floor((truth.motor_position + zeros["motor_position"]) / motor_count),
        "output_position": output_count
        * np.floor((truth.output_position + zeros["output_position"]) / output_count + dither),
        "motor_torque": motor_torque,
        "motor_current": motor_torque / instruments.torque_constant,
        "output_torque": truth.output_torque + instruments.output_torque_noise * of_cell,
        "temperature": truth.temperature + 0.05 * rng.standard_normal(n),
    }
    return measured, zeros


def _noise(kind: NoiseKind, load: Floats, n: int, rng: np.random.Generator) -> Floats:
    """Give n values of unit variance; for torque-proportional noise unit variance holds at 3/4 of the rated load."""
    if kind is NoiseKind.STUDENT_T:
        variance = STUDENT_DEGREES / (STUDENT_DEGREES - 2.0)
        return rng.standard_t(STUDENT_DEGREES, n) / math.sqrt(variance)
    white = rng.standard_normal(n)
    if kind is NoiseKind.AR1:
        start = AR1_POLE * rng.standard_normal()
        return np.asarray(lfilter([math.sqrt(1.0 - AR1_POLE**2)], [1.0, -AR1_POLE], white, zi=[start])[0])
    if kind is NoiseKind.TORQUE_PROPORTIONAL:
        return white * (PROPORTIONAL_REST + load)
    return white

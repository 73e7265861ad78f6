"""What the instruments make of the true signals: quantised encoders with unknown zeros, noisy torques, their errors.

An encoder's periodic errors belong to its disc: they follow the angle counted from the encoder's own zero.
Motor torque and motor current are one measurement, nominal torque constant times measured current; where a torque was
commanded, the drive makes it so that this reading is the command.
"""

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from tests.independent import effects as fx

Floats = NDArray[np.float64]


class NoiseKind(StrEnum):
    """Distribution and colour of the torque and current noise; the rms is the same for all."""

    WHITE = "white"
    AR1 = "ar1"
    STUDENT_T = "student-t"
    TORQUE_PROPORTIONAL = "torque-proportional"


AR1_POLE = 0.97
STUDENT_DEGREES = 3
MISSED = "encoder-missed-counts"
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


NO_EFFECTS = fx.Effects()


def measure(
    truth: Truth,
    instruments: Instruments,
    ratio: float,
    rng: np.random.Generator,
    effects: fx.Effects = NO_EFFECTS,
    time: Floats | None = None,
) -> tuple[dict[str, Floats], dict[str, float]]:
    """Give what the log holds, by contract name, and the encoder zeros of the run (rad).

    time: s, shape (n,), evenly spaced; without it 200 samples a second. Missed counts come at other times in every run.
    """
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
    temperature_noise = 0.05 * rng.standard_normal(n)
    signals = {
        "time": np.arange(n) / 200.0 if time is None else time,
        "motor_position": truth.motor_position + zeros["motor_position"],
        "output_position": truth.output_position + zeros["output_position"],
        "output_torque": truth.output_torque,
        "temperature": truth.temperature,
    }
    shown_motor_angle, shown_output_angle, shown_torque = (
        signals[name] + fx.total(ids, effects, signals, (n,))
        for name, ids in (
            ("motor_position", [name for name in fx.MOTOR_ANGLE if name != MISSED]),
            ("output_position", fx.OUTPUT_ANGLE),
            ("output_torque", fx.OUTPUT_TORQUE),
        )
    )
    for parameters in effects.of(MISSED):
        of_this_run = {**parameters, "seed": parameters["seed"] + float(rng.integers(2**31))}
        shown_motor_angle = shown_motor_angle + fx.SECOND_FORMULAS[MISSED](signals["time"], **of_this_run)
    motor_torque = shown_motor_torque(truth.motor_torque, effects, instruments.torque_constant)
    motor_torque = motor_torque + instruments.motor_torque_noise * of_drive
    measured = {
        "motor_position": motor_count * np.floor(shown_motor_angle / motor_count),
        "output_position": output_count * np.floor(shown_output_angle / output_count + dither),
        "motor_torque": motor_torque,
        "motor_current": motor_torque / instruments.torque_constant,
        "output_torque": shown_torque + instruments.output_torque_noise * of_cell,
        "temperature": truth.temperature + temperature_noise,
    }
    return measured, zeros


def shown_motor_torque(motor_torque: Floats, effects: fx.Effects, torque_constant: float) -> Floats:
    """Give what the drive takes the true torque (N*m) for: nominal torque constant times measured current."""
    signals = {"motor_torque": motor_torque, "motor_current": _current(motor_torque, effects, torque_constant)}
    return motor_torque + fx.total(fx.MOTOR_TORQUE, effects, signals, motor_torque.shape)


def true_motor_torque(commanded: Floats, effects: fx.Effects, torque_constant: float) -> Floats:
    """Give the true torque (N*m) when the drive shows `commanded`: its current sensor and constant decide."""
    feigned = fx.total(["current-sensor-offset"], effects, {"motor_torque": commanded}, commanded.shape)
    current = (commanded - feigned) / torque_constant
    missing = fx.total(["torque-constant-saturation"], effects, {"motor_current": current}, current.shape)
    return (torque_constant * current - missing) / _nominal_over_true(effects)


def _current(torque: Floats, effects: fx.Effects, torque_constant: float) -> Floats:
    """Give the true current (A) behind a torque; ValueError beyond what the saturated motor can give.

    The cubic k_t i (1 - a i^2) = (1 + error) torque is solved by the trisection of an angle.
    """
    unsaturated = _nominal_over_true(effects) * torque / torque_constant
    growth = sum(parameters["amplitude"] for parameters in effects.of("torque-constant-saturation"))
    if not growth:
        return unsaturated
    sine = 1.5 * math.sqrt(3.0 * growth) * unsaturated
    if np.max(np.abs(sine)) > 1.0:
        raise ValueError(f"no current gives {np.max(np.abs(torque)):g} N*m: the motor saturates")
    return np.asarray(2.0 / math.sqrt(3.0 * growth) * np.sin(np.arcsin(sine) / 3.0))


def _nominal_over_true(effects: fx.Effects) -> float:
    return 1.0 + sum(parameters["amplitude"] for parameters in effects.of("torque-constant-error"))


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

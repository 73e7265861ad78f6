"""Physics that is in no catalogue: what it adds to the true signals, and which answers describe it.

Nothing of the model is imported. An angle (rad) adds to the torsion: where the output is locked the motor's angle
moves, elsewhere the output's. A drag (N*m) adds to the torque that the motor gives; the mesh gets what it got without.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from tests.independent.campaign import Further
from tests.independent.instruments import Truth
from tests.independent.memory import lagged

Floats = NDArray[np.float64]

RATIO = 100.0
COLD = 20.0
"""degC at which what grows with the warmth is nothing."""
NOMINAL_VOLTAGE = 24.0
ROOM = 22.0


@dataclass(frozen=True, slots=True)
class Signals:
    """The true signals of one run, shape (n,), SI; `voltage` and `room` act on nothing in a catalogue."""

    procedure: str
    time: Floats
    truth: Truth
    velocity: Floats
    torque_rate: Floats
    voltage: Floats
    room: Floats


Law = Callable[[Signals, Mapping[str, float]], Floats]
"""What is added per unit of amplitude, shape (n,)."""


@dataclass(frozen=True, slots=True)
class Outside:
    """One kind of physics.

    `law` adds to the torsion (rad) or to the motor torque (`drag`, N*m); `amplitude`: where the search for the size
    starts; `constants` are drawn between two bounds. `variables` and `shapes`: answers that describe it. `same_as`:
    catalogue ids that are the same function on these data, and `because` why. `channel`: the further column it
    follows. `rich`: it shows only under loads while turning. `absolute`: the motor encoder must know its turn.
    """

    law: Law
    drag: bool
    amplitude: float
    constants: Mapping[str, tuple[float, float]]
    variables: frozenset[str]
    shapes: frozenset[str]
    same_as: frozenset[str] = frozenset()
    because: str = ""
    channel: str | None = None
    rich: bool = False
    absolute: bool = False


def draw_constants(kind: str, rng: np.random.Generator) -> dict[str, float]:
    """Draw the constants of one kind within their bounds."""
    return {name: float(rng.uniform(low, high)) for name, (low, high) in OUTSIDE[kind].constants.items()}


def acting(kind: str, amplitude: float, constants: Mapping[str, float]) -> Further:
    """Give what the generator lets act on every run."""
    return partial(_act, OUTSIDE[kind], amplitude, constants)


def _act(
    outside: Outside,
    amplitude: float,
    constants: Mapping[str, float],
    procedure: str,
    truth: Truth,
    time: Floats,
    seed: int,
) -> tuple[Truth, dict[str, Floats]]:
    rng = np.random.default_rng([seed, 2])
    seen = Signals(
        procedure,
        time,
        truth,
        np.gradient(truth.motor_position, time),
        np.gradient(truth.output_torque, time),
        _wandering(time, NOMINAL_VOLTAGE, 1.0, rng),
        _wandering(time, ROOM, 3.0, rng),
    )
    added = amplitude * outside.law(seen, constants)
    columns = {"supply_voltage": (seen.voltage, 0.01), "room_temperature": (seen.room, 0.05)}
    channels = {}
    if outside.channel is not None:
        values, noise = columns[outside.channel]
        channels[outside.channel] = values + noise * rng.standard_normal(time.size)
    return _dragged(truth, added) if outside.drag else _twisted(truth, added, procedure), channels


def _twisted(truth: Truth, angle: Floats, procedure: str) -> Truth:
    if procedure == "locked-output":
        return replace(truth, motor_position=truth.motor_position + RATIO * angle)
    return replace(truth, output_position=truth.output_position + angle)


def _dragged(truth: Truth, torque: Floats) -> Truth:
    return replace(truth, motor_torque=truth.motor_torque + torque)


def _wandering(time: Floats, mean: float, size: float, rng: np.random.Generator) -> Floats:
    """Give a slow course about `mean`: two sines of 15 to 60 s and a level of the day."""
    course = np.full(time.shape, mean + float(rng.uniform(-size, size)))
    for period in rng.uniform(15.0, 60.0, 2).tolist():
        course = course + 0.5 * size * np.sin(2.0 * math.pi * time / period + float(rng.uniform(-math.pi, math.pi)))
    return course


def _pressed_twice(s: Signals, c: Mapping[str, float]) -> Floats:
    return s.truth.output_torque**2 / 100.0 * np.sin(2.0 * s.truth.motor_position + c["phase"])


def _tooth_waves(s: Signals, c: Mapping[str, float]) -> Floats:
    return np.sin(2.0 * math.pi * s.truth.output_torque / c["period"] + c["phase"])


def _hardening(s: Signals, c: Mapping[str, float]) -> Floats:
    torque = s.truth.output_torque
    return -np.sign(torque) * np.maximum(np.abs(torque) - c["from"], 0.0) ** 2


def _late_gap(s: Signals, c: Mapping[str, float]) -> Floats:
    return np.clip((s.truth.output_torque - c["at"]) / 0.2, -1.0, 1.0)


def _odd_order(s: Signals, c: Mapping[str, float]) -> Floats:
    angle = c["order"] * s.truth.motor_position
    return np.sin(angle + c["phase"]) + 0.5 * np.sin(2.0 * angle + 1.0) + 0.3 * np.sin(3.0 * angle - 2.0)


def _bearing_cage(s: Signals, c: Mapping[str, float]) -> Floats:
    return np.sin(c["order"] * s.truth.output_position + c["phase"])


def _warm_load(s: Signals, _: Mapping[str, float]) -> Floats:
    load = np.abs(s.truth.output_torque) / RATIO
    return _turning(s) * load * (s.truth.temperature - COLD) / 10.0


def _grease(s: Signals, c: Mapping[str, float]) -> Floats:
    return s.velocity - lagged(s.time, s.velocity, c["time_constant"])


def _voltage(s: Signals, _: Mapping[str, float]) -> Floats:
    return s.voltage - NOMINAL_VOLTAGE


def _draught(s: Signals, _: Mapping[str, float]) -> Floats:
    return s.room - ROOM


def _rate_size(s: Signals, _: Mapping[str, float]) -> Floats:
    return np.abs(s.torque_rate)


def _first_loading(s: Signals, _: Mapping[str, float]) -> Floats:
    return np.maximum.accumulate(np.abs(s.truth.output_torque))


def _saturating(s: Signals, c: Mapping[str, float]) -> Floats:
    pressed = np.tanh(np.abs(s.truth.output_torque) / c["saturation"])
    return pressed * np.sin(2.0 * s.truth.motor_position + c["phase"])


def _hum(s: Signals, c: Mapping[str, float]) -> Floats:
    return np.sin(2.0 * math.pi * c["frequency"] * s.time + c["phase"])


def _churning(s: Signals, _: Mapping[str, float]) -> Floats:
    return s.velocity * np.abs(s.velocity)


def _turning(s: Signals) -> Floats:
    return np.sign(np.where(np.abs(s.velocity) > 1e-3, s.velocity, 0.0))


PHASE = (-math.pi, math.pi)
TORQUE, ANGLE = "output_torque", "motor_position"

OUTSIDE: Mapping[str, Outside] = MappingProxyType(
    {
        "torque squared, times angle": Outside(
            _pressed_twice, False, 1e-5, {"phase": PHASE}, frozenset({TORQUE, ANGLE}), frozenset({"product"})
        ),
        "waves over the torque": Outside(
            _tooth_waves,
            False,
            5e-6,
            {"period": (4.0, 8.0), "phase": PHASE},
            frozenset({TORQUE}),
            frozenset({"static", "periodic"}),
            because="what is periodic in a torque is also a static function of it",
        ),
        "stiffer beyond a torque": Outside(
            _hardening, False, 3e-7, {"from": (6.0, 8.0)}, frozenset({TORQUE}), frozenset({"static"})
        ),
        "gap at a torque": Outside(
            _late_gap, False, 1e-5, {"at": (3.5, 6.5)}, frozenset({TORQUE}), frozenset({"static"})
        ),
        "odd order with harmonics": Outside(
            _odd_order,
            False,
            5e-6,
            {"order": (2.2, 2.8), "phase": PHASE},
            frozenset({ANGLE}),
            frozenset({"periodic"}),
            frozenset({"kinematic-error"}),
            "an angle error of any order of the motor angle is what the catalogue calls by this name",
            absolute=True,
        ),
        "order of the output bearing": Outside(
            _bearing_cage,
            False,
            5e-6,
            {"order": (6.2, 9.8), "phase": PHASE},
            frozenset({"output_position", ANGLE}),
            frozenset({"periodic"}),
            frozenset({"output-encoder-eccentricity", "encoder-subdivision-error", "kinematic-error"}),
            "the output angle is the motor's over the ratio, to 1e-3 rad: one line of the torsion in either",
            absolute=True,
        ),
        "drag of warmth times load": Outside(
            _warm_load,
            True,
            1e-2,
            {},
            frozenset({"temperature", TORQUE}),
            frozenset({"product"}),
            rich=True,
        ),
        "drag that settles after a change of speed": Outside(
            _grease, True, 1e-5, {"time_constant": (1.5, 4.0)}, frozenset({"motor_velocity"}), frozenset({"lag"})
        ),
        "drag with the square of speed": Outside(
            _churning, True, 1e-7, {}, frozenset({"motor_velocity"}), frozenset({"static"}), rich=True
        ),
        "supply voltage": Outside(
            _voltage,
            True,
            3e-4,
            {},
            frozenset({"supply_voltage"}),
            frozenset({"static"}),
            channel="supply_voltage",
        ),
        "draught": Outside(
            _draught,
            False,
            2e-6,
            {},
            frozenset({"room_temperature"}),
            frozenset({"static"}),
            channel="room_temperature",
        ),
        "size of the torque's rate": Outside(
            _rate_size,
            False,
            2e-6,
            {},
            frozenset({TORQUE, "motor_torque"}),
            frozenset({"rate"}),
            because="in a sweep both torques have one rate, but while the mesh sticks",
        ),
        "largest torque so far": Outside(
            _first_loading, False, 1e-6, {}, frozenset({TORQUE}), frozenset({"hysteretic"})
        ),
        "angle error that the load brings out": Outside(
            _saturating,
            False,
            1e-5,
            {"saturation": (3.0, 6.0), "phase": PHASE},
            frozenset({TORQUE, ANGLE}),
            frozenset({"product"}),
        ),
        "hum": Outside(
            _hum, True, 3e-4, {"frequency": (0.7, 4.0), "phase": PHASE}, frozenset({"time"}), frozenset({"periodic"})
        ),
    }
)
"""By name. Whoever adds one decides here, before any campaign, which answers are right."""

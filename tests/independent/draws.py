"""Parameters of every effect drawn from a seed, where the effect is visible.

In the literature's working ranges, most in the upper half, none on a grid; where the range says nothing a comment does.
One effect is drawn larger, as it shows in no campaign otherwise: torque-sensor-nonlinearity.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from tests.independent.laws import Drive, flexspline_from_catalogue, wave_generator_from_tests
from tests.independent.terms import Arm, Effects, Line, Term, term

POLES, SLOTS = 14, 12
"""Motor of the generator: seven pole pairs on twelve slots; uneven parts also show the two numbers themselves."""

RATIO = 100.0
TORQUE_CONSTANT = 0.321
MOTOR_COUNTS = 16384.0
LINES = 2048.0
"""Line count of the output encoder."""
FULL_SCALE = 30.0
"""N*m, of the torque transducer."""
REFERENCE = 20.0
"""degC."""
STIFFNESS = 8336.0
"""N*m/rad, the drive's at rest; creep is stated relative to it."""
CONTACT = 1e-3
"""N*m at the motor that close a gap."""
RUNNING_FRICTION = 0.012
"""N*m at the motor."""


def draw(effect: str, rng: np.random.Generator) -> Effects:
    """Give one effect by id, with parameters drawn as said above; ValueError for an unknown id.

    Base terms but inertia belong to the drive: `draw_drive`.
    """
    phase = float(rng.uniform(-math.pi, math.pi))
    if effect == "kinematic-error":
        return Effects(kinematic_error=(Line(2.0, float(rng.uniform(5e-5, 2e-4)), phase),))
    if effect == "cogging":
        amplitude = float(rng.uniform(1e-3, 3e-3))
        lines = [Line(float(math.lcm(POLES, SLOTS)), amplitude, phase)]
        if rng.random() < 0.5:
            lines.append(Line(float(POLES), 0.5 * amplitude, float(rng.uniform(-math.pi, math.pi))))
        return Effects(cogging=tuple(lines))
    if effect == "gravity-load":
        return Effects(gravity_load=Arm(float(rng.uniform(0.2, 1.0)), phase))
    if effect not in DRAWN:
        raise ValueError(f"no second formula for effect {effect!r}")
    return Effects(others=(DRAWN[effect](_Dice(rng, phase)),))


def draw_drive(rng: np.random.Generator) -> Drive:
    """Give a drive with every base parameter within a fifth of the catalogue of the paper's drive."""
    K1, T1, loss, T_fs, T_fb, T_c, b = (
        value * float(rng.uniform(0.8, 1.2)) for value in (8.4e3, 3.9, 1.8e-4, 0.012, 2.0, 0.012, 1e-4)
    )
    K_F0, C_F = flexspline_from_catalogue(K1, K1 * float(rng.uniform(1.08, 1.2)), T1, 12.0)
    K_w0, C_w = wave_generator_from_tests(RATIO, loss, T_fs)
    return Drive(RATIO, K_F0, C_F, K_w0, C_w, T_fs, T_fb, T_c, b)


@dataclasses.dataclass(frozen=True, slots=True)
class _Dice:
    rng: np.random.Generator
    phase: float

    def between(self, low: float, high: float) -> float:
        return float(self.rng.uniform(low, high))

    def signed(self, low: float, high: float) -> float:
        return float(self.rng.choice([-1.0, 1.0])) * self.between(low, high)

    def whole(self, low: int, high: int) -> float:
        return float(self.rng.integers(low, high + 1))


DRAWN: Mapping[str, Callable[[_Dice], Term]] = MappingProxyType(
    {
        "inertia": lambda d: term("inertia", J=d.between(1e-4, 3e-4)),
        "soft-windup": lambda d: term("soft-windup", amplitude=d.between(3e-5, 5e-5), zone=d.between(0.8, 2.4)),
        "backlash": lambda d: term("backlash", amplitude=d.between(5e-3, 1e-2), contact=CONTACT, ratio=RATIO),
        # holds last 25 s: a longer memory is not seen to relax
        "creep": lambda d: term(
            "creep", amplitude=d.between(0.03, 0.05), time_constant=d.between(8.0, 25.0), stiffness=STIFFNESS
        ),
        "maxwell-slip": lambda d: term("maxwell-slip", amplitude=d.between(5e-6, 1e-5), radius=d.between(3.0, 5.0)),
        # no range is given for the lag: 4 N*m/s times it is comparable with the radius
        "rate-dependent-hysteresis": lambda d: term(
            "rate-dependent-hysteresis",
            amplitude=d.between(5e-6, 1e-5),
            radius=d.between(2.0, 4.0),
            time_constant=d.between(0.3, 1.0),
        ),
        # eight start angles split orders up to three
        "stiffness-modulation": lambda d: term(
            "stiffness-modulation", amplitude=d.between(5e-6, 1e-5), order=d.whole(1, 3), phase=d.phase
        ),
        "temperature-dependent-stiffness": lambda d: term(
            "temperature-dependent-stiffness", amplitude=d.between(2.5e-4, 5e-4), reference=REFERENCE
        ),
        # K_fix 2e4 to 5e4 N*m/rad
        "fixture-compliance": lambda d: term("fixture-compliance", amplitude=d.between(2e-5, 5e-5)),
        "thermal-expansion": lambda d: term(
            "thermal-expansion",
            amplitude=d.between(5e-6, 1e-5),
            time_constant=d.between(60.0, 200.0),
            reference=REFERENCE,
        ),
        # a reversal at 4 N*m/s rings by 8 N*m/s times the amplitude; below the Nyquist frequency of a 100 Hz log
        "structural-resonance": lambda d: term(
            "structural-resonance",
            amplitude=d.between(5e-6, 1.2e-5),
            frequency=d.between(8.0, 30.0),
            damping=d.between(0.02, 0.05),
        ),
        "stribeck-friction": lambda d: term(
            "stribeck-friction",
            amplitude=RUNNING_FRICTION * d.between(0.5, 1.0),
            velocity=d.between(5.0, 20.0),
            exponent=d.between(1.0, 2.0),
        ),
        "load-dependent-friction": lambda d: term(
            "load-dependent-friction", amplitude=d.between(0.16, 0.3), ratio=RATIO
        ),
        # below the running friction: the level never becomes negative
        "position-dependent-friction": lambda d: term(
            "position-dependent-friction", amplitude=d.between(5e-3, 1.1e-2), order=d.whole(1, 3), phase=d.phase
        ),
        "temperature-dependent-friction": lambda d: term(
            "temperature-dependent-friction", amplitude=d.between(0.03, 0.06), reference=REFERENCE
        ),
        "torque-ripple": lambda d: term(
            "torque-ripple", amplitude=d.between(0.025, 0.05), order=3.0 * POLES, phase=d.phase
        ),
        # 20 to 50 um on a disc of 25 mm radius
        "motor-encoder-eccentricity": lambda d: term(
            "motor-encoder-eccentricity", amplitude=d.between(8e-4, 2e-3), order=1.0, phase=d.phase
        ),
        "output-encoder-eccentricity": lambda d: term(
            "output-encoder-eccentricity", amplitude=d.between(2e-4, 4e-4), order=d.whole(1, 2), phase=d.phase
        ),
        "encoder-subdivision-error": lambda d: term(
            "encoder-subdivision-error", amplitude=d.between(5e-5, 1e-4), order=LINES, phase=d.phase
        ),
        "encoder-missed-counts": lambda d: term(
            "encoder-missed-counts",
            amplitude=d.whole(20, 100),
            rate=d.between(0.02, 0.06),
            seed=d.whole(1, 2**31 - 2),
            encoder_counts=MOTOR_COUNTS,
        ),
        "torque-sensor-offset": lambda d: term("torque-sensor-offset", amplitude=d.signed(0.25, 0.5)),
        # a cheap cell: ten to twenty times the good flange
        "torque-sensor-drift": lambda d: term(
            "torque-sensor-drift",
            per_kelvin=d.signed(0.015, 0.03),
            per_second=d.signed(5e-5, 1e-4),
            reference=REFERENCE,
        ),
        "torque-sensor-gain": lambda d: term("torque-sensor-gain", amplitude=d.signed(0.015, 0.03)),
        # 5 to 10 times the usual 0.1 % of full scale, which leaves 0.4 urad: a cheap cell again
        "torque-sensor-nonlinearity": lambda d: term(
            "torque-sensor-nonlinearity", even=d.signed(0.15, 0.3), odd=d.signed(0.15, 0.3), full_scale=FULL_SCALE
        ),
        "torque-sensor-lag": lambda d: term("torque-sensor-lag", time_constant=d.between(0.015, 0.03)),
        # 1 to 2 % of the motor's rated 0.59 A
        "current-sensor-offset": lambda d: term(
            "current-sensor-offset", amplitude=d.signed(6e-3, 1.2e-2), torque_constant=TORQUE_CONSTANT
        ),
        "torque-constant-error": lambda d: term("torque-constant-error", amplitude=d.signed(0.05, 0.1)),
        # saturation at 2 to 4 times the rated current
        "torque-constant-saturation": lambda d: term(
            "torque-constant-saturation", amplitude=d.between(1.2, 2.4) ** -2, torque_constant=TORQUE_CONSTANT
        ),
        "channel-delay": lambda d: term("channel-delay", delay=d.between(0.025, 0.05)),
    }
)
"""By catalogue id: how the effect's parameters are drawn."""

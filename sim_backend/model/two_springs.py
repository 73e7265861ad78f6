"""The two-spring analogue of a harmonic drive: two springs in series, between them a mass with dry friction.

    force F -> spring a (K_a) -> mass m, dry friction F_fr -> spring b (K_b) -> ground

    F_a = F,  F_b = K_b x,  m x'' + c x' + F_b = F - friction,  Delta X = F_a/K_a + F_b/K_b

As long as |F - F_b| < F_fr the mass sticks and only spring a deforms. In the slow limit F_b = play(F; F_fr), the
closed form with which the movement of the mass is compared. Its picture of the drive: F is N times the motor's torque,
K_a = N^2 K_w0, F_b the output torque, K_b = K_F0, F_fr = N T_fs, m = N^2 times the inertia at the motor.
Source: Zhang, Ahmad & Liu 2014, figures 4 to 6.
"""

import math
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from sim_backend.model.checks import require, require_all
from sim_backend.model.friction import play
from sim_backend.model.parameters import HarmonicDrive

Floats = NDArray[np.float64]

_MASS = "m x'' + c x' + K_b x = F - friction, Delta X = F/K_a + F_b/K_b,"
_UNITS = {
    "K_a": "N/m or N*m/rad",
    "K_b": "N/m or N*m/rad",
    "friction": "N or N*m",
    "mass": "kg or kg*m^2",
    "damping": "N*s/m or N*m*s/rad",
}


@dataclass(frozen=True, slots=True)
class TwoSprings:
    """Springs, friction and mass, in any coherent units: N/m, N and kg, or N*m/rad, N*m and kg*m^2."""

    K_a: float
    K_b: float
    friction: float
    mass: float
    damping: float = 0.0

    def __post_init__(self) -> None:
        for item in fields(self):
            lowest = {"low": 0.0} if item.name in ("friction", "damping") else {"above": 0.0}
            require(item.name, getattr(self, item.name), _UNITS[item.name], _MASS, **lowest)


@dataclass(frozen=True, slots=True)
class Path:
    """What the springs carry and by how much they shorten together; arrays (n,)."""

    F_a: Floats
    F_b: Floats
    displacement: Floats


def analogue_of(drive: HarmonicDrive, motor_inertia: float) -> TwoSprings:
    """Give the analogue of a drive at small torque: angles for displacements, all at the output.

    motor_inertia: rotor and wave generator, kg*m^2 at the motor. The mass is damped so that it does not ring on spring
    b: friction and stiffness, which are the picture's point, are all that shows.
    """
    mass = drive.ratio**2 * motor_inertia
    return TwoSprings(
        K_a=drive.ratio**2 * drive.K_w0,
        K_b=drive.K_F0,
        friction=drive.friction_torque,
        mass=mass,
        damping=2.0 * math.sqrt(drive.K_F0 * mass),
    )


def quasi_static(force: Floats, springs: TwoSprings) -> Path:
    """Give the path under a force (n,) that changes slowly, from rest without force: F_b = play(F; F_fr)."""
    require_all("force", force, "N or N*m", _MASS)
    return _path(force, play(force, springs.friction), springs)


def moving(force: Floats, step: float, springs: TwoSprings) -> Path:
    """Give the path under a force (n,) sampled every `step` (s), from rest without force, with the mass moving.

    The implicit Euler step solves for the speed with friction as its return mapping: the mass stops where friction
    can take up what is left of its momentum. Of first order in the step. Raises ModelError if `step` is not positive
    or a force not finite.
    """
    require("step", step, "s", "the implicit Euler step", above=0.0)
    require_all("force", force, "N or N*m", _MASS)
    s = springs
    carried = s.mass + step * s.damping + step**2 * s.K_b
    most = step * s.friction
    position = speed = 0.0
    F_b = []
    for pushed in np.asarray(force, dtype=np.float64).tolist():
        momentum = s.mass * speed + step * (pushed - s.K_b * position)
        speed = math.copysign(max(abs(momentum) - most, 0.0), momentum) / carried
        position += step * speed
        F_b.append(s.K_b * position)
    return _path(force, np.array(F_b), springs)


def _path(force: Floats, F_b: Floats, springs: TwoSprings) -> Path:
    F_a = np.asarray(force, dtype=np.float64)
    return Path(F_a, F_b, F_a / springs.K_a + F_b / springs.K_b)

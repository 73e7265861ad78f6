"""The two-spring analogue of a harmonic drive: two springs in series, between them a mass with dry friction.

    force F -> spring a (K_a) -> mass m, dry friction F_fr -> spring b (K_b) -> ground

    F_a = F,  F_b = K_b x,  m x'' + c x' + F_b = F - friction,  Delta X = F_a/K_a + F_b/K_b

As long as |F - F_b| < F_fr the mass sticks and only spring a deforms. In the slow limit F_b = play(F; F_fr), the
closed form with which the movement of the mass is compared. Its picture of the drive: F is N times the motor's torque,
K_a = N^2 K_w0, F_b the output torque, K_b = K_F0, F_fr = N T_fs, m = N^2 times the inertia at the motor.
Source: Zhang, Ahmad & Liu 2014, figures 4 to 6.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from sim_backend.errors import ModelError, shown
from sim_backend.model.checks import require_all
from sim_backend.model.friction import play
from sim_backend.model.limits import BENCH, Limit, require_limit, require_within
from sim_backend.model.parameters import HarmonicDrive

Floats = NDArray[np.float64]

_MASS = "m x'' + c x' + K_b x = F - friction, Delta X = F/K_a + F_b/K_b,"

LIMITS: Mapping[str, Limit] = {
    "K_a": Limit("N/m or N*m/rad", 1e-9, 1e24, _MASS),
    "K_b": Limit("N/m or N*m/rad", 1e-9, 1e24, _MASS),
    "friction": Limit("N or N*m", 0.0, 1e24, _MASS),
    "mass": Limit("kg or kg*m^2", 1e-24, 1e24, _MASS),
    "damping": Limit("N*s/m or N*m*s/rad", 0.0, 1e24, _MASS),
}
"""Springs, friction and mass: wide enough for the analogue of every drive within `limits`."""

INERTIA = Limit("kg*m^2", BENCH["rotor_inertia"].low, 2.0 * BENCH["rotor_inertia"].high, "m = N^2 (J_m + J_wg)")
STEP = Limit("s", 1e-12, 1e6, "the implicit Euler step")

LARGEST_FORCE = 1e24
"""N or N*m."""


@dataclass(frozen=True, slots=True)
class TwoSprings:
    """Springs, friction and mass, in any coherent units: N/m, N and kg, or N*m/rad, N*m and kg*m^2."""

    K_a: float
    K_b: float
    friction: float
    mass: float
    damping: float = 0.0

    def __post_init__(self) -> None:
        require_within(LIMITS, {item.name: getattr(self, item.name) for item in fields(self)})


@dataclass(frozen=True, slots=True)
class Path:
    """What the springs carry and by how much they shorten together; arrays (n,)."""

    F_a: Floats
    F_b: Floats
    displacement: Floats


def analogue_of(drive: HarmonicDrive, motor_inertia: float) -> TwoSprings:
    """Give the analogue of a drive at small torque: angles for displacements, all at the output.

    motor_inertia: rotor and wave generator, kg*m^2 at the motor. The mass is damped so that it does not ring on spring
    b: friction and stiffness, which are the picture's point, are all that shows. Raises ModelError if `drive` is none
    or the inertia outside `INERTIA`.
    """
    if not isinstance(drive, HarmonicDrive):
        raise ModelError(f"drive = {shown(drive)} is not possible: it must be a HarmonicDrive; {_MASS} needs it.")
    require_limit("motor_inertia", motor_inertia, INERTIA)
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
    _require_force(force)
    return _path(force, play(force, springs.friction), springs)


def moving(force: Floats, step: float, springs: TwoSprings) -> Path:
    """Give the path under a force (n,) sampled every `step` (s), from rest without force, with the mass moving.

    The implicit Euler step solves for the speed with friction as its return mapping: the mass stops where friction
    can take up what is left of its momentum. Of first order in the step. Raises ModelError if `step` is outside `STEP`
    or a force beyond +-`LARGEST_FORCE`.
    """
    require_limit("step", step, STEP)
    _require_force(force)
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


def _require_force(force: Floats) -> None:
    """Raise ModelError unless this is one series of possible forces."""
    require_all("force", force, "N or N*m", _MASS, low=-LARGEST_FORCE, high=LARGEST_FORCE)
    if np.ndim(force) != 1:
        raise ModelError(f"force has {np.ndim(force)} dimensions; it must be one series (N or N*m); {_MASS} needs it.")


def _path(force: Floats, F_b: Floats, springs: TwoSprings) -> Path:
    F_a = np.asarray(force, dtype=np.float64)
    return Path(F_a, F_b, F_a / springs.K_a + F_b / springs.K_b)

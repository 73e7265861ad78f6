"""A rotor on a wave-generator spring and a sliding mesh, integrated step by step: the breakaway is known exactly.

The spring law is equation (27) inverted by hand, the mesh slides at a constant torque; nothing of the simulated
plant is used.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SPRING_END = 9.0e-3
"""Largest torsion of the wave generator at the motor, rad: 1 / (C_w K_w0)."""

C_W = 83.33


@dataclass(frozen=True, slots=True)
class Rotor:
    """Breakaway and sliding torque N*m, inertia kg*m^2, viscous N*m*s; torque command in steps of `step` N*m."""

    breakaway: float = 0.012
    sliding: float | None = None
    inertia: float = 2.2e-5
    viscous: float = 1e-4
    step: float = 0.0
    noise: float = 1e-4


def ramp(
    rotor: Rotor, counts: int, *, start: float = 0.3, rate: float = 0.002, motion: float = 0.1, seed: int = 0
) -> tuple[Floats, Floats, Floats, Floats]:
    """Ramp the torque from rest until the reading has moved by `motion` rad.

    `start` is the true angle at rest in counts. Gives time s, measured torque N*m, read position rad, all (n,), and
    the 200 positions read at rest before.
    """
    random = np.random.default_rng(seed)
    resolution = 2.0 * math.pi / counts
    sliding = rotor.breakaway if rotor.sliding is None else rotor.sliding
    most, kept = _torsion(rotor.breakaway), _torsion(sliding)
    angle = mesh = start * resolution
    speed, slides = 0.0, False
    rest = math.floor(angle / resolution) * resolution
    rows = []
    for cycle in range(10**6):
        torque = rate * cycle * 1e-3
        if rotor.step:
            torque = round(torque / rotor.step) * rotor.step
        for _ in range(10):
            torsion = angle - mesh
            if abs(torsion) > (kept if slides else most):
                slides = True
                mesh = angle - math.copysign(kept, torsion)
                torsion = angle - mesh
            spring = -math.log(1.0 - abs(torsion) / SPRING_END) / C_W
            speed += 1e-4 * (torque - math.copysign(spring, torsion) - rotor.viscous * speed) / rotor.inertia
            angle += 1e-4 * speed
        read = math.floor(angle / resolution) * resolution
        measured = torque + rotor.noise * random.standard_normal()
        if rotor.step:
            measured = round(measured / rotor.step) * rotor.step
        rows.append((cycle * 1e-3, measured, read))
        if abs(read - rest) >= motion:
            break
    time, torque_read, position = np.array(rows).T
    return time, torque_read, position, np.full(200, rest)


def _torsion(torque: float) -> float:
    return SPRING_END * (1.0 - math.exp(-C_W * torque))

"""Quasi-static elastic laws of the harmonic drive.

    torsion = f(T_F) - g(T_w)/N                                            (28)
    f(T) = arctan(C_F T) / (C_F K_F0)                                      (24)
    g(T) = sgn(T) (1 - exp(-C_w |T|)) / (C_w K_w0), motor-side rad         (27)

and two older forms of the flexspline's law f, each selectable in its place (`LAWS`):

    T = a1 f + a3 f^3                                                      (10), cubic
    f = T/K1, beyond T1 with slope 1/K2, beyond T2 with slope 1/K3         (11), piecewise linear

(11) is printed for T >= 0 only; here it is odd, as the other laws are.
T_F acts on the flexspline output from outside, T_w is what the wave generator exerts back on the motor shaft, so
that T_w = -motor_torque at rest and torsion = f(output_torque) + g(motor_torque)/N in logged signals.

For scalars and arrays alike; the laws (24) and (27) are those of the catalogue's base terms. Parameters that no spring
can have, those outside `limits`, raise ModelError.
Source: Zhang, Ahmad & Liu, "Modeling of Torsional Compliance and Hysteresis Behaviors in Harmonic Drives".
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from sim_backend.errors import ModelError
from sim_backend.model import limits
from sim_backend.model.effects.flexspline_compliance import flexspline_compliance
from sim_backend.model.effects.wave_generator_compliance import wave_generator_compliance
from sim_backend.model.estimation import check_torques
from sim_backend.model.limits import require_limit, require_within

Floats = NDArray[np.float64]


class Compliance(StrEnum):
    """Laws of the flexspline's torsion."""

    ARCTAN = "arctan"
    CUBIC = "cubic"
    PIECEWISE = "piecewise"


def check_flexspline(K_F0: float, C_F: float) -> None:
    """Raise ModelError for parameters that the law (24) cannot have: outside `limits.DRIVE`."""
    require_within(limits.DRIVE, {"K_F0": K_F0, "C_F": C_F})


def check_wave_generator(K_w0: float, C_w: float) -> None:
    """Raise ModelError for parameters that the law (27) cannot have: outside `limits.DRIVE`."""
    require_within(limits.DRIVE, {"K_w0": K_w0, "C_w": C_w})


def check_cubic(a1: float, a3: float) -> None:
    """Raise ModelError for parameters that the law (10) cannot have: outside `limits.CUBIC`."""
    require_within(limits.CUBIC, {"a1": a1, "a3": a3})


def check_piecewise(K1: float, K2: float, K3: float, T1: float, T2: float) -> None:
    """Raise ModelError for parameters that the law (11) cannot have: outside `limits.PIECEWISE`, or T1 >= T2."""
    require_within(limits.PIECEWISE, {"K1": K1, "K2": K2, "K3": K3, "T1": T1, "T2": T2})
    check_torques(T1, T2)


def flexspline_torsion(torque: Floats, K_F0: float, C_F: float) -> Floats:
    """Torsion of the flexspline, rad at the output, for an output torque in N*m. Equation (24).

    K_F0: stiffness at zero torque, N*m/rad. C_F: 1/(N*m); positive.
    """
    check_flexspline(K_F0, C_F)
    return flexspline_compliance(torque, K_F0, C_F)


def flexspline_stiffness(torque: Floats, K_F0: float, C_F: float) -> Floats:
    """Local stiffness of the flexspline, N*m/rad, at an output torque in N*m. Equation (22)."""
    check_flexspline(K_F0, C_F)
    return K_F0 * (1.0 + (C_F * torque) ** 2)


def flexspline_torque(torsion: Floats, K_F0: float, C_F: float) -> Floats:
    """Output torque, N*m, at a torsion of the flexspline in rad: the inverse of (24).

    Raises ModelError at or beyond pi/(2 C_F K_F0), the torsion that (24) reaches under no torque.
    """
    check_flexspline(K_F0, C_F)
    most = np.pi / (2.0 * C_F * K_F0)
    largest = float(np.max(np.abs(torsion), initial=0.0))
    if not largest < most:
        raise ModelError(f"torsion = {largest!r} rad must be below {most:.6g} rad, where the law (24) ends.")
    return np.tan(C_F * K_F0 * torsion) / C_F


def cubic_torque(torsion: Floats, a1: float, a3: float) -> Floats:
    """Output torque, N*m, at a torsion in rad. Equation (10). a1: N*m/rad, positive. a3: N*m/rad^3, not negative."""
    check_cubic(a1, a3)
    return torsion * (a1 + a3 * np.square(torsion))


def cubic_torsion(torque: Floats, a1: float, a3: float) -> Floats:
    """Torsion, rad, for an output torque in N*m: the real root of (10), in closed form."""
    check_cubic(a1, a3)
    if a3 == 0.0:
        return torque / a1
    size = math.sqrt(a1) / math.sqrt(3.0 * a3)  # a1/(3 a3) itself overflows for the smallest a3
    return 2.0 * size * np.sinh(np.arcsinh(1.5 * torque / (a1 * size)) / 3.0)


def cubic_stiffness(torque: Floats, a1: float, a3: float) -> Floats:
    """Local stiffness, N*m/rad, at an output torque in N*m: the slope of (10)."""
    torsion = cubic_torsion(torque, a1, a3)
    return a1 + 3.0 * a3 * np.square(torsion)


def piecewise_torsion(torque: Floats, K1: float, K2: float, K3: float, T1: float, T2: float) -> Floats:
    """Torsion, rad, for an output torque in N*m. Equation (11), odd. K1, K2, K3: N*m/rad. T1 < T2: N*m."""
    check_piecewise(K1, K2, K3, T1, T2)
    size = np.abs(torque)
    first, second = np.minimum(size, T1), np.clip(size - T1, 0.0, T2 - T1)
    return np.sign(torque) * (first / K1 + second / K2 + np.maximum(size - T2, 0.0) / K3)


def piecewise_torque(torsion: Floats, K1: float, K2: float, K3: float, T1: float, T2: float) -> Floats:
    """Output torque, N*m, at a torsion in rad: the inverse of (11)."""
    check_piecewise(K1, K2, K3, T1, T2)
    size = np.abs(torsion)
    end1, width2 = T1 / K1, (T2 - T1) / K2
    first, second = np.minimum(size, end1), np.clip(size - end1, 0.0, width2)
    return np.sign(torsion) * (K1 * first + K2 * second + K3 * np.maximum(size - end1 - width2, 0.0))


def piecewise_stiffness(torque: Floats, K1: float, K2: float, K3: float, T1: float, T2: float) -> Floats:
    """Local stiffness, N*m/rad, at an output torque in N*m: the slope of (11); at T1 and T2 as printed there."""
    check_piecewise(K1, K2, K3, T1, T2)
    size = np.abs(torque)
    return np.where(size <= T1, K1, np.where(size < T2, K2, K3))


def wave_generator_torsion(torque: Floats, K_w0: float, C_w: float) -> Floats:
    """Torsion of the wave generator, rad at the motor, for a motor-side torque in N*m. Equation (27).

    K_w0: stiffness at zero torque, N*m/rad at the motor. C_w: 1/(N*m); positive.
    """
    check_wave_generator(K_w0, C_w)
    return wave_generator_compliance(torque, K_w0, C_w, 1.0)


def wave_generator_stiffness(torque: Floats, K_w0: float, C_w: float) -> Floats:
    """Local stiffness of the wave generator, N*m/rad at the motor. Equation (25)."""
    check_wave_generator(K_w0, C_w)
    with np.errstate(over="ignore"):  # a torque beyond any device meets a rigid wave generator
        return K_w0 * np.exp(C_w * np.abs(torque))


def wave_generator_torque(torsion: Floats, K_w0: float, C_w: float) -> Floats:
    """Motor-side torque, N*m, at a torsion of the wave generator in rad at the motor: the inverse of (27).

    Raises ModelError at or beyond 1/(C_w K_w0), the torsion that (27) reaches under no torque.
    """
    check_wave_generator(K_w0, C_w)
    most = 1.0 / (C_w * K_w0)
    largest = float(np.max(np.abs(torsion), initial=0.0))
    if not largest < most:
        raise ModelError(f"torsion = {largest!r} rad must be below {most:.6g} rad, where the law (27) ends.")
    return -np.sign(torsion) * np.log1p(-np.abs(torsion) / most) / C_w


@dataclass(frozen=True, slots=True)
class FlexsplineLaw:
    """One law of the flexspline. Each function takes an array and then `parameters` in order; `units` of these."""

    parameters: tuple[str, ...]
    units: tuple[str, ...]
    torsion: Callable[..., Floats]
    torque: Callable[..., Floats]
    stiffness: Callable[..., Floats]


LAWS: Mapping[Compliance, FlexsplineLaw] = MappingProxyType(
    {
        Compliance.ARCTAN: FlexsplineLaw(
            ("K_F0", "C_F"), ("N*m/rad", "1/(N*m)"), flexspline_torsion, flexspline_torque, flexspline_stiffness
        ),
        Compliance.CUBIC: FlexsplineLaw(
            ("a1", "a3"), ("N*m/rad", "N*m/rad^3"), cubic_torsion, cubic_torque, cubic_stiffness
        ),
        Compliance.PIECEWISE: FlexsplineLaw(
            ("K1", "K2", "K3", "T1", "T2"),
            ("N*m/rad", "N*m/rad", "N*m/rad", "N*m", "N*m"),
            piecewise_torsion,
            piecewise_torque,
            piecewise_stiffness,
        ),
    }
)
"""The laws by name: torsion over torque, its inverse, local stiffness over torque."""


def total_torsion(flexspline: Floats, wave_generator_torque: Floats, ratio: float, K_w0: float, C_w: float) -> Floats:
    """Torsion of the whole drive, rad at the output. Equation (28).

    flexspline: its torsion, rad, after any of the laws. wave_generator_torque: T_w, N*m, as it acts back on the motor.
    """
    require_limit("ratio", ratio, limits.RATIO._replace(equation="torsion = f(T_F) - g(T_w)/N, Zhang (28),"))
    return flexspline - wave_generator_torsion(wave_generator_torque, K_w0, C_w) / ratio

"""Base parameters: start values and priors scaled from the device under test, and which are estimated on a log scale.

Catalogue figures are priors and starting values, never limits. Source of the estimates: Zhang, Ahmad & Liu 2014,
(31)-(35) with the errata of (32) corrected.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from drivers.errors import ConfigError
from rig.config.catalogue import beyond_limits
from rig.config.dut import Dut, Gear
from sim_backend.errors import ModelError
from sim_backend.model.compliance import LAWS, Compliance
from sim_backend.model.estimation import cubic_from_catalogue
from sim_backend.model.limits import CUBIC, DRIVE, PIECEWISE, Limit

Floats = NDArray[np.float64]

LAW_LIMITS: Mapping[str, Limit] = MappingProxyType(
    {**{name: DRIVE[name] for name in ("K_F0", "C_F", "K_w0", "C_w")}, **CUBIC, **PIECEWISE}
)
"""What the parameters of the compliance laws, flexspline and wave generator, can be; SI."""


@dataclass(frozen=True, slots=True)
class BaseParameter:
    """One base parameter: unit, centre and standard deviation (relative if `logarithmic`) of its prior.

    `start`: where the fit starts, None at the centre of the prior.
    """

    name: str
    unit: str
    centre: float
    spread: float
    logarithmic: bool
    start: float | None = None


@dataclass(frozen=True, slots=True)
class ParameterTable:
    """All base parameters, in the order of the vectors that hold them.

    `law`: the flexspline's; its parameters come first, the very first is its stiffness without torque. `names`: of the
    entries.
    """

    entries: tuple[BaseParameter, ...]
    law: Compliance = Compliance.ARCTAN
    names: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "names", tuple(entry.name for entry in self.entries))

    def start(self) -> Floats:
        """Start values, SI, shape (p,); those of the compliance laws within what the laws can have."""
        return np.array([_possible(e.name, e.centre if e.start is None else e.start) for e in self.entries])

    def centre(self) -> Floats:
        """Centres of the priors, SI, shape (p,)."""
        return np.array([entry.centre for entry in self.entries])

    def logarithmic(self) -> NDArray[np.bool_]:
        """Which are positive and estimated as logarithms, shape (p,)."""
        return np.array([entry.logarithmic for entry in self.entries])

    def prior_weight(self) -> Floats:
        """1/variance of the prior in the scale of the fit, shape (p,)."""
        return np.array([1.0 / entry.spread**2 for entry in self.entries])

    def with_centre(self, values: Mapping[str, float]) -> "ParameterTable":
        """Give the same table with other priors where `values` has them."""
        return replace(self, entries=tuple(replace(e, centre=values.get(e.name, e.centre)) for e in self.entries))

    def with_start(self, values: Mapping[str, float]) -> "ParameterTable":
        """Give the same table with other start values where `values` has them."""
        return replace(self, entries=tuple(replace(e, start=values.get(e.name, e.start)) for e in self.entries))


def _possible(name: str, value: float) -> float:
    """Give the value nearest to this one that the laws can have: rough values of odd data lie anywhere."""
    limit = LAW_LIMITS.get(name)
    return value if limit is None else min(max(value, limit.low), limit.high)


TYPICAL_RATIO = 100.0
TYPICAL_STIFFNESS_TORQUES = (8.4e3, 9.4e3, 3.9, 12.0)
"""K1, K2 (N*m/rad), T1, T2 (N*m) of a size-17 drive: starting values where the dut file has none."""
TYPICAL_RATED_TORQUE = 16.0
TYPICAL_LAST_RISE = 1.2 / 0.94
"""Rated torque (N*m) of that drive, and its K3 over its K2."""

KNOWN, UNKNOWN = 0.3, 1.5
"""Relative standard deviations of a stiffness with and without the catalogue."""

KNOWN_KNEE, UNKNOWN_KNEE = 0.1, 0.3
"""The same of T1 and T2, where the catalogue's three lines meet. The data may move them, but not far: held 5 % beside
the true ones they shift K2 by 1 % and K3 by 3 %, and a sweep that does not reach them tells nothing of them."""

SLIGHT_STIFFENING = 0.01
"""Relative rise of the stiffness up to T2 at least, from which a fit starts."""


def parameter_table(dut: Dut, ratio: float | None, law: Compliance = Compliance.ARCTAN) -> ParameterTable:
    """Give start values and priors for this device. `ratio`: given or estimated; None: a typical one scales starts.

    Raises ConfigError if the device has catalogue values that no drive has.
    """
    mistakes = list(beyond_limits(dut))
    if mistakes:
        raise ConfigError(f"dut '{dut.name}'", mistakes)
    N = ratio or TYPICAL_RATIO
    gear = dut.gear
    rated = gear.rated_torque or TYPICAL_RATED_TORQUE
    T_fs = gear.starting_torque or 1e-3 * rated * 0.75
    loss = gear.hysteresis_loss or 1.8e-4
    return ParameterTable(
        (
            *flexspline_entries(gear, law),
            BaseParameter("K_w0", "N*m/rad", 2.0 * T_fs / (N * loss), 1.0, True),
            BaseParameter("C_w", "1/(N*m)", 1.0 / T_fs, 1.0, True),
            BaseParameter("T_fs", "N*m", T_fs, 1.5, True),
            BaseParameter("T_fb", "N*m", gear.backdriving_torque or 1.5 * N * T_fs, 1.5, True),
            BaseParameter("T_cr", "N*m", 0.0, 0.5 * T_fs, False),
            BaseParameter("b_r", "N*m*s", 0.0, 1e-2 * T_fs, False),
            BaseParameter("T_c", "N*m", T_fs, 1e3 * T_fs, False),
            BaseParameter("b", "N*m*s", 0.0, 1e3 * T_fs, False),
            BaseParameter("M_0", "N*m", 0.0, 1e3 * T_fs, False),
            BaseParameter("J_l", "kg*m^2", dut.output.inertia or 0.0, 1e-2, False),
            BaseParameter("windup", "rad", 0.0, 1e-2, False),
            BaseParameter("J_r", "kg*m^2", dut.motor.inertia or 0.0, 0.5 * (dut.motor.inertia or 1e-3), False),
            BaseParameter("K_r", "N*m/rad", 0.0, 2.0 * T_fs / (N * loss) * math.e, False),
            BaseParameter("i_c", "A", 0.0, 1e3, False),
            BaseParameter("i_v", "A*s", 0.0, 1e3, False),
            BaseParameter("i_0", "A", 0.0, 1e3, False),
            BaseParameter("T_co", "N*m", 0.0, 1e3 * rated, False),
            BaseParameter("b_o", "N*m*s", 0.0, 1e3 * rated, False),
            BaseParameter("J_o", "kg*m^2", 0.0, 1e3 * rated, False),
            BaseParameter("T_0", "N*m", 0.0, 1e3 * rated, False),
        ),
        law,
    )


def flexspline_entries(gear: Gear, law: Compliance) -> tuple[BaseParameter, ...]:
    """Give start values and priors of the parameters of the flexspline's law, in its order."""
    K1, K2, T1, T2 = _catalogue(gear)
    known = KNOWN if gear.K1 is not None and gear.K2 is not None else UNKNOWN
    centres: tuple[float, ...]
    spreads: tuple[float, ...]
    match law:
        case Compliance.ARCTAN:
            centres, spreads = flexspline_from_catalogue(K1, K2, T1, T2), (known, 2.0 * known)
        case Compliance.CUBIC:
            # the stiffness rises with a3 as with the square of C_F
            centres, spreads = _cubic(K1, K2, T1, T2), (known, 4.0 * known)
        case Compliance.PIECEWISE:
            centres = (K1, K2, gear.K3 or K2 * TYPICAL_LAST_RISE, T1, T2)
            knee = KNOWN_KNEE if gear.T1 is not None and gear.T2 is not None else UNKNOWN_KNEE
            spreads = (known, known, UNKNOWN if gear.K3 is None else known, knee, knee)
    rows = zip(LAWS[law].parameters, LAWS[law].units, centres, spreads, strict=True)
    return tuple(BaseParameter(*row, logarithmic=True) for row in rows)


def _catalogue(gear: Gear) -> tuple[float, float, float, float]:
    """Give K1, K2 (N*m/rad), T1, T2 (N*m), scaled from a typical drive where the device file lacks them."""
    rated = gear.rated_torque or TYPICAL_RATED_TORQUE
    typical_K1, typical_K2, typical_T1, typical_T2 = TYPICAL_STIFFNESS_TORQUES
    K1 = gear.K1 or typical_K1
    K2 = gear.K2 or K1 * typical_K2 / typical_K1
    T1 = gear.T1 or typical_T1 * rated / TYPICAL_RATED_TORQUE
    T2 = gear.T2 or typical_T2 * rated / TYPICAL_RATED_TORQUE
    if T1 >= T2:  # one of them is given, far from a typical drive's
        T1, T2 = (T1, T1 * typical_T2 / typical_T1) if gear.T2 is None else (T2 * typical_T1 / typical_T2, T2)
    return K1, K2, T1, T2


def _cubic(K1: float, K2: float, T1: float, T2: float) -> tuple[float, float]:
    """Give a1 and a3; a drive that no cubic has, for example one that softens, starts nearly linear."""
    try:
        a1, a3 = cubic_from_catalogue(K1, K2, T1, T2)
    except ModelError:
        a1, a3 = K1, 0.0
    return a1, max(a3, SLIGHT_STIFFENING * a1**3 / (3.0 * T2**2))


def flexspline_from_catalogue(K1: float, K2: float, T1: float, T2: float) -> tuple[float, float]:
    """Give K_F0 (31) and C_F (32) for stiffnesses N*m/rad at torques N*m; a softening drive starts nearly linear."""
    K_F0 = K1 + (K1 - K2) * T1**2 / ((T1 + T2) ** 2 - T1**2)
    if K2 <= K1 or K_F0 <= 0:
        return K1, 0.1 / T2
    return K_F0, 2.0 * math.sqrt((K2 - K1) / (K1 * (T1 + T2) ** 2 - K2 * T1**2))

"""Parameters of the compliance laws from catalogue values and two tests; Zhang, Ahmad & Liu 2014, (29)-(35).

The catalogue gives two slopes: K1 below T1, K2 between T1 and T2. They are taken as local stiffnesses in the middle of
their ranges, K1 at T1/2 and K2 at (T1+T2)/2, for the arctan law as the paper does in (29), (30) and for the cubic one,
whose constants a1 and a3 the paper leaves "to be determined", alike.
"""

import math

from sim_backend.model import limits
from sim_backend.model.checks import require
from sim_backend.model.limits import require_within

_STIFFENING = "C_F = 2 sqrt((K2 - K1)/(K1 (T1+T2)^2 - K2 T1^2)), Zhang (32),"
LOSS = "K_w0 = 2 T_fs/(N Psi), Zhang (33),"
PIECEWISE_EQUATION = "f = T1/K1 + (T - T1)/K2 from T1 to T2, Zhang (11),"
"""What needs the catalogue's torques and stiffnesses, whatever law is fitted."""

_CUBIC = "T = a1 f + a3 f^3, Zhang (10),"


def flexspline_from_catalogue(K1: float, K2: float, T1: float, T2: float) -> tuple[float, float]:
    """Give K_F0 (N*m/rad) and C_F (1/(N*m)) of the arctan law; (31), (32), the solution of (29) and (30).

    K1, K2: N*m/rad; T1, T2: N*m. The paper prints C_F = 0.089 for its drive: (32) with its leading 2 applied twice.
    Raises ModelError unless K1, T1 and T2 are within `limits.CATALOGUE`, T1 < T2 and K1 < K2 < K1 ((T1+T2)/T1)^2.
    """
    _demand_catalogue(K1, T1, T2, _STIFFENING)
    outer = (T1 + T2) ** 2
    require("K2", K2, "N*m/rad", _STIFFENING, above=K1, below=K1 * outer / T1**2)
    K_F0 = K1 + (K1 - K2) * T1**2 / (outer - T1**2)
    return K_F0, 2.0 * math.sqrt((K2 - K1) / (K1 * outer - K2 * T1**2))


def wave_generator_from_tests(ratio: float, hysteresis_loss: float, starting_torque: float) -> tuple[float, float]:
    """Give K_w0 (N*m/rad at the motor) and C_w (1/(N*m)) of the wave generator; (33), (35).

    hysteresis_loss: rad at the output; starting_torque: N*m at the motor. (33) put into (35) gives
    C_w = 1/starting_torque, whatever the loss. Raises ModelError if a value is not within `limits.CATALOGUE`.
    """
    values = {"ratio": ratio, "hysteresis_loss": hysteresis_loss, "starting_torque": starting_torque}
    require_within(limits.CATALOGUE, values)
    return 2.0 * starting_torque / (ratio * hysteresis_loss), 1.0 / starting_torque


def cubic_from_catalogue(K1: float, K2: float, T1: float, T2: float) -> tuple[float, float]:
    """Give a1 (N*m/rad) and a3 (N*m/rad^3) of the cubic law (10).

    The paper does not say how it found them. Here the local stiffness dT/dtorsion is K1 at T1/2 and K2 at (T1+T2)/2,
    as (29) and (30) demand of the arctan law, so that both laws know the same of the drive.
    Raises ModelError unless K1, T1 and T2 are within `limits.CATALOGUE`, T1 < T2 and K1 < K2 < K1 ((T1+T2)/T1)^(2/3):
    a cubic without a linear part stiffens by as much.
    """
    _demand_catalogue(K1, T1, T2, _CUBIC)
    low, high = 0.5 * T1, 0.5 * (T1 + T2)
    require("K2", K2, "N*m/rad", _CUBIC, above=K1, below=K1 * (high / low) ** (2.0 / 3.0))

    def constants(torsion: float) -> tuple[float, float]:
        """Give a1 and a3 of the cubic that has torque `low` and stiffness K1 at this torsion."""
        return 1.5 * low / torsion - 0.5 * K1, 0.5 * (K1 - low / torsion) / torsion**2

    # between a straight line (a3 = 0) and a cubic without a linear part (a1 = 0)
    softer, stiffer = low / K1, 3.0 * low / K1
    for _ in range(_HALVINGS):
        torsion = 0.5 * (softer + stiffer)
        a1, a3 = constants(torsion)
        if _cubic_stiffness(high, a1, a3) < K2:
            softer = torsion
        else:
            stiffer = torsion
    return constants(0.5 * (softer + stiffer))


_HALVINGS = 60
"""Of an interval as long as its middle: to the last bit of a float."""


def _cubic_stiffness(torque: float, a1: float, a3: float) -> float:
    if a3 <= 0.0:
        return a1
    size = math.sqrt(a1 / (3.0 * a3))
    return a1 * (1.0 + 4.0 * math.sinh(math.asinh(1.5 * torque / (a1 * size)) / 3.0) ** 2)


def check_torques(T1: float, T2: float, equation: str = PIECEWISE_EQUATION) -> None:
    """Raise ParameterError unless the torques at which the catalogue's stiffness changes (N*m) are in order."""
    require("T1", T1, "N*m", equation, above=0.0)
    require("T2", T2, "N*m", equation, above=T1)


def _demand_catalogue(K1: float, T1: float, T2: float, equation: str) -> None:
    """Raise ModelError unless these are within `limits.CATALOGUE` and in order; what K2 may be follows from them."""
    require_within(limits.CATALOGUE, {"K1": K1, "T1": T1, "T2": T2})
    check_torques(T1, T2, equation)

"""The paper's drive, SHD-17-100, with the values that section V prints, and the laws that are compared on it.

K3 is needed by the three lines (11) above T2 and is not printed; 1.2e4 N*m/rad is chosen here, as catalogues of such
drives have it. The constants of the cubic (10) are not printed either; see `estimation.cubic_from_catalogue`.
"""

from sim_backend.model.compliance import Compliance
from sim_backend.model.estimation import cubic_from_catalogue, flexspline_from_catalogue
from sim_backend.model.parameters import HarmonicDrive

RATIO = 100.0
K1, K2, K3 = 8.4e3, 9.4e3, 1.2e4
"""N*m/rad, catalogue; K3 is chosen."""
T1, T2 = 3.9, 12.0
"""N*m, catalogue."""
RATED_TORQUE = 16.0
"""N*m at the output."""
HYSTERESIS_LOSS = 1.8e-4
"""rad at the output, measured (Fig. 14)."""
STARTING_TORQUE, BACKDRIVING_TORQUE = 0.012, 2.0
"""N*m at the motor and at the output, measured."""
PRINTED_C_F = 0.089
"""1/(N*m), as printed; twice what (29) and (30) give, less a rounding."""
LINES, EDGES = 4096, 4
"""Encoder counts per motor revolution, and evaluations of each: 4096 x 1 or 4096 x 4."""


def paper_drive() -> HarmonicDrive:
    """Give the drive estimated by (29)-(35), with C_F as (29) and (30) demand it."""
    return HarmonicDrive.from_catalogue(RATIO, K1, K2, T1, T2, HYSTERESIS_LOSS, STARTING_TORQUE)


def flexspline_parameters(law: Compliance) -> tuple[float, ...]:
    """Give the parameters of a law of the flexspline, from the catalogue."""
    match law:
        case Compliance.ARCTAN:
            return flexspline_from_catalogue(K1, K2, T1, T2)
        case Compliance.CUBIC:
            return cubic_from_catalogue(K1, K2, T1, T2)
        case Compliance.PIECEWISE:
            return K1, K2, K3, T1, T2

"""The paper's drive: SHD-17-100 with the values that section V prints."""

from sim_backend.model.parameters import HarmonicDrive

RATIO = 100.0
K1, K2 = 8.4e3, 9.4e3
"""N*m/rad, catalogue."""
T1, T2 = 3.9, 12.0
"""N*m, catalogue."""
HYSTERESIS_LOSS = 1.8e-4
"""rad at the output, measured (Fig. 14)."""
STARTING_TORQUE, BACKDRIVING_TORQUE = 0.012, 2.0
"""N*m at the motor and at the output, measured."""
PRINTED_C_F = 0.089
"""1/(N*m), as printed; twice what (29) and (30) give, less a rounding."""


def paper_drive() -> HarmonicDrive:
    """Give the drive estimated by (29)-(35), with C_F as (29) and (30) demand it."""
    return HarmonicDrive.from_catalogue(RATIO, K1, K2, T1, T2, HYSTERESIS_LOSS, STARTING_TORQUE)

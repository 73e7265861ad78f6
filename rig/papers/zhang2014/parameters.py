"""Equations (29)-(35): parameters from catalogue values, starting torque and hysteresis loss."""

import numpy as np

from rig.papers.item import Outcome, Row, Workbench
from rig.papers.zhang2014.drive import HYSTERESIS_LOSS, K1, K2, PRINTED_C_F, RATIO, T1, T2, paper_drive
from sim_backend.model.compliance import flexspline_stiffness, wave_generator_torsion

SATURATED = 1e3
"""N*m; far beyond every torque, so that (27) has reached its end."""


def parameters(_: Workbench) -> Outcome:
    """Estimate the drive's parameters, and put them back into what they came from."""
    drive = paper_drive()
    low, high = flexspline_stiffness(np.array([0.5 * T1, 0.5 * (T1 + T2)]), drive.K_F0, drive.C_F).tolist()
    end = float(wave_generator_torsion(np.array(SATURATED), drive.K_w0, drive.C_w)) / RATIO
    return Outcome(
        rows=(
            Row("stiffness at T1/2", K1, low, "N*m/rad", "", "eq. (29)"),
            Row("stiffness at (T1+T2)/2", K2, high, "N*m/rad", "", "eq. (30)"),
            Row("K_F0", 8.333e3, drive.K_F0, "N*m/rad", "rounding in the paper", "eq. (31)"),
            Row("C_F", PRINTED_C_F, drive.C_F, "1/(N*m)", "the leading 2 of (32) was applied twice", "eq. (32)"),
            Row("K_w0", 1.33, drive.K_w0, "N*m/rad", "", "eq. (33)"),
            Row("largest torsion of the wave generator", 0.5 * HYSTERESIS_LOSS, end, "rad", "", "eq. (34)"),
            Row("C_w", 83.5, drive.C_w, "1/(N*m)", "1/T_fs; the paper put in the rounded 1.33", "eq. (35)"),
        )
    )

"""Equations (31)-(35): parameters from catalogue values, starting torque and hysteresis loss."""

from rig.papers.item import Outcome, Row, Workbench
from rig.papers.zhang2014.drive import PRINTED_C_F, paper_drive


def parameters(_: Workbench) -> Outcome:
    """Estimate the drive's parameters."""
    drive = paper_drive()
    return Outcome(
        rows=(
            Row("K_F0", 8.333e3, drive.K_F0, "N*m/rad", "rounding in the paper", "eq. (31)"),
            Row("C_F", PRINTED_C_F, drive.C_F, "1/(N*m)", "the leading 2 of (32) was applied twice", "eq. (32)"),
            Row("K_w0", 1.33, drive.K_w0, "N*m/rad", "", "eq. (33)"),
            Row("C_w", 83.5, drive.C_w, "1/(N*m)", "1/T_fs; the paper put in the rounded 1.33", "eq. (35)"),
        )
    )

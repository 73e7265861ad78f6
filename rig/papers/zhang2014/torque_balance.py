"""Equations (1)-(6): every configuration of the drive hands on the power that it is given."""

from rig.papers.item import Outcome, Row, Workbench
from rig.papers.zhang2014.drive import RATED_TORQUE, RATIO
from sim_backend.model.kinematics import Member, motion, power_surplus, speed_ratio, torques

PRINTED = {
    Member.CIRCULAR_SPLINE: (-RATIO, "eq. (4)-(6), the bench: wave generator over flexspline"),
    Member.FLEXSPLINE: (RATIO + 1.0, "from (1): wave generator over circular spline"),
    Member.WAVE_GENERATOR: ((RATIO + 1.0) / RATIO, "from (1): flexspline over circular spline"),
}


def configurations(_: Workbench) -> Outcome:
    """Give the speed ratio with each member held, and the power identity with two members driven."""
    rows = [
        Row(f"input over output, {member} held", printed, speed_ratio(RATIO, member), "", note)
        for member, (printed, note) in PRINTED.items()
    ]
    torque = torques(RATIO, flexspline=RATED_TORQUE)
    driven = [motion(RATIO, circular_spline=c, flexspline=f) for c, f in ((0.0, 1.0), (1.0, 0.0), (0.7, -2.3))]
    share = max(abs(power_surplus(torque, speed) / (torque.wave_generator * speed.wave_generator)) for speed in driven)
    rows.append(
        Row(
            "T_w w_w - T_c w_c - T_F w_F, share of the power",
            0.0,
            share,
            "",
            "largest of three motions, one differential",
        )
    )
    return Outcome(tuple(rows))

"""Equations (1)-(6): every configuration of the drive, against its teeth, and the power that it hands on."""

from rig.papers.item import Outcome, Row, Workbench
from rig.papers.zhang2014.drive import RATED_TORQUE, RATIO
from sim_backend.model.kinematics import Member, Members, motion, power_surplus, speed_ratio, torques

FLEXSPLINE_TEETH, CIRCULAR_SPLINE_TEETH = 2.0 * RATIO, 2.0 * RATIO + 2.0
"""Of a drive with two waves."""

DRIVEN = ((0.0, 1.0), (1.0, 0.0), (0.7, -2.3))
"""Motions of circular spline and flexspline: one held, the other held, both driven."""


def configurations(_: Workbench) -> Outcome:
    """Give the angles, the speed ratio with each member held, and the power identity with two members driven."""
    motions = [motion(RATIO, circular_spline=c, flexspline=f) for c, f in DRIVEN]
    slip = max(abs(_slip(angles)) for angles in motions)
    torque = torques(RATIO, flexspline=RATED_TORQUE)
    share = max(abs(power_surplus(torque, speed) / (torque.wave_generator * speed.wave_generator)) for speed in motions)
    note = "seen from the wave generator both members roll by as many teeth; largest of three motions"
    by_angle = motion(RATIO, wave_generator=1.0, circular_spline=0.0).flexspline
    rows = (
        Row("teeth of the flexspline less teeth of the circular spline", 0.0, slip, "", note, "eq. (1)"),
        *(_ratio(held, printed, note) for held, printed, note in HELD),
        Row(
            "T_w w_w - T_c w_c - T_F w_F, share of the power",
            0.0,
            share,
            "",
            "largest of three motions, one differential",
            "eq. (3)",
        ),
        Row("angle of the wave generator over that of the flexspline", -RATIO, 1.0 / by_angle, "", BENCH, "eq. (4)"),
        Row(
            f"input over output, {Member.CIRCULAR_SPLINE} held",
            -RATIO,
            speed_ratio(RATIO, Member.CIRCULAR_SPLINE),
            "",
            BENCH,
            "eq. (5)",
        ),
        Row(f"T_w under {RATED_TORQUE:g} N*m", -RATED_TORQUE / RATIO, torque.wave_generator, "N*m", BENCH, "eq. (6)"),
    )
    return Outcome(rows)


BENCH = "the bench: circular spline held"

HELD = (
    (Member.FLEXSPLINE, RATIO + 1.0, "wave generator over circular spline"),
    (Member.WAVE_GENERATOR, (RATIO + 1.0) / RATIO, "flexspline over circular spline"),
)


def _ratio(held: Member, printed: float, note: str) -> Row:
    return Row(f"input over output, {held} held", printed, speed_ratio(RATIO, held), "", note, "eq. (2)")


def _slip(angles: Members) -> float:
    """Give by how many teeth the members would have to slip; angles in rad."""
    flexspline = FLEXSPLINE_TEETH * (angles.flexspline - angles.wave_generator)
    return flexspline - CIRCULAR_SPLINE_TEETH * (angles.circular_spline - angles.wave_generator)

"""Equations (7)-(28) and (36): the model's laws, each against another way to the same number."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from rig.papers.item import Outcome, Row, Workbench
from rig.papers.zhang2014.drive import (
    BACKDRIVING_TORQUE,
    RATED_TORQUE,
    RATIO,
    T2,
    flexspline_parameters,
    paper_drive,
)
from sim_backend.model.compliance import (
    Compliance,
    cubic_stiffness,
    cubic_torque,
    flexspline_stiffness,
    flexspline_torsion,
    piecewise_torsion,
    total_torsion,
    wave_generator_stiffness,
    wave_generator_torsion,
)
from sim_backend.model.friction import backdriving_torque, play
from sim_backend.model.kinematics import motion, wave_generator_torque

Floats = NDArray[np.float64]


def laws(_: Workbench) -> Outcome:
    """Give friction, decomposition and compliance laws; equations that say what (1)-(6) say are checked with them."""
    drive = paper_drive()
    a1, a3 = flexspline_parameters(Compliance.CUBIC)
    rated = np.array([RATED_TORQUE])
    motor = RATED_TORQUE / RATIO
    held = wave_generator_torque(RATIO, RATED_TORQUE, drive.friction_torque)
    torsion = np.linspace(-1.5e-3, 1.5e-3, 7)
    slope = (cubic_torque(torsion + 1e-7, a1, a3) - cubic_torque(torsion - 1e-7, a1, a3)) / 2e-7
    local = cubic_stiffness(cubic_torque(torsion, a1, a3), a1, a3)
    flexspline = flexspline_torsion(rated, drive.K_F0, drive.C_F)
    whole = total_torsion(flexspline, np.array([-motor]), RATIO, drive.K_w0, drive.C_w)
    integral = _integral(lambda T: 1.0 / flexspline_stiffness(T, drive.K_F0, drive.C_F), RATED_TORQUE)
    generator = _integral(lambda T: 1.0 / wave_generator_stiffness(T, drive.K_w0, drive.C_w), motor)
    return Outcome(
        (
            Row("T_w under 16 N*m and friction of 1.2 N*m", None, held, "N*m", "", "eq. (7)-(9)"),
            Row("a1", None, a1, "N*m/rad", "not printed; see estimation.cubic_from_catalogue", "eq. (10)"),
            Row("a3", None, a3, "N*m/rad^3", "not printed", "eq. (10)"),
            Row("stiffness less dT/dtorsion, share", 0.0, _worst(local, slope), "1", "by differences", "eq. (10)"),
            Row("torsion at T2", None, _at(T2), "rad", "", "eq. (11)"),
            Row("torsion at -T2", None, _at(-T2), "rad", "odd; printed for T_F >= 0 only", "eq. (11)"),
            Row("(19) less (21)", 0.0, _decomposed(), "rad", "random angles, largest of 100", "eq. (12)-(21)"),
            Row(
                "(24) less the integral of 1/(22), share",
                0.0,
                _worst(flexspline, integral),
                "1",
                "at rated torque",
                "eq. (22)-(24)",
            ),
            Row(
                "(27) less the integral of 1/(25), share",
                0.0,
                _worst(wave_generator_torsion(np.array([motor]), drive.K_w0, drive.C_w), generator),
                "1",
                "at rated torque",
                "eq. (25)-(27)",
            ),
            Row("torsion at rated torque", None, float(whole[0]), "rad", "T_w = -T_F/N", "eq. (28)"),
        )
    )


def backdriving_logic(_: Workbench) -> Outcome:
    """Give the corrected logic (36) against the play operator, on two triangles of 14 N*m."""
    turns = np.linspace(0.0, 2.0, 4001) % 1.0
    T_F = 14.0 * np.interp(turns, [0.0, 0.25, 0.75, 1.0], [0.0, 1.0, -1.0, 0.0])
    T_w = backdriving_torque(T_F, RATIO, BACKDRIVING_TORQUE)
    apart = float(np.max(np.abs(T_w - play(-T_F / RATIO, BACKDRIVING_TORQUE / RATIO))))
    note = "second line corrected in sign and inequality: T_F + N T_w < -T_fb; see docs/errata.md"
    return Outcome((Row("T_w less play(-T_F/N; T_fb/N), largest", 0.0, apart, "N*m", note),))


def _at(torque: float) -> float:
    return float(piecewise_torsion(np.array(torque), *flexspline_parameters(Compliance.PIECEWISE)))


def _decomposed() -> float:
    """Give the largest difference of (19) from (21) with (14), (15), (18) for random angles."""
    random = np.random.default_rng(0)
    differences: list[float] = []
    for theta_Fi, windup_F, windup_w in random.uniform(-1e-2, 1e-2, (100, 3)).tolist():
        theta_wo = motion(RATIO, circular_spline=0.0, flexspline=theta_Fi).wave_generator
        theta_Fo, theta_wi = theta_Fi + windup_F, theta_wo - windup_w
        differences.append(abs((theta_Fo + theta_wi / RATIO) - (windup_F - windup_w / RATIO)))
    return max(differences)


def _integral(compliance: Callable[[Floats], Floats], end: float) -> Floats:
    """Integrate from zero to `end` by 48 Gauss points."""
    nodes, weights = np.polynomial.legendre.leggauss(48)
    return np.array([0.5 * end * float(weights @ compliance(0.5 * end * (nodes + 1.0)))])


def _worst(found: Floats, expected: Floats) -> float:
    return float(np.max(np.abs(found / expected - 1.0)))

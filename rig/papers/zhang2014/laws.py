"""Equations (10), (11), (22)-(28) and (36): the model's laws, each against another way to the same number."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from rig.papers.item import Outcome, Row, Workbench
from rig.papers.zhang2014.drive import (
    BACKDRIVING_TORQUE,
    RATED_TORQUE,
    RATIO,
    STARTING_TORQUE,
    T2,
    flexspline_parameters,
    paper_drive,
)
from sim_backend.model.compliance import (
    Compliance,
    cubic_stiffness,
    cubic_torque,
    flexspline_stiffness,
    flexspline_torque,
    flexspline_torsion,
    piecewise_torsion,
    total_torsion,
    wave_generator_stiffness,
    wave_generator_torque,
    wave_generator_torsion,
)
from sim_backend.model.friction import backdriving_torque, play

Floats = NDArray[np.float64]


def older_laws(_: Workbench) -> Outcome:
    """Give the cubic and the piecewise linear law."""
    a1, a3 = flexspline_parameters(Compliance.CUBIC)
    torsion = np.linspace(-1.5e-3, 1.5e-3, 7)
    slope = (cubic_torque(torsion + 1e-7, a1, a3) - cubic_torque(torsion - 1e-7, a1, a3)) / 2e-7
    local = cubic_stiffness(cubic_torque(torsion, a1, a3), a1, a3)
    return Outcome(
        (
            Row("a1", None, a1, "N*m/rad", "not printed; see estimation.cubic_from_catalogue", "eq. (10)"),
            Row("a3", None, a3, "N*m/rad^3", "not printed", "eq. (10)"),
            Row("stiffness less dT/dtorsion, share", 0.0, _worst(local, slope), "1", "by differences", "eq. (10)"),
            Row("torsion at T2", None, _at(T2), "rad", "", "eq. (11)"),
            Row("torsion at -T2", None, _at(-T2), "rad", "odd; printed for T_F >= 0 only", "eq. (11)"),
        )
    )


def laws(_: Workbench) -> Outcome:
    """Give both springs' laws: stiffness against the slope of the inverse, torsion against an integral."""
    drive = paper_drive()
    rated, motor = np.array([RATED_TORQUE]), np.array([RATED_TORQUE / RATIO])
    flexspline = flexspline_torsion(rated, drive.K_F0, drive.C_F)
    wave_generator = wave_generator_torsion(motor, drive.K_w0, drive.C_w)
    whole = total_torsion(flexspline, -motor, RATIO, drive.K_w0, drive.C_w)
    by_23 = _integral(lambda T: 1.0 / flexspline_stiffness(T, drive.K_F0, drive.C_F), RATED_TORQUE)
    by_26 = _integral(lambda T: 1.0 / wave_generator_stiffness(T, drive.K_w0, drive.C_w), float(motor[0]))
    at_rated, of_inverse = "at rated torque", "by differences, at half the rated torque"
    return Outcome(
        (
            Row("K_FL less dT_F/dtorsion, share", 0.0, _flexspline_slope(), "1", of_inverse, "eq. (22)"),
            Row("torsion of the flexspline", None, float(by_23[0]), "rad", f"{at_rated}, by quadrature", "eq. (23)"),
            Row("(24) less the integral (23), share", 0.0, _worst(flexspline, by_23), "1", at_rated, "eq. (24)"),
            Row("K_wL less dT_w/dtorsion, share", 0.0, _wave_generator_slope(), "1", "at T_fs", "eq. (25)"),
            Row(
                "torsion of the wave generator, at the motor",
                None,
                float(by_26[0]),
                "rad",
                f"{at_rated}, by quadrature",
                "eq. (26)",
            ),
            Row("(27) less the integral (26), share", 0.0, _worst(wave_generator, by_26), "1", at_rated, "eq. (27)"),
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


def _flexspline_slope() -> float:
    """Give the share by which (22) misses the slope of the inverse of (24)."""
    drive, torque = paper_drive(), np.array([0.5 * RATED_TORQUE])
    at, step = flexspline_torsion(torque, drive.K_F0, drive.C_F), 1e-8
    higher, lower = (flexspline_torque(at + s, drive.K_F0, drive.C_F) for s in (step, -step))
    return _worst(flexspline_stiffness(torque, drive.K_F0, drive.C_F), (higher - lower) / (2.0 * step))


def _wave_generator_slope() -> float:
    """Give the share by which (25) misses the slope of the inverse of (27)."""
    drive, torque = paper_drive(), np.array([STARTING_TORQUE])
    at, step = wave_generator_torsion(torque, drive.K_w0, drive.C_w), 1e-7
    higher, lower = (wave_generator_torque(at + s, drive.K_w0, drive.C_w) for s in (step, -step))
    return _worst(wave_generator_stiffness(torque, drive.K_w0, drive.C_w), (higher - lower) / (2.0 * step))


def _integral(compliance: Callable[[Floats], Floats], end: float) -> Floats:
    """Integrate from zero to `end` by 48 Gauss points."""
    nodes, weights = np.polynomial.legendre.leggauss(48)
    return np.array([0.5 * end * float(weights @ compliance(0.5 * end * (nodes + 1.0)))])


def _worst(found: Floats, expected: Floats) -> float:
    return float(np.max(np.abs(found / expected - 1.0)))

"""Figures 2, 7 and 8: the typical curve; local stiffness and torsion of the three laws of the flexspline."""

import numpy as np

from rig.papers.figures import label, new_figure
from rig.papers.item import Grid, Outcome, Row, Workbench
from rig.papers.zhang2014.colors import LAW_COLORS, MODEL_COLORS, PRINTED_COLOR
from rig.papers.zhang2014.drive import (
    HYSTERESIS_LOSS,
    K1,
    K2,
    K3,
    PRINTED_C_F,
    RATED_TORQUE,
    T1,
    T2,
    flexspline_parameters,
    paper_drive,
)
from rig.papers.zhang2014.rivals import PIECEWISE, PROPOSED
from sim_backend.model.compliance import LAWS, Compliance, flexspline_torsion, total_torsion
from sim_backend.model.friction import play

PRINTED_LAW = "arctan, C_F as printed"
COLORS = {**LAW_COLORS, PRINTED_LAW: PRINTED_COLOR}
TORQUE = np.linspace(0.0, RATED_TORQUE, 801)

Curve = tuple[str, Compliance, tuple[float, ...]]


def _curves() -> tuple[Curve, ...]:
    """Give name, law and parameters of what is drawn."""
    K_F0, _ = flexspline_parameters(Compliance.ARCTAN)
    own = tuple((str(law), law, flexspline_parameters(law)) for law in Compliance)
    return (*own, (PRINTED_LAW, Compliance.ARCTAN, (K_F0, PRINTED_C_F)))


def typical_curve(_: Workbench) -> Outcome:
    """Draw Fig. 2: the loop of the locked drive after (28), and the three lines beside its flexspline."""
    drive = paper_drive()
    turns = np.linspace(0.25, 1.25, 4001) % 1.0
    motor = (RATED_TORQUE + drive.friction_torque) * np.interp(turns, [0.0, 0.25, 0.75, 1.0], [0.0, 1.0, -1.0, 0.0])
    torque = play(motor, drive.friction_torque)
    flexspline = flexspline_torsion(torque, drive.K_F0, drive.C_F)
    torsion = total_torsion(flexspline, -motor / drive.ratio, drive.ratio, drive.K_w0, drive.C_w)
    lines = flexspline_parameters(Compliance.PIECEWISE)
    figure, axes = new_figure("Zhang 2014, Fig. 2: typical stiffness and hysteresis curve", panels=2)
    axes[0].plot(1e3 * torsion, torque, color=MODEL_COLORS[PROPOSED], label="(a) locked drive, (28)")
    by_lines = 1e3 * LAWS[Compliance.PIECEWISE].torsion(TORQUE, *lines)
    axes[1].plot(by_lines, TORQUE, color=MODEL_COLORS[PIECEWISE], label="(b) three lines (11)")
    for one in axes:
        label(one, "torsion [mrad]", "output torque [N*m]")
    turn = int(np.argmin(torque))
    ends = [np.interp(0.0, torque[:turn][::-1], torsion[:turn][::-1]), np.interp(0.0, torque[turn:], torsion[turn:])]
    slopes = LAWS[Compliance.PIECEWISE].stiffness(np.array([0.5 * T1, 0.5 * (T1 + T2)]), *lines).tolist()
    rows = (
        Row(
            "from B to B' at no torque",
            HYSTERESIS_LOSS,
            abs(float(ends[1] - ends[0])),
            "rad",
            "by (27) the wave generator has taken 63 % of Psi where the drive breaks away",
        ),
        Row("slope of the lines at T1/2", K1, slopes[0], "N*m/rad", "(b)"),
        Row("slope of the lines at (T1+T2)/2", K2, slopes[1], "N*m/rad", "(b)"),
    )
    return Outcome(rows, {"": figure})


def local_stiffness(_: Workbench) -> Outcome:
    """Draw Fig. 7."""
    figure, (axes,) = new_figure("Zhang 2014, Fig. 7: local elastic coefficient")
    at = np.array([0.5 * T1, 0.5 * (T1 + T2), RATED_TORQUE])
    found = {}
    for name, law, values in _curves():
        axes.plot(TORQUE, 1e-3 * LAWS[law].stiffness(TORQUE, *values), color=COLORS[name], label=name)
        found[name] = LAWS[law].stiffness(at, *values).tolist()
    label(axes, "output torque [N*m]", "local stiffness [kN*m/rad]")
    note = "the printed C_F does not return the catalogue it comes from"
    rows = (
        Row("stiffness at T1/2, proposed law", K1, found[Compliance.ARCTAN][0], "N*m/rad"),
        Row("stiffness at (T1+T2)/2, proposed law", K2, found[Compliance.ARCTAN][1], "N*m/rad"),
        Row("stiffness at T1/2, C_F as printed", K1, found[PRINTED_LAW][0], "N*m/rad", note),
        Row("stiffness at (T1+T2)/2, C_F as printed", K2, found[PRINTED_LAW][1], "N*m/rad", note),
    )
    headings = ("law", *(f"at {torque:.4g} N*m" for torque in at))
    cells = tuple((name, *(f"{value:.0f}" for value in values)) for name, values in found.items())
    title = f"Local stiffness, N*m/rad; above {T2:g} N*m only the chosen K3 = {K3:g} N*m/rad says anything"
    return Outcome(rows, {"": figure}, (Grid(title, headings, cells),))


def torsion_curves(_: Workbench) -> Outcome:
    """Draw Fig. 8, and say how far the laws lie apart; the paper says that they match."""
    figure, (axes,) = new_figure("Zhang 2014, Fig. 8: stiffness curves of the flexspline")
    curves = {name: LAWS[law].torsion(TORQUE, *values) for name, law, values in _curves()}
    for name, torsion in curves.items():
        axes.plot(1e3 * torsion, TORQUE, color=COLORS[name], label=name)
    label(axes, "torsion [mrad]", "output torque [N*m]")
    known = TORQUE <= T2
    lines = curves[Compliance.PIECEWISE]
    rows = []
    for name in (Compliance.ARCTAN, Compliance.CUBIC, PRINTED_LAW):
        apart = float(np.max(np.abs(curves[name] - lines)[known]) / lines[known][-1])
        note = "so that Fig. 8 was not drawn with it" if name == PRINTED_LAW else ""
        rows.append(Row(f"largest distance from three lines up to T2, {name}", '"matches"', apart, "1", note))
    headings = ("law", f"at {T1:g} N*m", f"at {T2:g} N*m", f"at {RATED_TORQUE:g} N*m")
    at = [int(np.argmin(np.abs(TORQUE - torque))) for torque in (T1, T2, RATED_TORQUE)]
    cells = tuple((name, *(f"{1e3 * torsion[k]:.4f}" for k in at)) for name, torsion in curves.items())
    return Outcome(tuple(rows), {"": figure}, (Grid("Torsion of the flexspline, mrad", headings, cells),))

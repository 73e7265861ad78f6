"""Figures 7 and 8: local stiffness and torsion of the three laws of the flexspline."""

import numpy as np

from rig.papers.figures import label, new_figure
from rig.papers.item import Grid, Outcome, Row, Workbench
from rig.papers.zhang2014.drive import K1, K2, K3, PRINTED_C_F, RATED_TORQUE, T1, T2, flexspline_parameters
from sim_backend.model.compliance import LAWS, Compliance

PRINTED_LAW = "arctan, C_F as printed"
TORQUE = np.linspace(0.0, RATED_TORQUE, 801)

Curve = tuple[str, Compliance, tuple[float, ...]]


def _curves() -> tuple[Curve, ...]:
    """Give name, law and parameters of what is drawn."""
    K_F0, _ = flexspline_parameters(Compliance.ARCTAN)
    own = tuple((str(law), law, flexspline_parameters(law)) for law in Compliance)
    return (*own, (PRINTED_LAW, Compliance.ARCTAN, (K_F0, PRINTED_C_F)))


def local_stiffness(_: Workbench) -> Outcome:
    """Draw Fig. 7."""
    figure, (axes,) = new_figure("Fig. 7: local elastic coefficient")
    at = np.array([0.5 * T1, 0.5 * (T1 + T2), RATED_TORQUE])
    found = {}
    for name, law, values in _curves():
        axes.plot(TORQUE, 1e-3 * LAWS[law].stiffness(TORQUE, *values), label=name)
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
    figure, (axes,) = new_figure("Fig. 8: stiffness curves of the flexspline")
    curves = {name: LAWS[law].torsion(TORQUE, *values) for name, law, values in _curves()}
    for name, torsion in curves.items():
        axes.plot(1e3 * torsion, TORQUE, label=name)
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

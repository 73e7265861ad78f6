"""Figures 5 and 6: two springs and a mass with dry friction make the drive's stiffness curve.

The paper prints no numbers for its springs; these are those of its drive at small torque (`two_springs.analogue_of`).
"""

import numpy as np
from numpy.typing import NDArray

from rig.papers.figures import label, new_figure
from rig.papers.item import Outcome, Row, Workbench
from rig.papers.zhang2014.colors import MODEL_COLORS, TWO_SPRINGS
from rig.papers.zhang2014.drive import RATED_TORQUE, paper_drive
from rig.papers.zhang2014.rivals import PROPOSED
from sim_backend.model.compliance import flexspline_torsion, total_torsion
from sim_backend.model.friction import play
from sim_backend.model.parameters import PlantConfig
from sim_backend.model.two_springs import Path, TwoSprings, analogue_of, moving, quasi_static

Floats = NDArray[np.float64]

SECONDS = 20.0
"""Of one cycle of the force: slow against the mass, 27 Hz on spring b."""

STEPS = 40_000
"""In a cycle."""


def _swept(springs: TwoSprings, steps: int) -> tuple[Path, Path, slice]:
    """Sweep the force from zero and through a full cycle; give the moving mass, the closed form, and the cycle."""
    turns = np.linspace(0.0, 1.25, round(1.25 * steps) + 1)
    force = RATED_TORQUE * np.interp(turns % 1.0, [0.0, 0.25, 0.75, 1.0], [0.0, 1.0, -1.0, 0.0])
    cycle = slice(round(0.25 * steps), None)
    return moving(force, SECONDS / steps, springs), quasi_static(force, springs), cycle


def spring_forces(bench: Workbench) -> Outcome:
    """Draw Fig. 5: the force of spring b over that of spring a."""
    springs = analogue_of(paper_drive(), PlantConfig(paper_drive()).motor_inertia)
    mass, closed, cycle = _swept(springs, STEPS // 10 if bench.quick else STEPS)
    figure, (axes,) = new_figure("Zhang 2014, Fig. 5: spring (b) against spring (a)")
    axes.plot(mass.F_a, mass.F_b, label="mass with dry friction")
    axes.plot(closed.F_a, closed.F_b, "--", label="play(F; F_fr)")
    label(axes, "F_a [N*m]", "F_b [N*m]")
    width = 0.5 * _width(mass.F_a[cycle], mass.F_b[cycle])
    trailing = float(np.max(np.abs(mass.F_b - closed.F_b)))
    return Outcome(
        (
            Row("half width of the loop at F_b = 0", None, width, "N*m", f"F_fr = {springs.friction:.4g} N*m"),
            Row("largest distance of the mass from the play", 0.0, trailing, "N*m", "falls with the rate of the force"),
        ),
        {"": figure},
    )


def stiffness_curves(bench: Workbench) -> Outcome:
    """Draw Fig. 6: the curve of the two springs beside that of the drive."""
    drive = paper_drive()
    springs = analogue_of(drive, PlantConfig(drive).motor_inertia)
    mass, closed, cycle = _swept(springs, STEPS // 10 if bench.quick else STEPS)
    output = play(closed.F_a, drive.friction_torque)
    torsion = total_torsion(
        flexspline_torsion(output, drive.K_F0, drive.C_F), -closed.F_a / drive.ratio, drive.ratio, drive.K_w0, drive.C_w
    )
    figure, (axes,) = new_figure("Zhang 2014, Fig. 6: stiffness curves of both")
    axes.plot(1e3 * mass.displacement[cycle], mass.F_b[cycle], color=TWO_SPRINGS, label="two springs")
    axes.plot(1e3 * torsion[cycle], output[cycle], color=MODEL_COLORS[PROPOSED], label="harmonic drive, (28)")
    label(axes, "torsion [mrad]", "torque of spring b, at the output [N*m]")
    widths = [_width(x[cycle], output[cycle]) for x in (closed.displacement, torsion)]
    return Outcome(
        (
            Row("loop of the two springs at zero torque", None, widths[0], "rad", "2 F_fr/K_a"),
            Row("loop of the drive at zero torque", None, widths[1], "rad", "narrower: its springs stiffen (27)"),
            Row("torsion of the two springs at rated torque", None, float(np.max(closed.displacement)), "rad"),
            Row("torsion of the drive at rated torque", None, float(np.max(torsion)), "rad", "the paper's mismatch"),
        ),
        {"": figure},
    )


def _width(values: Floats, torque: Floats) -> float:
    """Give how far both branches lie apart at zero torque; it falls in the first half of the cycle, then rises."""
    half = int(np.argmin(torque))
    falling = np.interp(0.0, torque[:half][::-1], values[:half][::-1])
    rising = np.interp(0.0, torque[half:], values[half:])
    return abs(float(rising - falling))

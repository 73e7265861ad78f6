"""Castejon, Garcia-Prada & Lara 2009, "Modelado de una transmision Harmonic Drive. Analisis del error cinematico".

Equations 1 to 40, figures 1 to 12, tables 1 and 2.
"""

from rig.papers.castejon2009 import identification, kinematics, linear, motion, results, tables
from rig.papers.item import Item, drawing

PAPER = "castejon2009"

ITEMS: tuple[Item, ...] = (
    Item(PAPER, "eq. (1)-(3)", "Ideal motion, torque and power", kinematics.ideal),
    Item(PAPER, "eq. (4)-(5)", "Kinematic error and its parts", kinematics.parts),
    drawing(PAPER, 1, "Harmonic drive, exploded and assembled"),
    Item(PAPER, "Fig. 2", "How the mechanism turns", kinematics.mechanism),
    Item(PAPER, "Fig. 3", "A typical kinematic error", kinematics.typical_error),
    Item(PAPER, "table 1", "Modes of motor, drive and load", tables.table_1),
    drawing(PAPER, 4, "Motor, harmonic drive and load", "its parameters are table 1"),
    Item(PAPER, "eq. (6)-(16)", "Lagrange's equations of motion", motion.equations_of_motion),
    Item(PAPER, "eq. (17)-(19)", "Fifteen coefficients from a slow run", identification.identification),
    drawing(PAPER, 5, "A system with its inputs and outputs"),
    drawing(PAPER, 6, "DC motor, harmonic drive and load", "computed in table 2 and figures 8 to 12"),
    Item(PAPER, "eq. (20)-(25)", "State space in general", linear.general_form),
    Item(PAPER, "eq. (26)-(40)", "Linear state space", linear.matrices),
    Item(PAPER, "table 2", "Speed against voltage", tables.table_2),
    drawing(PAPER, 7, "Block diagram", "what it computes is in figures 8 to 12"),
    Item(PAPER, "Fig. 8", "Pure error at 310 rpm", results.fig_8),
    Item(PAPER, "Fig. 9", "Flexible part at four speeds", results.fig_9),
    Item(PAPER, "Fig. 10", "Load angle around the ideal line at 1120 rpm", results.fig_10),
    Item(PAPER, "Fig. 11", "Parts of the error at 310 rpm", results.fig_11),
    Item(PAPER, "Fig. 12", "Spectrum at 310 rpm", results.fig_12),
    Item(PAPER, "conclusions", "Share of the flexible part against speed", results.conclusions),
)

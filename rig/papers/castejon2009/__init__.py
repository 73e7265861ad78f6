"""Castejon, Garcia-Prada & Lara 2009, "Modelado de una transmision Harmonic Drive. Analisis del error cinematico".

Figures 1, 2 and 4 to 7 are drawings and block diagrams: nothing of them can be computed.
"""

from rig.papers.castejon2009 import dynamics, identification, kinematics, results
from rig.papers.item import Item

PAPER = "castejon2009"

ITEMS: tuple[Item, ...] = (
    Item(PAPER, "eq. (1)-(3)", "Ideal motion, torque and power", kinematics.ideal),
    Item(PAPER, "eq. (4)-(5)", "Kinematic error and its parts", kinematics.parts),
    Item(PAPER, "Fig. 3", "A typical kinematic error", kinematics.typical_error),
    Item(PAPER, "table 1", "Modes of motor, drive and load", dynamics.table_1),
    Item(PAPER, "eq. (6)-(16)", "Lagrange's equations of motion", dynamics.equations_of_motion),
    Item(PAPER, "eq. (17)-(19)", "Fifteen coefficients from a slow run", identification.identification),
    Item(PAPER, "eq. (20)-(40)", "Linear state space", dynamics.matrices),
    Item(PAPER, "table 2", "Speed against voltage", dynamics.table_2),
    Item(PAPER, "Fig. 8", "Pure error at 310 rpm", results.fig_8),
    Item(PAPER, "Fig. 9", "Flexible part at four speeds", results.fig_9),
    Item(PAPER, "Fig. 10", "Load angle around the ideal line at 1120 rpm", results.fig_10),
    Item(PAPER, "Fig. 11", "Parts of the error at 310 rpm", results.fig_11),
    Item(PAPER, "Fig. 12", "Spectrum at 310 rpm", results.fig_12),
    Item(PAPER, "conclusions", "Share of the flexible part against speed", results.conclusions),
)

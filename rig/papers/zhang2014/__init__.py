"""Zhang, Ahmad & Liu, "Modeling of Torsional Compliance and Hysteresis Behaviors in Harmonic Drives".

IEEE/ASME Transactions on Mechatronics 19 (2014), doi 10.1109/TMECH.2014.2311382.
"""

from rig.papers.item import Item
from rig.papers.zhang2014.parameters import parameters
from rig.papers.zhang2014.stiffness import local_stiffness, torsion_curves
from rig.papers.zhang2014.torque_balance import configurations
from rig.papers.zhang2014.two_springs import spring_forces, stiffness_curves

PAPER = "zhang2014"

ITEMS: tuple[Item, ...] = (
    Item(PAPER, "eq. (1)-(6)", "Ideal kinematics and torques, every configuration", configurations),
    Item(PAPER, "eq. (31)-(35)", "Parameters from catalogue values and two tests", parameters),
    Item(PAPER, "Fig. 5", "Two springs: force of the one over that of the other", spring_forces),
    Item(PAPER, "Fig. 6", "Two springs and the drive: stiffness curves", stiffness_curves),
    Item(PAPER, "Fig. 7", "Local stiffness of three laws", local_stiffness),
    Item(PAPER, "Fig. 8", "Stiffness curves of three laws", torsion_curves),
)

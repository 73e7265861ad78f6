"""Zhang, Ahmad & Liu, "Modeling of Torsional Compliance and Hysteresis Behaviors in Harmonic Drives".

IEEE/ASME Transactions on Mechatronics 19 (2014), doi 10.1109/TMECH.2014.2311382.
"""

from rig.papers.item import Item
from rig.papers.zhang2014.parameters import parameters

PAPER = "zhang2014"

ITEMS: tuple[Item, ...] = (Item(PAPER, "eq. (31)-(35)", "Parameters from catalogue values and two tests", parameters),)

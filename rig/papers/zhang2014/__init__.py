"""Zhang, Ahmad & Liu, "Modeling of Torsional Compliance and Hysteresis Behaviors in Harmonic Drives".

IEEE/ASME Transactions on Mechatronics 19 (2014), doi 10.1109/TMECH.2014.2311382. Equations 1 to 36, figures 1 to 14, no
numbered table.
"""

from rig.papers.item import Item, drawing
from rig.papers.zhang2014 import backdrive, decomposition, locked_output
from rig.papers.zhang2014.closing import next_column
from rig.papers.zhang2014.laws import backdriving_logic, laws, older_laws
from rig.papers.zhang2014.parameters import parameters
from rig.papers.zhang2014.stiffness import local_stiffness, torsion_curves, typical_curve
from rig.papers.zhang2014.thresholds import backdriving_torque, estimated, starting_torque
from rig.papers.zhang2014.torque_balance import configurations
from rig.papers.zhang2014.two_springs import spring_forces, stiffness_curves

PAPER = "zhang2014"

ITEMS: tuple[Item, ...] = (
    Item(PAPER, "eq. (1)-(6)", "Ideal kinematics and torques, every configuration", configurations),
    Item(PAPER, "eq. (7)-(9)", "Gear side and friction", decomposition.friction),
    Item(PAPER, "eq. (10)-(11)", "Cubic and piecewise linear law", older_laws),
    Item(PAPER, "eq. (12)-(21)", "Torsion, and its parts in the plant", decomposition.decomposition),
    Item(PAPER, "eq. (22)-(28)", "Laws of flexspline and wave generator", laws),
    Item(PAPER, "eq. (29)-(35)", "Parameters from catalogue values and two tests", parameters),
    Item(PAPER, "eq. (36)", "Torque at the wave generator of a backdriven gear", backdriving_logic),
    drawing(PAPER, 1, "Exploded view of a harmonic drive"),
    Item(PAPER, "Fig. 2", "Typical stiffness and hysteresis curve, and three lines", typical_curve),
    drawing(PAPER, 3, "Axes of the wave generator, free body diagrams", "the angle between the axes is (27)"),
    drawing(PAPER, 4, "Two springs and a mass", "computed in figures 5 and 6"),
    Item(PAPER, "Fig. 5", "Two springs: force of the one over that of the other", spring_forces),
    Item(PAPER, "Fig. 6", "Two springs and the drive: stiffness curves", stiffness_curves),
    Item(PAPER, "Fig. 7", "Local stiffness of three laws", local_stiffness),
    Item(PAPER, "Fig. 8", "Stiffness curves of three laws", torsion_curves),
    Item(PAPER, "sec. V, T_fs", "Starting torque, by breakaway and by the first pulse", starting_torque),
    Item(PAPER, "sec. V, T_fb", "Backdriving torque", backdriving_torque),
    drawing(PAPER, 9, "Test apparatus", "the simulated bench has its motor, ratio, encoders and torque sensor"),
    Item(PAPER, "Fig. 10", "Motor torque of the first experiment", locked_output.torque_history),
    Item(PAPER, "Fig. 11", "Motor torque over torsion, measured and predicted", locked_output.loop),
    Item(PAPER, "Fig. 12", "Errors of cubic, piecewise and proposed model", locked_output.errors),
    Item(PAPER, "Fig. 13", "External torque of the second experiment", backdrive.torque_history),
    Item(PAPER, "Fig. 14", "Output torque over torsion, measured and predicted; Psi", backdrive.loop),
    Item(PAPER, "sec. V, parameters", "What (33) and (35) make of the bench's own T_fs and Psi", estimated),
    Item(PAPER, "beyond", "The loop closes on the remaining error", next_column),
)

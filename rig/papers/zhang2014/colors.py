"""One colour for each law in all figures of the paper, and one for what is measured."""

from collections.abc import Mapping
from types import MappingProxyType

from rig.papers.zhang2014.rivals import CUBIC, LINES_AND_WAVE_GENERATOR, PIECEWISE, PRINTED, PROPOSED
from sim_backend.model.compliance import Compliance

LAW_COLORS: Mapping[str, str] = MappingProxyType(
    {Compliance.CUBIC: "C0", Compliance.PIECEWISE: "C1", Compliance.ARCTAN: "C2"}
)
"""Of the flexspline's laws, alone or in a model of the torsion."""

PRINTED_COLOR = "C3"
"""The arctan law with C_F as printed."""

TRACED = "traced"
"""The model that the loop adds its effects to."""

MODEL_COLORS: Mapping[str, str] = MappingProxyType(
    {
        CUBIC: LAW_COLORS[Compliance.CUBIC],
        PIECEWISE: LAW_COLORS[Compliance.PIECEWISE],
        PROPOSED: LAW_COLORS[Compliance.ARCTAN],
        PRINTED: PRINTED_COLOR,
        LINES_AND_WAVE_GENERATOR: "C4",
        TRACED: "C5",
    }
)
"""Of the models of the torsion."""

TWO_SPRINGS = "C6"
"""The two springs and the mass beside the drive."""

MEASURED, MEASURED_BESIDES = "0.3", "0.75"
"""What the bench shows; and what it shows that the paper does not draw."""

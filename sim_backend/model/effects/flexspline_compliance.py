"""Flexspline compliance: the spring of the base model between the mesh and the output.

    torsion = f(T) = arctan(C_F T) / (C_F K_F0)        rad at the output, T = output_torque; (24)

The integral of 1/K with the local stiffness K = K_F0 (1 + (C_F T)^2), (22). Written with numpy's elementary functions,
so that one definition serves scalars in compiled code and whole signals in a fit.
Source: Zhang, Ahmad & Liu 2014, equations (22)-(24).
"""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from sim_backend.model.effects.effect import Effect, Energy, Enters, Parameter, Shape

Real = TypeVar("Real", float, NDArray[np.float64])


def flexspline_compliance(output_torque: Real, K_F0: float, C_F: float) -> Real:
    """Torsion of the flexspline, rad at the output, for an output torque in N*m. Equation (24).

    K_F0: stiffness at zero torque, N*m/rad. C_F: 1/(N*m); positive.
    """
    torsion: Real = np.arctan(C_F * output_torque) / (C_F * K_F0)
    return torsion


EFFECT = Effect(
    id="flexspline-compliance",
    summary="spring between mesh and output that stiffens with the torque",
    equation="torsion = arctan(C_F * output_torque) / (C_F * K_F0)",
    source="Zhang, Ahmad & Liu 2014 (22)-(24)",
    enters=Enters.BASE,
    variable="output_torque",
    shape=Shape.STATIC,
    unit="rad",
    parameters=(
        Parameter("K_F0", "N*m/rad", 1e-3, 1e9, 8336.0, (5e3, 2e4), "stiffness at zero torque, at the output"),
        Parameter("C_F", "1/(N*m)", 1e-9, 1e3, 0.0449, (0.02, 0.08), "stiffness doubles at the torque 1/C_F"),
    ),
    amplitudes=(),
    function=flexspline_compliance,
    energy=Energy.CONSERVATIVE,
    shows=("locked-output", "backdrive"),
    confusable=(
        "torque-sensor-gain",
        "fixture-compliance",
        "torque-constant-error",
        "kinematic-error",
        "soft-windup",
        "stiffness-modulation",
        "torque-sensor-nonlinearity",
        "torque-constant-saturation",
        "load-dependent-friction",
    ),
    separated_by="dead weights on a lever and a gauge on the fixture for its size; 8 to 16 start angles for its shape",
    linear=False,
)

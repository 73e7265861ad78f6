"""Wave-generator compliance: the spring of the base model between the motor shaft and the mesh.

    torsion = g(M) / ratio,  g(M) = sgn(M) (1 - exp(-C_w |M|)) / (C_w K_w0)        M = motor_torque; (27)

g is in rad at the motor. The paper's T_w is what the wave generator exerts back on the shaft, T_w = -M at rest, so
that its -g(T_w)/N is +g(M)/N in logged signals. Written with numpy's elementary functions, so that one definition
serves scalars in compiled code and whole signals in a fit. Source: Zhang, Ahmad & Liu 2014, equations (25)-(28).
"""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from sim_backend.model.effects.effect import Effect, Energy, Enters, Parameter, Shape

Real = TypeVar("Real", float, NDArray[np.float64])


def wave_generator_compliance(motor_torque: Real, K_w0: float, C_w: float, ratio: float) -> Real:
    """Torsion of the wave generator, rad at the output, for a motor torque in N*m. Equation (27), divided by the ratio.

    K_w0: stiffness at zero torque, N*m/rad at the motor. C_w: 1/(N*m); positive.
    """
    torsion: Real = np.sign(motor_torque) * (-np.expm1(-C_w * np.abs(motor_torque))) / (C_w * K_w0) / ratio
    return torsion


EFFECT = Effect(
    id="wave-generator-compliance",
    summary="spring between motor shaft and mesh that stiffens with the torque",
    equation="torsion = sgn(motor_torque) * (1 - exp(-C_w * |motor_torque|)) / (C_w * K_w0 * ratio)",
    source="Zhang, Ahmad & Liu 2014 (25)-(28)",
    enters=Enters.BASE,
    variable="motor_torque",
    shape=Shape.STATIC,
    unit="rad",
    parameters=(
        Parameter("K_w0", "N*m/rad", 1e-6, 1e6, 1.333, (0.5, 5.0), "stiffness at zero torque, at the motor"),
        Parameter("C_w", "1/(N*m)", 1e-6, 1e6, 83.3, (30.0, 200.0), "stiffness grows by e every 1/C_w of motor torque"),
        Parameter("ratio", "1", 1.0, 1e4, 100.0, (30.0, 320.0), "gear ratio", known=True),
    ),
    amplitudes=(),
    function=wave_generator_compliance,
    energy=Energy.CONSERVATIVE,
    shows=("locked-output", "backdrive"),
    confusable=("maxwell-slip", "backlash", "coulomb-friction", "soft-windup", "torque-constant-error"),
    separated_by="nested reversals at three or more amplitudes, about zero and about a bias torque",
    linear=False,
)

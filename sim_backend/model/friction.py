"""Rate-independent friction with pre-sliding, seen as a play operator between two torques.

    p_k = min(max(p_{k-1}, u_k - r), u_k + r)

The law is that of the catalogue's base term `coulomb-friction`. Locked output: T_F = play(N motor_torque; N T_fs).
Backdrive: motor_torque = play(T_F/N; T_fb/N), which equals equation (36) of Zhang, Ahmad & Liu 2014 with its sign and
inequality corrected.
"""

import numpy as np
from numpy.typing import NDArray

from sim_backend.errors import ModelError
from sim_backend.model.arrays import evaluate
from sim_backend.model.effects import coulomb_friction

Floats = NDArray[np.float64]


def play(inputs: Floats, radius: float, start: float | None = None) -> Floats:
    """Give the play of `inputs` with `radius`, shape (n,), in the unit of the inputs.

    start: the state before the first sample; it need not lie within reach of it. None: the equilibrium of a drive
    that was at rest without torque and then brought to the first sample, which is the same as start = 0.
    Raises ModelError if `radius` is negative or not finite, or `inputs` is not one-dimensional.
    """
    if np.ndim(inputs) != 1:
        raise ModelError(f"inputs has {np.ndim(inputs)} dimensions; the play operator takes one series at a time.")
    if not (np.isfinite(radius) and radius >= 0.0):
        raise ModelError(f"radius = {radius!r} must be finite and at least 0.")
    state = np.array([0.0 if start is None else start])
    ratio = 1.0
    return evaluate(coulomb_friction.EFFECT, {"motor_torque": inputs}, (radius, ratio), step=1.0, memory=state)

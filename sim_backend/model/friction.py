"""Rate-independent friction with pre-sliding, seen as a play operator between two torques.

    p_k = min(max(p_{k-1}, u_k - r), u_k + r)

The law is that of the catalogue's base term `coulomb-friction`. Locked output: T_F = play(N motor_torque; N T_fs).
Backdrive: motor_torque = play(T_F/N; T_fb/N), which equals equation (36) of Zhang, Ahmad & Liu 2014 with its sign and
inequality corrected.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim_backend.errors import ModelError
from sim_backend.model.compiler import load
from sim_backend.model.effects.coulomb_friction import coulomb_friction
from sim_backend.model.source import function_source

Floats = NDArray[np.float64]

_LOOP = """
@compiled
def over_arrays(outputs, inputs, radii, memory):
    for i in range(len(outputs)):
        outputs[i] = play(inputs[i], 1.0, memory, radii[i], 1.0)
"""


def play(inputs: Floats, radius: Floats | float, start: float | None = None) -> Floats:
    """Give the play of `inputs` with `radius`, shape (n,), in the unit of the inputs.

    radius: one value, or one for every input, shape (n,).
    start: the state before the first sample; it need not lie within reach of it. None: the equilibrium of a drive
    that was at rest without torque and then brought to the first sample, which is the same as start = 0.
    Raises ModelError if `radius` is negative or not finite, or `inputs` is not one-dimensional.
    """
    values = np.ascontiguousarray(inputs, dtype=np.float64)
    if values.ndim != 1:
        raise ModelError(f"inputs has {values.ndim} dimensions; the play operator takes one series at a time.")
    radii = np.ascontiguousarray(np.broadcast_to(radius, values.shape), dtype=np.float64)
    if not (np.all(np.isfinite(radii)) and np.all(radii >= 0.0)):
        raise ModelError(f"radius = {radius!r} must be finite and at least 0.")
    outputs = np.empty_like(values)
    _compiled_loop()(outputs, values, radii, np.array([0.0 if start is None else float(start)]))
    return outputs


@cache
def _compiled_loop() -> Callable[[Floats, Floats, Floats, Floats], None]:
    module: Any = load("The play operator", function_source(coulomb_friction, "play") + "\n\n" + _LOOP)
    loop: Callable[[Floats, Floats, Floats, Floats], None] = module.over_arrays
    return loop

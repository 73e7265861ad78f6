"""Rate-independent friction with pre-sliding, seen as a play operator between two torques.

    p_k = min(max(p_{k-1}, u_k - r), u_k + r)

The law is that of the catalogue's base term `coulomb-friction`. Locked output: T_F = play(N motor_torque; N T_fs).
Backdrive: motor_torque = play(T_F/N; T_fb/N), which equals equation (36) of Zhang, Ahmad & Liu 2014 with its sign and
inequality corrected (`backdriving_torque`).
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim_backend.errors import ModelError
from sim_backend.model.checks import require, require_all
from sim_backend.model.compiler import load
from sim_backend.model.effects.coulomb_friction import coulomb_friction
from sim_backend.model.source import function_source, operators_of

Floats = NDArray[np.float64]

_PLAY = "p = min(max(p_before, u - r), u + r)"
_LOGIC = "T_w = -(T_F -+ T_fb)/N, Zhang (36),"
_UNIT_OF_INPUTS = "(unit of the inputs)"

_LOOP = """
@compiled
def over_arrays(outputs, inputs, radii, memory):
    for i in range(len(outputs)):
        outputs[i] = through_the_mesh(inputs[i], 1.0, memory, radii[i], 1.0)
"""


def play(inputs: Floats, radius: Floats | float, start: float | None = None) -> Floats:
    """Give the play of `inputs` with `radius`, shape (n,), in the unit of the inputs.

    radius: one value, or one for every input, shape (n,).
    start: the state before the first sample; it need not lie within reach of it. None: the equilibrium of a drive
    that was at rest without torque and then brought to the first sample, which is the same as start = 0.
    Raises ModelError if `radius` is negative, anything is not finite, or `inputs` is not one-dimensional.
    """
    values = np.ascontiguousarray(inputs, dtype=np.float64)
    _check_series("inputs", values, "", _PLAY)
    require_all("radius", radius, _UNIT_OF_INPUTS, _PLAY, low=0.0)
    if start is not None:
        require("start", start, _UNIT_OF_INPUTS, _PLAY)
    radii = np.ascontiguousarray(np.broadcast_to(radius, values.shape), dtype=np.float64)
    outputs = np.empty_like(values)
    _compiled_loop()(outputs, values, radii, np.array([0.0 if start is None else float(start)]))
    return outputs


def backdriving_torque(output_torque: Floats, ratio: float, friction: float, start: float = 0.0) -> Floats:
    """Give T_w of a backdriven gear whose input is held, N*m, shape (n,): the logic (36), branch by branch.

    output_torque: T_F, N*m, shape (n,). friction: backdriving torque T_fb, N*m at the output. start: T_w before the
    first sample. The second branch is printed as "T_F - N T_w > -T_fb", which is true nearly always; here
    T_F + N T_w < -T_fb, with which (36) is play(-T_F/N; T_fb/N), sample by sample. T_w acts back on the motor: the
    motor's torque is -T_w. Raises ModelError if `ratio` is below 1, `friction` negative, or anything not finite.
    """
    inputs = np.asarray(output_torque, dtype=np.float64)
    _check_series("output_torque", inputs, "N*m", _LOGIC)
    require("ratio", ratio, "", _LOGIC, low=1.0)
    require("friction", friction, "N*m", _LOGIC, low=0.0)
    require("start", start, "N*m", _LOGIC)
    T_w = start
    found = []
    for T_F in inputs.tolist():
        if T_F + ratio * T_w > friction:
            T_w = -(T_F - friction) / ratio
        elif T_F + ratio * T_w < -friction:
            T_w = -(T_F + friction) / ratio
        found.append(T_w)
    return np.array(found)


def _check_series(name: str, values: Floats, unit: str, equation: str) -> None:
    if values.ndim != 1:
        raise ModelError(f"{name} has {values.ndim} dimensions; the play operator takes one series at a time.")
    require_all(name, values, unit, equation)


@cache
def _compiled_loop() -> Callable[[Floats, Floats, Floats, Floats], None]:
    parts = [operators_of([coulomb_friction]), function_source(coulomb_friction, "through_the_mesh"), _LOOP]
    body = "\n\n".join(parts)
    module: Any = load("The play operator", body)
    loop: Callable[[Floats, Floats, Floats, Floats], None] = module.over_arrays
    return loop

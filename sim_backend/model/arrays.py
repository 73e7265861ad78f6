"""An effect's function over whole signals, compiled from the same source as in the plant."""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim_backend.errors import ModelError
from sim_backend.model.compiler import load
from sim_backend.model.effects import Effect
from sim_backend.model.source import function_source, operators_of

Floats = NDArray[np.float64]


def evaluate(
    effect: Effect,
    signals: Mapping[str, Floats],
    values: Sequence[float],
    *,
    step: float | None = None,
    memory: Floats | None = None,
    compiled: bool = True,
) -> Floats:
    """Give what `effect` adds at every sample, shape (n,), in its unit.

    signals: contract signals by name, SI, each shape (n,); those which the effect takes must be there, others are
    ignored. values: its parameters in the order of `effect.parameters`; with amplitude 1 this is its column in a fit.
    step: s between two samples; an effect that remembers needs it. memory: what it remembers from the samples before,
    shape (effect.memory,), left as it is after the last one; None: these are the first.
    Raises ModelError if a signal is missing or has another length, the number of values is wrong, or an effect that
    remembers gets no positive step or a memory of another size.
    """
    missing = [name for name in effect.signals if name not in signals]
    if missing:
        raise ModelError(f"{effect.id} needs {', '.join(missing)}; given are {', '.join(signals) or 'no signals'}.")
    if len(values) != len(effect.parameters):
        names = ", ".join(parameter.name for parameter in effect.parameters)
        raise ModelError(f"{effect.id} takes {len(effect.parameters)} values ({names}); {len(values)} were given.")
    if effect.memory and not (step is not None and math.isfinite(step) and step > 0.0):
        raise ModelError(f"{effect.id} remembers and needs the step between two samples, above 0 s; step = {step!r} s.")
    remembered = np.zeros(effect.memory) if memory is None else memory
    if remembered.shape != (effect.memory,):
        raise ModelError(f"{effect.id}: memory has the shape {remembered.shape}; it must be ({effect.memory},).")
    columns = [np.ascontiguousarray(signals[name], dtype=np.float64) for name in effect.signals]
    shapes = {column.shape for column in columns}
    if len(shapes) != 1 or any(column.ndim != 1 for column in columns):
        raise ModelError(f"{effect.id}: its signals have shapes {sorted(shapes)}; they must be one (n,).")
    outputs = np.empty_like(columns[0])
    loop = _loop(effect, compiled)
    loop(outputs, np.array(values, dtype=np.float64), 0.0 if step is None else step, remembered, *columns)
    return outputs


@cache
def _loop(effect: Effect, compiled: bool) -> Callable[..., None]:
    """Give the loop over the samples."""
    columns = list(effect.signals)
    arguments = [f"{name}[i]" for name in columns]
    if effect.memory:
        arguments += ["step", "memory"]
    arguments += [f"values[{i}]" for i in range(len(effect.parameters))]
    loop = (
        f"@compiled\ndef over_arrays(outputs, values, step, memory, {', '.join(columns)}):\n"
        f"    for i in range(len(outputs)):\n"
        f"        outputs[i] = value({', '.join(arguments)})"
    )
    source = "\n\n".join([operators_of([effect.function]), function_source(effect.function, "value"), loop])
    module: Any = load(f"{effect.id} over arrays", source, compiled=compiled)
    over_arrays: Callable[..., None] = module.over_arrays
    return over_arrays

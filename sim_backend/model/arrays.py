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
from sim_backend.model.source import function_source

Floats = NDArray[np.float64]


def evaluate(
    effect: Effect,
    signals: Mapping[str, Floats],
    values: Sequence[float],
    *,
    step: float | None = None,
    compiled: bool = True,
) -> Floats:
    """Give what `effect` adds at every sample, shape (n,), in its unit.

    signals: contract signals by name, SI, each shape (n,); those which the effect takes must be there, others are
    ignored. values: its parameters in the order of `effect.parameters`; with amplitude 1 this is its column in a fit.
    step: s between samples, for effects with memory; the memory starts at the equilibrium of the first sample.
    Raises ModelError if a signal is missing or has another length, the number of values is wrong, or `step` is
    missing where the effect needs it.
    """
    return _apply(effect, _loop(effect, slope=False, compiled=compiled), signals, values, step)


def evaluate_slope(
    effect: Effect,
    signals: Mapping[str, Floats],
    values: Sequence[float],
    *,
    step: float | None = None,
    compiled: bool = True,
) -> Floats:
    """Give the torque which drives the motor per N*m of output torque (`Effect.slope`), shape (n,); as `evaluate`.

    Raises ModelError if the effect has none.
    """
    if effect.slope is None:
        raise ModelError(f"{effect.id} has no slope: it does not react on the motor.")
    return _apply(effect, _loop(effect, slope=True, compiled=compiled), signals, values, step)


def _apply(
    effect: Effect,
    loop: Callable[..., None],
    signals: Mapping[str, Floats],
    values: Sequence[float],
    step: float | None,
) -> Floats:
    missing = [name for name in effect.signals if name not in signals]
    if missing:
        raise ModelError(f"{effect.id} needs {', '.join(missing)}; given are {', '.join(signals) or 'no signals'}.")
    if len(values) != len(effect.parameters):
        names = ", ".join(parameter.name for parameter in effect.parameters)
        raise ModelError(f"{effect.id} takes {len(effect.parameters)} values ({names}); {len(values)} were given.")
    if effect.memory and not (step is not None and math.isfinite(step) and step > 0.0):
        raise ModelError(f"{effect.id} remembers: step = {step!r} s between its samples must be finite and above 0 s.")
    columns = [np.ascontiguousarray(signals[name], dtype=np.float64) for name in effect.signals]
    shapes = {column.shape for column in columns}
    if len(shapes) != 1 or any(column.ndim != 1 for column in columns):
        raise ModelError(f"{effect.id}: its signals have shapes {sorted(shapes)}; they must be one (n,).")
    outputs = np.empty_like(columns[0])
    loop(outputs, np.array(values, dtype=np.float64), step or 0.0, np.zeros(max(effect.memory, 1)), *columns)
    return outputs


@cache
def _loop(effect: Effect, *, slope: bool, compiled: bool) -> Callable[..., None]:
    columns = list(effect.signals)
    arguments = [f"{name}[i]" for name in columns]
    arguments += ["step", "memory"] if effect.memory else []
    arguments += [f"values[{i}]" for i in range(len(effect.parameters))]
    parts = [function_source(effect.function, "value")]
    call = f"value({', '.join(arguments)})"
    loop = [f"        outputs[i] = {call}"]
    if slope and effect.slope is not None:
        parts.append(function_source(effect.slope, "slope"))
        # what the slope stands on is remembered by the function
        loop = [f"        {call}"] if effect.memory else []
        loop.append(f"        outputs[i] = slope({', '.join(arguments)})")
    parts.append(
        f"@compiled\ndef over_arrays(outputs, values, step, memory, {', '.join(columns)}):\n"
        f"    for i in range(len(outputs)):\n" + "\n".join(loop)
    )
    module: Any = load(f"{effect.id} over arrays", "\n\n".join(parts), compiled=compiled)
    over_arrays: Callable[..., None] = module.over_arrays
    return over_arrays

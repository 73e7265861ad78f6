"""An effect's function over whole signals, compiled from the same source as in the plant."""

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
    effect: Effect, signals: Mapping[str, Floats], values: Sequence[float], *, compiled: bool = True
) -> Floats:
    """Give what `effect` adds at every sample, shape (n,), in its unit.

    signals: contract signals by name, SI, each shape (n,); those which the effect takes must be there, others are
    ignored. values: its parameters in the order of `effect.parameters`; with amplitude 1 this is its column in a fit.
    Raises ModelError if a signal is missing or has another length, or the number of values is wrong.
    """
    return _apply(effect, _loop(effect, effect.function, compiled), signals, values)


def evaluate_slope(
    effect: Effect, signals: Mapping[str, Floats], values: Sequence[float], *, compiled: bool = True
) -> Floats:
    """Give the derivative with respect to motor_position at every sample, shape (n,); as `evaluate`.

    Raises ModelError if the effect has none.
    """
    if effect.slope is None:
        raise ModelError(f"{effect.id} has no slope: it does not react on the motor.")
    return _apply(effect, _loop(effect, effect.slope, compiled), signals, values)


def _apply(
    effect: Effect,
    loop: Callable[..., None],
    signals: Mapping[str, Floats],
    values: Sequence[float],
) -> Floats:
    missing = [name for name in effect.signals if name not in signals]
    if missing:
        raise ModelError(f"{effect.id} needs {', '.join(missing)}; given are {', '.join(signals) or 'no signals'}.")
    if len(values) != len(effect.parameters):
        names = ", ".join(parameter.name for parameter in effect.parameters)
        raise ModelError(f"{effect.id} takes {len(effect.parameters)} values ({names}); {len(values)} were given.")
    columns = [np.ascontiguousarray(signals[name], dtype=np.float64) for name in effect.signals]
    shapes = {column.shape for column in columns}
    if len(shapes) != 1 or any(column.ndim != 1 for column in columns):
        raise ModelError(f"{effect.id}: its signals have shapes {sorted(shapes)}; they must be one (n,).")
    outputs = np.empty_like(columns[0])
    loop(outputs, np.array(values, dtype=np.float64), *columns)
    return outputs


@cache
def _loop(effect: Effect, function: Callable[..., float], compiled: bool) -> Callable[..., None]:
    columns = list(effect.signals)
    arguments = [f"{name}[i]" for name in columns]
    arguments += [f"values[{i}]" for i in range(len(effect.parameters))]
    body = (
        f"{function_source(function, 'value')}\n\n"
        f"@compiled\ndef over_arrays(outputs, values, {', '.join(columns)}):\n"
        f"    for i in range(len(outputs)):\n"
        f"        outputs[i] = value({', '.join(arguments)})"
    )
    module: Any = load(f"{effect.id} over arrays", body, compiled=compiled)
    over_arrays: Callable[..., None] = module.over_arrays
    return over_arrays

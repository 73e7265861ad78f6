"""The slope of an effect over whole signals: in the plant it is one line of the stepper, and no fit evaluates it."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from sim_backend.model.arrays import evaluate
from sim_backend.model.effects import Effect


def evaluate_slope(
    effect: Effect, signals: Mapping[str, np.ndarray], values: Sequence[float], **how: object
) -> np.ndarray:
    """Give the slope of an effect without memory at every sample, shape (n,), rad/rad; otherwise as `evaluate`."""
    assert effect.slope is not None
    assert not effect.memory
    return evaluate(dataclasses.replace(effect, function=effect.slope, slope=None), signals, values, **how)

"""The plant's kernel for one set of effects: one flat generated module of the stepper and the effects' functions."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim_backend.errors import ModelError
from sim_backend.model import constants, drive_loop, effect_sums, rim, springs, stepper
from sim_backend.model.compiler import load
from sim_backend.model.effects import ActiveEffect, Effect, Enters
from sim_backend.model.source import definitions, function_source

SIGNALS = (
    "time",
    "motor_position",
    "motor_velocity",
    "motor_torque",
    "output_position",
    "output_velocity",
    "output_torque",
    "temperature",
    "motor_temperature",
)
"""Signals that an effect in the plant may take, in the order in which the stepper passes them."""

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Kernel:
    """`advance(steps, state, inputs, constants, effect_parameters)` and the effects' sums, with their parameters.

    The sums take the signals in the order of SIGNALS and `effect_parameters`.
    """

    advance: Callable[[int, Array, Array, Array, Array], None]
    torsion_effects: Callable[..., tuple[float, float]]
    motor_effects: Callable[..., float]
    output_effects: Callable[..., float]
    effect_parameters: Array


def plant_kernel(effects: Sequence[ActiveEffect], *, compiled: bool = True) -> Kernel:
    """Give the kernel for these effects, compiled on first use and then from the user's cache.

    Raises ModelError if an effect takes a signal that the plant does not have, or enters where the plant cannot.
    """
    body = kernel_source([active.effect for active in effects])
    module: Any = load("The plant of a simulated bench", body, compiled=compiled)
    values = [value for active in effects for value in active.values]
    return Kernel(
        module.advance,
        module.torsion_effects,
        module.motor_effects,
        module.output_effects,
        np.array(values or [0.0], dtype=np.float64),
    )


def kernel_source(effects: Sequence[Effect]) -> str:
    """Give the source of everything the kernel consists of; it depends on the effects, not on their values."""
    parts = [
        definitions(constants, "unpack", "derive"),
        _unpack(),
        definitions(springs),
        definitions(rim),
        definitions(drive_loop),
    ]
    calls: dict[Enters, list[str]] = {Enters.TORSION: [], Enters.MOTOR_BALANCE: [], Enters.OUTPUT_BALANCE: []}
    slopes = []
    place = 0
    for number, effect in enumerate(effects):
        if effect.enters not in calls:
            raise ModelError(f"{effect.id} enters the {effect.enters}, which the plant cannot simulate.")
        unknown = [name for name in effect.signals if name not in SIGNALS]
        if unknown:
            raise ModelError(
                f"{effect.id} takes {', '.join(unknown)}, which the plant does not have; it has {', '.join(SIGNALS)}."
            )
        arguments = [*effect.signals, *(f"effect_parameters[{place + i}]" for i in range(len(effect.parameters)))]
        place += len(effect.parameters)
        parts.append(function_source(effect.function, f"effect_{number}"))
        calls[effect.enters].append(f"effect_{number}({', '.join(arguments)})")
        if effect.slope is not None:
            parts.append(function_source(effect.slope, f"effect_{number}_slope"))
            slopes.append(f"effect_{number}_slope({', '.join(arguments)})")
    parts += [
        _sum("torsion_effects", f"{_total(calls[Enters.TORSION])}, {_total(slopes)}"),
        _sum("motor_effects", _total(calls[Enters.MOTOR_BALANCE])),
        _sum("output_effects", _total(calls[Enters.OUTPUT_BALANCE])),
        definitions(stepper),
    ]
    return "\n\n".join(parts)


def _total(calls: Sequence[str]) -> str:
    return " + ".join(["0.0", *calls])


def _sum(name: str, value: str) -> str:
    if name not in vars(effect_sums):
        raise ModelError(f"the stepper calls no {name}().")
    return f"@compiled\ndef {name}({', '.join(SIGNALS)}, effect_parameters):\n    return {value}"


def _unpack() -> str:
    """Give an `unpack` that numba can compile: one index per constant."""
    places = ", ".join(f"values[{i}]" for i in range(len(constants.Constants._fields)))
    return f"@compiled\ndef unpack(values):\n    return Constants({places})"

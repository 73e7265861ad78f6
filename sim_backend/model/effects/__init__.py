"""The effect catalogue: one file an effect, one line here."""

from collections.abc import Mapping
from types import MappingProxyType

from sim_backend.model.effects import cogging, gravity_load, kinematic_error
from sim_backend.model.effects.effect import ActiveEffect, Effect, Energy, Enters, Parameter, Shape

__all__ = ["CATALOGUE", "ActiveEffect", "Effect", "Energy", "Enters", "Parameter", "Shape"]

CATALOGUE: Mapping[str, Effect] = MappingProxyType(
    {
        effect.id: effect
        for effect in (
            kinematic_error.EFFECT,
            cogging.EFFECT,
            gravity_load.EFFECT,
        )
    }
)

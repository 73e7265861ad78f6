"""Temperature-dependent friction: the lubricant thins out as it warms up.

    friction += base_friction * (exp(-amplitude * (temperature - reference)) - 1)        N*m at the motor

base_friction: T_c + b |motor_velocity| of the base model, which holds at the reference temperature.
Source: Wolf & Iskandar, ICRA 2018; makers' no-load curves.
"""

import math

from sim_backend.model.effects.effect import Effect, Energy, Enters, Parameter, Shape


def temperature_dependent_friction(
    temperature: float, base_friction: float, amplitude: float, reference: float
) -> float:
    """Give what is added to the friction level, N*m at the motor."""
    return base_friction * math.expm1(-amplitude * (temperature - reference))


EFFECT = Effect(
    id="temperature-dependent-friction",
    summary="friction falls as the drive warms up",
    equation="friction += base_friction * (exp(-amplitude * (temperature - reference)) - 1)",
    source="Wolf & Iskandar 2018; makers' no-load curves",
    enters=Enters.FRICTION,
    variable="temperature",
    shape=Shape.PRODUCT,
    unit="N*m",
    parameters=(
        Parameter("amplitude", "1/K", -0.5, 0.5, 0.04, (0.02, 0.06), "relative fall of the friction per kelvin"),
        Parameter("reference", "degC", -273.15, 1e3, 25.0, (15.0, 30.0), "temperature of the base model", known=True),
    ),
    amplitudes=("amplitude",),
    function=temperature_dependent_friction,
    energy=Energy.DISSIPATIVE,
    shows=("starting-torque", "free-run"),
    confusable=("torque-constant-error", "viscous-friction"),
    separated_by="soak at two temperatures, then return to the first: running-in stays, temperature comes back",
    linear=False,
)

"""Stribeck friction: dry friction falls as the speed builds up a film of lubricant.

    friction += amplitude * exp(-(|motor_velocity| / velocity)^exponent)        N*m at the motor; amplitude = T_s - T_c

Source: Armstrong-Helouvry, Dupont & Canudas de Wit, Automatica 30 (1994) 1083-1138.
"""

import math

from sim_backend.model.effects.effect import Effect, Energy, Enters, Parameter, Shape


def stribeck_friction(motor_velocity: float, amplitude: float, velocity: float, exponent: float) -> float:
    """Give what is added to the friction level, N*m at the motor."""
    return amplitude * math.exp(-((abs(motor_velocity) / velocity) ** exponent))


EFFECT = Effect(
    id="stribeck-friction",
    summary="friction falls with the speed before it grows",
    equation="friction += amplitude * exp(-(|motor_velocity| / velocity)^exponent)",
    source="Armstrong-Helouvry et al. 1994; usual amplitude derived: T_s/T_c of 1.1 to 2 with T_c = 12 mN*m",
    enters=Enters.FRICTION,
    variable="motor_velocity",
    shape=Shape.STATIC,
    unit="N*m",
    parameters=(
        Parameter("amplitude", "N*m", 0.0, 1e3, 6e-3, (1.2e-3, 1.2e-2), "static less kinetic friction, at the motor"),
        Parameter("velocity", "rad/s", 1e-6, 1e5, 5.0, (1.0, 20.0), "Stribeck velocity, at the motor"),
        Parameter("exponent", "1", 0.01, 100.0, 1.0, (0.5, 2.0), "shape"),
    ),
    amplitudes=("amplitude",),
    function=stribeck_friction,
    energy=Energy.DISSIPATIVE,
    shows=("free-run", "starting-torque"),
    confusable=("coulomb-friction", "viscous-friction", "cogging"),
    separated_by="six or more speeds, some below the Stribeck velocity; means over whole motor turns",
)

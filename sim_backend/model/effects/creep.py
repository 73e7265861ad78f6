"""Creep: viscoelastic relaxation of the flexspline; it yields further while the torque stays.

    torsion += amplitude * lag(output_torque; time_constant) / stiffness        rad at the output

lag(u; tau): tau dx/dt + x = u, solved exactly for a torque that runs straight between two calls. A spring and a damper
side by side (Kelvin-Voigt), in series with the base model's springs. Source: linear viscoelasticity.
"""

from sim_backend.model.effects.effect import Effect, Energy, Enters, Memory, Parameter, Shape
from sim_backend.model.effects.operators import lag


def creep(
    output_torque: float, step: float, memory: Memory, amplitude: float, time_constant: float, stiffness: float
) -> float:
    """Angle added to the torsion, rad. memory: the lagging torque, the torque before, started."""
    if memory[2] == 0.0:
        memory[0], memory[1], memory[2] = output_torque, output_torque, 1.0
    memory[0] = lag(memory[0], memory[1], output_torque, step, time_constant)
    memory[1] = output_torque
    return amplitude * memory[0] / stiffness


EFFECT = Effect(
    id="creep",
    summary="flexspline yields further while the torque stays",
    equation="torsion += amplitude * lag(output_torque; time_constant) / stiffness",
    source="linear viscoelasticity (Kelvin-Voigt element)",
    enters=Enters.TORSION,
    variable="output_torque",
    shape=Shape.LAG,
    unit="rad",
    parameters=(
        Parameter("amplitude", "1", 0.0, 10.0, 0.03, (0.01, 0.05), "share of the elastic torsion that comes late"),
        Parameter("time_constant", "s", 0.0, 1e6, 20.0, (1.0, 100.0), "time in which 63 % of it have come"),
        Parameter("stiffness", "N*m/rad", 1e-3, 1e9, 8336.0, (5e3, 2e4), "K_F0 of the flexspline", known=True),
    ),
    amplitudes=("amplitude",),
    function=creep,
    energy=Energy.DISSIPATIVE,
    shows=("locked-output", "backdrive"),
    confusable=(
        "channel-delay",
        "torque-sensor-lag",
        "rate-dependent-hysteresis",
        "maxwell-slip",
        "torque-sensor-drift",
        "thermal-expansion",
        "temperature-dependent-stiffness",
        "viscous-friction",
    ),
    separated_by="step and hold for five time constants; a dead weight held on the torque sensor alone",
    memory=3,
)

"""Thermal expansion: mount and drive change their geometry as they warm up.

    torsion += amplitude * (lag(temperature; time_constant) - reference)        rad at the output

lag(u; tau): tau dx/dt + x = u, solved exactly for a temperature that runs straight between two calls; it starts
settled. No torque enters. Source: thermal expansion with the mount's own time constant.
"""

from sim_backend.model.effects.effect import Effect, Energy, Enters, Memory, Parameter, Shape
from sim_backend.model.effects.operators import lag


def thermal_expansion(
    temperature: float, step: float, memory: Memory, amplitude: float, time_constant: float, reference: float
) -> float:
    """Angle added to the torsion, rad. memory: the lagging temperature, the temperature before, started."""
    if memory[2] == 0.0:
        memory[0], memory[1], memory[2] = temperature, temperature, 1.0
    memory[0] = lag(memory[0], memory[1], temperature, step, time_constant)
    memory[1] = temperature
    return amplitude * (memory[0] - reference)


EFFECT = Effect(
    id="thermal-expansion",
    summary="mount and drive turn against each other as they warm up",
    equation="torsion += amplitude * (lag(temperature; time_constant) - reference)",
    source="thermal expansion of mount and drive; usual time_constant derived: from the drive alone to drive and mount",
    enters=Enters.TORSION,
    variable="temperature",
    shape=Shape.LAG,
    unit="rad",
    parameters=(
        Parameter("amplitude", "rad/K", -1e-2, 1e-2, 3e-6, (1e-6, 1e-5), "angle per kelvin"),
        Parameter(
            "time_constant", "s", 0.0, 1e6, 300.0, (60.0, 1200.0), "time in which the mount follows the drive by 63 %"
        ),
        Parameter("reference", "degC", -273.15, 1e3, 25.0, (15.0, 30.0), "temperature without it", known=True),
    ),
    amplitudes=("amplitude",),
    function=thermal_expansion,
    energy=Energy.ACTIVE,
    shows=("locked-output (warming up)", "backdrive (warming up)"),
    confusable=("torque-sensor-drift", "creep", "temperature-dependent-stiffness"),
    separated_by="an unloaded run with a heater or after warm-up, with the unloaded torque logged",
    memory=3,
)

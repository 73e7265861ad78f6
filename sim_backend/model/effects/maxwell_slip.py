"""Maxwell slip: distributed dry friction in teeth and bearing; several instances make a stack.

    torsion += amplitude * play(output_torque; radius)        rad at the output
    play(u; r): p = min(max(p_before, u - r), u + r), at rest without torque before the first call

A rate-free loop, odd, with memory of its turning points. Dahl, LuGre, Bouc-Wen and Preisach models give the same
loop: the class can be identified, the name cannot. Source: Iwan, J. Appl. Mech. 33 (1966) 893-900.
"""

from sim_backend.model.effects.effect import Effect, Energy, Enters, Memory, Parameter, Shape
from sim_backend.model.effects.operators import play


def maxwell_slip(output_torque: float, step: float, memory: Memory, amplitude: float, radius: float) -> float:
    """Angle added to the torsion, rad. memory: the play."""
    memory[0] = play(memory[0], output_torque, radius)
    return amplitude * memory[0]


EFFECT = Effect(
    id="maxwell-slip",
    summary="hysteresis that does not depend on the rate, from dry friction in teeth and bearing",
    equation="torsion += amplitude * play(output_torque; radius)",
    source="Iwan 1966",
    enters=Enters.TORSION,
    variable="output_torque",
    shape=Shape.HYSTERETIC,
    unit="rad",
    parameters=(
        Parameter("amplitude", "rad/(N*m)", 0.0, 1.0, 5e-6, (1e-6, 1e-5), "compliance while it slips"),
        Parameter("radius", "N*m", 0.0, 1e5, 2.0, (1.0, 5.0), "torque at which it slips"),
    ),
    amplitudes=("amplitude",),
    function=maxwell_slip,
    energy=Energy.DISSIPATIVE,
    shows=("locked-output", "backdrive"),
    confusable=(
        "wave-generator-compliance",
        "coulomb-friction",
        "rate-dependent-hysteresis",
        "creep",
        "backlash",
        "torque-sensor-nonlinearity",
    ),
    separated_by="the same loop at three rates; nested reversals at three or more amplitudes; motion without torque",
    memory=1,
)

"""Rate-dependent hysteresis: a friction loop that opens with the rate.

    torsion += amplitude * play(lag(output_torque; time_constant); radius)        rad at the output
    lag(u; tau): tau dx/dt + x = u;  play(u; r): p = min(max(p_before, u - r), u + r)

The lag is exact for a torque that runs straight between two calls and starts settled; the play starts at rest without
torque. Source: Maxwell slip (Iwan 1966) behind a viscous layer.
Left out: a level that grows with the logarithm of the torque's rate.
"""

from sim_backend.model.effects.effect import Effect, Energy, Enters, Memory, Parameter, Shape
from sim_backend.model.effects.operators import lag, play


def rate_dependent_hysteresis(
    output_torque: float, step: float, memory: Memory, amplitude: float, radius: float, time_constant: float
) -> float:
    """Angle added to the torsion, rad. memory: the lagging torque, the torque before, the play, started."""
    if memory[3] == 0.0:
        memory[0], memory[1], memory[3] = output_torque, output_torque, 1.0
    memory[0] = lag(memory[0], memory[1], output_torque, step, time_constant)
    memory[1] = output_torque
    memory[2] = play(memory[2], memory[0], radius)
    return amplitude * memory[2]


EFFECT = Effect(
    id="rate-dependent-hysteresis",
    summary="friction loop that opens with the rate",
    equation="torsion += amplitude * play(lag(output_torque; time_constant); radius)",
    source="Maxwell slip behind a viscous layer; usual time_constant derived: radius over 4 N*m/s",
    enters=Enters.TORSION,
    variable="output_torque",
    shape=Shape.RATE,
    unit="rad",
    parameters=(
        Parameter("amplitude", "rad/(N*m)", 0.0, 1.0, 5e-6, (1e-6, 1e-5), "compliance while it slips"),
        Parameter("radius", "N*m", 0.0, 1e5, 2.0, (1.0, 5.0), "torque at which it slips"),
        Parameter("time_constant", "s", 0.0, 1e6, 0.5, (0.25, 1.25), "delay of the torque that it feels"),
    ),
    amplitudes=("amplitude",),
    function=rate_dependent_hysteresis,
    energy=Energy.DISSIPATIVE,
    shows=("locked-output", "backdrive"),
    confusable=("channel-delay", "torque-sensor-lag", "viscous-friction", "creep", "maxwell-slip"),
    separated_by="a ladder of at least four rates over a decade: delay and lag grow exactly with the rate",
    memory=4,
)

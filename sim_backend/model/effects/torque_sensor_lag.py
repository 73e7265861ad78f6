"""Torque-sensor lag: the transducer's amplifier filters.

    output_torque reads lag(output_torque; time_constant) - output_torque more        N*m at the output
    lag(u; tau): tau dx/dt + x = u

For slow ramps -time_constant times the torque's rate. Solved exactly for a torque that runs straight between two calls;
starts settled. Source: first-order low-pass.
"""

from sim_backend.model.effects.effect import Effect, Energy, Enters, Memory, Parameter, Shape
from sim_backend.model.effects.operators import lag


def torque_sensor_lag(output_torque: float, step: float, memory: Memory, time_constant: float) -> float:
    """Torque added to the reading, N*m. memory: the lagging torque, the torque before, started."""
    if memory[2] == 0.0:
        memory[0], memory[1], memory[2] = output_torque, output_torque, 1.0
    memory[0] = lag(memory[0], memory[1], output_torque, step, time_constant)
    memory[1] = output_torque
    return memory[0] - output_torque


EFFECT = Effect(
    id="torque-sensor-lag",
    summary="torque transducer follows late, and damps what is fast",
    equation="output_torque reads lag(output_torque; time_constant) - output_torque more",
    source="first-order low-pass",
    enters=Enters.READING,
    variable="output_torque",
    shape=Shape.RATE,
    unit="N*m",
    parameters=(Parameter("time_constant", "s", 0.0, 10.0, 5e-3, (1e-3, 3e-2), "of the low-pass"),),
    amplitudes=("time_constant",),
    function=torque_sensor_lag,
    energy=Energy.NONE,
    shows=("locked-output (fast)",),
    confusable=("channel-delay", "creep", "rate-dependent-hysteresis", "viscous-friction"),
    separated_by="a chirp: a lag rolls off, a delay keeps its gain; a ladder of rates against the others",
    linear=False,
    memory=3,
    reads="output_torque",
)

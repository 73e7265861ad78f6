"""Channel delay: the torque channel comes late.

    output_torque reads output_torque(t - delay) - output_torque(t) more        N*m at the output

Before the first call the torque was what it is then. The past is kept in a ring of samples, spread over the delay where
it has more steps than the ring has places (256), and read by straight lines in between. The step must stay the same.
Source: transport delay of buses, filters and unequal clocks.
Left out: clocks that run apart, and other channels than the torque.
"""

import math

from sim_backend.model.effects.effect import Effect, Energy, Enters, Memory, Parameter, Shape


def channel_delay(output_torque: float, step: float, memory: Memory, delay: float) -> float:
    """Torque added to the reading, N*m. memory: number of calls, then the ring."""
    if delay <= 0.0:
        return 0.0
    places = memory.size - 1
    calls = memory[0]
    spacing = max(1.0, math.ceil(delay / (step * (places - 2))))
    if calls % spacing == 0.0:
        memory[1 + int(calls / spacing) % places] = output_torque
    memory[0] = calls + 1.0
    behind = max(calls - delay / step, 0.0) / spacing
    left = int(behind)
    earlier, later = memory[1 + left % places], memory[1 + (left + 1) % places]
    return earlier + (later - earlier) * (behind - left) - output_torque


EFFECT = Effect(
    id="channel-delay",
    summary="torque channel comes late",
    equation="output_torque reads output_torque(t - delay) - output_torque(t) more",
    source="transport delay",
    enters=Enters.READING,
    variable="output_torque",
    shape=Shape.RATE,
    unit="N*m",
    parameters=(Parameter("delay", "s", 0.0, 0.1, 0.01, (1e-4, 5e-2), "by which the torque is late"),),
    amplitudes=("delay",),
    function=channel_delay,
    energy=Energy.NONE,
    shows=("locked-output", "backdrive", "free-run (loaded)"),
    confusable=("torque-sensor-lag", "creep", "rate-dependent-hysteresis", "viscous-friction"),
    separated_by="a ladder of rates; a sync pulse on both channels at start and end",
    linear=False,
    memory=257,
    reads="output_torque",
)

"""Structural resonance: frame, torque cell or lever ring when the torque's rate jumps, as at a reversal.

    output_position reads x more:  x'' + 2 damping w x' + w^2 x = amplitude * w * output_torque'',  w = 2 pi frequency

output_torque is the transducer's, the only torque on the frame that is measured: where it stays the same, as in a free
run at constant load, nothing rings, although a frame can be shaken there too. A jump of its rate by 1 N*m/s starts a
decaying sine of size `amplitude`. Between two calls the torque runs straight, so that its second derivative is a kick
at each call and x swings freely in between, which is solved exactly. Starts at rest.
Source: linear vibration of one mode.
Left out: a frame that the motor or an order of the gear shakes, which a ladder of speeds in a free run would show.
"""

import math

from sim_backend.model.effects.effect import Effect, Energy, Enters, Memory, Parameter, Shape


def structural_resonance(
    output_torque: float, step: float, memory: Memory, amplitude: float, frequency: float, damping: float
) -> float:
    """Angle added to the reading, rad.

    memory: swing per amplitude, its speed, torque and rate before, step, frequency and damping, and the decaying
    cosine and sine of a step of these.
    """
    w = 2.0 * math.pi * frequency
    if memory[4] != step or memory[5] != frequency or memory[6] != damping:
        if memory[4] == 0.0:
            memory[2] = output_torque
        ringing = w * math.sqrt(1.0 - damping * damping)
        decay = math.exp(-damping * w * step)
        memory[4], memory[5], memory[6] = step, frequency, damping
        memory[7], memory[8] = decay * math.cos(ringing * step), decay * math.sin(ringing * step) / ringing
    cosine, sine = memory[7], memory[8]
    rate = (output_torque - memory[2]) / step
    swing, speed = memory[0], memory[1] + w * (rate - memory[3])
    memory[0] = swing * (cosine + damping * w * sine) + speed * sine
    memory[1] = speed * (cosine - damping * w * sine) - swing * w * w * sine
    memory[2], memory[3] = output_torque, rate
    return amplitude * memory[0]


EFFECT = Effect(
    id="structural-resonance",
    summary="frame, torque cell or lever ring after a reversal",
    equation="output_position reads x more, "
    "x'' + 2 damping w x' + w^2 x = amplitude * w * output_torque'', w = 2 pi frequency",
    source="linear vibration of one mode; usual amplitude derived: 1e-6 to 1e-4 rad after a reversal at 4 N*m/s",
    enters=Enters.READING,
    variable="time",
    shape=Shape.PERIODIC,
    unit="rad",
    parameters=(
        Parameter(
            "amplitude",
            "rad*s/(N*m)",
            -1.0,
            1.0,
            1e-5,
            (1.25e-7, 1.25e-5),
            "size of the ringing per jump of the torque's rate",
        ),
        Parameter("frequency", "Hz", 1e-3, 1e5, 12.0, (0.5, 600.0), "w / (2 pi)"),
        Parameter("damping", "1", 0.0, 0.99, 0.02, (0.01, 0.05), "damping ratio"),
    ),
    amplitudes=("amplitude",),
    function=structural_resonance,
    energy=Energy.NONE,
    shows=("locked-output", "backdrive"),
    confusable=("kinematic-error", "inertia"),
    separated_by="sweeps at several rates: the ringing after a reversal keeps its frequency, orders move with the rate",
    memory=9,
    reads="output_position",
)

"""Missed encoder counts: the motor encoder's counter is suddenly wrong by some counts, and stays so.

    motor_position reads 2 pi / encoder_counts * amplitude * (sum of +1 or -1, one at each event) more

Events come at random times, `rate` of them per second on average (exponential waiting times); the first call has none.
The same seed gives the same events, whatever the step: Lehmer's generator x -> 16807 x mod (2^31 - 1), which is exact
in double precision. Source: Park & Miller, Commun. ACM 31 (1988) 1192-1201 for the generator.
Left out: the output encoder.
"""

import math

from sim_backend.model.effects.effect import Effect, Energy, Enters, Memory, Parameter, Shape


def encoder_missed_counts(
    time: float, step: float, memory: Memory, amplitude: float, rate: float, seed: float, encoder_counts: float
) -> float:
    """Angle added to the reading, rad at the motor. memory: sum of the events, time of the next, generator, started."""
    if memory[3] == 0.0:
        memory[2] = 1.0 + math.floor(seed) % 2147483646.0
        for _ in range(8):  # seeds next to each other give first numbers next to each other
            memory[2] = 16807.0 * memory[2] % 2147483647.0
        memory[1] = time
    while rate > 0.0 and memory[1] <= time:
        if memory[3] != 0.0:
            memory[2] = 16807.0 * memory[2] % 2147483647.0
            memory[0] += 1.0 if memory[2] < 1073741823.5 else -1.0
        memory[2] = 16807.0 * memory[2] % 2147483647.0
        memory[1] -= math.log(memory[2] / 2147483647.0) / rate
        memory[3] = 1.0
    memory[3] = 1.0
    return amplitude * memory[0] * 2.0 * math.pi / encoder_counts


EFFECT = Effect(
    id="encoder-missed-counts",
    summary="counter of the motor encoder jumps at random times",
    equation="motor_position reads 2 pi / encoder_counts * amplitude * (sum of +1 or -1, rate of them a second) more",
    source="incremental encoders under disturbance; usual rate derived: 0 to 10 events in a run of 100 s",
    enters=Enters.READING,
    variable="time",
    shape=Shape.EVENT,
    unit="rad",
    parameters=(
        Parameter("amplitude", "counts", 0.0, 1e6, 4.0, (1.0, 100.0), "counts per event"),
        Parameter("rate", "1/s", 0.0, 1e3, 0.05, (0.0, 0.1), "events per second, on average"),
        Parameter(
            "seed", "1", 0.0, 2147483645.0, 1.0, (0.0, 2147483645.0), "draws times and signs of the events", known=True
        ),
        Parameter("encoder_counts", "1/rev", 1.0, 1e9, 16384.0, (1e3, 1e5), "counts per motor turn", known=True),
    ),
    amplitudes=("amplitude",),
    function=encoder_missed_counts,
    energy=Energy.NONE,
    shows=("starting-torque", "locked-output", "backdrive", "free-run"),
    confusable=("backlash",),
    separated_by="many replicates, as it does not repeat; "
    "index pulse or absolute encoder against a coupling that slips",
    memory=4,
    reads="motor_position",
)

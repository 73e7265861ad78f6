"""Backlash: a gap in the coupling between motor shaft and wave generator.

    torsion += amplitude / ratio * s,  s = (motor_position - play(motor_position; amplitude)) / amplitude in [-1, 1]

amplitude is half of the gap, rad at the motor. The shaft turns by s within the gap before the wave generator follows
it, so that e = (motor_position - play) / ratio; it starts in the middle. Inside the gap the shaft turns free of the
load: the slope de/dmotor_position = 1/ratio gives the motor back all the torque that the load asks for; at the ends of
the gap the slope is 0. What the load does on e, the motor gets, so that nothing is lost.
Source: the play operator; Oldham and key couplings, loose encoder couplings.
"""

from sim_backend.model.effects.effect import Effect, Energy, Enters, Memory, Parameter, Shape


def backlash(motor_position: float, step: float, memory: Memory, amplitude: float, ratio: float) -> float:
    """Angle added to the torsion, rad. memory: the wave generator, whether the shaft is in the gap, started."""
    if memory[2] == 0.0:
        memory[0], memory[2] = motor_position, 1.0
    memory[1] = 1.0 if abs(motor_position - memory[0]) < amplitude else 0.0
    memory[0] = min(max(memory[0], motor_position - amplitude), motor_position + amplitude)
    return (motor_position - memory[0]) / ratio


def backlash_slope(motor_position: float, step: float, memory: Memory, amplitude: float, ratio: float) -> float:
    """Give the derivative with respect to the shaft's angle, rad/rad."""
    return memory[1] / ratio


EFFECT = Effect(
    id="backlash",
    summary="gap in the coupling of the motor shaft",
    equation="torsion += (motor_position - play(motor_position; amplitude)) / ratio",
    source="play operator; couplings with a gap",
    enters=Enters.TORSION,
    variable="motor_position",
    shape=Shape.HYSTERETIC,
    unit="rad",
    parameters=(
        Parameter("amplitude", "rad", 0.0, 1.0, 1e-3, "half of the gap, at the motor"),
        Parameter("ratio", "1", 1.0, 1e4, 100.0, "gear ratio", known=True),
    ),
    amplitudes=("amplitude",),
    function=backlash,
    energy=Energy.CONSERVATIVE,
    shows=("locked-output", "backdrive", "free-run"),
    confusable=(
        "soft-windup",
        "wave-generator-compliance",
        "maxwell-slip",
        "coulomb-friction",
        "encoder-missed-counts",
    ),
    separated_by="a bias torque removes it; reversals of a free run (motion without torque) against backdrive",
    linear=False,
    slope=backlash_slope,
    memory=3,
)

"""Backlash: a gap in the coupling between motor shaft and wave generator.

    torsion += amplitude / ratio * s,  s = motor_torque / contact within [-1, 1]

amplitude is half of the gap, rad at the motor. The gap carries the torque of the wave generator (motor_torque at rest)
and stands on the side that this torque presses on; `contact` is the torque at which it is closed. A spring in series
with the wave generator, without memory, so that the plant can invert it: it takes no energy. In a locked sweep it is
crossed with the sign of the torque, in a free run with the direction of turning, whose friction presses it, and a bias
torque keeps it closed.
Source: Oldham and key couplings, dead zone.
Left out: the memory of the gap, in which the shaft stays where it was left while nothing presses it, and a loose
coupling of the encoder, a loop of the reading against motion.
"""

from sim_backend.model.effects.effect import Effect, Energy, Enters, Parameter, Shape


def backlash(motor_torque: float, amplitude: float, contact: float, ratio: float) -> float:
    """Angle added to the torsion, rad; motor_torque: that in the wave generator, N*m."""
    return amplitude / ratio * min(max(motor_torque / contact, -1.0), 1.0)


EFFECT = Effect(
    id="backlash",
    summary="gap in the coupling of the motor shaft",
    equation="torsion += amplitude / ratio * clip(motor_torque / contact, -1, 1)",
    source="dead zone; couplings with a gap",
    enters=Enters.TORSION,
    variable="motor_torque",
    shape=Shape.STATIC,
    unit="rad",
    parameters=(
        Parameter("amplitude", "rad", 0.0, 1.0, 1e-3, (1e-4, 1e-2), "half of the gap, at the motor"),
        Parameter(
            "contact", "N*m", 1e-6, 10.0, 1e-3, (1e-4, 1e-2), "torque that closes the gap, at the motor", known=True
        ),
        Parameter("ratio", "1", 1.0, 1e4, 100.0, (30.0, 320.0), "gear ratio", known=True),
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
)

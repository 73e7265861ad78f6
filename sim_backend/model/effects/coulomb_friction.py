"""Coulomb friction: the dry friction of the mesh, with pre-sliding; a play between the torques of both sides.

    output_torque = play(ratio * motor_torque; ratio * T_fs)        N*m at the output, locked output
    play(u; r): p = min(max(p_before, u - r), u + r)

The play starts at rest without torque. Backdrive is the same law from the other side, motor_torque =
play(output_torque / ratio; T_fb / ratio), which equals equation (36) with its sign and inequality corrected; in a free
run it is a torque against the speed. Source: Zhang, Ahmad & Liu 2014, figures 4 to 6 and equation (36).
Left out: a backdriving torque that is not the ratio times the starting torque.
"""

from sim_backend.model.effects.effect import Effect, Energy, Enters, Memory, Parameter, Shape
from sim_backend.model.effects.operators import play


def coulomb_friction(motor_torque: float, step: float, memory: Memory, T_fs: float, ratio: float) -> float:
    """Give the torque that gets through the mesh, N*m at the output. memory: the play."""
    memory[0] = play(memory[0], ratio * motor_torque, ratio * T_fs)
    return memory[0]


EFFECT = Effect(
    id="coulomb-friction",
    summary="dry friction of the mesh: starting torque, backdriving torque, half of the loop's width",
    equation="output_torque = play(ratio * motor_torque; ratio * T_fs)",
    source="Zhang, Ahmad & Liu 2014, figures 4 to 6, (36) corrected; usual T_fs derived: around 12 and 29 mN*m",
    enters=Enters.BASE,
    variable="motor_torque",
    shape=Shape.HYSTERETIC,
    unit="N*m",
    parameters=(
        Parameter("T_fs", "N*m", 0.0, 1e3, 0.012, (5e-3, 3e-2), "starting torque, at the motor"),
        Parameter("ratio", "1", 1.0, 1e4, 100.0, (30.0, 320.0), "gear ratio", known=True),
    ),
    amplitudes=(),
    function=coulomb_friction,
    energy=Energy.DISSIPATIVE,
    shows=("starting-torque", "locked-output", "backdrive", "free-run"),
    confusable=(
        "wave-generator-compliance",
        "maxwell-slip",
        "backlash",
        "viscous-friction",
        "stribeck-friction",
        "load-dependent-friction",
    ),
    separated_by="a ladder of speeds for what depends on speed; nested reversals and a load ladder for the loop",
    linear=False,
    memory=1,
)

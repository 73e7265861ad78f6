"""What procedures may know of a bench and the device on it before anything moves."""

from drivers.errors import ConfigError, Mistake
from procedures.plan import BenchFacts
from rig.config.bench import BenchFile, Lock
from rig.config.dut import Dut, Gear, Rotation

STARTING_SHARE = 0.1
"""Starting torque in shares of rated torque / ratio, where the dut file names none (0.075 on the shipped drive)."""

BACKDRIVING_SHARE = 1.7
"""Backdriving torque in starting torques times the ratio, where the dut file names none; as on the shipped drive."""

MOTOR_COUNTS = 16384
"""Motor encoder counts per revolution where the dut file names none; the drives do not tell."""

HYSTERESIS_LOSS = 1.8e-4
"""rad at the output where the dut file names none; catalogues state 0.6 to 2 arc minutes."""

MOTOR_INERTIA, INERTIA_TORQUE = 2.2e-5, 0.16
"""Rotor, kg*m^2, of a motor for so much rated torque (N*m); others scale with torque^(5/3), as bodies of one shape."""


def bench_facts(bench: BenchFile, dut: Dut) -> BenchFacts:
    """Give what procedures may know of bench and device; what the dut lacks is guessed and named in `assumed`.

    Raises ConfigError if the dut lacks what they all scale by: ratio and rated torque.
    """
    gear, limits = dut.gear, bench.limits.frozen()
    missing = [
        Mistake(f"gear.{name}", None, f"missing; it scales torques and speeds of the procedures: {Gear.wanted(name)}")
        for name in ("ratio", "rated_torque")
        if getattr(gear, name) is None
    ]
    if gear.ratio is None or gear.rated_torque is None:
        raise ConfigError(f"dut '{dut.name}'", missing)
    assumed: list[str] = []

    def known(path: str, value: float | None, guess: float, unit: str) -> float:
        if value is None:
            assumed.append(f"{path} = {guess:.6g} {unit} for the procedures (not in the dut file)")
        return guess if value is None else value

    starting_guess = STARTING_SHARE * gear.rated_torque / gear.ratio
    starting = known("gear.starting_torque", gear.starting_torque, starting_guess, "N*m")
    backdriving_guess = BACKDRIVING_SHARE * starting * gear.ratio
    loss = known("gear.hysteresis_loss", gear.hysteresis_loss, HYSTERESIS_LOSS, "rad")
    inertia_guess = MOTOR_INERTIA * (gear.rated_torque / gear.ratio / INERTIA_TORQUE) ** (5 / 3)
    return BenchFacts(
        ratio=gear.ratio,
        rated_torque=gear.rated_torque,
        starting_torque=starting,
        backdriving_torque=known("gear.backdriving_torque", gear.backdriving_torque, backdriving_guess, "N*m"),
        # Zhang, Ahmad & Liu 2014, equation (33)
        wave_generator_stiffness=2.0 * starting / (gear.ratio * loss),
        motor_inertia=known("motor.inertia", dut.motor.inertia, inertia_guess, "kg*m^2"),
        motor_counts=round(known("motor.encoder_counts", dut.motor.encoder_counts, MOTOR_COUNTS, "per revolution")),
        cycle_time=bench.cycle_time,
        limits=limits,
        has_load_drive="load" in bench.devices,
        has_lock=bench.fixture.lock is not Lock.NONE,
        has_output_encoder="output_encoder" in bench.devices,
        has_torque_sensor="torque_sensor" in bench.devices,
        opposed=gear.rotation is Rotation.OPPOSED,
        assumed=tuple(assumed),
    )

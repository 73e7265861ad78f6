"""The plant alone: steps per second on one core, in one call and in calls of one control cycle, against real time.

Against the same plant in C: `effects`.
"""

import time

from sim_backend.model.effects import CATALOGUE, ActiveEffect, Enters
from sim_backend.model.parameters import HarmonicDrive, PlantConfig
from sim_backend.plant import Plant
from sim_backend.ports import AxisMode

DRIVE = HarmonicDrive.from_catalogue(
    100.0, K1=8.4e3, K2=9.4e3, T1=3.9, T2=12.0, hysteresis_loss=1.8e-4, starting_torque=0.012, viscous_friction=1.2e-4
)
SECONDS = 10.0
CYCLE = 1e-3
ROUNDS = 3


def prepared(effects: tuple[ActiveEffect, ...], *, locked: bool, compiled: bool = True) -> Plant:
    plant = Plant(PlantConfig(DRIVE), effects, compiled=compiled)
    plant.set_lock(locked)
    if locked:
        plant.command("motor", AxisMode.TORQUE, 0.1)
    else:
        plant.command("motor", AxisMode.VELOCITY, 50.0)
    plant.advance_to(0.01)
    return plant


def rate(plant: Plant, seconds: float, cycle: float, *, read: bool = False) -> float:
    """Million steps per second of processor time, best of three."""
    best = 0.0
    for _ in range(ROUNDS):
        start, begin = plant.time, time.process_time()
        for k in range(1, round(seconds / cycle) + 1):
            plant.advance_to(start + k * cycle)
            if read:
                plant.read()
        best = max(best, seconds / plant.config.step / (time.process_time() - begin) / 1e6)
    return best


def main() -> None:
    every = tuple(
        ActiveEffect(effect, tuple(p.typical for p in effect.parameters))
        for effect in CATALOGUE.values()
        if effect.enters is not Enters.BASE
    )
    error = every[:1]
    real_time = 1.0 / PlantConfig(DRIVE).step / 1e6
    print("                                    million steps/s   times real time")
    for name, effects, locked in (
        ("base, free run", (), False),
        ("base, locked", (), True),
        ("kinematic error, free run", error, False),
        ("every effect, free run", every, False),
    ):
        for how, cycle, read in (("one call", SECONDS, False), ("1 ms", CYCLE, False), ("1 ms and read", CYCLE, True)):
            found = rate(prepared(effects, locked=locked), SECONDS, cycle, read=read)
            print(f"  {name:26s} {how:13s} {found:8.2f} {found / real_time:15.0f}")
    found = rate(prepared((), locked=False, compiled=False), 0.2, CYCLE)
    print(f"  {'base, free run':26s} {'plain Python':13s} {found:8.3f} {found / real_time:15.1f}")
    print("  wanted: base plant 10 in one call, 5 in calls of 1 ms")

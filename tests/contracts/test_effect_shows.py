"""Every procedure that an effect claims to show in does show it; a new entry is covered without being named.

Each run is a short form of the procedure on the simulated bench without noise, with and without the effect.
"""

import dataclasses
from collections.abc import Mapping
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest

from sim_backend.model.effects import CATALOGUE, ActiveEffect, Effect, Enters, Shape
from sim_backend.model.parameters import HarmonicDrive, PlantConfig
from sim_backend.plant import Plant
from sim_backend.ports import AxisMode, PlantReading

DRIVE = HarmonicDrive.from_catalogue(
    100.0, K1=8.4e3, K2=9.4e3, T1=3.9, T2=12.0, hysteresis_loss=1.8e-4, starting_torque=0.012, viscous_friction=1e-4
)
QUIET = {field.name: 0.0 for field in dataclasses.fields(PlantConfig) if field.name.endswith("_noise")}
WARM = PlantConfig(
    DRIVE, output_inertia=5.5e-3, temperature=45.0, motor_temperature=45.0, ambient_temperature=45.0, **QUIET
)
WARMING = dataclasses.replace(WARM, temperature=25.0, gear_heat_capacity=1.0)
"""A gear that warms up by 20 K within the run."""

SEEN = {"torsion": 1e-6, "motor_torque": 1e-5, "output_torque": 1e-3, "motor_position": 4e-4}
"""Smallest rms change that counts: a twelfth of a count of the 19-bit output encoder (rad), a twentieth of the noise of
both torques (N*m), which hundreds of readings resolve, and a count of the motor encoder (rad)."""


class Leg(NamedTuple):
    """Targets of motor and load drive at both ends, straight in between. Load None: its drive is off."""

    seconds: float
    mode: AxisMode
    motor: tuple[float, float]
    load: tuple[float, float] | None = None


class Run(NamedTuple):
    """A procedure's short form: legs, sampling period (s), bench, whether the output is locked."""

    legs: tuple[Leg, ...]
    period: float = 0.01
    config: PlantConfig = WARM
    locked: bool = False


def turning(load: tuple[float, float] | None) -> tuple[Leg, ...]:
    """Turn slowly one way and fast the other."""
    speed = AxisMode.VELOCITY
    return (
        Leg(0.25, speed, (0.0, 25.0), load),
        Leg(1.0, speed, (25.0, 25.0), load),
        Leg(1.25, speed, (25.0, -100.0), load),
        Leg(3.0, speed, (-100.0, -100.0), load),
        Leg(1.0, speed, (-100.0, 0.0), load),
    )


def sweep(rate: float) -> tuple[Leg, ...]:
    """Sweep the motor's torque as far as 12 N*m at the output, at `rate` (N*m/s there)."""
    quarter, torque = 12.0 / rate, AxisMode.TORQUE
    return (
        Leg(quarter, torque, (0.0, 0.12)),
        Leg(2.0 * quarter, torque, (0.12, -0.12)),
        Leg(quarter, torque, (-0.12, 0.0)),
    )


HELD = AxisMode.POSITION
PULLED = (
    Leg(3.0, HELD, (0.0, 0.0), (0.0, 12.0)),
    Leg(6.0, HELD, (0.0, 0.0), (12.0, -12.0)),
    Leg(3.0, HELD, (0.0, 0.0), (-12.0, 0.0)),
)

RUNS: Mapping[str, Run] = {
    "starting-torque": Run(
        (
            Leg(0.6, AxisMode.TORQUE, (0.0, 0.03)),
            Leg(0.3, AxisMode.OFF, (0.0, 0.0)),
            Leg(0.6, AxisMode.TORQUE, (0.0, -0.03)),
        ),
        period=1e-3,
    ),
    "locked-output": Run(sweep(4.0), locked=True),
    "locked-output (fast)": Run(sweep(200.0), period=1e-3, locked=True),
    "locked-output (warming up)": Run(sweep(4.0), config=WARMING, locked=True),
    "backdrive": Run(PULLED),
    "backdrive (warming up)": Run(PULLED, config=WARMING),
    "free-run": Run(turning(None), period=1e-3),
    "free-run (loaded)": Run((Leg(1.0, HELD, (0.0, 0.0), (0.0, 8.0)), *turning((8.0, 8.0))), period=1e-3),
}
"""By what an effect may name in `shows`."""

BASE_CHANGES: Mapping[str, Mapping[str, str]] = {
    "flexspline-compliance": {"K_F0": "drive"},
    "wave-generator-compliance": {"K_w0": "drive"},
    "coulomb-friction": {"friction_torque": "drive"},
    "viscous-friction": {"viscous_friction": "drive"},
    "inertia": {"rotor_inertia": "bench"},
}
"""Of a base term, which is never absent: what is made 20 % larger in its place."""


def typical(effect: Effect, warming: bool) -> ActiveEffect:
    """Typical values; as many events, and where the gear warms up as short a lag, as such a short run can show."""
    values = {p.name: 0.3 if p.name == "phase" else p.typical for p in effect.parameters}
    if effect.shape is Shape.EVENT:
        values["rate"] = 100.0
    if warming and "time_constant" in values:
        values["time_constant"] = 3.0
    return ActiveEffect(effect, tuple(values.values()))


def changed(effect: Effect, config: PlantConfig) -> PlantConfig:
    """Give the bench with 20 % more of a base term."""
    ((name, where),) = BASE_CHANGES[effect.id].items()
    if where == "bench":
        more: dict[str, Any] = {name: 1.2 * getattr(config, name)}
    else:
        more = {"drive": dataclasses.replace(config.drive, **{name: 1.2 * getattr(config.drive, name)})}
    return dataclasses.replace(config, **more)


def recorded(run: Run, config: PlantConfig, *effects: ActiveEffect) -> dict[str, np.ndarray]:
    """Give what the instruments record; the torsion's zero is that of two encoders and says nothing."""
    plant, rows = Plant(config, effects), []
    plant.set_lock(run.locked)
    for leg in run.legs:
        ticks = round(leg.seconds / run.period)
        for tick in range(1, ticks + 1):
            part = tick / ticks
            plant.command("motor", leg.mode, leg.motor[0] + (leg.motor[1] - leg.motor[0]) * part)
            if leg.load is not None:
                plant.command("load", AxisMode.TORQUE, leg.load[0] + (leg.load[1] - leg.load[0]) * part)
            plant.advance_to(plant.time + run.period)
            rows.append(plant.read())
    log = np.rec.fromrecords(rows, names=PlantReading._fields)
    torsion = log.output_position + log.motor_position / config.drive.ratio
    return {"torsion": torsion - np.mean(torsion)} | {name: log[name] for name in SEEN if name != "torsion"}


@cache
def plain(name: str) -> dict[str, np.ndarray]:
    return recorded(RUNS[name], RUNS[name].config)


@pytest.mark.parametrize(
    ("effect", "name"), [pytest.param(e, name, id=f"{e.id} in {name}") for e in CATALOGUE.values() for name in e.shows]
)
def test_a_procedure_that_it_claims_shows_it(effect: Effect, name: str):
    run = RUNS[name]
    if effect.enters is Enters.BASE:
        log = recorded(run, changed(effect, run.config))
    else:
        log = recorded(run, run.config, typical(effect, run.config is WARMING))
    change = {signal: float(np.sqrt(np.mean((log[signal] - plain(name)[signal]) ** 2))) for signal in SEEN}
    assert any(change[signal] > least for signal, least in SEEN.items()), change

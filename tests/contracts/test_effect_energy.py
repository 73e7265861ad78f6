"""What every registered effect does with energy in the plant; a new entry is covered without being named.

The plant's account says work = stored + heat + effect_work. Here `effect_work` is not looked at: over a cycle that
ends as it began, work less heat less what is stored is what the effect took, wherever the plant booked it.
"""

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import pytest

from sim_backend.model.effects import CATALOGUE, ActiveEffect, Effect, Energy, Enters
from sim_backend.model.parameters import HarmonicDrive, PlantConfig
from sim_backend.plant import Plant, PlantTruth
from sim_backend.ports import AxisMode

FRICTIONLESS = HarmonicDrive(100.0, 8336.0, 0.0449, 1.333, 83.3, friction_torque=0.0, viscous_friction=1e-5)
WARM = PlantConfig(FRICTIONLESS, temperature=45.0, motor_temperature=45.0)
"""Nothing rubs dry, so that springs come to rest where they were; dampers let the bench settle."""
COLD = dataclasses.replace(
    WARM, drive=dataclasses.replace(FRICTIONLESS, friction_torque=0.05), temperature=5.0, ambient_temperature=5.0
)
"""A little dry friction, which the cold raises."""

MOVING = [effect for effect in CATALOGUE.values() if effect.enters not in (Enters.BASE, Enters.READING)]
CONSERVATIVE = [effect for effect in MOVING if effect.energy is Energy.CONSERVATIVE]
DISSIPATIVE = [effect for effect in MOVING if effect.energy is Energy.DISSIPATIVE]

LOAD = 12.0
"""N*m at the output."""
TURN = 2.0 * math.pi
LEG = 0.15
"""s for one leg; it leaves a fifth of it to settle."""
TICK = 2e-4

Rows = list[PlantTruth]


def over(effects: list[Effect]):
    return pytest.mark.parametrize("effect", effects, ids=[effect.id for effect in effects])


def typical(effect: Effect, **changed: float) -> ActiveEffect:
    """Typical values, with a phase on no symmetry and memories that have forgotten within a leg."""
    values = {p.name: p.typical for p in effect.parameters}
    values |= {name: value for name, value in (("phase", 0.3), ("time_constant", 0.03)) if name in values}
    return ActiveEffect(effect, tuple((values | changed).values()))


def leg(
    plant: Plant,
    motor: tuple[AxisMode, float, float],
    load: tuple[float, float] = (0.0, 0.0),
    duration: float = LEG,
) -> Rows:
    """Lead the motor's target and the load's torque smoothly from one value to another, then hold them."""
    begin, rows = plant.time, []
    while plant.time < begin + duration - 0.5 * TICK:
        part = min(1.0, (plant.time - begin) / (0.8 * duration))
        done = part * part * (3.0 - 2.0 * part)
        mode, first, last = motor
        plant.command("motor", mode, first + (last - first) * done)
        plant.command("load", AxisMode.TORQUE, load[0] + (load[1] - load[0]) * done)
        plant.advance_to(plant.time + TICK)
        rows.append(plant.truth())
    return rows


def round_the_map(plant: Plant) -> Rows:
    """Load, turn the motor under load, unload, turn back: angle and torque go round an area."""
    hold = AxisMode.POSITION
    return [
        *leg(plant, (hold, 0.0, 0.0), (0.0, LOAD)),
        *leg(plant, (hold, 0.0, 1.0), (LOAD, LOAD)),
        *leg(plant, (hold, 1.0, 1.0), (LOAD, 0.0)),
        *leg(plant, (hold, 1.0, 0.0)),
    ]


def whole_turn(plant: Plant) -> Rows:
    """One turn of the motor under load, from where it stands, then unload: all that follows its angle is back."""
    hold, at = AxisMode.POSITION, TURN * round(plant.truth().motor_position / TURN)
    return [
        *leg(plant, (hold, at, at), (0.0, LOAD)),
        *leg(plant, (hold, at, at + TURN), (LOAD, LOAD), duration=4.0 * LEG),
        *leg(plant, (hold, at + TURN, at + TURN), (LOAD, 0.0)),
    ]


def locked_sweep(plant: Plant) -> Rows:
    """Motor torque up, down and back to nothing against the locked output."""
    plant.set_lock(True)
    torque, most = AxisMode.TORQUE, LOAD / 100.0
    rows = []
    for first, last in ((0.0, most), (most, -most), (-most, 0.0)):
        rows += leg(plant, (torque, first, last), duration=3.0 * LEG)
    return rows


CYCLES = {"round the map": round_the_map, "whole turn": whole_turn, "locked sweep": locked_sweep}
CASES = pytest.mark.parametrize("cycle", CYCLES.values(), ids=CYCLES)


def second_cycle(
    cycle: Callable[[Plant], Rows], effects: list[ActiveEffect], config: PlantConfig, step: float = 2e-5
) -> np.recarray:
    """Go round twice and give the second time, which begins and ends in the same state."""
    if cycle is locked_sweep:  # no drive's loop holds the motor there: a damper of its own lets it settle
        config = dataclasses.replace(config, rotor_viscous_friction=4e-3)
    plant = Plant(dataclasses.replace(config, step=step), effects)
    last = cycle(plant)[-1]
    rows = np.rec.fromrecords([last, *cycle(plant)], names=PlantTruth._fields)
    turned = TURN if cycle is whole_turn else 0.0
    assert rows.motor_position[-1] - rows.motor_position[0] == pytest.approx(turned, abs=1e-6)
    assert rows.output_position[-1] - rows.output_position[0] == pytest.approx(-turned / 100.0, abs=1e-6)
    assert np.max(np.abs(rows.motor_velocity[[0, -1]])) < 1e-2
    assert rows.flexspline_torque[-1] - rows.flexspline_torque[0] == pytest.approx(0.0, abs=1e-4)
    return rows


def taken(rows: np.recarray) -> float:
    """What went in and is neither heat nor stored, J."""
    kept = rows.work - rows.heat - rows.stored
    return float(kept[-1] - kept[0])


def in_springs(rows: np.recarray) -> float:
    """Most that is stored on the way, J: nearly all of it in the springs under the load."""
    return float(np.max(rows.stored))


def heat_of(rows: np.recarray) -> float:
    return float(rows.heat[-1] - rows.heat[0])


def given_back(heat: np.ndarray) -> float:
    """Heat that became something else, J."""
    return float(-np.sum(np.minimum(np.diff(heat), 0.0)))


@CASES
@over(CONSERVATIVE)
def test_a_conservative_effect_takes_and_gives_nothing_over_a_cycle(effect: Effect, cycle: Callable[[Plant], Rows]):
    if cycle is whole_turn and "output_position" in effect.signals:
        return  # the output has not come back to where it was
    coarse, fine = (second_cycle(cycle, [typical(effect)], WARM, step) for step in (2e-5, 1e-5))
    # the integrator is of second order: what it makes up, 5e-9 J at most, falls by 4 and drops out of this; what an
    # effect makes up stays. Left are 4e-11 J of the 1e-2 J in the springs.
    without_the_step = (4.0 * taken(fine) - taken(coarse)) / 3.0
    assert abs(without_the_step) < 1e-7 * in_springs(fine)


@CASES
@over(DISSIPATIVE)
def test_a_dissipative_effect_takes_energy_over_a_cycle(effect: Effect, cycle: Callable[[Plant], Rows]):
    rows = second_cycle(cycle, [typical(effect)], COLD)
    assert given_back(rows.heat) < 1e-5 * heat_of(rows)
    if effect.enters is Enters.FRICTION:  # what it takes is heat at once; the bench without it makes less
        assert heat_of(rows) > 1.2 * heat_of(second_cycle(cycle, [], COLD))
    else:
        assert taken(rows) > 1e-4 * in_springs(rows)


@over([effect for effect in DISSIPATIVE if effect.enters is Enters.FRICTION])
def test_a_friction_effect_never_drives_where_nothing_else_rubs(effect: Effect):
    """The level of the whole does not fall below zero, whatever the effect would take off it."""
    for cycle in CYCLES.values():
        plant = Plant(WARM, [typical(effect)])
        rows = np.rec.fromrecords(cycle(plant), names=PlantTruth._fields)
        # the speed that makes the level's bound is that of the step before: a part of 6e-6, first order in the step
        assert given_back(rows.heat) < 1e-5 * rows.heat[-1]

"""What every registered effect must fulfil in the plant; a new entry is covered without being named."""

import dataclasses

import numpy as np
import pytest

from sim_backend.errors import ModelError, shown
from sim_backend.model.effects import CATALOGUE, ActiveEffect, Effect, Enters, Shape
from sim_backend.model.parameters import HarmonicDrive, PlantConfig
from sim_backend.plant import Plant, PlantTruth
from sim_backend.ports import AxisMode, PlantReading

DRIVE = HarmonicDrive.from_catalogue(
    100.0, K1=8.4e3, K2=9.4e3, T1=3.9, T2=12.0, hysteresis_loss=1.8e-4, starting_torque=0.012, viscous_friction=1e-4
)
WARM = PlantConfig(DRIVE, temperature=45.0, motor_temperature=45.0)
IN_PLANT = [effect for effect in CATALOGUE.values() if effect.enters is not Enters.BASE]
MOVING = [effect for effect in IN_PLANT if effect.enters is not Enters.READING]


def over(effects: list[Effect]):
    return pytest.mark.parametrize("effect", effects, ids=[effect.id for effect in effects])


def typical(effect: Effect, **changed: float) -> ActiveEffect:
    """Typical values with a phase that puts no sample on a symmetry of the effect."""
    values = {p.name: 0.3 if p.name == "phase" else p.typical for p in effect.parameters}
    return ActiveEffect(effect, tuple((values | changed).values()))


def absent(effect: Effect) -> ActiveEffect:
    return typical(effect, **dict.fromkeys(effect.amplitudes, 0.0))


def follow(plant: Plant, until: float) -> list[PlantTruth]:
    rows = []
    while plant.time < until - 1e-9:
        plant.advance_to(plant.time + 1e-3)
        rows.append(plant.truth())
    return rows


def round_trip(effects: list[ActiveEffect], *, step: float = 2e-5) -> tuple[list[PlantTruth], PlantReading]:
    """Turn, reverse, hold against a load, then push the locked output both ways and let go."""
    plant = Plant(dataclasses.replace(WARM, step=step), effects)
    rows = []
    for locked, motor, load, until in (
        (False, (AxisMode.VELOCITY, 60.0), 2.0, 0.2),
        (False, (AxisMode.VELOCITY, -40.0), -1.0, 0.4),
        (False, (AxisMode.POSITION, 0.5), 6.0, 0.7),
        (False, (AxisMode.OFF, 0.0), 0.0, 0.8),
        (True, (AxisMode.TORQUE, 0.09), 0.0, 1.0),
        (True, (AxisMode.TORQUE, -0.07), 0.0, 1.005),
    ):
        plant.set_lock(locked)
        plant.command("motor", *motor)
        plant.command("load", AxisMode.TORQUE, load)
        rows += follow(plant, until)
    reading = plant.read()  # while the torque moves: a channel that comes late shows no constant one
    rows += follow(plant, 1.2)
    plant.command("motor", AxisMode.OFF, 0.0)
    return rows + follow(plant, 1.5), reading


def balance(rows: list[PlantTruth]) -> tuple[float, float]:
    """Largest error of the energy account, and the work put in until then, J."""
    table = np.rec.fromrecords(rows, names=PlantTruth._fields)
    error = table.work - table.heat - table.effect_work - table.stored
    return float(np.max(np.abs(error))), float(np.sum(np.maximum(np.diff(table.work), 0.0)))


@over(IN_PLANT)
def test_zero_amplitude_equals_absent_to_the_last_bit(effect: Effect):
    assert round_trip([absent(effect)]) == round_trip([])


@over(IN_PLANT)
def test_it_changes_what_the_bench_does_or_what_it_reads(effect: Effect):
    # as many events as it takes to see one in a second
    often = {"rate": 100.0} if effect.shape is Shape.EVENT else {}
    (rows, reading), (plain_rows, plain_reading) = round_trip([typical(effect, **often)]), round_trip([])
    if effect.enters is Enters.READING:
        assert reading != plain_reading
    else:
        assert rows != plain_rows


@over(MOVING)
def test_the_energy_account_closes_with_it_and_better_so_at_a_finer_step(effect: Effect):
    error, gross = balance(round_trip([typical(effect)])[0])
    assert error < 1e-4 * gross
    finer, _ = balance(round_trip([typical(effect)], step=5e-6)[0])
    # second order gives a sixteenth; nearly all of it comes of one jolt, in which the steps are too long for the rule
    assert finer < 0.2 * error


JUMPS = ("backlash",)
"""The torque crosses the gap within the first step, when it jumps from rest: first order in the step."""


@over(MOVING)
@pytest.mark.parametrize("locked", [False, True], ids=["free", "locked"])
def test_its_error_falls_with_the_square_of_the_step(effect: Effect, locked: bool):
    def trajectory(step: float) -> np.ndarray:
        plant = Plant(dataclasses.replace(WARM, step=step), [typical(effect)])
        plant.set_lock(locked)
        plant.command("motor", AxisMode.TORQUE, 0.05 if locked else 0.03)
        plant.command("load", AxisMode.TORQUE, 3.0 if locked else 0.5)
        rows = np.rec.fromrecords(follow(plant, 0.06), names=PlantTruth._fields)
        # locked, the motor comes to rest where statics put it whatever the step: it shows rounding only
        moved = rows.effect_work + rows.heat if locked else rows.motor_position
        return np.array([rows.output_position, rows.flexspline_torque, moved])

    exact = trajectory(1.25e-6)
    coarse, fine = (np.sqrt(np.mean((trajectory(h) - exact) ** 2, axis=1)) for h in (2e-5, 5e-6))
    if effect.id in JUMPS:
        assert np.all(coarse / fine > 2.0)
        return
    # second order gives (16^2 - 1) / (4^2 - 1) = 17, first order 5; the moment at which the rim breaks away leaves
    # some spread
    assert np.all(coarse / fine > 9.0)


def test_base_terms_are_no_active_effects():
    for effect in CATALOGUE.values():
        if effect.enters is Enters.BASE:
            with pytest.raises(ModelError, match=f"{effect.id} is a term of the base model"):
                Plant(WARM, [typical(effect)])


@pytest.mark.parametrize("effect", CATALOGUE.values(), ids=CATALOGUE)
@pytest.mark.parametrize("value", ["0.1", None, True, 1j, float("nan"), [1.0], 10**400])
def test_what_is_no_number_is_refused_by_name_unit_range_and_equation(effect, value):
    parameters = effect.parameters
    for place, parameter in enumerate(parameters):
        values = [p.typical for p in parameters]
        with pytest.raises(ModelError) as refused:
            ActiveEffect(effect, (*values[:place], value, *values[place + 1 :]))
        told = str(refused.value)
        assert told.startswith(f"{effect.id}: {parameter.name} = {shown(value)} ")
        unit = "" if parameter.unit == "1" else f" {parameter.unit}"
        range_ = f"at least {parameter.low:.6g} and at most {parameter.high:.6g}{unit}"
        assert told.endswith(f"{range_}; {effect.equation} needs it.")


def test_values_may_be_a_list_or_an_array():
    cogging = CATALOGUE["cogging"]
    for values in ([1e-3, 84, 0.0], np.array([1e-3, 84.0, 0.0])):
        assert ActiveEffect(cogging, values) == ActiveEffect(cogging, (1e-3, 84.0, 0.0))


@pytest.mark.parametrize("values", [None, 0.1, "0.1", b"0.1"])
def test_values_that_are_no_tuple_are_refused_with_what_is_wanted(values):
    with pytest.raises(ModelError, match=rf"cogging: values = {values!r} .* amplitude \(N\*m, 0 to .* needs them"):
        ActiveEffect(CATALOGUE["cogging"], values)
    with pytest.raises(ModelError, match=r"effect = 'cogging' .* an Effect"):
        ActiveEffect("cogging", (0.1,))

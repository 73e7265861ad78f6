"""Effects inside their own ranges that this plant cannot have: refused before anything moves, with the bound."""

import dataclasses
import itertools
import math
from collections.abc import Iterator, Sequence

import numpy as np
import pytest

from sim_backend.errors import ModelError
from sim_backend.model.effects import CATALOGUE, ActiveEffect, Effect, Enters
from sim_backend.model.parameters import Cubic, Piecewise, PlantConfig
from sim_backend.model.step_bounds import most_amplitude
from sim_backend.plant import Plant
from sim_backend.ports import AxisMode
from tests.sim_backend.test_plant import CONFIG, SILENT
from tests.sim_backend.test_plant_physics import FLOOR, OF_THE_BENCH, active, play_through, random_plan


def swept(plant: Plant) -> None:
    """Sweep the locked drive to the motor's rated torque in both directions, let it go and turn it."""
    plant.set_lock(True)
    for k in range(500):
        share = float(np.interp(k, [0, 100, 300, 400], [0.0, 1.0, -1.0, 0.0]))
        plant.command("motor", AxisMode.TORQUE, share * plant.config.motor_rated_torque)
        plant.advance_to(1e-3 * (k + 1))
    plant.set_lock(False)
    plant.command("motor", AxisMode.VELOCITY, 20.0)
    plant.advance_to(0.6)


def balance(plant: Plant) -> float:
    now = plant.truth()
    return (now.work - now.heat - now.effect_work - now.stored) / now.work


# ---- what is left of the flexspline's compliance


CAP = CONFIG.flexspline_stiffness_cap
FOR_STEP = CONFIG.output_inertia / CONFIG.step**2 - CONFIG.fixture_stiffness
"""N*m/rad: K with h^2 (K + K_fix)/J = 1."""
MOST_MODULATION = 0.9 / CAP


def test_a_modulation_that_would_turn_the_flexspline_round_is_refused_with_the_bound_of_this_drive():
    with pytest.raises(
        ModelError,
        match=rf"stiffness-modulation: amplitude = 0.0002 rad/\(N\*m\) .* at most {MOST_MODULATION:.4g} .* "
        rf"\(1/K_F = {1.0 / CAP:.4g} .* that a jolt reaches, .*; torsion \+= amplitude \* output_torque \* sin"
        r".* needs it. Make it smaller, or flexspline_stiffness_cap lower.",
    ):
        Plant(CONFIG, [active("stiffness-modulation", amplitude=2e-4)])
    # two of them add up
    half = active("stiffness-modulation", amplitude=0.6 * MOST_MODULATION)
    Plant(CONFIG, [half])
    with pytest.raises(ModelError, match="all such amplitudes together"):
        Plant(CONFIG, [half, half])


@pytest.mark.parametrize("law", [Cubic(2e4, 0.0), Piecewise(8.4e3, 2e4, 9.4e3, 3.9, 12.0)], ids=["cubic", "piecewise"])
def test_the_bound_is_that_of_the_law_that_the_flexspline_has(law):
    with pytest.raises(ModelError, match=r"must be at most 4.5e-05 rad/\(N\*m\)"):
        Plant(dataclasses.replace(CONFIG, flexspline=law), [active("stiffness-modulation", amplitude=5e-5)])


@pytest.mark.parametrize(
    ("amplitude", "reference", "at"),
    [(-0.1, 14.0, 25.0), (-0.0034, -273.15, 25.0), (0.0011, 1000.0, 25.0), (-0.05, 25.0, 50.0)],
)
def test_a_temperature_at_which_no_compliance_would_be_left_is_refused(amplitude, reference, at):
    warm = dataclasses.replace(CONFIG, temperature=at)
    with pytest.raises(
        ModelError,
        match=rf"temperature-dependent-stiffness: amplitude = {amplitude!r} 1/K with reference = {reference:g} degC "
        rf"leaves .* at {at:g} degC; it must be above 0.1, which step = 2e-05 s and the solution need at {CAP:g} N",
    ):
        Plant(warm, [active("temperature-dependent-stiffness", amplitude=amplitude, reference=reference)])


def test_a_stiff_flexspline_leaves_less_to_a_modulation_where_the_step_needs_more():
    lighter = dataclasses.replace(CONFIG, output_inertia=3e-4)
    most = 1.0 / CAP - 1.0 / (3e-4 / CONFIG.step**2 - CONFIG.fixture_stiffness)
    assert most < MOST_MODULATION
    with pytest.raises(ModelError, match=rf"at most {most:.4g} rad"):
        Plant(lighter, [active("stiffness-modulation", amplitude=1.001 * most)])
    Plant(lighter, [active("stiffness-modulation", amplitude=0.999 * most)])
    assert CONFIG.stiffness_for_step == pytest.approx(FOR_STEP)


def at_the_ends(effect: Effect, known: Sequence[str] = ()) -> Iterator[dict[str, float]]:
    """Give each combination of ends of the parameters' usual ranges; what is `known` keeps its typical value."""
    ends = [(p.typical,) if p.name in known else p.usual for p in effect.parameters]
    for values in itertools.product(*ends):
        yield {p.name: value for p, value in zip(effect.parameters, values, strict=True)}


@pytest.mark.parametrize("effect", [e for e in CATALOGUE.values() if e.enters is not Enters.BASE], ids=lambda e: e.id)
def test_an_effect_may_have_both_ends_of_every_usual_range(effect):
    for values in at_the_ends(effect, OF_THE_BENCH):
        Plant(CONFIG, [active(effect.id, **values)], compiled=False)


def bench_with(base_term: str, values: dict[str, float]) -> PlantConfig:
    """Give the bench whose base term has these values."""
    drive = CONFIG.drive
    match base_term, values:
        case "coulomb-friction", {"T_fs": level, "ratio": ratio}:
            values = {"friction_torque": level * ratio, "ratio": ratio}
        case "viscous-friction", {"b": b}:
            values = {"viscous_friction": b}
        case "inertia", {"J": J}:  # seen at the motor
            rotor = J - CONFIG.wave_generator_inertia - CONFIG.output_inertia / drive.ratio**2
            return dataclasses.replace(CONFIG, rotor_inertia=rotor)
    return dataclasses.replace(CONFIG, drive=dataclasses.replace(drive, **values))


@pytest.mark.parametrize("effect", [e for e in CATALOGUE.values() if e.enters is Enters.BASE], ids=lambda e: e.id)
def test_a_bench_may_have_both_ends_of_every_usual_range_of_its_base_terms(effect):
    for values in at_the_ends(effect):
        plant = Plant(bench_with(effect.id, values), compiled=False)
        plant.command("motor", AxisMode.TORQUE, 0.1)
        plant.advance_to(2e-3)


def test_just_inside_these_bounds_the_plant_is_sound_at_the_rated_torque():
    least = 0.1001
    for effects in (
        *([active("stiffness-modulation", amplitude=0.999 * MOST_MODULATION, phase=p)] for p in (0.0, 1.6, 3.1, 4.7)),
        [active("temperature-dependent-stiffness", amplitude=-0.1 * (1.0 - least), reference=15.0)],
    ):
        plant = Plant(CONFIG, effects)
        swept(plant)
        assert all(map(math.isfinite, plant.truth()))
        assert abs(balance(plant)) < 1e-4


# ---- what the step can carry of an error that goes with the motor


FAST = math.pi / (CONFIG.motor_speed_limit * CONFIG.step)
"""1/rev: half a period in a step at the speed limit."""


def worst_account(effect: ActiveEffect, config: PlantConfig = SILENT) -> float:
    """Give what the energy account leaves of the gross work put in, at worst of six random plays with jolts."""
    left = []
    for seed in (3, 17, 48, 5, 6, 7):
        error, gross = play_through((effect,), random_plan(seed), config.step, config)
        left.append((error - FLOOR) / gross)
    return max(left)


@pytest.mark.parametrize(
    ("order", "step"),
    [
        *((order, 2e-5) for order in (1.0, 2.0, 3.0, 4.0, 5.0, 7.0, 10.0, 20.0, 50.0, 100.0, 0.999 * FAST)),
        *((order, 1e-5) for order in (7.0, 50.0)),
    ],
)
def test_an_error_just_inside_its_bound_keeps_the_account_and_just_outside_is_refused(order, step):
    config = dataclasses.replace(SILENT, step=step)
    most = most_amplitude(order, config)
    inside = active("kinematic-error", amplitude=min(0.999 * most, 0.1), order=order)
    assert worst_account(inside, config) < 1e-4
    if most < 0.1:
        with pytest.raises(
            ModelError,
            match=rf"kinematic-error: amplitude = .* rad is not possible at order = {order!r} 1/rev: .* at most "
            rf"{most:.4g} rad here.* w = 600 rad/s .* step h = {step:g} s misses \(order w h\)\^2/12, .* 3e-05 .*"
            r"sin\(order \* motor_position \+ phase\) needs it. Use a shorter step .*, a smaller amplitude or a lower",
        ):
            Plant(config, [active("kinematic-error", amplitude=1.001 * most, order=order)])


@pytest.mark.parametrize("order", [10.0, 20.0, 50.0, 100.0, 200.0])
def test_the_bound_of_an_error_is_not_needlessly_tight(order, monkeypatch):
    beyond = active("kinematic-error", amplitude=5.0 * most_amplitude(order, SILENT), order=order)
    monkeypatch.setattr("sim_backend.plant.check_effects", lambda effects, config: None)
    assert worst_account(beyond) > 1e-4


@pytest.mark.parametrize("effect", ["kinematic-error", "stiffness-modulation"])
def test_an_order_that_passes_by_more_than_half_a_period_in_a_step_is_refused_with_the_highest(effect):
    Plant(CONFIG, [active(effect, amplitude=1e-9, order=0.999 * FAST)])
    Plant(CONFIG, [active(effect, amplitude=0.0, order=1e4)])
    with pytest.raises(
        ModelError,
        match=rf"{effect}: order = 1000.0 1/rev is not possible: it must be at most {FAST:.4g} 1/rev, .* w = 600 rad/s "
        r"and step = 2e-05 s.* needs it. Use a step of at most 5.236e-06 s",
    ):
        Plant(CONFIG, [active(effect, amplitude=1e-9, order=1e3)])
    Plant(dataclasses.replace(CONFIG, step=5e-6), [active(effect, amplitude=1e-9, order=1e3)])


def test_errors_of_one_order_add_up_and_those_of_different_orders_share():
    def part(share: float, order: float) -> ActiveEffect:
        return active("kinematic-error", amplitude=share * most_amplitude(order, CONFIG), order=order)

    Plant(CONFIG, [part(0.7, 20.0), part(0.7, 50.0)])
    with pytest.raises(ModelError, match=r"at order = 20.0 1/rev.*all together use 1.96 times what there is"):
        Plant(CONFIG, [part(0.7, 20.0), part(0.7, 20.0)])
    with pytest.raises(ModelError, match=r"at order = 50.0 1/rev"):
        Plant(CONFIG, [part(0.8, 20.0), part(0.8, 50.0)])


# ---- what the motor's drive can regulate


@pytest.mark.parametrize("amplitude", [-0.5, -0.1, 0.1, 0.5])
def test_a_wrong_torque_constant_gives_the_shaft_what_was_asked_for_over_1_plus_a(amplitude):
    plant = Plant(SILENT, [active("torque-constant-error", amplitude=amplitude)])
    plant.set_lock(True)
    plant.command("motor", AxisMode.TORQUE, 0.1)
    plant.advance_to(0.02)
    assert plant.truth().motor_torque == pytest.approx(0.1 / (1.0 + amplitude), rel=1e-12)
    assert plant.read().motor_torque == pytest.approx(0.1, rel=1e-12)


@pytest.mark.parametrize("amplitude", [-1.0, -0.51, 0.51, 10.0])
def test_a_torque_constant_with_which_the_drive_does_not_settle_is_refused(amplitude):
    with pytest.raises(
        ModelError, match=rf"torque-constant-error: amplitude = {amplitude!r} .* within -0.5 to 0.5 .* reads amplitude"
    ):
        Plant(CONFIG, [active("torque-constant-error", amplitude=amplitude)])


def test_a_saturation_beyond_which_the_torque_falls_with_the_current_is_refused_at_the_rated_current():
    current = CONFIG.motor_rated_torque / CONFIG.torque_constant
    most = 1.0 / (3.0 * current**2)
    plant = Plant(CONFIG, [active("torque-constant-saturation", amplitude=0.999 * most)])
    plant.command("motor", AxisMode.TORQUE, CONFIG.motor_rated_torque)
    plant.set_lock(True)
    plant.advance_to(0.05)
    plant.command("motor", AxisMode.OFF, 0.0)
    plant.advance_to(0.1)
    assert all(map(math.isfinite, plant.truth()))
    assert plant.truth().motor_torque == pytest.approx(0.0, abs=1e-12)
    with pytest.raises(
        ModelError,
        match=r"torque-constant-saturation: amplitude = 1.2 1/A\^2 .* 1/\(3 i\^2\) = 0.9718 1/A\^2 at the rated "
        r"current i = 0.5857 A",
    ):
        Plant(CONFIG, [active("torque-constant-saturation", amplitude=1.2)])

"""Which effects of the catalogue are lines for the loop, which the demo hides, and how fitted ones run on the bench."""

import math

import pytest

from rig.commands.demo import draw_effect
from rig.loop.files.model_file import Model, ModelBase, ModelEffect, ModelEstimate, ModelLine
from rig.loop.model.shapes import catalogue_shapes
from rig.loop.model.terms import Entry, periodic_effects
from rig.simulation import effects_of_model
from sim_backend.model.effects import CATALOGUE, ActiveEffect, Enters, Shape
from tests.rig.loop.runs import dut

LINE = ModelLine(order=2.0, amplitude=1e-4, phase=0.3)


def model_with(*effects: ModelEffect) -> Model:
    base = ModelBase(model="zhang-2014", ratio=100.0, parameters={})
    return Model(schema="rig.model/1", dut=dut(), base=base, effects=effects, software="0")


def fitted(effect: str, enters: str, variable: str, shape: str = "periodic", order: float = 2.0) -> ModelEffect:
    line = LINE.model_copy(update={"order": order})
    return ModelEffect(effect=effect, enters=enters, variable=variable, shape=shape, lines=(line,), parameters={})


def test_every_periodic_effect_of_the_catalogue_is_a_line_that_acts_where_it_enters():
    kinds = {kind.effect: kind.entry for kind in periodic_effects()}
    assert kinds == {
        "kinematic-error": Entry.TORSION,
        "stiffness-modulation": Entry.TORSION_TIMES_TORQUE,
        "position-dependent-friction": Entry.MOTOR_AGAINST_MOTION,
        "cogging": Entry.MOTOR,
        "torque-ripple": Entry.MOTOR_TIMES_TORQUE,
        "gravity-load": Entry.OUTPUT,
        "motor-encoder-eccentricity": Entry.MOTOR_ANGLE,
        "output-encoder-eccentricity": Entry.ANGLE_ONLY,
        "encoder-subdivision-error": Entry.ANGLE_ONLY,
    }
    with_phase = {e.id for e in CATALOGUE.values() if any(p.name == "phase" for p in e.parameters)}
    assert with_phase == set(kinds)
    assert next(kind for kind in periodic_effects() if kind.effect == "gravity-load").fixed_order == 1.0


def test_lines_and_shapes_together_are_all_effects_that_repeat():
    lines = {kind.effect for kind in periodic_effects()}
    shapes = {effect.id for effect in catalogue_shapes()}
    assert not lines & shapes
    left = {e.id for e in CATALOGUE.values() if e.enters is not Enters.BASE} - lines - shapes
    assert left == {e.id for e in CATALOGUE.values() if e.shape is Shape.EVENT}
    # the fit lets lines alone act back on the motor
    assert all(effect.slope is None for effect in catalogue_shapes())


def test_the_demo_hides_what_every_bench_can_have():
    assert {draw_effect(seed).effect.id for seed in range(60)} == {"kinematic-error", "cogging", "gravity-load"}


def test_a_fitted_line_runs_as_its_catalogue_effect_and_an_unnamed_one_as_the_effect_of_its_kind():
    assumed: list[str] = []
    model = model_with(
        fitted("cogging", "motor balance", "motor_position"),
        fitted("unnamed:motor_position:periodic", "torsion", "motor_position"),
        fitted("unnamed:output_position:periodic", "output balance", "output_position", order=1.0),
    )
    active = effects_of_model(model, assumed)
    assert [item.effect.id for item in active] == ["cogging", "kinematic-error", "gravity-load"]
    assert active[0].values == (1e-4, 2.0, 0.3)
    assert not assumed


def angle_of(item: ActiveEffect, motor: float) -> float:
    """Give the line's value at a motor angle (rad) of the plant, whose output is at -motor / 100."""
    order, amplitude, phase = (
        dict(zip((p.name for p in item.effect.parameters), item.values, strict=True))[name]
        for name in ("order", "amplitude", "phase")
    )
    angle = motor if item.effect.variable == "motor_position" else -motor / 100.0
    return amplitude * math.sin(order * angle + phase)


@pytest.mark.parametrize(
    ("enters", "variable", "order", "runs_as"),
    [
        ("angle only", "motor_position", 3.0, "encoder-subdivision-error"),
        ("angle only", "motor_position", 0.5, "output-encoder-eccentricity"),
        ("torsion", "output_position", 4.0, "kinematic-error"),
        ("motor balance", "output_position", 700.0, "cogging"),
        ("motor balance, against motion", "output_position", 50.0, "position-dependent-friction"),
    ],
)
def test_a_line_that_no_effect_of_its_angle_makes_runs_through_the_gear(enters, variable, order, runs_as):
    assumed: list[str] = []
    (active,) = effects_of_model(model_with(fitted("unnamed:x:periodic", enters, variable, order=order)), assumed)
    assert active.effect.id == runs_as
    for motor in (-2.0, 0.0, 0.1, 5.0):
        own = motor if variable == "motor_position" else -motor / 100.0
        assert angle_of(active, motor) == pytest.approx(1e-4 * math.sin(order * own + 0.3), abs=1e-12)
    assert not assumed


def test_a_line_that_the_bench_cannot_make_is_left_out_and_said_with_its_size():
    assumed: list[str] = []
    second = fitted("unnamed:output_position:periodic", "output balance", "output_position", order=2.0)
    assert effects_of_model(model_with(second), assumed) == ()
    (told,) = assumed
    assert "'output balance' that follows output_position at order 2;" in told
    assert told.endswith("its logs will lack the line of 0.0001")


def shaped(**parameters: float) -> ModelEffect:
    estimates = {name: ModelEstimate(value=value, unit="?") for name, value in parameters.items()}
    return ModelEffect(effect="creep", enters="torsion", variable="output_torque", shape="lag", parameters=estimates)


def test_a_fitted_effect_that_is_no_line_runs_with_its_parameters():
    assumed: list[str] = []
    active = effects_of_model(model_with(shaped(amplitude=0.02, time_constant=7.0, stiffness=8e3)), assumed)
    assert [(item.effect.id, item.values) for item in active] == [("creep", (0.02, 7.0, 8e3))]
    assert not assumed


def test_an_effect_that_no_bench_can_have_is_left_out_and_said():
    assumed: list[str] = []
    model = model_with(
        shaped(amplitude=0.02, stiffness=8e3),
        shaped(amplitude=-1.0, time_constant=7.0, stiffness=8e3),
        fitted("goblins", "nowhere", "motor_position"),
    )
    assert effects_of_model(model, assumed) == ()
    assert "no time_constant" in assumed[0]
    assert "amplitude = -1.0" in assumed[1]
    assert "'goblins'" in assumed[2]

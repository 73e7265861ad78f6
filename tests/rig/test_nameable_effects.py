"""The loop's terms, the demo and fitted models keep to the effects that are one line of one angle."""

from rig.commands.demo import draw_effect
from rig.loop.model_file import Model, ModelBase, ModelEffect, ModelLine
from rig.loop.terms import Entry, periodic_effects
from rig.simulation import effects_of_model
from sim_backend.model.effects import CATALOGUE, Shape
from tests.rig.loop.runs import dut

LINE = ModelLine(order=2.0, amplitude=1e-4, phase=0.3)


def model_with(*effects: ModelEffect) -> Model:
    base = ModelBase(model="zhang-2014", ratio=100.0, parameters={})
    return Model(schema="rig.model/1", dut=dut(), base=base, effects=effects, software="0")


def fitted(effect: str, enters: str, variable: str, shape: str = "periodic") -> ModelEffect:
    return ModelEffect(effect=effect, enters=enters, variable=variable, shape=shape, lines=(LINE,), parameters={})


def test_a_term_is_a_catalogue_effect_of_one_angle_in_the_torsion_or_a_balance():
    kinds = {kind.effect: kind for kind in periodic_effects()}
    assert list(kinds) == ["kinematic-error", "cogging", "gravity-load"]
    assert kinds["gravity-load"].fixed_order == 1.0
    assert kinds["kinematic-error"].entry is Entry.TORSION
    # products of two signals and errors of a reading are periodic too, but no line
    for other in (
        "torque-ripple",
        "stiffness-modulation",
        "position-dependent-friction",
        "output-encoder-eccentricity",
    ):
        assert CATALOGUE[other].shape in (Shape.PERIODIC, Shape.PRODUCT)
        assert other not in kinds


def test_the_demo_hides_every_effect_that_the_loop_can_name_and_no_other():
    drawn = {draw_effect(seed).effect.id for seed in range(60)}
    assert drawn == {kind.effect for kind in periodic_effects()}


def test_a_fitted_line_runs_as_its_catalogue_effect_and_an_unnamed_one_as_the_effect_of_its_kind():
    assumed: list[str] = []
    model = model_with(
        fitted("cogging", "motor balance", "motor_position"),
        fitted("unnamed:motor_position:periodic", "torsion", "motor_position"),
        fitted("unnamed:output_position:periodic", "output balance", "output_position"),
    )
    active = effects_of_model(model, assumed)
    assert [item.effect.id for item in active] == ["cogging", "kinematic-error", "gravity-load"]
    assert active[0].values == (1e-4, 2.0, 0.3)
    assert not assumed


def test_a_catalogue_effect_that_is_no_line_is_left_out_and_said():
    assumed: list[str] = []
    model = model_with(
        fitted("creep", "torsion", "output_torque", "lag"),
        fitted("torque-ripple", "motor balance", "motor_position", "product"),
    )
    assert effects_of_model(model, assumed) == ()
    assert [text.partition(" ")[0] for text in assumed] == ["'creep'", "'torque-ripple'"]

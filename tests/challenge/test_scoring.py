"""What the scoring calls an answer: also, and first of all, a wrong one."""

import dataclasses
import math

import numpy as np
import pytest

from tests.challenge.answers import answer, estimate, step
from tests.challenge.cases import EFFECTS, LEAN, Case, make_case
from tests.challenge.expected import answers, expected_of
from tests.challenge.outside import OUTSIDE
from tests.challenge.scoring import Parameter, base_truth, naming_of, parameters_of, truth_of
from tests.independent.campaign import STANDARD
from tests.independent.draws import draw
from tests.independent.instruments import NoiseKind
from tests.independent.laws import shd_17_100
from tests.independent.terms import Effects, term


def case_with(*effects: str, family: str = "single", plan=STANDARD) -> Case:
    hidden = tuple(draw(effect, np.random.default_rng(1)) for effect in effects)
    return Case(family, 1, "rich", plan, NoiseKind.WHITE, shd_17_100(), hidden)


def called(case: Case, given) -> str:
    return naming_of(expected_of(case), given)[0]


def test_the_page_answers_every_effect_that_is_hidden():
    assert set(EFFECTS) <= set(answers())


def test_one_effect_is_right_by_its_name_and_alone():
    case = case_with("soft-windup")
    assert called(case, answer(step("soft-windup"))) == "right"
    assert called(case, answer(step("soft-windup"), step("creep"))) == "extra"
    assert called(case, answer(step("creep"))) == "wrong"
    assert called(case, answer(step("unnamed:output_torque:static"))) == "wrong"
    assert called(case, answer()) == "missed"
    assert called(case, answer(verdict="untraced", statements=[("untraced", ["soft-windup"])])) == "missed"


def test_a_set_is_not_right_where_the_campaign_can_tell():
    given = answer(step("", ["backlash", "soft-windup"]))
    assert called(case_with("soft-windup"), given) == "in set"
    assert called(case_with("soft-windup"), answer(statements=[("absorbed", ["soft-windup"])])) == "absorbed"


def test_a_set_with_the_truth_is_right_where_no_campaign_can_tell():
    case = case_with("torque-sensor-gain")
    assert called(case, answer(step("", ["torque-constant-error", "torque-sensor-gain"]))) == "right"
    assert called(case, answer(statements=[("absorbed", ["torque-sensor-gain", "fixture-compliance"])])) == "right"
    assert called(case, answer(step("", ["creep", "torque-constant-error"]))) == "wrong"


def test_a_set_with_the_truth_is_right_where_the_lean_plan_lacks_what_would_tell():
    given = answer(step("", ["channel-delay", "creep"]))
    assert called(case_with("creep", plan=LEAN), given) == "right"
    assert called(case_with("creep"), given) == "in set"


def test_where_the_design_cannot_tell_a_single_name_is_wrong_even_if_true():
    case = case_with("kinematic-error", family="ambiguous")
    assert called(case, answer(step("", ["kinematic-error", "stiffness-modulation"]))) == "right"
    assert called(case, answer(step("kinematic-error"))) == "wrong"
    assert called(case, answer(step("stiffness-modulation"))) == "wrong"
    assert called(case, answer()) == "missed"


def test_of_two_effects_both_must_be_found():
    case = case_with("soft-windup", "cogging", family="pair")
    assert naming_of(expected_of(case), answer(step("cogging"), step("soft-windup"))) == (
        "right",
        ["cogging", "soft-windup"],
    )
    assert naming_of(expected_of(case), answer(step("cogging"))) == ("missed", ["cogging"])
    assert called(case, answer(step("cogging"), step("soft-windup"), step("creep"))) == "extra"


def test_a_drifting_transducer_may_be_offset_too():
    given = answer(step("torque-sensor-drift"), step("torque-sensor-offset"))
    assert called(case_with("torque-sensor-drift"), given) == "right"
    assert called(case_with("torque-sensor-gain"), answer(step("torque-sensor-offset"))) == "wrong"


def test_of_missed_counts_nothing_may_be_added_and_it_must_be_said_that_they_do_not_repeat():
    case = case_with("encoder-missed-counts")
    assert called(case, answer(verdict="uncontrolled", statements=[("uncontrolled", [])])) == "right"
    both = [("uncontrolled", []), ("untraced", [])]
    assert called(case, answer(verdict="uncontrolled", statements=both)) == "right"
    assert called(case, answer(verdict="untraced", statements=[("untraced", [])])) == "missed"
    assert called(case, answer()) == "missed"
    assert called(case, answer(step("backlash"), statements=[("uncontrolled", [])])) == "wrong"


def test_silence_is_right_only_where_nothing_is_hidden_and_a_claim_is_a_false_alarm():
    case = Case("none", 1, "rich", STANDARD, NoiseKind.WHITE, shd_17_100())
    assert called(case, answer()) == "right"
    assert called(case, answer(step("cogging"))) == "wrong"
    assert called(case, answer(verdict="absorbed", statements=[("absorbed", ["torque-sensor-gain"])])) == "wrong"
    assert called(case, answer(verdict="untraced", statements=[("untraced", [])])) == "wrong"


def test_physics_outside_the_catalogue_needs_variable_and_shape():
    kind = next(name for name, item in OUTSIDE.items() if item.channel == "supply_voltage")
    case = dataclasses.replace(case_with(), family="outside", outside=kind)
    right = step("unnamed:supply_voltage:static", variable="supply_voltage")
    other = step("unnamed:time:static", variable="time")
    assert called(case, answer(right)) == "right"
    assert called(case, answer(right, other)) == "extra"
    assert called(case, answer(other)) == "wrong"
    assert called(case, answer(step("unnamed:supply_voltage:lag", variable="supply_voltage", shape="lag"))) == "wrong"
    assert called(case, answer(right, step("current-sensor-offset"))) == "wrong"
    assert called(case, answer()) == "missed"


def test_every_kind_of_physics_that_has_another_name_says_why():
    assert all(bool(item.same_as) <= bool(item.because) for item in OUTSIDE.values())


def test_a_phase_counts_up_to_whole_turns_and_an_amplitude_does_not():
    assert Parameter("cogging", "phase_2", 3.1, -3.18, -3.2, -3.15).inside
    assert not Parameter("cogging", "phase", 3.1, 0.0, -0.1, 0.1).inside
    assert not Parameter("cogging", "amplitude", 3.1, 3.1 - 2 * math.pi, -3.2, -3.15).inside


def test_intervals_are_counted_for_what_was_named_and_the_base_only_where_all_is_right():
    hidden = Effects(others=(term("soft-windup", amplitude=3e-5, zone=1.0),))
    named = step("soft-windup", parameters={"amplitude": estimate(3.1e-5, 2e-6), "zone": estimate(2.0, 0.1)})
    found = parameters_of(shd_17_100(), (hidden,), answer(named), "right")
    assert {item.name: item.inside for item in found if item.of == "soft-windup"} == {"amplitude": True, "zone": False}
    assert {item.name for item in found if item.of == "base"} >= {"K_F0", "C_F", "T_fs"}
    assert {item.of for item in parameters_of(shd_17_100(), (hidden,), answer(named), "extra")} == {"soft-windup"}


def test_truths_are_turned_into_the_frame_of_the_loop():
    bent = Effects(others=(term("torque-sensor-nonlinearity", even=0.2, odd=0.4, full_scale=30.0),))
    assert truth_of(bent, {"full_scale": {"value": 15.0}}) == pytest.approx(
        {"even": 0.05, "odd": 0.05, "full_scale": 30.0}
    )
    warm = Effects(others=(term("temperature-dependent-stiffness", amplitude=0.01, reference=20.0),))
    given = {"reference": {"value": 25.0}}
    at_25 = truth_of(warm, given)["amplitude"]
    answered = answer(step("temperature-dependent-stiffness", parameters=given))
    softer = base_truth(shd_17_100(), (warm,), answered)["K_F0"]
    for temperature in (20.0, 31.0):
        by_truth = (1.0 + 0.01 * (temperature - 20.0)) / shd_17_100().K_F0
        assert (1.0 + at_25 * (temperature - 25.0)) / softer == pytest.approx(by_truth)


def test_a_case_is_the_same_for_the_same_seed_and_every_effect_has_its_turn():
    assert make_case("pair", 1007) == make_case("pair", 1007)
    assert {make_case("single", seed).ids[0] for seed in range(1000, 1000 + len(EFFECTS))} == set(EFFECTS)
    assert {make_case("outside", seed).outside for seed in range(len(OUTSIDE))} == set(OUTSIDE)
    assert len({make_case("none", seed).noise for seed in range(4)}) == 4

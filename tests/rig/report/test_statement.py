"""The statement in one sentence, for every verdict."""

import pytest

from rig.loop.result import Verdict
from rig.report.loop_file import LoopFile
from rig.report.sentences import effect_words, floor_remark, statement
from tests.rig.report.folders import ERRORS, loop_content

GRAVITY = {"verdict": "named", "effect": "gravity-load"}
LAG = {"verdict": "ambiguous", "effect": "ambiguous:channel-delay|torque-sensor-lag"}
WORSE = {**ERRORS, "rms_before": 2.5e-4, "rms_after": 3.5e-4, "floor": None}
SIDES = {"train": ("locked-output", "free-run", "backdrive"), "held_out": ("locked-output",)}
ABSORBED = {
    "verdict": "absorbed",
    "parameter": "K_F0",
    "deviation": -0.29,
    "group": ["fixture-compliance", "torque-sensor-gain"],
}


def said(verdict: str, steps=(), still_open=(), equations=None) -> str:
    plain = {"torsion": {"unit": "rad", "held_out": ERRORS}}
    content = loop_content(verdict=verdict, steps=list(steps), open=list(still_open), equations=equations or plain)
    return statement(LoopFile.model_validate(content))


def test_a_named_effect_with_what_it_removes() -> None:
    assert said("named", [GRAVITY]) == (
        "The model lacks gravity-load; on 1 held-out run the error of torsion falls from 24 to 4 µrad rms "
        "(noise alone leaves 3.9 µrad)."
    )


def test_a_procedure_that_no_held_out_run_tests_is_named() -> None:
    sides = {side: {**ERRORS, "by_procedure": dict.fromkeys(names, ERRORS)} for side, names in SIDES.items()}
    text = said("none", equations={"torsion": {"unit": "rad", **sides}})
    assert text.endswith("; no held-out run tests free-run or backdrive.")


def test_an_ambiguous_set_is_not_said_for_sure() -> None:
    text = said("ambiguous", [LAG, GRAVITY])
    assert text.startswith(
        "The model lacks channel-delay or torque-sensor-lag: these runs cannot tell which; besides it lacks gravity"
    )


def test_noise() -> None:
    assert said("none").startswith(
        "Nothing is missing as far as these runs tell: what is left is noise; on 1 held-out run"
    )


def test_an_absorbed_parameter_with_its_causes() -> None:
    text = said("absorbed", still_open=[ABSORBED])
    assert text.startswith(
        "K_F0 is 29.0 % below its catalogue value: fixture-compliance or torque-sensor-gain could have moved it;"
    )


def test_an_untraced_rest_names_its_equation_and_that_one_s_error() -> None:
    equations = {"torsion": {"unit": "rad", "held_out": ERRORS}, "motor-torque": {"unit": "N*m", "held_out": WORSE}}
    text = said(
        "untraced", still_open=[{"verdict": "untraced", "evidence": {"equation": "motor-torque"}}], equations=equations
    )
    assert text == (
        "What is left of motor-torque could not be traced to a cause; on 1 held-out run the error of motor-torque is "
        "0.35 mN·m rms."
    )


def test_a_rest_that_does_not_repeat_is_no_effect_that_is_missing() -> None:
    equations = {"torsion": {"unit": "rad", "held_out": ERRORS}}
    still_open = [{"verdict": "uncontrolled", "evidence": {"equation": "torsion"}}]
    text = said("uncontrolled", still_open=still_open, equations=equations)
    assert text.startswith("What is left of torsion does not repeat: single events, or something that is not held;")


def test_an_error_that_grew_is_said_beside_the_one_that_fell() -> None:
    equations = {"torsion": {"unit": "rad", "held_out": ERRORS}, "motor-torque": {"unit": "N*m", "held_out": WORSE}}
    assert "but that of motor-torque rises from 0.25 to 0.35 mN·m" in said("named", [GRAVITY], equations=equations)


def test_an_unnamed_term_is_told_by_its_variable_and_shape() -> None:
    assert effect_words("unnamed:motor_position:periodic") == (
        "something periodic in motor_position that no effect of the catalogue is"
    )
    assert effect_words("unnamed:x") == "something  in x that no effect of the catalogue is"


@pytest.mark.parametrize("verdict", [*Verdict])
def test_whatever_is_missing_there_is_a_sentence(verdict: str) -> None:
    content = {"schema": "rig.loop/1", "verdict": verdict}
    if verdict in ("named", "ambiguous", "unnamed"):
        content["steps"] = [{"verdict": verdict, "effect": ""}]
    elif verdict != "none":
        content["open"] = [{"verdict": verdict}]
    text = statement(LoopFile.model_validate(content))
    assert text.endswith(".")
    assert len(text) > 20


def remark(still_open=(), **errors) -> str:
    held = {**ERRORS, "by_procedure": {"free-run": ERRORS, "backdrive": {**ERRORS, **errors}}}
    equations = {"torsion": {"unit": "rad", "held_out": held}}
    verdict = "untraced" if still_open else "named"
    content = loop_content(verdict=verdict, open=list(still_open), equations=equations)
    return floor_remark(LoopFile.model_validate(content))


def test_an_error_above_its_floor_that_counts_as_noise_is_said_with_the_rule() -> None:
    text = remark(rms_after=4.6e-6)
    assert text.startswith(
        "After lies above the floor's interval in torsion (backdrive): up to 1.5 times its upper end"
    )
    assert remark(rms_after=6.7e-6).startswith("After lies above 1.5 times the floor's interval in torsion (backdrive)")
    assert "counts as noise" not in remark(rms_after=6.7e-6)
    assert remark(rms_after=4.3e-6) == ""
    assert remark(rms_after=4.6e-6, floor_ci95=None) == ""


@pytest.mark.parametrize("equation", ["torsion", "motor-torque, torsion"])
@pytest.mark.parametrize("procedure", ["backdrive", None])
def test_an_error_above_its_floor_of_which_a_statement_speaks_is_left_to_it(procedure, equation) -> None:
    said_of = {"verdict": "untraced", "evidence": {"equation": equation, "procedure": procedure}}
    assert remark([said_of], rms_after=9e-6) == ""

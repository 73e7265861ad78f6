"""The sentence with which the demo judges the loop by the truth."""

import math
from dataclasses import replace

from rig.commands.demo import Truth, bench_model, draw_effect, judged
from rig.loop.result import Estimate, LoopResult, Step, Verdict

TRUTH = Truth("cogging", {"amplitude": (0.003, "N*m"), "order": (84.0, "1/rev"), "phase": (3.1, "rad")})


def step(effect: str, *members: str, amplitude: float = 0.003, phase: float = 3.1) -> Step:
    values = {"amplitude": (amplitude, 1e-5, "N*m"), "phase": (phase, 0.01, "rad")}
    parameters = {name: Estimate(v, (v - half, v + half), unit) for name, (v, half, unit) in values.items()}
    parameters["order"] = Estimate(84.0, None, "1/rev")
    return Step(
        Verdict.AMBIGUOUS if members else Verdict.NAMED, effect, members, "motor_position", "periodic", (),
        "motor-torque", parameters, (), 1e-9, {}, {},
    )  # fmt: skip


def said(*steps: Step) -> str:
    empty = LoopResult(("a",), ("b",), {}, (), (), (), 0.0, bench_model(draw_effect(1)))
    return judged(TRUTH, replace(empty, steps=steps))


def test_what_was_found_is_judged_by_its_intervals_and_a_phase_within_a_turn():
    right = "The loop found what was hidden, and nothing else"
    assert said(step("cogging")) == f"{right}; 2 of 2 intervals hold the truth."
    assert said(step("cogging", phase=3.1 - 2.0 * math.pi)) == f"{right}; 2 of 2 intervals hold the truth."
    assert said(step("cogging", amplitude=0.0031)) == f"{right}; 1 of 2 intervals hold the truth."


def test_what_is_not_there_is_said():
    assert ", and beside it what is not there: gravity-load;" in said(step("cogging"), step("gravity-load"))
    assert said(step("gravity-load")) == (
        "The loop did not find what was hidden; it added what is not there: gravity-load."
    )


def test_a_set_with_the_truth_in_it_is_no_name():
    assert said(step("torque-ripple", "cogging", "torque-ripple")) == (
        "The loop found what was hidden as one of cogging | torque-ripple, and nothing else."
    )


def test_nothing_found_is_said():
    assert said() == "The loop did not find what was hidden."

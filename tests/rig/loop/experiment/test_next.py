"""What is open, the next experiment closes: the command in `loop.json`, typed at the same bench, settles it."""

from types import SimpleNamespace

import pytest

from rig.loop.experiment.choice import Choice
from rig.loop.experiment.next import by_hand, experiment_of
from tests.rig.loop.experiment.hidden import loop, record, truth

SINGLE_RATE = (
    "rig run locked-output --repeat 2 --set locked-output.dwell=2 --set locked-output.start_angles=2 "
    "--set locked-output.amplitudes=1 --set locked-output.rates=0.06"
)
LOCKED_ONLY = "rig run locked-output --set locked-output.dwell=2 --set locked-output.start_angles=4"


def proposal(result, members):
    """Give the next experiment of the step that leaves these effects open."""
    (step,) = (step for step in result["steps"] if step["verdict"] == "ambiguous")
    assert members <= set(step["set"])
    return step["next_experiment"]


@pytest.mark.timeout(600)
@pytest.mark.parametrize(
    ("campaign", "effect", "values", "members", "procedure"),
    [
        pytest.param(SINGLE_RATE, "maxwell-slip", {}, {"creep", "maxwell-slip"}, "", marks=pytest.mark.campaign),
        (
            LOCKED_ONLY + " --set locked-output.rates=0.12",
            "fixture-compliance",
            {"amplitude": 3e-5},
            {"fixture-compliance", "flexspline-compliance"},
            "backdrive",
        ),
    ],
    ids=["one rate", "fixture always closed"],
)
def test_the_printed_command_ends_the_ambiguity(tmp_path, campaign, effect, values, members, procedure):
    bench = truth(tmp_path, effect, **values)
    record(bench, campaign, 51, tmp_path / "first")
    told = proposal(loop([tmp_path / "first"], tmp_path / "before"), members)
    assert told["command"].startswith(f"rig run {procedure}")
    assert all(member in told["why"] for member in members)
    assert told["expected_separation_sigma"] > 5.0
    assert 0.1 < told["minutes"] < 5.0
    record(bench, told["command"], 52, tmp_path / "second")
    result = loop([tmp_path / "first", tmp_path / "second"], tmp_path / "after")
    # the steps of the drives' torque that shake the mesh may leave structure open beside it
    assert [(step["verdict"], step["effect"]) for step in result["steps"]] == [("named", effect)]
    assert not any(step["next_experiment"] for step in result["steps"])


@pytest.mark.campaign
@pytest.mark.timeout(600)
def test_what_no_run_of_the_bench_tells_apart_is_said_with_what_does_and_no_command(tmp_path):
    bench = truth(tmp_path, "torque-sensor-lag", time_constant=0.005)
    record(bench, SINGLE_RATE, 53, tmp_path / "first")
    told = proposal(loop([tmp_path / "first"], tmp_path / "loop"), {"channel-delay", "torque-sensor-lag"})
    assert told["command"] == ""
    assert told["expected_separation_sigma"] is None
    assert told["why"].startswith("No run of this bench tells channel-delay | torque-sensor-lag apart; by hand: ")


def test_where_nothing_is_known_that_tells_two_lines_apart_the_sentence_says_so() -> None:
    told = by_hand(["a line in the torsion", "unnamed:motor_position:periodic"])
    assert told == (
        "No run of this bench tells a line in the torsion | the line as it is now: motor_position:periodic apart, and "
        "no change by hand is known that does."
    )


@pytest.mark.parametrize("elsewhere", [True, False])
def test_what_the_chosen_run_leaves_is_for_another_run_or_by_hand_only_where_no_run_does(elsewhere: bool) -> None:
    rivals = [SimpleNamespace(effect=name) for name in ("backlash", "creep", "maxwell-slip")]
    offer = SimpleNamespace(entry=SimpleNamespace(varies="rates"), minutes=2.0, command=lambda repeat: "rig run x")
    left = frozenset({frozenset(("backlash", "maxwell-slip"))})
    chosen = Choice(
        offer, 1, (("backlash", "creep"), ("creep", "maxwell-slip")), 6.0, left if elsewhere else frozenset()
    )
    told = experiment_of(("backlash", "creep", "maxwell-slip"), SimpleNamespace(in_question=lambda: rivals), chosen)
    assert told.command == "rig run x"
    assert told.why.startswith("Rates: tells backlash from creep and creep from maxwell-slip.")
    assert (
        "What remains of backlash and maxwell-slip another run tells: ask again with this one." in told.why
    ) == elsewhere
    assert ("No run of this bench tells backlash | maxwell-slip apart" in told.why) != elsewhere

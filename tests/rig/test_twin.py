"""The twin: the simulated bench runs the fitted model, and the loop finds in its logs what it found in the bench's."""

import math

import pytest

from tests.rig.loop.experiment.hidden import loop, record, truth

RATES = (
    "rig run locked-output --set locked-output.dwell=2 --set locked-output.start_angles=2 "
    "--set locked-output.amplitudes=1 --set locked-output.rates=0.06,0.17,0.03"
)
TURNS = (
    "rig run free-run --set free-run.dwell=2 --set free-run.turns=1 --set free-run.speeds=22,31,41 "
    "--set free-run.repeats=1"
)
LOADS = (
    "rig run free-run --set free-run.dwell=2 --set free-run.turns=1 --set free-run.speeds=31,60 "
    "--set free-run.repeats=1 --set free-run.load_torques=-8,0,8"
)

WIDE = 1.5
"""Half widths of both 95 % intervals together by which one seed may miss."""


@pytest.mark.timeout(600)
@pytest.mark.parametrize(
    ("effect", "values", "campaign", "equation"),
    [
        ("kinematic-error", {"amplitude": 6e-5, "order": 2.0, "phase": 0.7}, TURNS, "torsion"),
        pytest.param("load-dependent-friction", {"amplitude": 0.08}, LOADS, "motor-torque", marks=pytest.mark.campaign),
        pytest.param("creep", {"time_constant": 1.5}, RATES, "torsion", marks=pytest.mark.campaign),
    ],
)
def test_the_loop_finds_the_same_in_the_logs_of_the_twin(tmp_path, effect, values, campaign, equation):
    record(truth(tmp_path, effect, **values), campaign, 61, tmp_path / "bench")
    measured = loop([tmp_path / "bench"], tmp_path / "model")
    record(tmp_path / "model" / "model.json", campaign, 62, tmp_path / "twin")
    again = loop([tmp_path / "twin"], tmp_path / "again")
    assert measured["effects"] == again["effects"] == [effect]
    for name, value in values.items():
        one, other = (result["steps"][0]["parameters"][name] for result in (measured, again))
        half = sum(0.5 * (x["ci95"][1] - x["ci95"][0]) for x in (one, other))
        assert abs(one["value"] - other["value"]) <= WIDE * half, name
        assert one["value"] == pytest.approx(value, rel=0.1), name
    # the structure, not the noise, makes up what the base model leaves
    before, twin = (result["equations"][equation]["held_out"] for result in (measured, again))
    assert before["rms_before"] > 1.3 * before["rms_after"]
    assert math.isclose(before["rms_before"], twin["rms_before"], rel_tol=0.1)

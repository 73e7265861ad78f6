"""From the procedure to the verdict on the simulated bench, with an effect that the loop is not told."""

import math
from pathlib import Path

import pytest

from rig.commands import demo
from rig.commands.loop import dut_of
from rig.log.load import load_runs
from rig.loop.campaign import LoopOptions
from rig.loop.result import LoopResult, Verdict
from rig.loop.trace import trace
from sim_backend.model.effects import CATALOGUE, ActiveEffect

WIDE = 1.5
"""Half widths of a 95 % interval by which one seed may miss: three standard errors."""


def traced(folder: Path, effects: tuple[ActiveEffect, ...]) -> LoopResult:
    demo.record(effects, seed=71, logs=folder)
    runs = load_runs([folder])
    return trace(runs, dut_of(runs), LoopOptions())


@pytest.mark.campaign  # the same with fewer runs: test_twin.py, test_next.py and the README's example
@pytest.mark.timeout(600)  # ten minutes of bench time
def test_an_undeclared_kinematic_error_is_named_and_removed_down_to_the_floor(tmp_path):
    hidden = ActiveEffect(CATALOGUE["kinematic-error"], (1e-4, 2.0, 0.7))
    result = traced(tmp_path, (hidden,))
    assert result.verdict is Verdict.NAMED
    assert result.effects == ("kinematic-error",)
    found = result.steps[0].parameters
    counted_down = 2.0 * math.pi / dut_of(load_runs([tmp_path])).motor.encoder_counts  # half a count, twice a turn
    for name, truth in (("order", 2.0), ("amplitude", 1e-4), ("phase", 0.7 + counted_down)):
        low, high = found[name].ci95
        assert abs(found[name].value - truth) < WIDE * 0.5 * (high - low), name
    torsion = result.equations["torsion"].held_out
    assert torsion.rms_before > 10 * torsion.rms_after
    assert torsion.floor_ci95[0] <= torsion.rms_after <= torsion.floor_ci95[1]


@pytest.mark.campaign
@pytest.mark.timeout(600)  # ten minutes of bench time
def test_without_an_effect_the_loop_says_none(tmp_path):
    result = traced(tmp_path, ())
    assert result.verdict is Verdict.NONE
    assert result.effects == ()

"""A hum that does not start with the logs is told with its frequency; noise and lines of an angle are none."""

import math

import numpy as np
import pytest

from rig.log.run import ProcedureName, Run
from rig.loop.campaign import LoopOptions
from rig.loop.result import Verdict
from rig.loop.statements.hums import hum_of, without_hum
from rig.loop.trace import trace
from tests.independent.campaign import held_out
from tests.independent.instruments import NoiseKind
from tests.independent.terms import Effects, Line
from tests.rig.loop.runs import as_run, dut
from tests.rig.loop.statements.left import by_place, changed, left_of, recorded

SIZE = 3e-4
"""N*m."""

FREE = ("motor-torque", "free-run")


def humming(seed: int, hertz: float, noise: NoiseKind = NoiseKind.WHITE, size: float = SIZE) -> list[Run]:
    """Give runs with a hum in the motor torque while it turns, of another phase in every run."""
    rng = np.random.default_rng(seed)
    runs = []
    for run in map(as_run, recorded(seed, noise)):
        phase = rng.uniform(-math.pi, math.pi)
        free = run.procedure is ProcedureName.FREE_RUN
        added = size * free
        runs.append(changed(run, "motor_torque", lambda t, a=added, p=phase: a * np.sin(2.0 * math.pi * hertz * t + p)))
    return runs


@pytest.mark.parametrize("noise", list(NoiseKind))
@pytest.mark.parametrize("hertz", [1.7, 12.5, 41.3])
def test_a_hum_is_found_with_its_frequency_and_amplitude(hertz, noise):
    residuals, _ = left_of(humming(31, hertz, noise))
    found = hum_of(by_place(residuals)[FREE])
    assert found is not None
    assert found.frequency == pytest.approx(hertz, abs=0.05)
    assert found.amplitude == pytest.approx(SIZE, rel=0.2)
    calm = [without_hum(residual, found) for residual in by_place(residuals)[FREE]]
    assert hum_of(calm) is None


@pytest.mark.parametrize("seed", [41, 42, 43])
@pytest.mark.parametrize("noise", list(NoiseKind))
def test_noise_of_any_colour_has_no_hum(noise, seed):
    residuals, _ = left_of(recorded(seed, noise))
    assert all(hum_of(members) is None for members in by_place(residuals).values())


@pytest.mark.parametrize("order", [1.0, 7.0, 24.0])
def test_a_line_of_an_angle_is_no_hum(order):
    residuals, _ = left_of(recorded(51, effects=Effects(cogging=(Line(order, 1e-3, 0.4),))))
    assert all(hum_of(members) is None for members in by_place(residuals).values())


@pytest.mark.timeout(300)
def test_a_hum_with_a_phase_of_its_own_in_every_run_is_uncontrolled_and_told_in_hertz():
    runs = humming(61, 12.5)
    result = trace(runs, dut(), LoopOptions(held_out=held_out(recorded(61))))
    assert (result.verdict, result.effects) == (Verdict.UNCONTROLLED, ())
    (item,) = result.open
    assert item.evidence["frequency"] == pytest.approx(12.5, abs=0.05)
    assert item.evidence["amplitude"] == pytest.approx(SIZE, rel=0.2)
    assert item.next_experiment is not None
    assert "12.5 Hz" in item.next_experiment.why
    assert item.next_experiment.command.startswith("rig run free-run")

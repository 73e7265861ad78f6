"""A further column that is another reading of what is predicted is no cause of it; what merely goes with it may be."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from rig.log.run import Run
from rig.loop.campaign import LoopOptions
from rig.loop.result import EquationResult, Verdict
from rig.loop.signals.copies import without_copies
from rig.loop.trace import trace
from tests.independent.campaign import Campaign, Plan
from tests.rig.loop.runs import Floats, dut, runs_of, turning_run

FREE = Plan(locked_angles=0, locked_pairs=0, backdrives=0, free_runs=4, free_run_pairs=1)
NOISE = 2e-4
"""N*m of the motor torque of `turning_run`."""


def beside(run: Run, column: Callable[[Run], Floats]) -> Run:
    return replace(run, auxiliary={"iq": column(run)}, auxiliary_units={"iq": "A"})


def noise(run: Run, size: float) -> Floats:
    return size * np.random.default_rng(7).standard_normal(run.time.size)


def current(run: Run, own: float = 0.0) -> Floats:
    return run.signals["motor_torque"] / 0.321 + noise(run, own)


def switched(run: Run) -> Floats:
    return (run.time % 2.0 < 1.0).astype(float)


@pytest.mark.parametrize("own", [0.0, NOISE / 0.321, 3.0 * NOISE / 0.321])
def test_a_column_with_the_noise_of_the_torque_is_left_out_and_told(own: float) -> None:
    runs = [beside(turning_run(name, seed), lambda run: current(run, own)) for seed, name in enumerate("ab")]
    left, (warning,) = without_copies(runs)
    assert [run.auxiliary for run in left] == [{}, {}]
    assert warning == (
        "iq moves with motor_torque from sample to sample: taken for another reading of it, and not for a cause."
    )


@pytest.mark.parametrize(
    ("column", "share"),
    [
        (lambda run: noise(run, 1.0), 0.1),
        (lambda run: np.sin(run.time), 10.0),
        (lambda run: np.round(np.sin(run.time), 1), 10.0),
        (switched, 10.0),
        (lambda run: np.zeros(run.time.size), 0.0),
        (lambda run: np.full(run.time.size, np.nan), 0.0),
    ],
    ids=["noise of its own", "slow", "rounded", "switched", "constant", "never read"],
)
def test_a_column_of_its_own_stays_though_the_torque_follows_it(column: Callable[[Run], Floats], share: float) -> None:
    """The torque follows it by a `share` of its own noise."""

    def driven(run: Run) -> Run:
        more = np.nan_to_num(column(run)) * share * NOISE
        return replace(run, signals={**run.signals, "motor_torque": run.signals["motor_torque"] + more})

    runs = [beside(driven(turning_run(name, seed)), column) for seed, name in enumerate("ab")]
    left, warnings = without_copies(runs)
    assert [list(run.auxiliary) for run in left] == [["iq"], ["iq"]]
    assert warnings == ()


def test_a_campaign_that_lacks_nothing_stays_without_a_cause_beside_such_a_column() -> None:
    runs, held_out = runs_of(Campaign(2002, plan=FREE, rate=100.0))
    runs = tuple(beside(run, lambda run: current(run, 3e-4)) for run in runs)
    result = trace(runs, dut(), LoopOptions(held_out=held_out))
    assert (result.verdict, result.effects) == (Verdict.NONE, ())
    assert any(text.startswith("iq moves with motor_torque") for text in result.warnings)
    motor: EquationResult = result.equations["motor-torque"]
    assert motor.held_out is not None
    assert motor.held_out.rms_after == motor.held_out.rms_before

"""A run whose torque is far louder or quieter than that of the others is named; noise of no kind is taken for that."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from rig.log.run import Run
from rig.loop.campaign import LoopOptions
from rig.loop.statements.loudness import loud_or_quiet
from rig.loop.trace import trace
from tests.independent.campaign import STANDARD, Campaign, Plan
from tests.independent.instruments import Instruments, NoiseKind
from tests.rig.loop.runs import Floats, dut, runs_of

THREE = Plan(locked_angles=2, locked_pairs=1, backdrives=2, backdrive_pairs=1, free_runs=2, output_turns=0.6)


def three_of_each(change: Callable[[Floats], Floats] = lambda values: values, *names: str) -> list[Run]:
    """Give three runs of every procedure, the output torque of those with these `names` changed."""
    runs, _ = runs_of(Campaign(5, plan=THREE, rate=100.0))
    return [
        replace(run, signals={**run.signals, "output_torque": change(run.signals["output_torque"])})
        if run.name in names
        else run
        for run in runs
    ]


def in_millis(values: Floats) -> Floats:
    return 1000.0 * values


def noisy(values: Floats) -> Floats:
    return values + 0.6 * np.random.default_rng(1).standard_normal(values.size)


@pytest.mark.parametrize("plan", [THREE, STANDARD], ids=["three of each", "other rates and loads"])
@pytest.mark.parametrize("noise", list(NoiseKind))
def test_noise_of_any_kind_is_as_loud_in_every_run(noise: NoiseKind, plan: Plan) -> None:
    for seed in (1, 2):
        runs, _ = runs_of(Campaign(seed, instruments=Instruments(noise=noise), plan=plan, rate=100.0))
        assert loud_or_quiet(runs) == []


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (in_millis, "is 20 N*m, 1000 times"),
        (noisy, "is 0.6 N*m, 30 times"),
        (lambda values: 1e-3 * values, "is 2e-05 N*m, 0.001 times"),
    ],
    ids=["mN*m", "noisy", "kN*m"],
)
def test_the_one_run_with_another_noise_is_named(change: Callable[[Floats], Floats], told: str) -> None:
    for name in ("free-run-02", "backdrive-01a", "locked-output-02"):
        (text,) = loud_or_quiet(three_of_each(change, name))
        assert text.startswith(f"{name}: noise of output_torque")
        assert text.endswith(f"of the other {name.rsplit('-', 1)[0]} runs: unit, range or cable?")
        number = [float(word) for word in text.split() if word[0].isdigit()]
        expected = [float(word) for word in told.split() if word[0].isdigit()]
        assert number == pytest.approx(expected, rel=0.3)


def test_of_two_runs_against_two_or_of_two_alone_none_is_named() -> None:
    four, _ = runs_of(Campaign(5, plan=replace(THREE, free_runs=3), rate=100.0))
    free = [run for run in four if run.name.startswith("free-run")]
    odd = [replace(run, signals={"output_torque": 1e3 * run.signals["output_torque"]}) for run in free[:2]]
    assert len(free) == 4
    assert loud_or_quiet([*odd, *free[2:]]) == []
    assert loud_or_quiet([odd[0], free[3]]) == []
    assert len(loud_or_quiet([odd[0], *free[1:]])) == 1


def test_a_held_out_run_in_millis_is_among_the_warnings() -> None:
    result = trace(three_of_each(in_millis, "free-run-02"), dut(), LoopOptions(held_out=("free-run-02",)))
    assert any(text.startswith("free-run-02: noise of output_torque") for text in result.warnings)

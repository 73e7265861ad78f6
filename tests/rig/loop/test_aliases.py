"""Orders that a campaign cannot tell apart, against the arithmetic of sampling."""

import numpy as np
import pytest

from rig.log.run import Run
from rig.loop.campaign import LoopOptions
from rig.loop.result import LoopResult, Verdict
from rig.loop.search.aliases import Sampling, aliases, alike, likeliest, stands_still
from rig.loop.trace import trace
from tests.independent.campaign import Campaign, Plan
from tests.independent.effects import Effects
from tests.independent.terms import Line
from tests.rig.loop.runs import dut, make_run, runs_of

COUNT = 2 * np.pi / 16384


def legs(*per_turn: float) -> tuple[Sampling, ...]:
    return tuple(Sampling(samples, 50.0, 100.0) for samples in per_turn)


def test_one_leg_folds_at_its_samples_a_revolution() -> None:
    assert aliases(2.0, 200.0, legs(180.0)) == pytest.approx((178.0, 182.0))


def test_speeds_that_are_multiples_share_the_aliases_of_the_slowest() -> None:
    assert aliases(84.0, 200.0, legs(240.0, 120.0, 60.0)) == pytest.approx((156.0,))


def test_speeds_that_are_no_multiples_share_none() -> None:
    assert aliases(84.0, 200.0, legs(240.0, 131.0, 77.0)) == ()
    assert not alike(84.0, 156.0, legs(240.0, 131.0))


def test_a_line_that_every_sample_of_a_leg_sees_alike_stands_still_there() -> None:
    assert stands_still(104.0, legs(131.0, 26.0))
    assert stands_still(26.0, legs(26.0))
    assert not stands_still(104.1, legs(131.0, 26.0))
    assert not stands_still(2.0, legs(131.0, 26.0))


def test_the_lowest_whole_order_is_the_likeliest() -> None:
    assert likeliest(20.72, (84.0, 125.44), legs(104.72)) == 84.0
    assert likeliest(192.0, (12.0, 168.0), legs(180.0)) == 12.0
    assert likeliest(20.72, (83.31,), legs(104.03)) == 20.72


def campaign(rate: float, speeds: tuple[float, ...], count: float) -> LoopResult:
    """Trace cogging of order 84 and a kinematic error of order 2, two runs at each speed."""
    rng = np.random.default_rng(5)
    runs: list[Run] = []
    for number, speed in enumerate(speeds * 2):
        time = np.arange(0.0, 24.0, 1.0 / rate)
        turning = np.interp(time, [0, 0.2, 11.8, 12.0, 12.2, 23.8, 24.0], [0, 1, 1, 0, -1, -1, 0])
        angle = np.cumsum(speed * turning) / rate
        seen = count * np.floor(angle / count) if count else angle
        signals = {
            "motor_position": seen,
            "output_position": -angle / 100 + 1e-4 * np.sin(2 * angle + 0.5) + 2e-7 * rng.standard_normal(time.size),
            "motor_torque": 0.012 * np.sign(turning)
            + 3e-3 * np.sin(84 * angle + 0.3)
            + 2e-4 * rng.standard_normal(time.size),
        }
        runs.append(make_run(f"r{number}", "free-run", time, signals, replicate=f"s{speed:g}"))
    out = (f"r{len(speeds) - 1}", f"r{2 * len(speeds) - 1}")
    return trace(runs, dut(), LoopOptions(held_out=out))


def test_orders_at_commensurate_speeds_are_the_whole_ones_and_their_aliases_are_said() -> None:
    result = campaign(500.0, (30.0, 60.0, 120.0), 0.0)
    found = {step.effect: [line.order for line in step.lines] for step in result.steps}
    assert found["cogging"] == pytest.approx([84.0], abs=1e-3)
    assert found["kinematic-error"] == pytest.approx([2.0], abs=1e-3)
    assert any("cannot tell the order 84 of motor_position from 20.7" in text for text in result.warnings)


def test_counts_that_beat_with_the_samples_are_no_kinematic_error() -> None:
    """16384 counts at 22 rad/s and 1 kHz, 285.6 samples a turn: the sawtooth folds down to order 104.84."""
    result = campaign(1000.0, (22.0, 44.0, 88.0), COUNT)
    (step,) = (step for step in result.steps if step.effect == "kinematic-error")
    assert [line.order for line in step.lines] == pytest.approx([2.0], abs=1e-3)


def free_runs_alone(seed: int, effects: Effects, rate: float = 100.0) -> LoopResult:
    """Trace a campaign of three free runs, two of them replicates, that hides these effects."""
    plan = Plan(locked_angles=0, locked_pairs=0, backdrives=0, backdrive_pairs=0, free_runs=2, free_run_pairs=1)
    runs, held = runs_of(Campaign(seed, effects=effects, plan=plan, rate=rate))
    return trace(runs, dut(), LoopOptions(held_out=held))


@pytest.mark.timeout(300)
@pytest.mark.parametrize(
    ("seed", "rate"), [(8000, 50.0), (8003, 50.0), (14, 200.0), *((seed, 100.0) for seed in (2, 5, 107, 108, 8203))]
)
def test_free_runs_alone_show_no_effect_that_the_counts_of_either_encoder_make(seed: int, rate: float) -> None:
    result = free_runs_alone(seed, Effects(), rate)
    assert result.effects == ()
    assert result.verdict is Verdict.NONE


@pytest.mark.timeout(300)
def test_an_effect_as_small_as_a_count_is_found_where_it_does_not_beat() -> None:
    (step,) = free_runs_alone(109, Effects(kinematic_error=(Line(2.0, 4e-6, 0.3),))).steps
    assert "kinematic-error" in step.effect
    assert step.lines[0].order == pytest.approx(2.0, abs=0.01)
    assert step.lines[0].amplitude == pytest.approx(4e-6, rel=0.1)

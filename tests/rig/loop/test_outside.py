"""Physics of no catalogue that shows in few places: a hum, a drag of the speed, one that settles, a rate."""

from collections.abc import Callable
from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from rig.log.run import ProcedureName, Run
from rig.loop.campaign import LoopOptions
from rig.loop.model.hum import with_hums
from rig.loop.model.terms import Entry, Line, TermClass
from rig.loop.result import LoopResult, Verdict
from rig.loop.signals.tracks import Track, make_track, thin_track
from rig.loop.trace import trace
from sim_backend.model.effects import Shape
from tests.independent.campaign import Campaign, Plan
from tests.rig.loop.runs import dut, make_run, runs_of

Floats = NDArray[np.float64]

LADDER = Plan(
    locked_angles=6,
    locked_pairs=1,
    backdrives=3,
    backdrive_pairs=1,
    free_runs=3,
    free_run_pairs=1,
    holds=(0.0, 5.0),
    further_legs=((5.0, 30.0, 10.0), (35.0, 70.0, 10.0)),
)
HERTZ, SIZE = 2.5, 3e-4
"""Frequency and amplitude (N*m) of the hum."""


def hum(run: Run) -> Run:
    return dragged(run, SIZE * np.sin(2.0 * np.pi * HERTZ * run.time + 1.0))


def churning(run: Run) -> Run:
    """Drag of a body in a fluid at a high Reynolds number: with the square of the speed."""
    speed = velocity(run)
    return dragged(run, 5e-7 * speed * np.abs(speed))


def settling(run: Run) -> Run:
    """Drag of a grease that takes 2 s to shear down after a change of speed."""
    speed, keep = velocity(run), np.exp(-0.01 / 2.0)
    slow = lfilter([1.0 - keep], [1.0, -keep], speed)
    return dragged(run, 2e-5 * (speed - slow))


def rate_size(run: Run) -> Run:
    """Torsion that is larger, whichever way, the faster the torque changes."""
    if run.procedure is ProcedureName.FREE_RUN:
        return run
    rate = np.gradient(np.interp(run.time, run.time[::20], run.signals["output_torque"][::20]), run.time)
    name, share = (
        ("motor_position", 100.0) if run.procedure is ProcedureName.LOCKED_OUTPUT else ("output_position", 1.0)
    )
    moved = run.signals[name] + share * 3e-6 * np.abs(rate)
    return replace(run, signals=MappingProxyType({**run.signals, name: moved}))


def velocity(run: Run) -> Floats:
    """Motor speed of a free run, rad/s; 0 where the motor does not turn."""
    if run.procedure is not ProcedureName.FREE_RUN:
        return np.zeros(run.time.size)
    return np.convolve(np.gradient(run.signals["motor_position"], run.time), np.full(9, 1.0 / 9.0), mode="same")


def dragged(run: Run, torque: Floats) -> Run:
    signals = {**run.signals, "motor_torque": run.signals["motor_torque"] + torque}
    return replace(run, signals=MappingProxyType(signals))


def traced(hide: Callable[[Run], Run], seed: int) -> LoopResult:
    runs, held_out = runs_of(Campaign(seed, plan=LADDER, rate=100.0))
    return trace([hide(run) for run in runs], dut(), LoopOptions(held_out=held_out))


CASES = [
    pytest.param(hum, "time", Shape.PERIODIC, "motor-torque", marks=pytest.mark.campaign),
    (churning, "motor_velocity", Shape.STATIC, "motor-torque"),
    (settling, "motor_velocity", Shape.LAG, "motor-torque"),
    (rate_size, "output_torque", Shape.RATE, "torsion"),
]


@pytest.mark.parametrize(("hide", "variable", "shape", "equation"), CASES)
@pytest.mark.timeout(300)
def test_what_shows_in_few_places_is_unnamed_with_its_variable_and_shape(
    hide: Callable[[Run], Run], variable: str, shape: Shape, equation: str
) -> None:
    result = traced(hide, 11)
    assert [(step.verdict, step.variable, step.shape) for step in result.steps] == [(Verdict.UNNAMED, variable, shape)]
    assert result.verdict is Verdict.UNNAMED, "what the shape explains looks like nothing else any more"
    held_out = result.equations[equation].held_out
    assert held_out is not None
    assert held_out.rms_after < 0.9 * held_out.rms_before
    if hide is hum:
        (line,) = result.steps[0].lines
        assert line.order == pytest.approx(HERTZ, abs=1e-3)
        assert line.amplitude == pytest.approx(SIZE, rel=0.05)


def swept(noise: float) -> tuple[Track, Floats]:
    """Give a locked sweep of the motor torque with a hum, and the torque (n,) that is to be known, hum and all."""
    rng = np.random.default_rng(3)
    time = np.arange(0.0, 40.0, 0.01)
    torque = np.interp(time, [0, 5, 15, 25, 35, 40], [0.0, 0.1, -0.1, 0.1, 0.0, 0.0])
    true = torque + SIZE * np.sin(2.0 * np.pi * HERTZ * time)
    signals = {
        "motor_position": torque + 1e-5 * rng.standard_normal(time.size),
        "output_position": 1e-6 * rng.standard_normal(time.size),
        "motor_torque": true + noise * rng.standard_normal(time.size),
        "output_torque": 100.0 * torque + 0.01 * rng.standard_normal(time.size),
    }
    return make_track(make_run("a", "locked-output", time, signals), dut()), true


@pytest.mark.parametrize("noise", [3e-5, 2e-3])
def test_a_hum_that_smoothing_took_from_a_swept_torque_is_given_back(noise: float) -> None:
    track, true = swept(noise)
    line = Line(TermClass(None, Entry.MOTOR, "time"), HERTZ, SIZE, 0.0)
    again = with_hums(track, (line,))
    sine = np.sin(2.0 * np.pi * HERTZ * track.time)

    def missing(found: Floats | None) -> float:
        assert found is not None
        return float(2.0 * np.mean((true - found) * sine)) / SIZE

    for before, after in ((track.M, again.M), (track.play_drive, again.play_drive)):
        assert abs(missing(after)) < 0.03 + 3.0 * noise / SIZE * np.sqrt(2.0 / track.size)
        assert abs(missing(after)) <= abs(missing(before)) + 1e-12
    assert abs(missing(track.play_drive)) > 0.2  # a mean over 0.2 s takes a third of it, a polyline all
    assert again.T is track.T
    coarse = thin_track(track, 0.1)
    found = with_hums(coarse, (line,)).play_drive
    assert found is not None
    fine = np.sin(2.0 * np.pi * HERTZ * track.time[: found.size])
    left = 2.0 * np.mean((true[: found.size] - found) * fine) / SIZE
    assert abs(left) < 0.03 + 3.0 * noise / SIZE * np.sqrt(2.0 / track.size)
    assert with_hums(track, ()).M is track.M

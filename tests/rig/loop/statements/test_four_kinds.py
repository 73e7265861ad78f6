"""A replicate pair and the quiet dwells decide what kind of residual it is, before any term is tried.

| the residual | is |
|---|---|
| repeats between replicates | missing physics |
| is what noise leaves, white or coloured | noise |
| steps at single moments | an event |
| does not repeat and is more than noise leaves | something that nobody holds |
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from rig.loop.model.equations import pieces_of
from rig.loop.signals.tracks import make_track
from rig.loop.statements.events import events_of, without_events
from rig.loop.statements.evidence import ljung_box, louder, repeats
from rig.loop.statements.residuals import Residual
from tests.independent.instruments import NoiseKind
from tests.independent.terms import Effects, Line, term
from tests.rig.loop.runs import as_run, dut, turning_run
from tests.rig.loop.statements.left import by_place, changed, left_of, recorded

COUNT = 2.0 * math.pi / 16384
"""Of the motor's encoder, rad at the motor."""


def judged(recordings):
    """Give structured and unsteady places, and all events, of what the base model leaves."""
    residuals, model = left_of(recordings)
    events = events_of(residuals, dut(), model)
    calm = [without_events(residual, found) for residual, found in zip(residuals, events, strict=True)]
    said = {place: repeats(members, dut(), model) for place, members in by_place(calm).items()}
    assert all(item is not None for item in said.values())
    return (
        {place for place, item in said.items() if item.structured},
        {place for place, item in said.items() if item.unsteady},
        [event for found in events for event in found],
    )


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("noise", list(NoiseKind))
def test_noise_of_any_colour_is_noise(noise, seed):
    recordings = recorded(seed, noise)
    assert judged(recordings) == (set(), set(), [])
    assert louder(left_of(recordings)[0]) == []


@pytest.mark.parametrize(
    ("effects", "place"),
    [
        (Effects(kinematic_error=(Line(7.0, 4e-5, 0.3),)), ("torsion", "locked-output")),
        (Effects(others=(term("backlash", amplitude=2e-2, contact=1e-3, ratio=100.0),)), ("torsion", "locked-output")),
        (
            Effects(others=(term("torque-sensor-nonlinearity", even=3.0, odd=0.0, full_scale=32.0),)),
            ("output-torque", "locked-output"),
        ),
    ],
    ids=["kinematic error", "backlash", "bent transducer"],
)
def test_missing_physics_repeats(effects, place):
    structured, unsteady, events = judged(recorded(4, NoiseKind.WHITE, effects))
    assert place in structured
    assert unsteady == set()
    assert events == []


@pytest.mark.parametrize("noise", [NoiseKind.WHITE, NoiseKind.AR1])
def test_missed_counts_are_events_with_their_times_and_counts(noise):
    missed = Effects(
        others=(term("encoder-missed-counts", amplitude=6.0, rate=0.03, seed=5.0, encoder_counts=16384.0),)
    )
    with_them, without = recorded(6, noise, missed), recorded(6, noise)
    structured, _, events = judged(with_them)
    assert structured == set()
    found, real = 0, 0
    for one, other in zip(with_them, without, strict=True):
        # the same noise: what differs are the events
        steps = np.diff((one.columns["motor_position"] - other.columns["motor_position"]) / COUNT)
        truth = [(one.time[k + 1], round(steps[k])) for k in np.flatnonzero(np.abs(steps) > 2.0)]
        said = [(event.time, event.counts) for event in events if event.run == one.name]
        for time, counts in said:
            assert min((abs(time - at) for at, size in truth if abs(size - counts) <= 1), default=9.0) < 0.2, (
                one.name,
                time,
            )
        found, real = found + len(said), real + len(truth)
    # those while a free run changes its speed, or at the ends of a run, cannot be seen
    assert found > 0.6 * real > 6


@pytest.mark.parametrize("noise", [NoiseKind.TORQUE_PROPORTIONAL, NoiseKind.AR1])
def test_what_differs_slowly_from_run_to_run_is_held_by_nobody(noise):
    runs = [
        changed(as_run(item), "output_position", lambda t, k=2.4 * k: 4e-5 * np.sin(0.3 * t + k))
        for k, item in enumerate(recorded(8, noise))
    ]
    structured, unsteady, events = judged(runs)
    assert structured == set()
    assert ("torsion", "locked-output") in unsteady
    assert {equation for equation, _ in unsteady} == {"torsion"}
    assert events == []


def test_without_a_dwell_nothing_tells_what_does_not_repeat_from_coloured_noise():
    def cut(run):
        late = run.time > 5.3
        signals = {name: values[late] for name, values in run.signals.items()}
        return replace(run, time=run.time[late] - run.time[late][0], signals=signals)

    residuals, model = left_of([cut(as_run(item)) for item in recorded(9, NoiseKind.AR1)])
    for members in by_place(residuals).values():
        said = repeats(members, dut(), model)
        assert said is not None
        assert said.noise is None
        assert not said.unsteady


def with_steps(names):
    def jump(time):
        return np.where(time > 20.0, 9 * COUNT, 0.0)

    runs = [as_run(item) for item in recorded(10)]
    residuals, model = left_of([changed(run, "motor_position", jump) if run.name in names else run for run in runs])
    found = events_of(residuals, dut(), model)
    return {residual.piece.track.name for residual, events in zip(residuals, found, strict=True) if events}


@pytest.mark.parametrize(
    ("stepping", "told"),
    [
        (("locked-output-01a",), {"locked-output-01a"}),
        (("locked-output-01a", "locked-output-01b"), set()),
        (("locked-output-03",), {"locked-output-03"}),
        # where replicates step together the others' steps are the same shape that is missing
        (("locked-output-01a", "locked-output-01b", "locked-output-03"), set()),
    ],
)
def test_a_step_is_an_event_unless_replicates_have_it_too(stepping, told):
    assert with_steps(stepping) == told


def test_the_counts_of_a_reading_that_stands_are_no_events():
    """A held motor whose reading creeps over the edge of a count is no encoder that missed one."""
    runs = [
        changed(as_run(item), "motor_position", lambda t: np.where(t > 3.0, COUNT, 0.0))
        for item in recorded(11)
        if item.procedure == "backdrive"
    ]
    residuals, model = left_of(runs)
    assert not any(events_of(residuals[:1], dut(), model))


def test_of_a_run_too_short_for_it_no_memory_is_given() -> None:
    values = np.random.default_rng(2).standard_normal(2000)
    run = turning_run("a", 1)
    piece = pieces_of(make_track(run, dut()), 100.0)[0]
    time = piece.track.period * np.arange(values.size)
    box = ljung_box(Residual(piece, time, values))
    assert box == pytest.approx(1.0, abs=0.7)
    few = round(5.0 / piece.track.period)
    assert ljung_box(Residual(piece, time[:few], values[:few])) is None

"""backdrive on the simulated plant, whose tooth friction is 1.2 N*m at the output."""

from dataclasses import replace

import pytest

from drivers.errors import ConfigError, LimitError
from drivers.types import Mode
from procedures.backdrive import Backdrive, plan, summarise
from procedures.errors import NoMotionError, TravelError
from procedures.intents import Command
from tests.procedures.drive import FACTS, LIMITS, Driven, PlantBench, drive, drive_all, with_facts

FRICTION = 1.2

HELD = Backdrive(dwell=1.0, start_angles=1, repeats=1)

FREE = replace(HELD, input="free")

SIM = with_facts(backdriving_torque=FRICTION)
"""The plant has one friction level, the paper's catalogue two."""


@pytest.fixture(scope="module")
def held() -> Driven:
    bench = PlantBench()
    return next(driven for run, driven in drive_all(plan(HELD, FACTS), bench) if not run.set_up)


@pytest.fixture(scope="module")
def free() -> Driven:
    bench = PlantBench()
    return next(driven for run, driven in drive_all(plan(FREE, SIM), bench) if not run.set_up)


def test_held_input_gives_the_hysteresis_loss_and_the_friction_level(held: Driven) -> None:
    assert held.named("hysteresis_loss") == pytest.approx(1.14e-4, rel=0.03)
    assert held.named("friction_level") == pytest.approx(FRICTION, rel=0.01)


def test_held_input_gives_the_stiffness_of_the_chord(held: Driven) -> None:
    """16 N*m over f(16) + g(0.148)/N; the mean of the outer tenths is a little softer."""
    assert held.named("stiffness") == pytest.approx(16.0 / (1.664e-3 + 9.0e-5), rel=0.025)


def test_the_motor_is_held_where_it_stood(held: Driven) -> None:
    setpoints = {command.motor for command in held.commands if command.motor is not None}
    assert len(setpoints) == 1
    only = setpoints.pop()
    assert only.mode is Mode.POSITION
    assert only.value == held.samples[0].motor_position


def test_the_load_torque_runs_both_ways_to_the_rated_torque(held: Driven) -> None:
    torques = [command.load.value for command in held.commands if command.load is not None]
    assert max(torques) == pytest.approx(16.0)
    assert min(torques) == pytest.approx(-16.0)


def test_free_input_gives_the_backdriving_torque_both_ways(free: Driven) -> None:
    for direction in ("forward", "backward"):
        found = free.measurement(f"breakaway_torque_{direction}")
        assert found.uncertainty is not None
        assert abs(found.value - FRICTION) < 2.0 * found.uncertainty
        assert found.uncertainty < 0.03 * FRICTION


def test_the_motor_is_released_throughout_a_free_run(free: Driven) -> None:
    assert {command.motor for command in free.commands} == {None}


def test_the_load_torque_is_taken_away_promptly(free: Driven) -> None:
    torques = [command.load.value for command in free.commands if command.load is not None]
    speeds = [abs(sample.motor_velocity or 0.0) for sample in free.samples]
    assert max(map(abs, torques)) < 1.1 * FRICTION
    assert max(speeds) < FREE.speed_max


def test_the_summary_of_free_runs_is_the_backdriving_torque(free: Driven) -> None:
    joined = {m.name: m for m in summarise((free.result, free.result)).measurements}
    assert joined["backdriving_torque"].value == pytest.approx(FRICTION, rel=0.02)


def test_a_free_run_takes_as_long_as_planned_where_the_catalogue_is_right(free: Driven) -> None:
    run = next(run for run in plan(FREE, SIM) if not run.set_up)
    assert free.seconds == pytest.approx(run.duration, rel=0.05)


def test_a_drive_that_cannot_be_backdriven_ends_the_run_with_both_values() -> None:
    driven = drive(plan(replace(FREE, torque_max=0.8), FACTS)[1], PlantBench())
    assert isinstance(driven.error, NoMotionError)
    assert isinstance(driven.error, LimitError)
    assert driven.error.limit == 0.8
    assert abs(driven.error.travel) < 1e-3


class _LimpMotor(PlantBench):
    def cycle(self, command: Command) -> object:
        return super().cycle(replace(command, motor=None))


def test_a_motor_that_does_not_hold_ends_a_held_run() -> None:
    driven = drive(plan(HELD, FACTS)[1], _LimpMotor())
    assert isinstance(driven.error, TravelError)
    assert "does not hold" in str(driven.error)


def test_the_largest_load_torque_allowed_leaves_the_motor_below_its_limit() -> None:
    driven = drive(plan(replace(HELD, peak_torque=23.75), FACTS)[1], PlantBench())
    assert driven.error is None
    assert max(abs(sample.motor_torque or 0.0) for sample in driven.samples) < LIMITS.motor_torque


def test_the_fastest_load_rate_that_a_plan_takes_gives_the_friction_within_2_percent() -> None:
    driven = drive(plan(replace(HELD, rates=(32.8,)), FACTS)[1], PlantBench())
    assert driven.named("friction_level") == pytest.approx(FRICTION, rel=0.02)


def test_a_default_peak_asks_no_more_of_the_motor_than_it_may_hold() -> None:
    runs = plan(HELD, with_facts(limits=replace(LIMITS, motor_torque=0.1)))
    torques = [c.load.value for c in drive(runs[1], PlantBench()).commands if c.load is not None]
    assert max(torques) == pytest.approx(9.5)


def test_every_start_angle_is_repeated_in_both_modes() -> None:
    for mode in ("held", "free"):
        runs = [run for run in plan(Backdrive(input=mode, start_angles=3, repeats=2), FACTS) if not run.set_up]
        assert len(runs) == 6
        assert len({run.replicate for run in runs}) == len({run.start_angle for run in runs}) == 3


def test_held_rates_beyond_the_first_are_run_once() -> None:
    runs = [run for run in plan(replace(HELD, rates=(8.0, 4.0)), FACTS) if not run.set_up]
    assert [run.replicate for run in runs] == [None, None]
    assert runs[1].duration - runs[0].duration == pytest.approx(runs[0].duration - 1.0, rel=1e-9)


@pytest.mark.parametrize(
    ("parameters", "facts", "words"),
    [
        (Backdrive(peak_torque=40.0), {}, ("peak_torque", "40 N*m", "30 N*m")),
        (Backdrive(rates=(5.0, 1000.0)), {}, ("rates", "1000 N*m/s", "at most 32.82 N*m/s", "zero")),
        (Backdrive(peak_torque=2.2), {}, ("peak_torque", "2.2 N*m", "2.5 N*m", "never slides", "backdriving_torque")),
        (Backdrive(amplitudes=(0.1,)), {}, ("amplitudes", "1.6 N*m", "2.5 N*m", "never slides")),
        (Backdrive(peak_torque=30.0), {}, ("peak_torque", "30 N*m", "28.5 N*m")),
        (Backdrive(peak_torque=28.0), {}, ("peak_torque", "0.28 N*m", "motor_torque", "peak_torque / ratio")),
        (Backdrive(input="free", torque_rate=100.0), {}, ("torque_rate", "100 N*m/s", "too fast, at most 19.69 N*m/s")),
        (Backdrive(input="free", torque_max=40.0), {}, ("torque_max", "40 N*m", "30 N*m")),
        (Backdrive(), {"has_load_drive": False}, ("no load drive",)),
        (Backdrive(input="stuck"), {}, ("input", "stuck", "held or free")),
        (Backdrive(bias_torque=12.0), {}, ("bias_torque", "20 N*m", "16 N*m")),
        (Backdrive(amplitudes=()), {}, ("amplitudes",)),
        (
            Backdrive(input="free", speed_max=90.0),
            {"limits": replace(LIMITS, motor_velocity=50.0)},
            ("speed_max", "50 rad/s"),
        ),
    ],
)
def test_what_bench_or_limits_forbid_is_refused(
    parameters: Backdrive, facts: dict[str, object], words: tuple[str, ...]
) -> None:
    with pytest.raises(ConfigError) as caught:
        plan(parameters, with_facts(**facts))
    for word in words:
        assert word in str(caught.value)

"""locked-output on the simulated plant, with Zhang's drive: N T_fs = 1.2 N*m, loop width 2 g(12 mN*m)/N."""

import itertools
from dataclasses import replace

import pytest

from drivers.errors import ConfigError
from drivers.types import Mode
from procedures.errors import TravelError
from procedures.intents import Command
from procedures.locked_output import LockedOutput, plan, summarise
from procedures.waveforms import start_angles
from tests.procedures.drive import FACTS, LIMITS, Driven, PlantBench, drive, drive_all, with_facts

WIDTH = 2.0 * 9.0e-5 * (1.0 - 2.718281828 ** (-1.0))
"""1.14e-4 rad: twice the wave generator's torsion at 12 mN*m, equation (27) with C_w = 1/12 mN*m."""

SHORT = LockedOutput(dwell=0.5, start_angles=1, replicate_pairs=0, rates=(0.2,))


class _HoldingLoad(PlantBench):
    """A load drive that holds as stiffly as the fixture does."""

    def cycle(self, command: Command) -> object:
        held = command.load is not None and command.load.mode is Mode.POSITION
        self.set_lock(held)
        return super().cycle(replace(command, load=None) if held else command)


@pytest.fixture(scope="module")
def default_run() -> Driven:
    bench = PlantBench()
    runs = plan(LockedOutput(), FACTS)
    drive(runs[0], bench)
    return drive(runs[1], bench)


def test_the_hysteresis_loss_is_the_wave_generators_share(default_run: Driven) -> None:
    loss = default_run.measurement("hysteresis_loss")
    # a sweep of 18 s has a viscous share: the rim slides at a few mrad/s
    assert loss.value == pytest.approx(WIDTH, rel=0.03)
    assert loss.uncertainty is not None
    assert loss.uncertainty < 0.01 * WIDTH


def test_the_friction_level_is_the_starting_torque(default_run: Driven) -> None:
    assert default_run.named("friction_torque") == pytest.approx(0.012, rel=0.01)


def test_the_stiffness_is_the_chord_to_the_rated_torque(default_run: Driven) -> None:
    """16 N*m over f(16) + g(0.17)/N = 1.664e-3 + 9.0e-5 rad; the mean of the outer tenths is 1 % softer."""
    assert default_run.named("stiffness") == pytest.approx(16.0 / (1.664e-3 + 9.0e-5), rel=0.02)


def test_the_rated_output_torque_is_reached_and_not_exceeded(default_run: Driven) -> None:
    torques = [sample.output_torque or 0.0 for sample in default_run.samples]
    # four standard deviations of the transducer's noise of 0.02 N*m, and half a per cent for the fast sweep
    assert max(torques) == pytest.approx(16.0, abs=0.16)
    assert min(torques) == pytest.approx(-16.0, abs=0.16)


def test_the_gear_is_left_without_torque(default_run: Driven) -> None:
    last = [sample.output_torque or 0.0 for sample in default_run.samples[-40:]]
    # without the last turn 1.2 N*m would stay locked in
    assert abs(sum(last) / len(last)) < 0.05


def test_reversals_are_nested_three_deep(default_run: Driven) -> None:
    torques = [c.motor.value for c in default_run.commands if c.motor is not None]
    moving = [value for value, _ in itertools.groupby(torques)]
    turns = [b for a, b, c in zip(moving, moving[1:], moving[2:], strict=False) if (b - a) * (c - b) < 0.0]
    peak = 0.172
    shares = (1.0, -1.0, 1.0, -0.5, 0.5, -0.5, 0.25, -0.25, 0.25)
    assert turns == pytest.approx([*(share * peak for share in shares), -0.012])


def test_the_default_plan_has_eight_start_angles_two_pairs_and_two_rates() -> None:
    runs = [run for run in plan(LockedOutput(), FACTS) if not run.set_up]
    assert {run.start_angle for run in runs} == set(start_angles(8))
    groups = [run.replicate for run in runs if run.replicate is not None]
    assert sorted(groups) == ["locked-output-angle-1"] * 2 + ["locked-output-angle-2"] * 2
    assert sum("rate" in run.name for run in runs) == 1
    assert len(runs) == 8 + 2 + 1


def test_the_output_is_unlocked_only_to_move_and_in_the_end() -> None:
    runs = drive_all(plan(replace(SHORT, start_angles=2, replicate_pairs=1), FACTS), PlantBench())
    locks = [(run.set_up, driven.locks) for run, driven in runs]
    assert locks == [
        (True, [False, True]),
        (False, []),
        (False, []),
        (True, [False, True]),
        (False, []),
        (True, [False]),
    ]


def test_runs_start_at_different_motor_angles_under_the_same_lock() -> None:
    runs = drive_all(plan(replace(SHORT, start_angles=3), FACTS), PlantBench())
    starts = [driven.samples[0].motor_position or 0.0 for run, driven in runs if not run.set_up]
    assert min(abs(a - b) for a, b in itertools.combinations(starts, 2)) > 1.0


def test_a_hold_waits_at_every_turning_point() -> None:
    without, with_hold = (plan(replace(SHORT, hold=hold), FACTS)[1] for hold in (0.0, 2.0))
    bench = PlantBench()
    drive(plan(SHORT, FACTS)[0], bench)
    held = drive(with_hold, bench)
    assert with_hold.duration == pytest.approx(without.duration + 10 * 2.0)
    assert held.seconds == pytest.approx(with_hold.duration, rel=0.01)
    assert sum(phase.startswith("hold") for _, phase in held.phases) == 10


def test_a_bias_moves_the_nested_triangles_only() -> None:
    run = plan(replace(SHORT, bias_torque=0.05, amplitudes=(1.0, 0.2)), FACTS)[1]
    bench = PlantBench()
    drive(plan(SHORT, FACTS)[0], bench)
    phases = [phase for _, phase in drive(run, bench).phases if phase.startswith("sweep")]
    assert phases[3:6] == ["sweep down to 0.0156 N*m", "sweep up to 0.0844 N*m", "sweep down to 0.0156 N*m"]


def test_each_further_rate_adds_one_run_at_the_first_angle() -> None:
    runs = [run for run in plan(replace(SHORT, rates=(0.2, 0.1, 0.05), start_angles=2), FACTS) if not run.set_up]
    assert [run.name for run in runs] == ["angle-1", "angle-1-rate-2", "angle-1-rate-3", "angle-2"]
    sweeps = [run.duration - 0.5 for run in runs]
    assert sweeps[1] == pytest.approx(2.0 * sweeps[0])
    assert sweeps[2] == pytest.approx(4.0 * sweeps[0])


def test_a_load_drive_that_holds_serves_as_the_lock() -> None:
    runs = plan(replace(SHORT, lock="load-drive", rates=(0.05,)), FACTS)
    bench = _HoldingLoad()
    done = drive_all(runs, bench)
    assert all(driven.locks in ([], [False]) for _, driven in done)
    driven = next(driven for run, driven in done if not run.set_up)
    holds = {command.load for command in driven.commands if command.motor is not None}
    assert len(holds) == 1
    assert driven.named("hysteresis_loss") == pytest.approx(WIDTH, rel=0.05)


def test_an_output_that_is_not_held_ends_the_run() -> None:
    driven = drive(plan(SHORT, FACTS)[1], PlantBench())
    assert isinstance(driven.error, TravelError)
    assert driven.error.limit == SHORT.travel_max
    # one cycle at the speed it has by then
    assert abs(driven.error.value) < 1.1 * SHORT.travel_max


def test_without_a_torque_sensor_the_run_is_logged_and_nothing_is_claimed() -> None:
    facts = with_facts(has_torque_sensor=False)
    runs = plan(SHORT, facts)
    bench = PlantBench(facts)
    drive(runs[0], bench)
    driven = drive(runs[1], bench)
    assert driven.error is None
    assert driven.result.measurements == ()


@pytest.mark.parametrize("bounds", [{"rates": (0.328,)}, {"rates": (0.005,), "peak_torque": 0.015}])
def test_the_fastest_rate_and_the_smallest_loop_that_a_plan_takes_give_the_friction(bounds: dict[str, object]) -> None:
    runs = plan(replace(SHORT, **bounds), FACTS)
    bench = PlantBench()
    drive(runs[0], bench)
    assert drive(runs[1], bench).named("friction_torque") == pytest.approx(0.012, rel=0.025)


def test_without_a_torque_sensor_any_rate_may_be_logged() -> None:
    assert plan(LockedOutput(rates=(1.0,)), with_facts(has_torque_sensor=False))


def test_the_summary_is_the_mean_over_the_runs(default_run: Driven) -> None:
    joined = {m.name: m for m in summarise((default_run.result, default_run.result)).measurements}
    assert joined["stiffness"].value == pytest.approx(default_run.named("stiffness"))


@pytest.mark.parametrize(
    ("parameters", "facts", "words"),
    [
        (LockedOutput(peak_torque=0.3), {}, ("peak_torque", "0.3 N*m", "motor_torque", "0.25 N*m")),
        (LockedOutput(rates=(1.0,)), {}, ("rates", "1 N*m/s", "at most 0.3282 N*m/s", "Lower the rate")),
        (LockedOutput(rates=(0.05, 1000.0)), {}, ("rates", "1000 N*m/s", "at most 0.3282 N*m/s")),
        (LockedOutput(rates=(0.2,)), {"cycle_time": 0.01}, ("rates", "0.2 N*m/s", "24 cycles")),
        (LockedOutput(amplitudes=(0.01,)), {}, ("amplitudes", "0.00172 N*m", "0.015 N*m", "never slides")),
        (LockedOutput(peak_torque=0.005), {}, ("peak_torque", "0.005 N*m", "0.015 N*m", "never slides")),
        (LockedOutput(peak_torque=0.25), {}, ("peak_torque", "0.25 N*m", "0.2375 N*m")),
        (
            LockedOutput(peak_torque=0.2),
            {"limits": replace(LIMITS, output_torque=16.0)},
            ("peak_torque", "18.8 N*m", "16 N*m"),
        ),
        (LockedOutput(), {"has_lock": False}, ("lock", "no lock")),
        (LockedOutput(lock="load-drive"), {"has_load_drive": False}, ("lock", "no load drive")),
        (LockedOutput(lock="glue"), {}, ("lock", "glue", "fixture or load-drive")),
        (LockedOutput(replicate_pairs=9), {}, ("replicate_pairs", "9")),
        (LockedOutput(bias_torque=0.1), {}, ("bias_torque", "0.186 N*m", "0.172 N*m")),
        (LockedOutput(amplitudes=()), {}, ("amplitudes",)),
        (LockedOutput(tare=True), {"has_torque_sensor": False}, ("tare", "no torque sensor")),
        (
            LockedOutput(),
            {"limits": replace(LIMITS, motor_travel=2.0)},
            ("start_angles", "3.14159 rad", "motor_travel", "2 rad"),
        ),
    ],
)
def test_what_bench_or_limits_forbid_is_refused(
    parameters: LockedOutput, facts: dict[str, object], words: tuple[str, ...]
) -> None:
    with pytest.raises(ConfigError) as caught:
        plan(parameters, with_facts(**facts))
    for word in words:
        assert word in str(caught.value)


def test_every_mistake_is_reported_at_once() -> None:
    with pytest.raises(ConfigError) as caught:
        plan(LockedOutput(lock="glue", replicate_pairs=20, peak_torque=1.0), FACTS)
    assert len(caught.value.mistakes) >= 3


def test_a_default_peak_stays_below_a_tight_limit() -> None:
    runs = plan(LockedOutput(), with_facts(limits=replace(LIMITS, motor_torque=0.1)))
    bench = PlantBench()
    drive(runs[0], bench)
    driven = drive(runs[1], bench, replace(LIMITS, motor_torque=0.1))
    assert driven.error is None

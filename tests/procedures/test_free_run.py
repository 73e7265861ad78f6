"""free-run on the simulated plant: 12 mN*m of dry friction and 1e-4 N*m*s of viscous friction at the motor."""

import itertools
from dataclasses import replace

import pytest

from drivers.errors import ConfigError, RigTimeoutError
from drivers.types import Mode, Sample
from procedures.free_run import FreeRun, plan, summarise
from procedures.intents import Command
from procedures.waveforms import TURN
from sim_backend.model.effects import CATALOGUE, ActiveEffect
from tests.procedures.drive import FACTS, LIMITS, Driven, PlantBench, drive, drive_all, with_facts

FAST = FreeRun(dwell=1.0, speeds=(100.0, 200.0), turns=1, repeats=1)


@pytest.fixture(scope="module")
def ladder() -> list[Driven]:
    runs = drive_all(plan(FAST, FACTS), PlantBench())
    return [driven for run, driven in runs if not run.set_up]


def test_the_friction_at_every_speed_is_coulomb_plus_viscous(ladder: list[Driven]) -> None:
    for driven, speed in zip(ladder, FAST.speeds, strict=True):
        # the noise of the current over a leg leaves 2 uN*m
        assert driven.named("friction") == pytest.approx(0.012 + 1e-4 * speed, abs=2e-5)
        assert abs(driven.named("torque_offset")) < 2e-5


def test_the_summary_splits_coulomb_and_viscous_friction(ladder: list[Driven]) -> None:
    joined = {m.name: m for m in summarise(tuple(driven.result for driven in ladder)).measurements}
    assert joined["coulomb_friction"].value == pytest.approx(0.012, rel=0.01)
    assert joined["viscous_friction"].value == pytest.approx(1e-4, rel=0.01)
    assert "friction_at_100_rad_s" in joined
    assert "friction_at_200_rad_s" in joined


def test_one_speed_gives_its_friction_and_no_split(ladder: list[Driven]) -> None:
    names = {m.name for m in summarise((ladder[0].result,)).measurements}
    assert names == {"friction_at_100_rad_s", "torque_offset_at_100_rad_s"}


def test_the_slowest_default_leg_covers_two_output_turns_both_ways() -> None:
    runs = [run for run in plan(FreeRun(dwell=0.5), FACTS) if not run.set_up]
    slowest = max(runs, key=lambda run: run.duration)
    driven = drive(slowest, PlantBench())
    turned = [(sample.output_position or 0.0) / TURN for sample in driven.samples]
    forward = next(cycle for cycle, phase in driven.phases if phase.startswith("leg forward"))
    reversal = next(cycle for cycle, phase in driven.phases if phase == "slow down")
    backward = next(cycle for cycle, phase in driven.phases if phase.startswith("leg backward"))
    stop = [cycle for cycle, phase in driven.phases if phase == "slow down"][1]
    # a thousandth of a turn: the velocity loop's lag at the ends of the leg
    assert turned[forward] - turned[reversal] == pytest.approx(2.0, abs=1e-3)
    assert turned[stop] - turned[backward] == pytest.approx(2.0, abs=1e-3)


def test_speeds_are_reached_by_gentle_ramps(ladder: list[Driven]) -> None:
    for driven in ladder:
        speeds = [c.motor.value for c in driven.commands if c.motor is not None and c.motor.mode is Mode.VELOCITY]
        steps = [abs(b - a) for a, b in itertools.pairwise(speeds)]
        assert max(steps) <= FAST.acceleration * 1e-3 * (1.0 + 1e-9)


def test_the_motor_is_released_during_the_dwell(ladder: list[Driven]) -> None:
    assert all(command.motor is None for command in ladder[0].commands[:1000])


def test_the_default_ladder_goes_from_slow_to_fast_and_stays_below_the_limit() -> None:
    for limit in (50.0, 220.0, 1000.0):
        limits = replace(LIMITS, motor_velocity=limit)
        runs = [
            run for run in plan(FreeRun(repeats=1, turns=1, dwell=0.5), with_facts(limits=limits)) if not run.set_up
        ]
        assert len(runs) == 4
        driven = drive(runs[-1], PlantBench(), limits)
        assert max(abs(s.motor_velocity or 0.0) for s in driven.samples) < limit


def test_a_coast_down_releases_the_motor_until_it_stands() -> None:
    run = plan(replace(FAST, speeds=(200.0,), coast_down=1.0), FACTS)[1]
    driven = drive(run, PlantBench())
    assert driven.error is None
    assert driven.seconds == pytest.approx(run.duration, rel=0.01)
    for start in [cycle for cycle, phase in driven.phases if phase == "coast-down"]:
        assert all(command.motor is None for command in driven.commands[start : start + 1000])
        assert abs(driven.samples[start + 5].motor_velocity or 0.0) > 100.0
        assert abs(driven.samples[start + 999].motor_velocity or 0.0) < 1.0


def test_a_coast_down_that_is_too_short_is_an_error_that_says_so() -> None:
    driven = drive(plan(replace(FAST, speeds=(200.0,), coast_down=0.05), FACTS)[1], PlantBench())
    assert isinstance(driven.error, RigTimeoutError)
    assert driven.error.waited == 0.05
    assert "coast_down" in str(driven.error)


class _SilentVelocity(PlantBench):
    """A drive that maps no velocity into its PDOs, as the CANopen drives here."""

    def cycle(self, command: Command) -> Sample:
        return super().cycle(command)._replace(motor_velocity=None)


@pytest.mark.parametrize("coast_down", [0.001, 0.05])
def test_a_short_coast_down_is_noticed_without_a_measured_velocity(coast_down: float) -> None:
    driven = drive(plan(replace(FAST, speeds=(200.0,), coast_down=coast_down), FACTS)[1], _SilentVelocity())
    assert isinstance(driven.error, RigTimeoutError)
    assert driven.error.waited == coast_down
    assert "coast_down" in str(driven.error)


@pytest.mark.parametrize("counts", [256, 16384])
def test_a_coast_down_from_creeping_speed_is_not_mistaken_for_motion(counts: int) -> None:
    """2 % of a creeping speed is less than one encoder count in 10 ms."""
    facts = with_facts(ratio=2.0, motor_counts=counts)
    run = plan(replace(FAST, speeds=(1.0,), coast_down=0.5), facts)[1]
    assert drive(run, _SilentVelocity(facts)).error is None


def test_every_speed_is_repeated_as_replicates() -> None:
    runs = [run for run in plan(FreeRun(speeds=(20.0, 40.0, 80.0), repeats=3), FACTS) if not run.set_up]
    assert len(runs) == 9
    assert len({run.replicate for run in runs}) == 3
    # warm-up must not be mistaken for speed: the ladder is climbed anew for every repeat
    assert [run.replicate for run in runs[:4]] == [
        "free-run-speed-1",
        "free-run-speed-2",
        "free-run-speed-3",
        "free-run-speed-1",
    ]


LOADED = replace(FAST, speeds=(150.0,), load_torques=(-8.0, 0.0, 8.0))


@pytest.fixture(scope="module")
def loaded() -> list[Driven]:
    friction = ActiveEffect(CATALOGUE["load-dependent-friction"], (0.05, FACTS.ratio))
    runs = drive_all(plan(LOADED, FACTS), PlantBench(effects=(friction,)))
    return [driven for run, driven in runs if not run.set_up]


def test_half_the_sum_of_both_directions_is_the_load_over_the_ratio(loaded: list[Driven]) -> None:
    for driven, load in zip(loaded, LOADED.load_torques, strict=True):
        offset = driven.measurement("torque_offset")
        assert driven.named("load_torque") == load
        assert offset.uncertainty is not None
        assert abs(offset.value - load / FACTS.ratio) < 3.0 * offset.uncertainty
        assert offset.uncertainty < 1e-5


def test_half_the_difference_is_friction_that_grows_with_the_load(loaded: list[Driven]) -> None:
    for driven, load in zip(loaded, LOADED.load_torques, strict=True):
        friction = 0.012 + 0.05 * abs(load) / FACTS.ratio + 1e-4 * 150.0
        assert driven.named("friction") == pytest.approx(friction, rel=0.01)


def test_the_load_is_put_on_and_off_while_the_motor_holds_still(loaded: list[Driven]) -> None:
    driven = loaded[0]
    for before, command in itertools.pairwise(driven.commands):
        if command.load is not None and before.load is not None and command.load.value != before.load.value:
            assert command.motor == (Mode.VELOCITY, 0.0)
    held = max(abs(sample.motor_velocity or 0.0) for sample in driven.samples[1000:2000])
    # winding up by g(80 mN*m)/N and f(8 N*m) in one second turns the motor by a tenth of a radian; the loop is soft
    assert held < 5.0
    assert driven.commands[-1].load == (Mode.TORQUE, 0.0)
    assert driven.seconds == pytest.approx(plan(LOADED, FACTS)[1].duration, rel=0.01)


def test_the_summary_of_a_load_ladder_is_by_load_and_speed(loaded: list[Driven]) -> None:
    names = {m.name for m in summarise(tuple(driven.result for driven in loaded)).measurements}
    assert names == {f"{q}_at_150_rad_s_and_{load}_N_m" for q in ("friction", "torque_offset") for load in (-8, 0, 8)}


def test_replicates_share_speed_and_load() -> None:
    runs = [run for run in plan(replace(LOADED, speeds=(100.0, 150.0), repeats=2), FACTS) if not run.set_up]
    assert len(runs) == 12
    assert [run.replicate for run in runs[:3]] == [
        "free-run-speed-1-load-1",
        "free-run-speed-2-load-1",
        "free-run-speed-1-load-2",
    ]
    assert len({run.replicate for run in runs}) == 6


@pytest.mark.parametrize(
    ("parameters", "facts", "words"),
    [
        (LOADED, {"has_load_drive": False}, ("load_torques", "no load drive")),
        (replace(LOADED, coast_down=1.0), {}, ("coast_down", "1 s", "load_torques")),
        (replace(LOADED, load_torques=(1.0, -29.0)), {}, ("load_torques", "29 N*m", "28.5 N*m")),
        (replace(LOADED, load_torques=(24.0,)), {}, ("load_torques", "0.2542 N*m at the motor", "motor_torque")),
        (replace(FAST, acceleration=2e4), {}, ("acceleration", "0.452 N*m", "motor_torque", "0.25 N*m")),
    ],
)
def test_torques_that_bench_or_motor_cannot_give_are_refused(
    parameters: FreeRun, facts: dict[str, object], words: tuple[str, ...]
) -> None:
    with pytest.raises(ConfigError) as caught:
        plan(parameters, with_facts(**facts))
    for word in words:
        assert word in str(caught.value)


def test_a_bench_without_a_lock_needs_no_set_up() -> None:
    assert not any(run.set_up for run in plan(FreeRun(), with_facts(has_lock=False)))


@pytest.mark.parametrize(
    ("parameters", "limits", "words"),
    [
        (FreeRun(speeds=(300.0,)), LIMITS, ("speeds", "300 rad/s", "motor_velocity", "220 rad/s")),
        (FreeRun(speeds=(220.0,)), LIMITS, ("speeds", "220 rad/s", "209 rad/s", "overshoot")),
        (FreeRun(), replace(LIMITS, output_travel=6.0), ("turns", "output_travel", "6 rad")),
        (FreeRun(), replace(LIMITS, motor_travel=1000.0), ("turns", "motor_travel", "1000 rad")),
    ],
)
def test_what_a_limit_forbids_is_refused_by_name_value_and_limit(
    parameters: FreeRun, limits: object, words: tuple[str, ...]
) -> None:
    with pytest.raises(ConfigError) as caught:
        plan(parameters, with_facts(limits=limits))
    for word in words:
        assert word in str(caught.value)

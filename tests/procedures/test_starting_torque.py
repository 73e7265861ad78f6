"""starting-torque on the simulated plant, whose breakaway torque is 12 mN*m."""

import math
from dataclasses import replace

import pytest

from drivers.errors import ConfigError, LimitError
from procedures.errors import NoMotionError
from procedures.intents import Command, Measurement, Result
from procedures.plan import PlannedRun
from procedures.starting_torque import StartingTorque, plan, summarise
from procedures.waveforms import TURN, start_angles
from tests.procedures.drive import FACTS, LIMITS, PlantBench, drive, with_facts

BREAKAWAY = 0.012
"""1.2 N*m of tooth friction over the ratio of 100."""

STEP = 1.88e-4
"""1 per mille of a motor's 188 mN*m: what a drive can command."""

SHORT = StartingTorque(dwell=1.0, start_angles=1, repeats=1)


def measuring(parameters: StartingTorque, **facts: object) -> PlannedRun:
    return next(run for run in plan(parameters, with_facts(**facts)) if not run.set_up)


@pytest.mark.parametrize("direction", ["forward", "backward"])
@pytest.mark.parametrize("counts", [4096, 16384])
def test_the_breakaway_is_right_within_its_uncertainty_at_both_resolutions(counts: int, direction: str) -> None:
    facts = with_facts(motor_counts=counts)
    driven = drive(measuring(SHORT, motor_counts=counts), PlantBench(facts, torque_step=STEP))
    found = driven.measurement(f"breakaway_torque_{direction}")
    assert found.uncertainty is not None
    assert abs(found.value - BREAKAWAY) < 2.0 * found.uncertainty
    assert found.uncertainty < 0.02 * BREAKAWAY


@pytest.mark.parametrize("counts", [4096, 16384])
@pytest.mark.parametrize("rate", [5e-4, 2e-3, 0.01, 0.05, 0.118])
def test_the_breakaway_is_right_within_its_uncertainty_at_every_rate_a_plan_takes(rate: float, counts: int) -> None:
    facts = with_facts(motor_counts=counts)
    run = measuring(replace(SHORT, torque_rate=rate), motor_counts=counts)
    driven = drive(run, PlantBench(facts, torque_step=STEP), keep_samples=False)
    for direction in ("forward", "backward"):
        found = driven.measurement(f"breakaway_torque_{direction}")
        assert found.uncertainty is not None
        assert abs(found.value - BREAKAWAY) < 2.0 * found.uncertainty
        # 2 % at the rate of the default plan, 5 % where the rotor hardly follows a coarse encoder's ramp
        assert found.uncertainty < (0.02 if rate <= 2e-3 else 0.055) * BREAKAWAY


@pytest.mark.parametrize("rate", [0.2, 0.5, 1.0])
def test_a_drive_that_breaks_away_far_below_its_catalogue_value_is_stated_as_uncertain(rate: float) -> None:
    """The plan trusts the catalogue; winding up is then too short for the rate, and the result has to say so."""
    run = measuring(replace(SHORT, torque_rate=rate, torque_max=0.2), starting_torque=0.15)
    driven = drive(run, PlantBench(torque_step=STEP), keep_samples=False)
    found = driven.measurement("breakaway_torque_forward")
    assert found.uncertainty is not None
    assert abs(found.value - BREAKAWAY) < 2.0 * found.uncertainty


def test_the_first_pulse_measures_the_encoder_and_not_the_friction() -> None:
    pulses = {}
    for counts in (2048, 16384):
        driven = drive(measuring(SHORT, motor_counts=counts), PlantBench(with_facts(motor_counts=counts)))
        pulses[counts] = max(driven.named(f"first_pulse_torque_{d}") for d in ("forward", "backward"))
    assert pulses[2048] > 3.0 * pulses[16384]
    assert pulses[16384] < 0.1 * BREAKAWAY


def test_the_motor_is_stopped_promptly_after_the_breakaway() -> None:
    driven = drive(measuring(SHORT), PlantBench())
    speeds = [abs(sample.motor_velocity or 0.0) for sample in driven.samples]
    positions = [sample.motor_position or 0.0 for sample in driven.samples]
    assert max(speeds) < SHORT.speed_max
    # 0.1 rad end the ramp; friction stops a rotor of a few rad/s within a few hundredths of a radian
    assert max(abs(position - positions[0]) for position in positions) < 0.15


def test_no_torque_is_commanded_beyond_the_one_that_broke_away() -> None:
    driven = drive(measuring(SHORT), PlantBench())
    torques = [command.motor.value for command in driven.commands if command.motor is not None]
    assert max(map(abs, torques)) < 1.1 * BREAKAWAY


def test_a_motor_that_does_not_move_ends_the_run_with_torque_limit_and_travel() -> None:
    driven = drive(measuring(replace(SHORT, torque_max=0.008)), PlantBench())
    error = driven.error
    assert isinstance(error, NoMotionError)
    assert isinstance(error, LimitError)
    assert error.limit == 0.008
    assert error.value == pytest.approx(0.008)
    # the wave generator's spring has wound up by g(8 mN*m) = 4.4 mrad; a count is 0.4 mrad
    assert error.travel == pytest.approx(4.4e-3, abs=8e-4)
    assert error.facts["travel"] == error.travel


def test_a_motor_that_turns_against_its_torque_reveals_a_wrong_sign() -> None:
    error = drive(measuring(SHORT), PlantBench(encoder_sign=-1.0)).error
    assert isinstance(error, ConfigError)
    assert "sign" in str(error)


def test_every_start_angle_is_measured_as_often_as_asked() -> None:
    runs = [run for run in plan(StartingTorque(start_angles=4, repeats=3), FACTS) if not run.set_up]
    assert len(runs) == 12
    assert {run.start_angle for run in runs} == set(start_angles(4))
    assert len({run.replicate for run in runs}) == 4


def test_each_run_starts_at_its_angle() -> None:
    bench = PlantBench()
    for run in plan(replace(SHORT, start_angles=5), FACTS):
        if run.set_up:
            assert drive(run, bench).error is None
        else:
            position = bench.cycle(Command()).motor_position or 0.0
            # the position controller's rest and the spring's relaxation: half a degree is plenty
            assert abs(math.remainder(position - (run.start_angle or 0.0), TURN)) < 0.01


def test_the_set_up_unlocks_and_zeroes_once_when_asked() -> None:
    bench = PlantBench()
    runs = plan(replace(SHORT, start_angles=2, repeats=2, tare=True), FACTS)
    set_ups = [drive(run, bench) for run in runs if run.set_up]
    assert [driven.locks for driven in set_ups] == [[False]] * 4
    assert [driven.tares for driven in set_ups] == [1, 0, 0, 0]


def test_the_summary_gives_the_means_over_runs_and_over_both_directions() -> None:
    def run(forward: float, backward: float) -> Result:
        return Result(
            (
                Measurement("breakaway_torque_forward", forward, "N*m", 1e-4),
                Measurement("breakaway_torque_backward", backward, "N*m", 1e-4),
            )
        )

    joined = {m.name: m for m in summarise((run(0.011, 0.012), run(0.013, 0.014))).measurements}
    assert joined["breakaway_torque_forward"].value == pytest.approx(0.012)
    assert joined["breakaway_torque_backward"].value == pytest.approx(0.013)
    assert joined["starting_torque"].value == pytest.approx(0.0125)


@pytest.mark.parametrize(
    ("parameters", "limits", "words"),
    [
        (StartingTorque(torque_rate=100.0), LIMITS, ("torque_rate", "100 N*m/s", "too fast, at most 0.1182 N*m/s")),
        (StartingTorque(torque_rate=1.0), LIMITS, ("torque_rate", "1 N*m/s", "rotor can follow")),
        (StartingTorque(torque_max=0.3), LIMITS, ("torque_max", "0.3 N*m", "motor_torque", "0.25 N*m")),
        (StartingTorque(speed_max=90.0), replace(LIMITS, motor_velocity=50.0), ("speed_max", "90 rad/s", "50 rad/s")),
        (StartingTorque(motion=0.5), replace(LIMITS, motor_travel=0.8), ("motion", "1 rad", "0.8 rad")),
    ],
)
def test_what_a_limit_forbids_is_refused_by_name_value_and_limit(
    parameters: StartingTorque, limits: object, words: tuple[str, ...]
) -> None:
    with pytest.raises(ConfigError) as caught:
        plan(parameters, with_facts(limits=limits))
    for word in words:
        assert word in str(caught.value)


def test_a_motion_of_too_few_encoder_counts_is_refused_before_anything_moves() -> None:
    with pytest.raises(ConfigError, match=r"motion.*0\.0123 rad.*10 counts of the motor encoder"):
        plan(StartingTorque(motion=0.0123), with_facts(motor_counts=4096))


def test_a_slow_cycle_asks_for_a_slow_ramp() -> None:
    with pytest.raises(ConfigError, match=r"torque_rate.*50 cycles"):
        plan(StartingTorque(torque_rate=0.1), with_facts(cycle_time=0.01))


def test_a_coarse_encoder_moves_further_before_it_calls_it_motion() -> None:
    assert drive(measuring(SHORT, motor_counts=256), PlantBench(with_facts(motor_counts=256))).error is None

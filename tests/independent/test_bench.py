"""The quasi-static bench obeys the papers' numbers, and each effect shows where it acts."""

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.independent import bench, laws
from tests.independent import effects as fx

Floats = NDArray[np.float64]
DRIVE = laws.shd_17_100()
NOTHING = fx.Effects()
KINEMATIC = fx.Effects(kinematic_error=(fx.Line(2.0, 1e-4, 0.4),))
COGGED = fx.Effects(cogging=(fx.Line(20.0, 3e-3, 1.1),))
HANGING = fx.Effects(gravity_load=fx.Arm(0.6, 0.3))


def cycles(peak: float, samples: int = 1000) -> Floats:
    """Two triangles of the given peak after a rise from zero; the last 4 * samples are one closed cycle."""
    corners = peak * np.array([0.0, 1.0, -1.0, 1.0, -1.0, 1.0])
    return np.interp(np.arange(9 * samples + 1) / samples, [0, 1, 3, 5, 7, 9], corners)


def last_cycle(signal: Floats) -> Floats:
    return signal[-4001:]


def locked(effects: fx.Effects, start_angle: float = 0.0) -> bench.Signals:
    return bench.locked_output(cycles(0.16), start_angle, DRIVE, effects)


def path(turns: float) -> tuple[Floats, Floats]:
    """Go `turns` motor turns and come back, at 20 rad/s, 200 samples a second: angle and speed."""
    there = np.arange(0.0, turns * 2 * np.pi, 0.1)
    position = np.concatenate([there, there[::-1]])
    return position, np.concatenate([np.full(there.size, 20.0), np.full(there.size, -20.0)])


def torsion(signals: bench.Signals) -> Floats:
    return signals[1] + signals[0] / DRIVE.ratio


def test_a_locked_sweep_of_16_newton_metres_turns_the_motor_by_0_166_rad():
    """The 16 N*m are those of the motor times the ratio; friction keeps 1.2 N*m of them from the output."""
    motor_position, _, _, output_torque = locked(NOTHING)
    assert np.max(np.abs(output_torque)) == pytest.approx(14.8, abs=1e-9)
    assert np.max(np.abs(motor_position)) == pytest.approx(0.166, abs=5e-4)
    half = bench.locked_output(cycles(0.08), 0.0, DRIVE, NOTHING)
    assert np.max(np.abs(half[0])) == pytest.approx(0.088, abs=5e-4)


def test_a_locked_cycle_dissipates_7_5_millijoule():
    motor_position, _, motor_torque, output_torque = locked(NOTHING)
    spent = np.trapezoid(last_cycle(motor_torque), last_cycle(motor_position))
    assert spent == pytest.approx(7.5e-3, abs=5e-5)
    assert np.corrcoef(output_torque, torsion(locked(NOTHING)))[0, 1] > 0.99


def test_a_backdriven_cycle_dissipates_0_72_millijoule():
    signals = bench.backdrive(cycles(16.0), 0.0, DRIVE, NOTHING)
    spent = np.trapezoid(last_cycle(signals[3]), last_cycle(signals[1]))
    assert spent == pytest.approx(0.72e-3, abs=1e-5)


@pytest.mark.parametrize("effects", [KINEMATIC, COGGED, HANGING], ids=["kinematic-error", "cogging", "gravity-load"])
def test_conservative_effects_leave_the_energy_of_a_locked_cycle_dissipative(effects: fx.Effects):
    motor_position, _, motor_torque, _ = locked(effects, start_angle=0.7)
    assert np.trapezoid(last_cycle(motor_torque), last_cycle(motor_position)) > 0.0


def test_an_unloaded_turn_costs_the_running_friction_and_the_sign_of_power_is_positive():
    position, velocity = path(2.0)
    _, _, motor_torque, output_torque = bench.free_run(position, velocity, DRIVE, NOTHING)
    assert motor_torque[100] == pytest.approx(0.012 + 1e-4 * 20.0)
    assert motor_torque[-1] == pytest.approx(-0.014)
    assert np.sum(motor_torque * velocity) > 0.0
    assert not output_torque.any()


def test_the_output_stands_still_while_the_wave_generator_winds_up_at_a_reversal():
    fine = np.concatenate([np.linspace(0.0, 0.1, 1001), np.linspace(0.1, 0.0, 1001)])
    slow = laws.Drive(*[getattr(DRIVE, name) for name in DRIVE.__slots__[:-1]], b=0.0)
    _, output_position, motor_torque, _ = bench.free_run(fine, np.zeros(fine.size), slow, NOTHING)
    winding = slice(1002, 1002 + 110)  # 2 g(12 mN m) = 11.4 mrad at the motor
    assert np.ptp(output_position[winding]) < 1e-12
    assert np.ptp(motor_torque[winding]) > 0.02


@pytest.mark.parametrize("procedure", ["locked-output", "free-run"])
def test_a_kinematic_error_adds_to_the_torsion_at_the_motor_angle(procedure: str):
    position, velocity = path(2.0)
    runs = {
        "locked-output": lambda effects: locked(effects, 0.9),
        "free-run": lambda effects: bench.free_run(position, velocity, DRIVE, effects),
    }
    signals = runs[procedure](KINEMATIC)
    motor_position, _, motor_torque, output_torque = signals
    slope = 2e-4 * np.cos(2.0 * motor_position + 0.4)
    base = laws.total_torsion(output_torque, motor_torque + output_torque * slope, DRIVE)
    left = torsion(signals) - base
    assert left == pytest.approx(1e-4 * np.sin(2.0 * motor_position + 0.4), abs=1e-12)


def test_a_kinematic_error_helps_or_hinders_the_held_motor_under_load():
    plain = bench.backdrive(cycles(16.0), 0.9, DRIVE, NOTHING)
    with_error = bench.backdrive(cycles(16.0), 0.9, DRIVE, KINEMATIC)
    helped = plain[2] - with_error[2]
    assert helped == pytest.approx(plain[3] * 2e-4 * np.cos(1.8 + 0.4), abs=1e-12)
    assert torsion(with_error) - torsion(plain) == pytest.approx(1e-4 * np.sin(1.8 + 0.4), abs=1e-12)


def test_work_at_motor_and_output_balances_over_a_turn_with_kinematic_error():
    """Without friction what the motor puts in comes out: the reaction on the motor is the slope of the error."""
    no_friction = laws.Drive(*[getattr(DRIVE, name) for name in DRIVE.__slots__[:5]], 0.0, 0.0, 0.0, 0.0)
    position, velocity = np.linspace(0.0, 2 * np.pi * 100, 200_001), np.full(200_001, 1.0)
    both = fx.Effects(kinematic_error=KINEMATIC.kinematic_error, gravity_load=fx.Arm(0.6, 0.3))
    _, output_position, motor_torque, _ = bench.free_run(position, velocity, no_friction, both)
    put_in = np.trapezoid(motor_torque, position)
    at_start, at_end = -0.6 * np.cos(output_position[[0, -1]] + 0.3)
    assert put_in == pytest.approx(at_end - at_start, abs=1e-6)


def test_cogging_adds_to_the_motor_torque_and_not_to_the_wave_generator():
    position, velocity = path(2.0)
    plain = bench.free_run(position, velocity, DRIVE, NOTHING)
    cogged = bench.free_run(position, velocity, DRIVE, COGGED)
    assert cogged[2] - plain[2] == pytest.approx(3e-3 * np.sin(20.0 * position + 1.1), abs=1e-15)
    assert torsion(cogged) == pytest.approx(torsion(plain), abs=1e-15)


def test_cogging_in_a_locked_sweep_is_taken_from_what_reaches_the_gear():
    motor_position, _, motor_torque, output_torque = locked(COGGED, 0.2)
    reaching = motor_torque - 3e-3 * np.sin(20.0 * motor_position + 1.1)
    assert output_torque == pytest.approx(laws.play(100.0 * reaching, 1.2), abs=1e-9)


def test_a_shaft_that_snaps_is_refused():
    with pytest.raises(ValueError, match="snaps"):
        locked(fx.Effects(cogging=(fx.Line(84.0, 0.02, 0.0),)), 0.2)


def test_an_arm_shows_in_the_motor_torque_of_a_free_run_divided_by_the_ratio():
    position, velocity = path(100.0)
    plain = bench.free_run(position, velocity, DRIVE, NOTHING)
    loaded = bench.free_run(position, velocity, DRIVE, HANGING)
    moving = np.abs(position - position.max()) > 0.1
    expected = -0.6 * np.sin(loaded[1] + 0.3) / 100.0
    assert (loaded[2] - plain[2])[moving][1:] == pytest.approx(expected[moving][1:], abs=1e-8)
    assert not loaded[3].any()


def test_starting_torque_winds_up_first_and_breaks_away_at_t_fs():
    ramp = 4e-3 * np.arange(2000) / 200.0
    motor_position, output_position, motor_torque, _ = bench.starting_torque(ramp, 0.005, 0.3, 0.5, DRIVE, NOTHING)
    before = motor_torque < 0.012
    wound = laws.wave_generator_torsion(motor_torque[before], DRIVE.K_w0, DRIVE.C_w)
    # viscous friction lags by b * speed: 1e-4 N*m*s * 3 mrad/s = 0.3 uN*m
    assert motor_position[before] - 0.3 == pytest.approx(wound, abs=1e-6)
    assert np.ptp(output_position[before]) < 1e-8
    first_count = np.argmax(motor_position - 0.3 > 2 * np.pi / 16384)
    assert motor_torque[first_count] < 0.52e-3 + 3e-5  # the ramp rises by 20 uN*m a sample
    assert abs(motor_position[-1] - 0.3) > 0.5
    assert motor_torque[-1] == pytest.approx(0.0128, abs=4e-4)

"""The drive's inner loops, one call at a time."""

import pytest

from sim_backend.model.drive_loop import OFF, POSITION, TORQUE, VELOCITY, drive_loop
from sim_backend.ports import AxisMode

GAINS = {"position_gain": 10.0, "velocity_gain": 2.0, "integral_gain": 5.0, "speed_limit": 3.0, "period": 0.1}


def run(mode, target, *, limit=100.0, position=0.0, velocity=0.0, integral=0.0):
    return drive_loop(mode, target, limit, position, velocity, integral, **GAINS)


def test_the_modes_are_those_of_the_port():
    assert [int(mode) for mode in (AxisMode.OFF, AxisMode.TORQUE, AxisMode.VELOCITY, AxisMode.POSITION)] == [
        OFF,
        TORQUE,
        VELOCITY,
        POSITION,
    ]


def test_off_gives_no_torque_and_forgets_the_integral():
    assert run(OFF, 5.0, integral=3.0) == (0.0, 0.0, 0.0)


def test_torque_passes_through_and_is_where_a_speed_loop_would_take_over():
    assert run(TORQUE, 1.5) == (1.5, 1.5, 0.0)


@pytest.mark.parametrize("target", [7.0, -7.0])
def test_a_torque_beyond_the_limit_is_clipped_and_reported(target):
    torque, _, limited = run(TORQUE, target, limit=2.0)
    assert torque == pytest.approx(2.0 if target > 0 else -2.0)
    assert limited == 1.0


def test_the_speed_loop_is_proportional_plus_integral():
    assert run(VELOCITY, 1.0, velocity=0.6, integral=0.3) == pytest.approx(
        (2.0 * 0.4 + 0.3, 0.3 + 5.0 * 0.1 * 0.4, 0.0)
    )


def test_the_position_loop_asks_for_a_bounded_speed():
    assert run(POSITION, 0.1)[0] == pytest.approx(2.0 * 10.0 * 0.1)
    assert run(POSITION, 50.0)[0] == pytest.approx(2.0 * 3.0)
    assert run(POSITION, -50.0)[0] == pytest.approx(-2.0 * 3.0)


def test_the_integral_does_not_wind_up_against_the_limit_but_unwinds():
    assert run(VELOCITY, 5.0, limit=1.0, integral=0.9) == (1.0, 0.9, 1.0)
    torque, integral, limited = run(VELOCITY, -0.1, limit=0.5, integral=1.0)
    assert (torque, limited) == (0.5, 1.0)
    assert integral < 1.0

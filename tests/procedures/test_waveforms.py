import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from procedures.waveforms import (
    TURN,
    cycles,
    line,
    nearest_turn,
    nested_triangles,
    path_length,
    smooth_step,
    start_angles,
)


def test_start_angles_lie_within_one_turn_and_apart() -> None:
    angles = sorted(start_angles(8))
    assert all(0.0 <= angle < TURN for angle in angles)
    gaps = [b - a for a, b in itertools.pairwise([*angles, angles[0] + TURN])]
    # golden spacing: no gap exceeds the even one by more than a factor 2
    assert max(gaps) < 2.0 * TURN / 8


@pytest.mark.parametrize("order", [1, 2, 3, 4, 7, 20])
def test_eight_start_angles_see_every_low_order_at_both_of_its_phases(order: int) -> None:
    """Commensurate angles (every eighth of a turn) would show order 8 or 16 at one phase only."""
    sine = [math.sin(order * angle) for angle in start_angles(8)]
    cosine = [math.cos(order * angle) for angle in start_angles(8)]
    assert max(sine) - min(sine) > 1.0
    assert max(cosine) - min(cosine) > 1.0


def test_triangles_nest_inside_each_other_and_leave_the_gear_without_torque() -> None:
    points = nested_triangles(1.0, (1.0, 0.5, 0.25), 0.0, 0.1)
    assert points == (0.0, 1.0, -1.0, 1.0, -0.5, 0.5, -0.5, 0.25, -0.25, 0.25, -0.1, 0.0)


def test_smaller_triangles_lie_about_the_bias() -> None:
    points = nested_triangles(1.0, (1.0, 0.25), 0.5, 0.0)
    assert points[:4] == (0.0, 1.0, -1.0, 1.0)
    assert points[4:7] == (0.25, 0.75, 0.25)


def test_the_order_in_which_amplitudes_are_given_does_not_matter() -> None:
    assert nested_triangles(2.0, (0.25, 1.0), 0.0, 0.1) == nested_triangles(2.0, (1.0, 0.25), 0.0, 0.1)


@given(
    start=st.floats(-10, 10),
    end=st.floats(-10, 10),
    rate=st.floats(2.0, 100),
)
def test_a_line_ends_exactly_and_never_exceeds_its_rate(start: float, end: float, rate: float) -> None:
    values = [start, *line(start, end, rate, 1e-3)]
    assert values[-1] == pytest.approx(end, abs=1e-12)
    steps = [abs(b - a) for a, b in itertools.pairwise(values)]
    # rounding of values up to 10 leaves a few 1e-15
    assert max(steps) <= rate * 1e-3 * (1.0 + 1e-6) + 1e-14


def test_a_line_takes_its_distance_over_its_rate() -> None:
    assert len(list(line(0.0, 1.0, 0.5, 1e-3))) == 2000


def test_a_smooth_step_starts_and_ends_at_rest() -> None:
    values = [0.0, *smooth_step(0.0, 1.0, 1.0, 1e-3)]
    speeds = [(b - a) / 1e-3 for a, b in itertools.pairwise(values)]
    assert values[-1] == pytest.approx(1.0)
    assert max(speeds) == pytest.approx(math.pi / 2.0, rel=1e-3)
    assert speeds[0] < 0.01
    assert speeds[-1] < 0.01


@given(angle=st.floats(0, TURN), position=st.floats(-1e4, 1e4))
def test_the_nearest_turn_shows_the_angle_within_half_a_turn(angle: float, position: float) -> None:
    target = nearest_turn(angle, position)
    assert abs(target - position) <= math.pi + 1e-9
    # positions of 1e4 rad are exact to 2e-12 rad only
    assert math.remainder(target - angle, TURN) == pytest.approx(0.0, abs=1e-9)


def test_a_duration_takes_whole_cycles_and_at_least_one() -> None:
    assert cycles(5.0, 1e-3) == 5000
    assert cycles(0.0001, 1e-3) == 1
    assert cycles(0.0015, 1e-3) == 2


def test_the_path_length_adds_up_both_directions() -> None:
    assert path_length((0.0, 1.0, -1.0, 0.0)) == 4.0

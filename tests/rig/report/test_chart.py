import re

import pytest

from drivers.errors import DataError
from rig.report.chart import HEIGHT, WIDTH, Axis, Chart, Trace, axis_over, draw, log_axis_over, ticks


@pytest.mark.parametrize(
    ("axis", "expected"),
    [
        (Axis("x", 0.0, 10.0), (0, 2, 4, 6, 8, 10)),
        (Axis("x", -0.31, 0.31), (-0.2, 0.0, 0.2)),
        (Axis("x", 0.05, 250.0, log=True), (0.1, 1, 10, 100)),
        (Axis("x", 0.9, 11.0, log=True), (1, 2, 5, 10)),
        (Axis("x", 3.0, 8.0, log=True), (3, 4, 5, 6, 7, 8)),
    ],
)
def test_ticks_are_round_values_on_the_axis(axis: Axis, expected: tuple[float, ...]) -> None:
    assert ticks(axis) == pytest.approx(expected)


def test_a_point_lies_where_its_axes_say() -> None:
    axes = Axis("x", 0.0, 10.0), Axis("y", 1.0, 100.0, log=True)
    svg = draw(Chart("alt", *axes, (Trace("after", [0.0, 10.0, 5.0], [1.0, 100.0, 10.0]),)), "a").text
    left, top, width, height = map(float, re.search(r'data-box="([^"]*)"', svg)[1].split())
    path = re.search(r'<path d="M([^"]*)"', svg)[1]
    found = [tuple(map(float, point.split())) for point in path.split("L")]
    middle = (left + width / 2, top + height / 2)
    assert found == [pytest.approx(p) for p in ((left, top + height), (left + width, top), middle)]
    assert (left + width, top + height) < (WIDTH, HEIGHT)


@pytest.mark.parametrize("make", [axis_over, log_axis_over])
def test_a_value_that_no_axis_has_room_for_is_refused(make) -> None:
    with pytest.raises(DataError, match="cannot be drawn"):
        make("x", [1.0, 1e308])
    assert make("x", [1.0, 1e99]).high > 1e99


@pytest.mark.parametrize("values", [[], [3.0], [0.0, 0.0], [1e-9, 2e-9], [-5.0, 7.0]])
def test_an_axis_has_room_around_whatever_it_shows(values: list[float]) -> None:
    for axis in (axis_over("x", values), axis_over("x", values, symmetric=True), log_axis_over("x", values)):
        assert axis.low < axis.high
        assert all(axis.low < value < axis.high for value in values if not axis.log or value > 0.0)
        assert len(ticks(axis)) <= 12


def test_a_symmetric_axis_has_zero_in_its_middle() -> None:
    axis = axis_over("x", [-1.0, 4.0], symmetric=True)
    assert axis.place(0.0) == pytest.approx(0.5)


def test_the_picture_is_told_in_words() -> None:
    chart = Chart('what "it" shows', axis_over("x", [0, 1]), axis_over("y", [0, 1]), ())
    assert 'role="img" aria-label="what &quot;it&quot; shows"' in draw(chart, "a").text

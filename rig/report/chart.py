"""One plot as inline SVG that shows everything without a script; the script zooms into the same paths.

Everything is drawn in a box of fixed size; the paths of the data lie in one group, so that zooming is one transform.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from drivers.errors import DataError
from rig.report.html import Markup, element, joined

WIDTH, HEIGHT = 480.0, 310.0
LEFT, TOP, RIGHT, BOTTOM = 76.0, 10.0, 12.0, 46.0
"""Size of the picture and of its margins, in its own units."""

TICKS = 5
"""About so many ticks on an axis."""

MARGIN = 0.05
"""Share of the range that is left free at either end of an axis."""


LARGEST, LEAST = 1e100, 1e-100
"""Sizes between which a value is drawn."""


@dataclass(frozen=True, slots=True)
class Axis:
    """One axis from `low` to `high`, in decades where `log`."""

    label: str
    low: float
    high: float
    log: bool = False

    def place(self, value: float) -> float:
        """Give where a value lies: 0 at the low end, 1 at the high end."""
        if not self.log:
            return (value - self.low) / (self.high - self.low)
        low, high = math.log10(self.low), math.log10(self.high)
        return (math.log10(max(value, 1e-300)) - low) / (high - low)


@dataclass(frozen=True, slots=True)
class Trace:
    """Points to draw, as `dots` or as a `line`, in the colours of `role` (a class of the style sheet)."""

    role: str
    x: Sequence[float]
    y: Sequence[float]
    dots: bool = False


@dataclass(frozen=True, slots=True)
class Chart:
    """Axes, traces from back to front, and marked places on the x axis with a word at each."""

    alternative: str
    x: Axis
    y: Axis
    traces: tuple[Trace, ...]
    marks: tuple[tuple[float, str], ...] = ()


def _drawable(values: Sequence[float]) -> list[float]:
    """Raise DataError where a value is beyond anything that is measured, and no axis has room for it."""
    beyond = next((value for value in values if abs(value) > LARGEST), None)
    if beyond is not None:
        raise DataError(
            "report",
            "a value cannot be drawn",
            value=beyond,
            expected=f"sizes up to {LARGEST:g}",
            hint="Make the result anew with `rig loop`.",
        )
    return list(values)


def axis_over(label: str, values: Sequence[float], *, symmetric: bool = False) -> Axis:
    """Give a linear axis around the values; `symmetric` about zero."""
    values = _drawable(values)
    low, high = min(values, default=0.0), max(values, default=1.0)
    if symmetric:
        high = max(abs(low), abs(high))
        low = -high
    room = MARGIN * (high - low) or abs(high) or 1.0
    return Axis(label, low - room, high + room)


def log_axis_over(label: str, values: Sequence[float]) -> Axis:
    """Give a logarithmic axis around the positive values."""
    positive = [value for value in _drawable(values) if value > LEAST] or [1.0]
    low, high = min(positive), max(positive)
    room = (high / low) ** MARGIN if high > low else 2.0
    return Axis(label, low / room, high * room, log=True)


def ticks(axis: Axis) -> tuple[float, ...]:
    """Give round values on the axis."""
    if axis.log and axis.high / axis.low >= 10.0:
        found = _log_ticks(axis, (1.0, 2.0, 5.0))
        return found if len(found) <= 2 * TICKS else _log_ticks(axis, (1.0,))
    span = axis.high - axis.low
    raw = span / TICKS
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= raw)
    first, last = math.ceil(axis.low / step), math.floor(axis.high / step)
    return tuple(number * step for number in range(first, last + 1))


def _log_ticks(axis: Axis, factors: Sequence[float]) -> tuple[float, ...]:
    decades = range(math.floor(math.log10(axis.low)), math.ceil(math.log10(axis.high)) + 1)
    values = [factor * 10.0**decade for decade in decades for factor in factors]
    return tuple(value for value in values if axis.low <= value <= axis.high)


def draw(chart: Chart, name: str) -> Markup:
    """Give the SVG; `name` is unique on the page and a plain word."""
    box = WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM
    frame = {"x": LEFT, "y": TOP, "width": box[0], "height": box[1]}
    clip = element("clipPath", element("rect", **frame), id=f"clip-{name}")
    data = element("g", *(_path(trace, chart) for trace in chart.traces), class_="data")
    middle = TOP + box[1] / 2
    return element(
        "svg",
        clip,
        element("g", *_vertical(chart), class_="x-ticks"),
        element("g", *_horizontal(chart), class_="y-ticks"),
        element("g", data, clip_path=f"url(#clip-{name})"),
        element("g", *_marks(chart), class_="marks"),
        element("rect", **frame, class_="frame"),
        element("text", chart.x.label, x=LEFT + box[0] / 2, y=HEIGHT - 8, class_="label"),
        element("text", chart.y.label, transform=f"translate(13 {middle}) rotate(-90)", class_="label"),
        viewBox=f"0 0 {WIDTH:g} {HEIGHT:g}",
        role="img",
        aria_label=chart.alternative,
        data_box=f"{LEFT:g} {TOP:g} {box[0]:g} {box[1]:g}",
        data_x=_range(chart.x),
        data_y=_range(chart.y),
    )


def _range(axis: Axis) -> str:
    return f"{axis.low!r} {axis.high!r} {'log' if axis.log else 'linear'}"


def _at(chart: Chart, x: float, y: float) -> tuple[float, float]:
    across = LEFT + chart.x.place(x) * (WIDTH - LEFT - RIGHT)
    return across, TOP + (1.0 - chart.y.place(y)) * (HEIGHT - TOP - BOTTOM)


def _path(trace: Trace, chart: Chart) -> Markup:
    places = [_at(chart, x, y) for x, y in zip(trace.x, trace.y, strict=True)]
    if trace.dots:
        written = "".join(f"M{x:.2f} {y:.2f}h.01" for x, y in places)
    else:
        written = "M" + "L".join(f"{x:.2f} {y:.2f}" for x, y in places) if places else ""
    return element("path", d=written, class_=f"{'dots' if trace.dots else 'line'} {trace.role}")


def _vertical(chart: Chart) -> list[Markup]:
    found = []
    for value in ticks(chart.x):
        x, bottom = _at(chart, value, chart.y.low)
        line = element("line", x1=f"{x:.2f}", x2=f"{x:.2f}", y1=TOP, y2=f"{bottom:.2f}")
        found.append(joined([line, element("text", tick_text(value), x=f"{x:.2f}", y=f"{bottom + 16:.2f}")]))
    return found


def _horizontal(chart: Chart) -> list[Markup]:
    found = []
    for value in ticks(chart.y):
        x, y = _at(chart, chart.x.low, value)
        line = element("line", x1=f"{x:.2f}", x2=WIDTH - RIGHT, y1=f"{y:.2f}", y2=f"{y:.2f}")
        found.append(joined([line, element("text", tick_text(value), x=f"{x - 5:.2f}", y=f"{y + 4:.2f}")]))
    return found


def _marks(chart: Chart) -> list[Markup]:
    found = []
    for value, word in chart.marks:
        if chart.x.low <= value <= chart.x.high:
            x = f"{_at(chart, value, chart.y.low)[0]:.2f}"
            line = element("line", x1=x, x2=x, y1=TOP, y2=HEIGHT - BOTTOM)
            found.append(joined([line, element("text", word, x=x, y=TOP + 12)]))
    return found


def tick_text(value: float) -> str:
    """Give the value of a tick as short as it is exact."""
    return f"{value:.6g}".replace("-", "−") if value else "0"

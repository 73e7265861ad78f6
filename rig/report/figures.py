"""The figures of a loop's report: a plot with its caption, legend and the runs that it shows."""

import math
from collections.abc import Sequence
from itertools import pairwise

from rig.loop.files.views_file import CycleView, ResidualView, SpectrumView
from rig.report.chart import Axis, Chart, Trace, axis_over, draw, log_axis_over
from rig.report.html import Markup, element, joined
from rig.report.numbers import error_scale, prefix_of, scaled, unit_text

SIDES = {"held_out": "held-out", "train": "fitted (no run was held out for this)"}

MOST_MARKED = 3
"""Lines of a spectrum that get a word."""


def residual_figure(view: ResidualView, name: str) -> Markup:
    """Draw the residual before and after against one variable."""
    unit, scale = error_scale(view.unit)
    across, label = (1.0, _variable(view))
    if view.order is not None:
        across = 180.0 / math.pi
    x = [value * across for value in view.x]
    before, after = [value * scale for value in view.before], [value * scale for value in view.after]
    means = {
        "before-mean": [value * scale for value in view.means.before],
        "after-mean": [value * scale for value in view.means.after],
    }
    at = [value * across for value in view.means.x]
    horizontal = axis_over(label, x) if view.order is None else Axis(label, 0.0, 360.0 / view.order)
    rms = [f"rms {scaled(value, scale, 3)} {unit}" for value in (view.rms_before, view.rms_after)]
    chart = Chart(
        alternative=(
            f"Residual of {view.equation} in {view.procedure} against {view.variable}: before {rms[0]}, after {rms[1]}."
        ),
        x=horizontal,
        y=axis_over(f"residual [{unit}]", [*before, *after], symmetric=True),
        traces=(
            Trace("before", x, before, dots=True),
            Trace("after", x, after, dots=True),
            *(Trace(role, at[k:m], values[k:m]) for role, values in means.items() for k, m in _unbroken(at)),
        ),
    )
    legend = [("before", f"before, {rms[0]}"), ("after", f"after, {rms[1]}")]
    legend += [("before-mean", "mean before"), ("after-mean", "mean after")] if at else []
    of = f"{len(x)} of {view.samples} samples" if len(x) < view.samples else f"{view.samples} samples"
    title = f"{view.equation}, {view.procedure}: residual against {view.variable}"
    return figure(title, draw(chart, name), legend, _told(view.side, view.runs, of))


def cycle_figure(view: CycleView, name: str) -> Markup:
    """Draw the measured hysteresis loops of a few runs and the model's."""
    parts = view.stretches
    largest = max((abs(v) for part in parts for v in part.measured), default=0.0)
    unit, scale = prefix_of(view.equation, largest, view.unit)
    every = [v * scale for part in parts for v in (*part.measured, *part.before, *part.after)]
    traces: list[Trace] = []
    for role in ("measured", "before-line", "after-line"):
        for part in parts:
            values = {"measured": part.measured, "before-line": part.before, "after-line": part.after}[role]
            traces.append(Trace(role, part.x, [v * scale for v in values], dots=role == "measured"))
    quantity = "torsion" if view.equation == "torsion" else view.equation.replace("-", " ")
    chart = Chart(
        alternative=(
            f"Hysteresis loop of {view.procedure}: measured {quantity} over {view.variable}, with the base model's and "
            f"that of the model with everything that was added."
        ),
        x=axis_over(f"{view.variable} [{unit_text(view.variable_unit)}]", [v for part in parts for v in part.x]),
        y=axis_over(f"{quantity} [{unit}]", every),
        traces=tuple(traces),
    )
    legend = [("measured", "measured"), ("before-line", "base model"), ("after-line", "with what was added")]
    more = f"{view.left_out} more not drawn" if view.left_out else ""
    title = f"{view.procedure}: {quantity} over {view.variable}"
    return figure(title, draw(chart, name), legend, _told(view.side, view.runs, more))


def spectrum_figure(view: SpectrumView, name: str) -> Markup:
    """Draw the amplitude of the residual by order, before and after, on logarithmic axes."""
    unit, scale = error_scale(view.unit)
    before, after = [v * scale for v in view.before], [v * scale for v in view.after]
    per = "cycles per s" if view.variable == "time" else f"cycles per revolution of {view.variable}"
    highest = max(before, default=0.0)
    at = view.orders[before.index(highest)] if before else 0.0
    chart = Chart(
        alternative=(
            f"Spectrum of the residual of {view.equation} in {view.procedure}: before, the highest amplitude is "
            f"{highest:.3g} {unit} at {at:.4g} {per}; after, it is {max(after, default=0.0):.3g} {unit}."
        ),
        x=log_axis_over(f"order [{per}]", view.orders),
        y=log_axis_over(f"amplitude [{unit}]", [*before, *after]),
        traces=(Trace("before-solid", view.orders, before), Trace("after-line", view.orders, after)),
        marks=tuple((order, f"{order:.6g}") for order in view.lines[:MOST_MARKED]),
    )
    legend = [("before-solid", "before"), ("after-line", "after")]
    title = f"{view.equation}, {view.procedure}: spectrum over {view.variable}"
    return figure(title, draw(chart, name), legend, _told(view.side, view.runs, ""))


def _unbroken(at: Sequence[float]) -> list[tuple[int, int]]:
    """Give begin and end of the parts of a mean between which intervals are empty."""
    steps = [b - a for a, b in pairwise(at)]
    breaks = [k + 1 for k, step in enumerate(steps) if step > 1.5 * min(steps)]
    return list(pairwise([0, *breaks, len(at)])) if at else []


def _variable(view: ResidualView) -> str:
    if view.order is not None:
        within = "a turn" if view.order == 1.0 else f"1/{view.order:.6g} of a turn"
        return f"{view.variable} within {within} [°]"
    unit = unit_text(view.variable_unit)
    return f"{view.variable} [{unit}]" if unit else view.variable


def figure(title: str, plot: Markup, legend: Sequence[tuple[str, str]], told: str) -> Markup:
    """Give a plot with its title, a legend of roles and words, and what is told of its runs."""
    keys = [
        element("span", element("i", class_=f"key {role}", aria_hidden="true"), text, class_="legend")
        for role, text in legend
    ]
    caption = element(
        "figcaption",
        element("b", title),
        element("span", joined(keys), class_="keys") if keys else None,
        element("small", told, class_="runs"),
    )
    return element("figure", caption, plot, class_="plot")


def _told(side: str, runs: Sequence[str], note: str) -> str:
    told = f"{SIDES.get(side, side)} runs: {', '.join(runs)}" + (f"; {note}" if note else "")
    return f"{told[0].upper()}{told[1:]}."

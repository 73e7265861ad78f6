"""The report of runs: what each measured, how it ended, what was recorded, and where it comes from."""

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np

from drivers.signals import BY_NAME
from procedures.intents import Measurement
from rig.config.dut import Dut, Rotation
from rig.log.measurements import MEASUREMENTS, measurements_in
from rig.log.run import Floats, Run, averagings
from rig.report.chart import Chart, Trace, axis_over, draw
from rig.report.figures import figure
from rig.report.html import NOTHING, Markup, element, joined
from rig.report.numbers import prefix_of, shown_as, signed, unit_text
from rig.report.page import page, row, section, table
from rig.report.sentences import listed
from rig.terminal import counted

POINTS = 1200
"""Samples of one run that a plot shows."""

TORQUES = ("output_torque", "motor_torque")
OVER_TIME = ("motor_torque", "output_torque", "motor_position", "output_position")
"""Signals shown over time, each in a plot of its own."""

TURNING = 2.0 * math.pi
"""rad of travel at the motor from which its torque is shown over its speed as well."""

NO_LIMITS = "No procedure declares a verdict limit yet: what was measured is told, not judged."


def run_page(runs: Sequence[tuple[Run, Dut | None]], software: str) -> str:
    """Give the report as the text of an HTML file. `software`: what wrote the report. One run at least is needed."""
    devices = list(dict.fromkeys(dut.name for _, dut in runs if dut is not None))
    device = listed(devices) or "unknown device"
    links = [element("li", element("a", run.name, href=f"#run{n}")) for n, (run, _) in enumerate(runs)]
    body = [
        element(
            "header",
            element("p", f"Report of runs, device under test {device}"),
            element("h1", statement([run for run, _ in runs])),
            element("p", NO_LIMITS, class_="soft"),
            element("nav", element("ul", *links), aria_label="Runs"),
        ),
        element("main", *(_section(run, dut, number, len(runs) == 1) for number, (run, dut) in enumerate(runs))),
        element("footer", element("p", f"Report by {software}.", class_="soft")),
    ]
    return page(f"{device}: {len(runs)} run{'s' if len(runs) != 1 else ''} – report", body)


def statement(runs: Sequence[Run]) -> str:
    """Say in one sentence what was run and how it ended."""
    procedures = listed(list(dict.fromkeys(run.procedure.value for run in runs)))
    if len(runs) == 1:
        return f"{runs[0].name}, {procedures}: {_ended(runs[0])}."
    told = [f"{run.name}: {run.ending}" for run in runs if run.ending is not None]
    unknown = sum(run.ending is None and run.status is None for run in runs)
    if unknown:
        told.append(f"how {'they' if unknown == len(runs) else f'{unknown} of them'} ended was not recorded")
    ended = f"; {'; '.join(told)}" if told else ", all as planned"
    return f"{counted(len(runs), 'run')} of {procedures}{ended}."


def _ended(run: Run) -> str:
    return run.ending or ("how the run ended was not recorded" if run.status is None else "the run went as planned")


def _section(run: Run, dut: Dut | None, number: int, alone: bool) -> Markup:
    measured = measurements_in(run.metadata)
    figures = [*_loops(run, dut, number), *_over_time(run, number)] if run.time.size > 1 else []
    return section(
        run.name,
        f"run{number}",
        element("p", f"{run.procedure.value}: {_ended(run)}."),
        _measured(measured, run.name) if measured else element("p", "The log holds no measurements."),
        element("div", *figures, class_="figures") if figures else None,
        _notes(run),
        _facts(run, alone),
    )


def _measured(measured: Iterable[Measurement], name: str) -> Markup:
    numbers = frozenset({1, 2})
    rows = []
    for item in measured:
        spread = item.uncertainty
        interval = None if spread is None else (item.value - 2.0 * spread, item.value + 2.0 * spread)
        shown = shown_as(item.name, item.value, interval, item.unit)
        width = "" if spread is None else signed(f"{spread * shown.scale:.2g}")
        rows.append(row([item.name, shown.text(item.value), width, shown.unit, item.meaning], numbers))
    return table(
        f"Measured in {name} (± standard uncertainty)", ("quantity", "value", "±", "unit", "meaning"), rows, numbers
    )


def _loops(run: Run, dut: Dut | None, number: int) -> list[Markup]:
    """Draw what the run shows over a torque: the torsion, and one torque over the other."""
    torque = next((name for name in TORQUES if _varies(run.signals.get(name))), None)
    angle = run.signals.get("motor_position")
    turns = angle is not None and float(np.nanmax(angle) - np.nanmin(angle)) > TURNING
    if torque is None or turns:
        return []
    found = []
    torsion = _torsion(run, dut)
    if torsion is not None:
        found.append(_plot(run, f"run{number}torsion", torque, run.signals[torque], "torsion", torsion, "rad"))
    if torque == "output_torque" and _varies(run.signals.get("motor_torque")):
        motor = run.signals["motor_torque"]
        found.append(_plot(run, f"run{number}torques", torque, run.signals[torque], "motor_torque", motor, "N*m"))
    return found


def _over_time(run: Run, number: int) -> list[Markup]:
    known = [(name, values) for name in OVER_TIME if (values := run.signals.get(name)) is not None and _varies(values)]
    return [
        _plot(run, f"run{number}time{place}", "time", run.time, name, values, BY_NAME[name].unit)
        for place, (name, values) in enumerate(known)
    ]


def _plot(run: Run, place: str, over: str, x: Floats, name: str, y: Floats, unit: str) -> Markup:
    known = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    if known.size < 2:
        return NOTHING
    shown = known[np.unique(np.linspace(0, known.size - 1, min(known.size, POINTS)).astype(np.intp))]
    largest = float(np.abs(y[shown]).max())
    prefixed, scale = prefix_of(name, largest, unit)
    label = "time [s]" if over == "time" else f"{over} [{unit_text(BY_NAME[over].unit)}]"
    across, up = x[shown].tolist(), (y[shown] * scale).tolist()
    low, high = float(y[shown].min()) * scale, float(y[shown].max()) * scale
    step = float(np.median(np.diff(run.time))) * max(1.0, known.size / POINTS)
    breaks = (np.flatnonzero(np.diff(run.time[shown]) > 5.0 * step) + 1).tolist()
    parts = list(pairwise([0, *breaks, shown.size]))
    chart = Chart(
        alternative=f"{name} over {over} in {run.name}: from {low:.4g} to {high:.4g} {prefixed}.",
        x=axis_over(label, across),
        y=axis_over(f"{name} [{prefixed}]", up),
        traces=tuple(Trace("after-line", across[k:m], up[k:m]) for k, m in parts),
    )
    note = f"{shown.size} of {run.time.size} samples" if shown.size < run.time.size else f"{run.time.size} samples"
    return figure(f"{run.procedure.value}: {name} over {over}", draw(chart, place), (), f"Run: {run.name}; {note}.")


def _torsion(run: Run, dut: Dut | None) -> Floats | None:
    """Give the torsion about its mean, rad; None without both angles, the ratio, or a motion of either."""
    output, motor = run.signals.get("output_position"), run.signals.get("motor_position")
    if output is None or motor is None or dut is None or dut.gear.ratio is None:
        return None
    sense = -1.0 if dut.gear.rotation is Rotation.SAME else 1.0
    torsion = np.asarray(output + sense * motor / dut.gear.ratio)
    return torsion - float(np.nanmean(torsion)) if _varies(torsion) else None


def _varies(values: Floats | None) -> bool:
    if values is None:
        return False
    known = values[np.isfinite(values)]
    return known.size > 1 and float(np.ptp(known)) > 0.0


def _notes(run: Run) -> Markup | None:
    events = [f"{event.time:.3f} s, {event.kind}: {event.text}" for event in run.events]
    gaps = [f"A gap after {time:.3f} s." for time in run.gaps]
    warnings = [*run.warnings, *averagings([run]), *gaps]
    return joined(
        [
            element("h3", "Warnings") if warnings else None,
            element("ul", *(element("li", text) for text in warnings), class_="plain") if warnings else None,
            element(
                "details",
                element("summary", f"{len(events)} events"),
                element("ul", *(element("li", text) for text in events), class_="plain"),
            )
            if events
            else None,
        ]
    )


def _facts(run: Run, alone: bool) -> Markup:
    told = {"file": run.file.name, "samples": f"{run.time.size}", "replicates of": run.replicate or ""}
    told |= {key: text for key, text in run.metadata.items() if key != MEASUREMENTS}
    terms = [part for key, text in told.items() if text for part in (element("dt", key), element("dd", text))]
    return element("details", element("summary", "Where it comes from"), element("dl", *terms), open=alone)

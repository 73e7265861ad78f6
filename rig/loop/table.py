"""The table before/after, for the terminal and as plain text."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from rich.table import Table

from rig.loop.display import SCALES, interval_text, rounded
from rig.loop.files.evidence_keys import expected_of, in_words
from rig.loop.files.model_file import ModelBase, ModelEstimate
from rig.loop.predict import Predicted
from rig.loop.result import (
    FOUND_NOT_ADDED,
    MEANINGS,
    EquationResult,
    Errors,
    Estimate,
    LoopResult,
    NextExperiment,
    Open,
    Silence,
    Step,
    above_floor,
    fitted_alone,
)
from rig.terminal import counted
from sim_backend.model.compliance import LAWS

TITLES = ("equation", "unit", "before", "after", "floor", "floor 95 %", "max after")

UNCOUNTED = " *"
"""Mark of a row in the table that holds a run which the verdict does not count."""

MOST_LISTED = 6
"""Events and the like that a line of text lists; all are in `loop.json`."""

MOST_FOUND = 3
"""Terms that were found and not added, of which the terminal and the text tell."""

BASE_PARTS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "wave generator": ("K_w0", "C_w"),
        "friction": ("T_fs", "T_fb", "T_c", "b", "T_cr", "b_r", "i_c", "i_v", "T_co", "b_o"),
        "inertia and springs": ("J_r", "K_r", "J_l", "J_o", "windup"),
        "offsets": ("M_0", "i_0", "T_0"),
    }
)
"""Parameters of the base model besides the flexspline's, in the lines in which they are printed."""


def table_of(result: LoopResult) -> Table:
    """Give the held-out errors per equation and procedure as a table for the terminal, at most 80 columns wide."""
    table = Table(title="Error on held-out runs (rms)", title_justify="left", header_style="bold", box=None)
    for number, title in enumerate(TITLES):
        table.add_column(title, justify="left" if number < 2 else "right", no_wrap=True)
    for row in rows_of(result):
        table.add_row(*row, style="" if row[0].startswith(" ") else "bold")
    table.caption, table.caption_justify = uncounted_remark(result) or None, "left"
    return table


def remaining_table(predicted: Sequence[Predicted]) -> Table:
    """Give what a model leaves of every equation of every run as a table for the terminal."""
    table = Table(title="Residual of the model (rms)", title_justify="left", header_style="bold", box=None)
    table.add_column("run", overflow="fold")
    table.add_column("equation", no_wrap=True)
    table.add_column("rms", justify="right", no_wrap=True)
    table.add_column("unit", no_wrap=True)
    table.add_column("samples", justify="right", no_wrap=True)
    for one in predicted:
        for item in one.remaining:
            unit, scale = SCALES.get(item.unit, (item.unit, 1.0))
            table.add_row(one.run, item.equation, f"{item.rms * scale:.4g}", unit, f"{100.0 * item.share:.0f} %")
        if not one.remaining:
            table.add_row(one.run, "none: the run allows no equation", "", "", "")
    return table


def text_of(result: LoopResult) -> str:
    """Give the same as plain text, with what was added, what stays open and the warnings below."""
    rows = [TITLES, *rows_of(result)]
    widths = [max(len(row[k]) for row in rows) for k in range(len(TITLES))]
    lines = [headline(result), ""]
    lines += ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    lines += [text] if (text := uncounted_remark(result)) else []
    lines += ["", *statements(result)]
    return "\n".join(lines).rstrip() + "\n"


def headline(result: LoopResult) -> str:
    """Say the verdict with its meaning, from how many runs, and what was added."""
    held = f"{counted(len(result.train), 'training run')}, {len(result.held_out)} held out"
    alone = fitted_alone(result.equations)
    held += f", none tests {' or '.join(alone)}" if alone else ""
    apart = result.views.apart
    held += f", not counting {', '.join(apart)}, of another kind" if apart else ""
    added = f"added: {', '.join(result.effects)}" if result.effects else "nothing was added"
    return f"Verdict: {result.verdict}: {MEANINGS[result.verdict]} ({held}; {added})."


def statements(result: LoopResult) -> list[str]:
    """Give what is above the floor, the base parameters, a few lines per step and open statement, one per warning."""
    lines = [text] if (text := floor_remark(result)) else []
    lines += _base(result.model.base)
    for step in result.steps:
        lines.append(f"+ {step.effect} in {step.equation}, false-alarm probability {step.p_value:.1g}")
        lines += [f"    {text}" for text in _parameters(step)] + _next(step.next_experiment)
    for item in result.open:
        lines.append("? " + _statement(item, result.equations))
        lines += _next(item.next_experiment)
    lines += _silence(result.silence) if result.silence is not None else []
    found = [warning for warning in result.warnings if warning.startswith(FOUND_NOT_ADDED)]
    shown = [warning for warning in result.warnings if warning not in found[MOST_FOUND:]]
    more = [f"! {FOUND_NOT_ADDED}: {counted(len(found) - MOST_FOUND, 'more line')} in loop.json and the report."]
    return [*lines, *(f"! {warning}" for warning in shown), *(more if len(found) > MOST_FOUND else [])]


def _silence(silence: Silence) -> list[str]:
    """Give what the verdict `none` rests on."""
    alike = [f"{x.equation} in {x.procedure} {x.rho:+.2f} ({counted(x.pairs, 'pair')})" for x in silence.replicates]
    seen = [f"{x.effect} {x.amplitude:.2g} {x.unit}".removesuffix(" 1") for x in silence.smallest]
    lines = [f". correlation of replicates: {', '.join(alike)}"] if alike else []
    return lines + ([f". would have been seen from: {', '.join(seen)}"] if seen else [])


def floor_remark(result: LoopResult) -> str:
    """Say which errors lie above the floor's interval and are no statement; "" where none does."""
    held_out = {name: item.held_out for name, item in result.equations.items() if item.held_out is not None}
    return above_floor(held_out, [item.evidence for item in result.open])


def _base(base: ModelBase) -> list[str]:
    """Give the law of the flexspline and the other parts of the base model, as far as the data told of them."""
    groups = {f"flexspline {base.law}": LAWS[base.law].parameters, **BASE_PARTS}
    lines = []
    for part, names in groups.items():
        values = [_with_doubt(name, base.parameters[name]) for name in names if name in base.parameters]
        lines += [f"= {part}: {', '.join(values)}"] if values else []
    return lines


def _with_doubt(name: str, estimate: ModelEstimate) -> str:
    """Give a base parameter, and whether these runs tell anything of it."""
    shown = _shown(name, estimate)
    if estimate.ci95 is None:
        return f"{shown} (no interval)"
    return f"{shown} (not told from 0)" if estimate.ci95[0] <= 0.0 <= estimate.ci95[1] else shown


def _parameters(step: Step) -> list[str]:
    """Give the parameters with their 95 % half widths, those of one line of a periodic term in one line of text."""
    places = [name for name in step.parameters if name.startswith("at_")]
    if len(places) > MOST_LISTED:
        return [_curve(step, len(places))]
    found: dict[str, list[str]] = {}
    for name, estimate in step.parameters.items():
        base, _, rank = name.rpartition("_")
        key, shown = (rank, base) if rank.isdecimal() else ("", name)
        found.setdefault(key, []).append(_shown(shown, estimate))
    return [", ".join(texts) for texts in found.values()]


def _curve(step: Step, count: int) -> str:
    """Say where a curve of many places begins, ends, and is lowest and highest."""
    points = [(step.parameters[f"at_{k}"], step.parameters[f"value_{k}"]) for k in range(1, count + 1)]
    low, high = (pick(points, key=lambda point: point[1].value) for pick in (min, max))
    ends = [f"{at.value:.3g} {at.unit}".rstrip() for at, _ in (points[0], points[-1])]
    extremes = [f"{_shown('', value).strip()} at {at.value:.3g}" for at, value in (low, high)]
    return f"{count} places from {ends[0]} to {ends[1]}: {' to '.join(extremes)}; all of them in loop.json"


def _shown(name: str, estimate: Estimate | ModelEstimate) -> str:
    """Give a parameter with its 95 % half width and unit, or the interval itself where it is too wide for one."""
    if estimate.ci95 is None:
        return f"{name} {estimate.value:.7g} {estimate.unit}".rstrip()
    low, high = estimate.ci95
    half = 0.5 * (high - low)
    # an interval on a logarithmic scale that is wider than its value has no half width worth the name
    within = f"({low:.2g} to {high:.2g})" if low > 0.0 and half > estimate.value else f"+- {half:.2g}"
    return f"{name} {rounded(estimate.value, half)} {within} {estimate.unit}".rstrip()


def _statement(item: Open, equations: Mapping[str, EquationResult]) -> str:
    """Give verdict, place and meaning of an open statement, then its numbers."""
    evidence = dict(item.evidence)
    known = equations.get(str(evidence.get("equation")))
    shown, scale = ("", 1.0) if known is None else SCALES.get(known.unit, (known.unit, 1.0))
    place = " in ".join(str(evidence.pop(key)) for key in ("equation", "procedure") if key in evidence)
    what = place or " | ".join(item.group)
    if item.parameter is not None and item.deviation is not None:
        off = f"{100 * item.deviation:+.1f} % off {expected_of(item.parameter)}"
        what = f"{item.parameter} is {off}, by {' | '.join(item.group)}"
    meaning = evidence.pop("meaning", "")
    numbers = [
        f"{words} {_short(value)} {unit}".rstrip() for _, words, value, unit in in_words(evidence, (shown, scale))
    ]
    return f"{item.verdict}: {what}: {meaning} ({', '.join(numbers)})"


def _next(experiment: NextExperiment | None) -> list[str]:
    if experiment is None:
        return []
    sigma, minutes = experiment.expected_separation_sigma, experiment.minutes
    told = [] if sigma is None else [f"expected separation {sigma:.2g} sigma"]
    told += [] if minutes is None else [f"{minutes:.2g} minutes of bench time"]
    lines = [f"    next: {experiment.why}" + (f" ({', '.join(told)})" if told else "")]
    return lines + [f"    {command}" for command in (experiment.command, experiment.then) if command]


def is_command(line: str) -> bool:
    """Tell whether a line of the statements is a command, which must stay in one line to be copied."""
    return line.startswith("    rig ")


def rows_of(result: LoopResult) -> list[tuple[str, ...]]:
    """Give the table's rows: an equation over all held-out runs, then its procedures, indented."""
    rows = []
    apart = {run.procedure for run in result.views.runs if run.name in result.views.apart}
    for name, equation in result.equations.items():
        if equation.held_out is None:
            continue
        by_procedure = equation.held_out.by_procedure
        rows.append(_row(_marked(name, apart & by_procedure.keys()), equation.unit, equation.held_out))
        if len(by_procedure) > 1:
            rows += [_row(_marked(f"  {p}", p in apart), equation.unit, errors) for p, errors in by_procedure.items()]
    return rows


def _marked(name: str, uncounted: object) -> str:
    """Give the name of a row, marked where a run is in it that is not counted."""
    return f"{name}{UNCOUNTED}" if uncounted else name


def uncounted_remark(result: LoopResult) -> str:
    """Say what the mark of a row means; "" where none has one."""
    if not any(row[0].endswith(UNCOUNTED) for row in rows_of(result)):
        return ""
    return (
        f"{UNCOUNTED.strip()} with {', '.join(result.views.apart)}, of another kind, which the verdict does not count"
    )


def _row(name: str, unit: str, errors: Errors) -> tuple[str, ...]:
    shown, scale = SCALES.get(unit, (unit, 1.0))
    interval = errors.floor_ci95
    return (
        name,
        shown,
        f"{errors.rms_before * scale:.4g}",
        f"{errors.rms_after * scale:.4g}",
        "-" if errors.floor is None else f"{errors.floor * scale:.4g}",
        "-" if interval is None else interval_text(interval[0] * scale, interval[1] * scale),
        f"{errors.max_after * scale:.3g}",
    )


def _short(value: object) -> str:
    if isinstance(value, Mapping):
        return " ".join(f"{key} {_short(part)}" for key, part in value.items())
    if isinstance(value, list | tuple):
        more = [f"and {len(value) - MOST_LISTED} more"] if len(value) > MOST_LISTED else []
        return " | ".join([*map(_short, value[:MOST_LISTED]), *more])
    return f"{value:.3g}" if isinstance(value, float) else str(value)

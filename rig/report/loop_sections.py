"""The sections of a loop's report besides the figures: tables, what was added, what stays open, provenance."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from pydantic import JsonValue

from rig.loop.display import interval_text
from rig.loop.files.evidence_keys import expected_of, in_words, meaning_of_key
from rig.loop.files.views_file import RunFacts
from rig.loop.result import MEANINGS, Verdict
from rig.report.html import Markup, element, joined
from rig.report.loop_file import (
    Candidate,
    Errors,
    Estimate,
    LoopFile,
    ModelFile,
    NextExperiment,
    Open,
    Shift,
    Silence,
    Step,
)
from rig.report.numbers import (
    UNKNOWN,
    change_text,
    error_scale,
    interval_in,
    prefix_of,
    probability_text,
    scaled,
    shown_as,
    unit_text,
)
from rig.report.page import row, table
from rig.report.sentences import place_of, title_of
from rig.terminal import counted
from sim_backend.model.effects import CATALOGUE

ERROR_TITLES = ("equation", "unit", "before", "after", "removed", "floor", "floor, 95 %", "max before", "max after", "")

PARAMETERS: Mapping[str, str] = MappingProxyType(
    {
        "K_F0": "stiffness of the flexspline at zero torque",
        "C_F": "its stiffness doubles at the torque 1/C_F",
        "a1": "T = a1 f + a3 f³ of the flexspline's torsion f",
        "a3": "T = a1 f + a3 f³ of the flexspline's torsion f",
        "K1": "stiffness of the flexspline up to T1",
        "K2": "stiffness of the flexspline from T1 to T2",
        "K3": "stiffness of the flexspline above T2",
        "T1": "torque at which the stiffness becomes K2",
        "T2": "torque at which the stiffness becomes K3",
        "K_w0": "stiffness of the wave generator at zero torque, at the motor",
        "C_w": "its stiffness grows by e with every 1/C_w of motor torque",
        "T_fs": "friction of the mesh in a locked sweep, at the motor",
        "T_fb": "friction of the mesh in a backdrive, at the output",
        "T_c": "Coulomb friction of a free run, at the motor",
        "b": "viscous friction of a free run, at the motor",
        "T_cr": "share of T_c that the rotor itself has",
        "b_r": "share of b that the rotor itself has",
        "i_c": "current for the Coulomb friction",
        "i_v": "current for the viscous friction, per speed",
        "T_co": "Coulomb friction at the output",
        "b_o": "viscous friction at the output",
        "J_r": "inertia of the rotor",
        "K_r": "stiffness of the springs behind the rotor where it ripples",
        "J_l": "inertia of the output that does not follow a fast angle error",
        "J_o": "inertia at the output",
        "windup": "wave generator's torsion under the running friction, at the output",
        "M_0": "offset of the motor torque",
        "i_0": "offset of the motor current",
        "T_0": "offset of the output torque",
    }
)
"""What the parameters of the base model are; the glossary says more."""

SIDE_WORDS = {"train": "fitted", "held_out": "held out"}


def badge(verdict: Verdict) -> Markup:
    """Give a verdict as a word with a border; its colour repeats what the word says."""
    return element("span", verdict, class_=f"badge {verdict}", title=MEANINGS[verdict])


def errors_table(loop: LoopFile, side: str) -> Markup | None:
    """Give the errors before and after per equation and, below it, per procedure; None where a side has none."""
    numbers = frozenset(range(2, 9))
    rows = []
    for name, equation in loop.equations.items():
        errors = equation.held_out if side == "held_out" else equation.train
        if errors is None:
            continue
        rows.append(_errors_row(name, equation.unit, errors, numbers, None))
        if len(errors.by_procedure) > 1:
            rows += [_errors_row(p, equation.unit, e, numbers, "part") for p, e in errors.by_procedure.items()]
    if not rows:
        return None
    which = "held-out runs, which took no part in the fit" if side == "held_out" else "fitted runs"
    return table(f"Error (rms) on {which}", ERROR_TITLES, rows, numbers)


def _errors_row(name: str, unit: str, errors: Errors, numbers: frozenset[int], kind: str | None) -> Markup:
    shown, scale = error_scale(unit)
    low, high = errors.floor_ci95 or (None, None)
    interval = UNKNOWN if low is None or high is None else interval_text(low * scale, high * scale)
    cells: list[Markup | str] = [
        name if kind else element("b", name),
        shown,
        scaled(errors.rms_before, scale),
        scaled(errors.rms_after, scale),
        change_text(errors.rms_before, errors.rms_after),
        scaled(errors.floor, scale),
        interval,
        scaled(errors.max_before, scale, 3),
        scaled(errors.max_after, scale, 3),
        _bar(errors),
    ]
    return row(cells, numbers, kind)


def _bar(errors: Errors) -> Markup | str:
    """Draw before, after and the floor's interval as lengths; the numbers stand beside it."""
    low, high = errors.floor_ci95 or (None, None)
    longest = max(value or 0.0 for value in (errors.rms_before, errors.rms_after, high))
    if longest <= 0.0:
        return ""
    per = 100.0 / longest
    before, after = (errors.rms_before or 0.0) * per, (errors.rms_after or 0.0) * per
    parts = [
        element("rect", x=0, y=0, height=4, width=f"{before:.2f}", class_="before"),
        element("rect", x=0, y=5, height=4, width=f"{after:.2f}", class_="after"),
    ]
    if low is not None and high is not None:
        width = f"{max((high - low) * per, 0.5):.2f}"
        parts.append(element("rect", x=f"{low * per:.2f}", y=0, height=9, width=width, class_="floor"))
    return element("svg", *parts, viewBox="0 0 100 9", preserveAspectRatio="none", class_="bar", aria_hidden="true")


def next_box(experiment: NextExperiment) -> Markup:
    """Give why and how to measure next, the command ready to be copied."""
    figures = []
    if experiment.expected_separation_sigma is not None:
        figures.append(f"expected separation {experiment.expected_separation_sigma:.3g} standard deviations")
    if experiment.minutes is not None:
        figures.append(f"{experiment.minutes:.3g} minutes on the bench")
    return joined(
        [
            element("p", experiment.why) if experiment.why else None,
            element("p", "; ".join(figures), class_="soft") if figures else None,
            *_command(experiment.command),
            *(
                [element("p", "Then the loop over old and new logs:"), *_command(experiment.then)]
                if experiment.then
                else []
            ),
        ]
    )


def _command(text: str) -> list[Markup]:
    """Give a command that is to be typed; of none nothing."""
    if not text:
        return []
    return [element("div", element("pre", text, class_="command", tabindex=0), class_="command-line")]


def next_experiments(loop: LoopFile) -> tuple[NextExperiment, ...]:
    """Give what to measure next, each command once."""
    told = [*(step.next_experiment for step in loop.steps), *(item.next_experiment for item in loop.open)]
    found = [experiment for experiment in told if experiment is not None]
    return tuple({(item.command, item.why): item for item in found}.values())


def step_panel(number: int, step: Step) -> Markup:
    """Give one term that was added: what it is, its parameters."""
    told = {"equation": step.equation, "variable": step.variable, "shape": step.shape}
    told |= {"false-alarm probability": probability_text(step.p_value)}
    words = "; ".join(f"{name} {text}" for name, text in told.items() if text)
    known = CATALOGUE.get(step.effect)
    return element(
        "div",
        element("h3", f"{number}. {title_of(step)} ", badge(step.verdict)),
        element("p", f"{known.summary[0].upper()}{known.summary[1:]}.") if known is not None else None,
        *_members(step),
        element("p", f"{words[:1].upper()}{words[1:]}.", class_="soft"),
        _parameters(step.parameters, f"Parameters of {title_of(step)}"),
        element("p", f"What would tell it apart: {known.separated_by}.") if known and known.separated_by else None,
        class_="panel",
    )


def _members(step: Step) -> list[Markup]:
    return [
        element("p", element("b", member), f": {CATALOGUE[member].summary}." if member in CATALOGUE else "")
        for member in step.members
    ]


def _parameters(parameters: Mapping[str, Estimate], caption: str) -> Markup | None:
    if not parameters:
        return None
    numbers = frozenset({1, 3})
    rows = [row([name, *_texts(name, item)], numbers) for name, item in parameters.items()]
    return table(caption, ("parameter", "value", "unit", "95 % interval"), rows, numbers)


def _texts(name: str, item: Estimate) -> tuple[str, str, str]:
    shown = shown_as(name, item.value, item.ci95, item.unit)
    return shown.text(item.value), shown.unit, interval_in(shown, item.ci95)


def open_panel(item: Open, units: Mapping[str, str]) -> Markup:
    """Give one statement that stays open, with its evidence and what to do next. `units`: of the equations, by name."""
    shown = error_scale(units.get(str(item.evidence.get("equation")), ""))
    evidence = {key: value for key, value in item.evidence.items() if value is not None}
    meaning = str(evidence.pop("meaning", "")) or MEANINGS[item.verdict]
    off = ""
    if item.parameter is not None and item.deviation is not None:
        side = "below" if item.deviation < 0.0 else "above"
        off = f"{item.parameter} is {100.0 * abs(item.deviation):.3g} % {side} {expected_of(item.parameter)}"
    heading = off or place_of(item)
    for key in ("equation", "procedure"):
        evidence.pop(key, None)
    if item.times:
        evidence["times"] = ", ".join(f"{time:.4g} s" for time in item.times)
    terms = []
    for key, words, value, unit in in_words(evidence, shown):
        terms += [element("dt", words, title=meaning_of_key(key)), _shown(value, unit_text(unit))]
    return element(
        "div",
        element("h3", f"{heading} ", badge(item.verdict)),
        element("p", f"{meaning[:1].upper()}{meaning[1:]}."),
        element("p", "Could be: ", element("b", ", ".join(item.group)), ".") if item.group else None,
        element("dl", *terms) if terms else None,
        next_box(item.next_experiment) if item.next_experiment is not None else None,
        class_="panel",
    )


def _shown(value: JsonValue, unit: str) -> Markup:
    return element("dd", f"{_words(value)} {unit}".rstrip())


def _words(value: JsonValue) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list):
        return ("; " if any(isinstance(part, dict) for part in value) else ", ").join(map(_words, value))
    if isinstance(value, dict):
        return ", ".join(f"{key}: {_words(part)}" for key, part in value.items())
    return UNKNOWN if value is None else str(value)


def base_table(model: ModelFile, shifts: Mapping[str, Shift]) -> Markup:
    """Give the parameters of the base model with interval and meaning, and what they were before effects were added."""
    numbers = frozenset({1, 3, 4}) if shifts else frozenset({1, 3})
    rows = []
    for name, item in model.base.parameters.items():
        before = []
        if shifts:
            start = shifts[name].start if name in shifts else None
            before = [shown_as(name, item.value, item.ci95, item.unit).text(start)]
        rows.append(row([name, *_texts(name, item), *before, PARAMETERS.get(name, "")], numbers))
    titles = ["parameter", "value", "unit", "95 % interval", *(["base model alone"] if shifts else []), "meaning"]
    law = f"Base model {model.base.model}" + (f", ratio {model.base.ratio:.8g}" if model.base.ratio else "")
    return table(law, titles, rows, numbers)


def smallest_table(silence: Silence) -> Markup | None:
    """Give the amplitude from which on each effect would have been added."""
    rows = []
    for item in silence.smallest:
        unit, scale = prefix_of("amplitude", item.amplitude or 0.0, item.unit)
        summary = CATALOGUE[item.effect].summary if item.effect in CATALOGUE else ""
        size = f"{scaled(item.amplitude, scale, 2)} {unit_text(unit)}".rstrip()
        rows.append(row([item.effect, size, summary], frozenset({1})))
    titles = ("effect", "seen from", "what it is")
    return table("Smallest effects that would have been seen", titles, rows, frozenset({1})) if rows else None


def replicates_table(silence: Silence) -> Markup | None:
    """Give how like noise the residuals of replicates are."""
    numbers = frozenset({2, 3, 4})
    rows = []
    for item in silence.replicates:
        figures = [str(item.replicate_pairs), scaled(item.rho, 1.0, 2), scaled(item.ljung_box_per_lag, 1.0, 3)]
        rows.append(row([item.equation, item.procedure, *figures], numbers))
    titles = ("equation", "procedure", "replicate pairs", "correlation", "Ljung-Box per lag")
    return table("How like noise it is: correlation 0, Ljung-Box 1", titles, rows, numbers) if rows else None


def candidates_table(number: int, step: Step) -> Markup | None:
    """Give what was tried for one step: gain and p-value of every class, the best first."""
    if not step.candidates:
        return None
    numbers = frozenset({2, 3, 4})
    ordered = sorted(step.candidates, key=lambda item: -(item.gain or 0.0))
    best = max((item.gain or 0.0 for item in ordered), default=0.0)
    chosen = next((place for place, item in enumerate(ordered) if item.effect == step.effect), None)
    rows = [row(_candidate(item, best, step, place == chosen), numbers) for place, item in enumerate(ordered)]
    titles = ("class", "of what, and where", "gain in weighted squares", "of the best", "p-value", "outcome")
    return table(f"Tried for step {number}, {title_of(step)}", titles, rows, numbers)


def _candidate(item: Candidate, best: float, step: Step, chosen: bool) -> list[Markup | str]:
    added = chosen and not step.members
    outcome = "added" if added else "in the set" if chosen or item.effect in step.members else "rejected"
    share = UNKNOWN if item.gain is None or best <= 0.0 else f"{100.0 * item.gain / best:.3g} %"
    gain = UNKNOWN if item.gain is None else f"{item.gain:.4g}"
    order = "" if item.order is None else f"order {item.order:.6g} of "
    where = ", ".join(text for text in (f"{order}{item.variable}", item.enters) if text)
    # a bound on the false-alarm probability that has reached 1 says nothing
    p = UNKNOWN if item.p_value is None or item.p_value >= 1.0 else probability_text(item.p_value)
    return [item.effect, where, gain, share, p, element("b", outcome) if chosen else outcome]


def listed_texts(texts: Sequence[str]) -> Markup | None:
    """Give texts as a list."""
    return element("ul", *(element("li", text) for text in texts), class_="plain") if texts else None


def runs_table(facts: Sequence[RunFacts], loop: LoopFile) -> Markup:
    """Give every run with its side; of runs of which nothing else is known, the name."""
    known = {item.name: item for item in facts}
    sides = {**dict.fromkeys(loop.runs.train, "train"), **dict.fromkeys(loop.runs.held_out, "held_out")}
    titles = ("run", "side", "procedure", "replicates of", "samples", "s", "started", "operator", "bench", "ended")
    content = [[name, SIDE_WORDS[side], *_facts(known.get(name))] for name, side in sides.items()]
    told = [place for place in range(len(titles)) if any(line[place] for line in content)]
    numbers = frozenset(told.index(place) for place in (4, 5) if place in told)
    rows = [row([line[place] for place in told], numbers) for line in content]
    return table(counted(len(sides), "run"), [titles[place] for place in told], rows, numbers)


def _facts(item: RunFacts | None) -> tuple[str, ...]:
    if item is None:
        return ("",) * 8
    known = (item.started, item.operator, item.bench, item.status)
    return (item.procedure, item.replicate or "", f"{item.samples}", f"{item.seconds:.1f}", *(x or "" for x in known))


def device_list(model: ModelFile) -> Markup:
    """Give what the device file said."""
    units = {"ratio": "", "rotation": "", "pole_pairs": "", "encoder_counts": "1/rev"}
    units |= {"K1": "N*m/rad", "K2": "N*m/rad", "K3": "N*m/rad", "T1": "N*m", "T2": "N*m", "rated_torque": "N*m"}
    units |= {"hysteresis_loss": "rad", "starting_torque": "N*m", "backdriving_torque": "N*m"}
    units |= {"torque_constant": "N*m/A", "inertia": "kg*m^2"}
    parts = {"gear": model.dut.gear, "motor": model.dut.motor, "output": model.dut.output}
    terms = []
    for part, values in parts.items():
        for key, value in values.items():
            if value is not None:
                unit = unit_text(units.get(key, ""))
                name = f"{part} {key}".replace("_", " ")
                terms += [element("dt", name), element("dd", f"{_words(value)} {unit}".strip())]
    return element("dl", *terms)

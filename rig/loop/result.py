"""What the loop found: frozen records, and the file `loop.json` (schema `rig.loop/1`).

Before is the base model refitted without the effects, after is base and effects refitted together.
"""

import math
from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, field
from enum import StrEnum
from types import MappingProxyType
from typing import Protocol, TypeAlias

from rig.loop.files.model_file import Model
from rig.loop.files.views_file import Views

SCHEMA = "rig.loop/1"

RESULT_NAME = "loop.json"
"""What `rig loop` calls the result in its folder."""

ABOVE_FLOOR = 1.5
"""Times the upper end of the floor's interval beyond which what is left is no longer noise."""

Json: TypeAlias = "bool | int | float | str | Sequence[Json] | Mapping[str, Json] | None"
"""What a JSON file can hold."""


class Verdict(StrEnum):
    """What can be said, the most serious first: a campaign's verdict is the first that any of its parts has."""

    UNCONTROLLED = "uncontrolled"
    UNTRACED = "untraced"
    AMBIGUOUS = "ambiguous"
    UNNAMED = "unnamed"
    NAMED = "named"
    ABSORBED = "absorbed"
    NONE = "none"


MEANINGS: Mapping[Verdict, str] = MappingProxyType(
    {
        Verdict.UNCONTROLLED: "it does not repeat: events, or something that is not held and not in the model",
        Verdict.UNTRACED: "what is left has structure, but no term passes the tests, or nothing tells it from noise",
        Verdict.AMBIGUOUS: "several effects explain it equally: the ambiguous set",
        Verdict.UNNAMED: "on what it depends and how is known, but no effect of the catalogue fits",
        Verdict.NAMED: "effects of the catalogue explain it, with parameters and intervals",
        Verdict.ABSORBED: "a base parameter is away from its catalogue value, and several causes could have moved it",
        Verdict.NONE: "what is left is noise",
    }
)
"""What each verdict says; the glossary and the page of the loop say the same."""


FOUND_NOT_ADDED = "Found, not added"
"""How a warning begins that tells of a term which was significant and not added."""


def first_verdict(verdicts: Sequence[Verdict]) -> Verdict:
    """Give the most serious verdict; `none` if there is nothing to say."""
    return next((verdict for verdict in Verdict if verdict in verdicts), Verdict.NONE)


@dataclass(frozen=True, slots=True)
class Errors:
    """Error of one equation before and after, in its unit. `floor`: rms that noise alone leaves, None if unknown."""

    rms_before: float
    rms_after: float
    max_before: float
    max_after: float
    floor: float | None = None
    floor_ci95: tuple[float, float] | None = None
    by_procedure: Mapping[str, "Errors"] = field(default_factory=dict)


class Judged(Protocol):
    """Errors of an equation or of one procedure in it, as the loop gives them or as a report reads them."""

    @property
    def rms_after(self) -> float | None:
        """Error with what was added."""

    @property
    def floor_ci95(self) -> tuple[float | None, float | None] | None:
        """Interval of the floor."""

    @property
    def by_procedure(self) -> "Mapping[str, Judged]":
        """The same for every procedure."""


class Sides(Protocol):
    """Errors of an equation on the runs that were fitted and on those that were held out."""

    @property
    def train(self) -> Judged | None:
        """On the runs that were fitted."""

    @property
    def held_out(self) -> Judged | None:
        """On the others."""


def fitted_alone(equations: Mapping[str, Sides]) -> list[str]:
    """Give the procedures that were fitted and in which no held-out run tests any equation."""
    fitted, tested = (
        {name: None for side in sides if side is not None for name in side.by_procedure}
        for sides in ([item.train for item in equations.values()], [item.held_out for item in equations.values()])
    )
    return [name for name in fitted if name not in tested]


def above_floor(held_out: Mapping[str, Judged], told_by: Iterable[Mapping[str, object]]) -> str:
    """Say which errors lie above their floor's interval and are taken for noise all the same; "" where none does.

    `held_out`: by equation; `told_by`: evidence of the open statements, which say more of their equations.
    """
    told = {
        (equation, str(evidence.get("procedure") or ""))
        for evidence in told_by
        for equation in str(evidence.get("equation") or "").split(", ")
    }
    near, far = (_places_above(held_out, told, *bounds) for bounds in ((1.0, ABOVE_FLOOR), (ABOVE_FLOOR, math.inf)))
    texts = []
    if near:
        texts.append(
            f"After lies above the floor's interval in {', '.join(near)}: up to {ABOVE_FLOOR:g} times its upper end it "
            "still counts as noise, as few runs tell of the floor."
        )
    if far:
        texts.append(
            f"After lies above {ABOVE_FLOOR:g} times the floor's interval in {', '.join(far)} without a statement: "
            "what a play or smoothing carries on of the noise, or runs that are not counted."
        )
    return " ".join(texts)


def _places_above(held_out: Mapping[str, Judged], told: Set[tuple[str, str]], least: float, most: float) -> list[str]:
    """Give equations, with their procedures, whose error is `least` to `most` times the upper end of the floor."""
    names = []
    for equation, whole in held_out.items():
        between = [p for p, errors in whole.by_procedure.items() if least < _above(errors) <= most]
        found = [p for p in between if (equation, p) not in told]
        if (equation, "") in told or not (found or least < _above(whole) <= most):
            continue
        if found or not any(name == equation for name, _ in told):
            names.append(equation + (f" ({', '.join(found)})" if found else ""))
    return names


def _above(errors: Judged) -> float:
    """Give the error over the upper end of the floor's interval; 0 where one of them is not known."""
    high = errors.floor_ci95[1] if errors.floor_ci95 is not None else None
    return 0.0 if errors.rms_after is None or not high else errors.rms_after / high


@dataclass(frozen=True, slots=True)
class EquationResult:
    """Errors of one equation on held-out and on training runs; None where no run allows the equation."""

    unit: str
    held_out: Errors | None
    train: Errors | None


@dataclass(frozen=True, slots=True)
class LineResult:
    """One line of a periodic term: cycles per revolution of the variable, the equation's unit, rad."""

    order: float
    amplitude: float
    phase: float


@dataclass(frozen=True, slots=True)
class Estimate:
    """A value with its 95 % interval, None where there is none."""

    value: float
    ci95: tuple[float, float] | None
    unit: str


@dataclass(frozen=True, slots=True)
class Candidate:
    """A class that was tried: gain in weighted squares, and p-value for all that was tried with it.

    `variable`, `enters`: on what it depends and where it acts, "" where its name says it; `order`: of a line.
    """

    effect: str
    gain: float
    p_value: float
    variable: str = ""
    enters: str = ""
    order: float | None = None


@dataclass(frozen=True, slots=True)
class Shift:
    """How a base parameter moved when the effects were added."""

    start: float
    end: float
    unit: str


@dataclass(frozen=True, slots=True)
class NextExperiment:
    """What to measure next, as a ready command, and the loop over old and new logs to type `then`, "" where not known.

    Separation in standard deviations, None if not computed.
    """

    why: str
    command: str
    expected_separation_sigma: float | None = None
    minutes: float | None = None
    then: str = ""


@dataclass(frozen=True, slots=True)
class Step:
    """One term that was added."""

    verdict: Verdict
    effect: str
    members: tuple[str, ...]
    variable: str
    shape: str
    lines: tuple[LineResult, ...]
    equation: str
    parameters: Mapping[str, Estimate]
    candidates: tuple[Candidate, ...]
    p_value: float
    held_out: Mapping[str, tuple[float, float]]
    shift: Mapping[str, Shift]
    next_experiment: NextExperiment | None = None


@dataclass(frozen=True, slots=True)
class Open:
    """A statement that remains open. `evidence` holds numbers and texts by name."""

    verdict: Verdict
    evidence: Mapping[str, Json]
    group: tuple[str, ...] = ()
    parameter: str | None = None
    deviation: float | None = None
    times: tuple[float, ...] = ()
    next_experiment: NextExperiment | None = None


@dataclass(frozen=True, slots=True)
class Replicates:
    """How like noise the residuals of a procedure's replicates are.

    `rho`: correlation of the smoothed residuals of a pair, `pairs` of them; `ljung_box`: statistic per lag, 1 of white
    noise, None where the runs are too short for it.
    """

    equation: str
    procedure: str
    pairs: int
    rho: float
    ljung_box: float | None


@dataclass(frozen=True, slots=True)
class Smallest:
    """Amplitude from which on an effect would have been added."""

    effect: str
    amplitude: float
    unit: str


@dataclass(frozen=True, slots=True)
class Silence:
    """What the verdict `none` rests on."""

    replicates: tuple[Replicates, ...]
    smallest: tuple[Smallest, ...]


@dataclass(frozen=True, slots=True)
class LoopResult:
    """Everything the loop says about a campaign. Names of runs, not paths.

    `silence`: with the verdict `none` only.
    """

    train: tuple[str, ...]
    held_out: tuple[str, ...]
    equations: Mapping[str, EquationResult]
    steps: tuple[Step, ...]
    open: tuple[Open, ...]
    warnings: tuple[str, ...]
    elapsed: float
    model: Model
    views: Views = field(default_factory=Views)
    silence: Silence | None = None

    @property
    def verdict(self) -> Verdict:
        """The first verdict that any step or open statement has."""
        return first_verdict([*(step.verdict for step in self.steps), *(item.verdict for item in self.open)])

    @property
    def effects(self) -> tuple[str, ...]:
        """What was added, in order."""
        return tuple(step.effect for step in self.steps)

    def to_json(self) -> dict[str, Json]:
        """Give the content of `loop.json`; numbers that are not finite become null."""
        return {
            "schema": SCHEMA,
            "runs": {"train": list(self.train), "held_out": list(self.held_out)},
            "verdict": self.verdict.value,
            "effects": list(self.effects),
            "equations": {name: _equation(item) for name, item in self.equations.items()},
            "steps": [_step(step) for step in self.steps],
            "open": [_open(item) for item in self.open],
            "warnings": list(self.warnings),
            "elapsed_s": self.elapsed,
            **({} if self.silence is None else {"none": _silence(self.silence)}),
        }


def _finite(value: Json) -> Json:
    """Give a value in which numbers that are not finite are null."""
    match value:
        case float():
            return _number(value)
        case list():
            return [_finite(item) for item in value]
        case dict():
            return {name: _finite(item) for name, item in value.items()}
    return value


def _number(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


def _pair(pair: tuple[float, float] | None) -> Json:
    return None if pair is None else [_number(pair[0]), _number(pair[1])]


def _errors(errors: Errors) -> dict[str, Json]:
    return {
        "rms_before": _number(errors.rms_before),
        "rms_after": _number(errors.rms_after),
        "max_before": _number(errors.max_before),
        "max_after": _number(errors.max_after),
        "floor": _number(errors.floor),
        "floor_ci95": _pair(errors.floor_ci95),
    }


def _with_procedures(errors: Errors | None) -> Json:
    if errors is None:
        return None
    return {**_errors(errors), "by_procedure": {name: _errors(item) for name, item in errors.by_procedure.items()}}


def _equation(item: EquationResult) -> dict[str, Json]:
    return {"unit": item.unit, "held_out": _with_procedures(item.held_out), "train": _with_procedures(item.train)}


def estimate_json(estimate: Estimate) -> dict[str, Json]:
    """Give value, interval and unit as in `loop.json` and `model.json`."""
    return {"value": _number(estimate.value), "ci95": _pair(estimate.ci95), "unit": estimate.unit}


def _next(experiment: NextExperiment | None) -> Json:
    if experiment is None:
        return None
    return {
        "why": experiment.why,
        "command": experiment.command,
        "expected_separation_sigma": _number(experiment.expected_separation_sigma),
        "minutes": _number(experiment.minutes),
        "then": experiment.then,
    }


def _candidate(item: Candidate) -> dict[str, Json]:
    return {
        "effect": item.effect,
        "variable": item.variable,
        "enters": item.enters,
        "order": _number(item.order),
        "gain": _number(item.gain),
        "p_value": _number(item.p_value),
    }


def _step(step: Step) -> dict[str, Json]:
    return {
        "verdict": step.verdict.value,
        "effect": step.effect,
        "set": list(step.members),
        "variable": step.variable,
        "shape": step.shape,
        "lines": [
            {"order": _number(x.order), "amplitude": _number(x.amplitude), "phase": _number(x.phase)}
            for x in step.lines
        ],
        "equation": step.equation,
        "parameters": {name: estimate_json(value) for name, value in step.parameters.items()},
        "candidates": [_candidate(item) for item in step.candidates],
        "p_value": _number(step.p_value),
        "held_out": {
            name: {"rms_before": _number(before), "rms_after": _number(after)}
            for name, (before, after) in step.held_out.items()
        },
        "shift": {
            name: {"from": _number(s.start), "to": _number(s.end), "unit": s.unit} for name, s in step.shift.items()
        },
        "next_experiment": _next(step.next_experiment),
    }


def _silence(item: Silence) -> dict[str, Json]:
    return {
        "replicates": [
            {
                "equation": x.equation,
                "procedure": x.procedure,
                "replicate_pairs": x.pairs,
                "rho": _number(x.rho),
                "ljung_box_per_lag": _number(x.ljung_box),
            }
            for x in item.replicates
        ],
        "smallest": [{"effect": x.effect, "amplitude": _number(x.amplitude), "unit": x.unit} for x in item.smallest],
    }


def _open(item: Open) -> dict[str, Json]:
    return {
        "verdict": item.verdict.value,
        "group": list(item.group),
        "parameter": item.parameter,
        "deviation": _number(item.deviation),
        "times": [_number(time) for time in item.times],
        "evidence": {name: _finite(value) for name, value in item.evidence.items()},
        "next_experiment": _next(item.next_experiment),
    }

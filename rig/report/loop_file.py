"""What a report reads of `loop.json` and `model.json`: tolerant of what is absent and of what is new."""

from typing import Annotated, Literal, Self, TypeAlias

from pydantic import BaseModel, ConfigDict, Field, JsonValue, model_validator

from rig.loop.result import Verdict, first_verdict


class Tolerant(BaseModel):
    """Base of everything that is read: frozen; unknown keys are passed over, a wrong kind of value is an error."""

    model_config = ConfigDict(frozen=True, extra="ignore", strict=True, allow_inf_nan=False)


Pair: TypeAlias = Annotated[tuple[float | None, float | None], Field(strict=False)]
Names: TypeAlias = Annotated[tuple[str, ...], Field(strict=False)]
OneVerdict: TypeAlias = Annotated[Verdict, Field(strict=False)]


class Errors(Tolerant):
    """Error of one equation before and after, in its unit, and the floor below it."""

    rms_before: float | None = None
    rms_after: float | None = None
    max_before: float | None = None
    max_after: float | None = None
    floor: float | None = None
    floor_ci95: Pair | None = None
    by_procedure: dict[str, "Errors"] = {}


class Equation(Tolerant):
    """Errors of one equation on both sides."""

    unit: str = ""
    held_out: Errors | None = None
    train: Errors | None = None


class Line(Tolerant):
    """One line of a periodic term."""

    order: float
    amplitude: float
    phase: float


class Estimate(Tolerant):
    """A value with its interval and unit."""

    value: float | None = None
    ci95: Pair | None = None
    unit: str = ""


class Candidate(Tolerant):
    """A class that was tried."""

    effect: str
    gain: float | None = None
    p_value: float | None = None
    variable: str = ""
    enters: str = ""
    order: float | None = None


class Shift(Tolerant):
    """How a base parameter moved."""

    start: float | None = Field(default=None, alias="from")
    end: float | None = Field(default=None, alias="to")
    unit: str = ""


class NextExperiment(Tolerant):
    """What to measure next."""

    why: str = ""
    command: str = ""
    expected_separation_sigma: float | None = None
    minutes: float | None = None
    then: str = ""


class Step(Tolerant):
    """One term that was added."""

    verdict: OneVerdict
    effect: str
    members: Names = Field(default=(), alias="set")
    variable: str = ""
    shape: str = ""
    lines: Annotated[tuple[Line, ...], Field(strict=False)] = ()
    equation: str = ""
    parameters: dict[str, Estimate] = {}
    candidates: Annotated[tuple[Candidate, ...], Field(strict=False)] = ()
    p_value: float | None = None
    shift: dict[str, Shift] = {}
    next_experiment: NextExperiment | None = None


class Open(Tolerant):
    """A statement that remains open."""

    verdict: OneVerdict
    group: Names = ()
    parameter: str | None = None
    deviation: float | None = None
    times: Annotated[tuple[float, ...], Field(strict=False)] = ()
    evidence: dict[str, JsonValue] = {}
    next_experiment: NextExperiment | None = None


class Replicates(Tolerant):
    """How like noise the residuals of a procedure's replicates are."""

    equation: str
    procedure: str
    replicate_pairs: int = 0
    rho: float | None = None
    ljung_box_per_lag: float | None = None


class Smallest(Tolerant):
    """Amplitude from which on an effect would have been added."""

    effect: str
    amplitude: float | None = None
    unit: str = ""


class Silence(Tolerant):
    """What the verdict `none` rests on."""

    replicates: Annotated[tuple[Replicates, ...], Field(strict=False)] = ()
    smallest: Annotated[tuple[Smallest, ...], Field(strict=False)] = ()


class Runs(Tolerant):
    """Names of the runs on both sides."""

    train: Names = ()
    held_out: Names = ()


class LoopFile(Tolerant):
    """The content of `loop.json`."""

    schema_: Literal["rig.loop/1"] = Field(alias="schema")
    runs: Runs = Runs()
    verdict: OneVerdict
    effects: Names = ()
    equations: dict[str, Equation] = {}
    steps: Annotated[tuple[Step, ...], Field(strict=False)] = ()
    open: Annotated[tuple[Open, ...], Field(strict=False)] = ()
    none: Silence | None = None
    warnings: Names = ()
    elapsed_s: float | None = None

    @model_validator(mode="after")
    def _say_one_thing(self) -> Self:
        told = first_verdict([*(step.verdict for step in self.steps), *(item.verdict for item in self.open)])
        if told is not self.verdict:
            raise ValueError(f"the verdict '{self.verdict}' contradicts steps and open statements, which make '{told}'")
        return self


class DutPart(Tolerant):
    """What a report says of the device."""

    name: str = ""
    gear: dict[str, JsonValue] = {}
    motor: dict[str, JsonValue] = {}
    output: dict[str, JsonValue] = {}


class BasePart(Tolerant):
    """The base model and its parameters."""

    model: str = ""
    ratio: float | None = None
    parameters: dict[str, Estimate] = {}


class ModelFile(Tolerant):
    """The content of `model.json`."""

    schema_: Literal["rig.model/1"] = Field(alias="schema")
    dut: DutPart = DutPart()
    base: BasePart = BasePart()
    runs: Names = ()
    software: str = ""

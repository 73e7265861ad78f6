"""The content of `views.json` (schema `rig.views/1`): what a report of a loop draws, so that it needs no log.

Angles and torques are in the signs of the contract, numbers in SI with six digits. Of long runs a part of the samples
is kept, evenly over time; errors and means are those of all samples.
"""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from rig.config.toml_file import Conflict, FileModel, Table

VIEWS_NAME = "views.json"
"""What `rig loop` calls the file in its folder."""

Numbers = Annotated[tuple[float, ...], Field(strict=False)]
Names = Annotated[tuple[str, ...], Field(strict=False)]


class Series(FileModel):
    """Base of everything that has series of numbers, which must be equally long."""

    series: ClassVar[tuple[str, ...]]

    @classmethod
    def conflicts(cls, table: Table) -> Iterable[Conflict]:
        """Give the first series whose length differs from that of the first one."""
        lengths = [len(table.get(name) or ()) for name in cls.series]
        for name, length in zip(cls.series, lengths, strict=True):
            if length != lengths[0]:
                yield Conflict((name,), length, f"has {length} numbers, {cls.series[0]} has {lengths[0]}")
                return


class RunFacts(FileModel):
    """One run that took part: `side` is `train` or `held_out`, `seconds` its length, the rest as its log says.

    `counted`: whether the verdict counts its errors; not those of a run of another kind.
    """

    name: str
    side: str
    procedure: str
    counted: bool = True
    replicate: str | None = None
    start_angle: float | None = None
    samples: int
    seconds: float
    operator: str | None = None
    bench: str | None = None
    started: str | None = None
    status: str | None = None
    software: str | None = None


class Means(Series):
    """Mean residual over intervals of the variable, each around `x`; equally long."""

    series: ClassVar[tuple[str, ...]] = ("x", "before", "after")

    x: Numbers = ()
    before: Numbers = ()
    after: Numbers = ()


class ResidualView(Series):
    """Residual of the runs of one equation and procedure against one variable; `x`, `before`, `after` equally long.

    `effects`: what was added that depends on the variable. `order`: the variable is an angle and folded into one
    period of this many a revolution; None where it is not. `samples`: how many there were before thinning.
    """

    series: ClassVar[tuple[str, ...]] = ("x", "before", "after")

    equation: str
    unit: str
    procedure: str
    side: str
    runs: Names
    variable: str
    variable_unit: str
    effects: Names = ()
    order: float | None = None
    samples: int
    rms_before: float
    rms_after: float
    x: Numbers
    before: Numbers
    after: Numbers
    means: Means = Means()


class Stretch(Series):
    """An unbroken part of one run: what was measured, and what the model says before and after; equally long."""

    series: ClassVar[tuple[str, ...]] = ("x", "measured", "before", "after")

    run: str
    x: Numbers
    measured: Numbers
    before: Numbers
    after: Numbers


class CycleView(FileModel):
    """A measured quantity over the torque that drives it, with the model's: the hysteresis loop of a sweep."""

    equation: str
    unit: str
    procedure: str
    side: str
    runs: Names
    left_out: int = 0
    variable: str
    variable_unit: str
    stretches: Annotated[tuple[Stretch, ...], Field(strict=False)]


class SpectrumView(Series):
    """Amplitude of the residual by order: cycles per revolution of an angle (per s where the variable is time).

    Every point is the highest amplitude of an interval of orders. `lines`: orders that were added.
    """

    series: ClassVar[tuple[str, ...]] = ("orders", "before", "after")

    equation: str
    unit: str
    procedure: str
    side: str
    runs: Names
    variable: str
    lines: Numbers = ()
    orders: Numbers
    before: Numbers
    after: Numbers


class Views(FileModel):
    """The content of `views.json`."""

    schema_: Literal["rig.views/1"] = Field(alias="schema", default="rig.views/1")
    runs: Annotated[tuple[RunFacts, ...], Field(strict=False)] = ()
    residuals: Annotated[tuple[ResidualView, ...], Field(strict=False)] = ()
    cycles: Annotated[tuple[CycleView, ...], Field(strict=False)] = ()
    spectra: Annotated[tuple[SpectrumView, ...], Field(strict=False)] = ()

    @property
    def apart(self) -> tuple[str, ...]:
        """Names of held-out runs that are experiments of another kind, whose errors the verdict does not count."""
        return tuple(run.name for run in self.runs if run.side == "held_out" and not run.counted)


def write_views(views: Views, path: Path) -> None:
    """Write the file; what was there is replaced."""
    text = json.dumps(views.model_dump(mode="json", by_alias=True), allow_nan=False, separators=(",", ":"))
    path.write_text(text + "\n", encoding="utf-8")

"""The mapping file of `rig import`: which column of a foreign log is which signal.

[signals.time]                 # needed unless the file has a column time[s]
column = "t"
[signals.output_torque]        # value = sign * (scale * raw + offset) in `unit`, then to SI
column = "tau_Nm"
unit = "N*m"                   # default: [unit] in the column's name, else the signal's SI unit
scale = 1.0
offset = 0.0
sign = 1                       # or -1
[signals.aux_pressure]         # aux_NAME: an auxiliary signal of that name, unit as written
column = "p"
unit = "bar"
[run]                          # as in a sidecar: procedure, replicate, start_angle, any metadata
procedure = "other"
[run.split]                    # cut the recording into runs
by = "time"                    # or a signal
blocks = 8                     # equal parts of its range, or: period = 6.283 (SI)
"""

import difflib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from drivers.signals import AUXILIARY_PREFIX, BY_NAME, TIME
from rig.config.toml_file import FileModel, parse_toml, read_text, whole_number_is_a_number
from rig.log.csv_file import RunFacts
from rig.log.names import plain_name
from rig.log.units import find_unit, spellings

MAX_BLOCKS = 1000


Number = Annotated[float, BeforeValidator(whole_number_is_a_number)]


class SignalMap(FileModel):
    """Where one signal comes from: value = `sign` * (`scale` * raw + `offset`) in `unit`."""

    column: Annotated[str, Field(min_length=1)]
    unit: str | None = None
    scale: Number = 1.0
    offset: Number = 0.0
    sign: Literal[1, -1] = 1

    @model_validator(mode="after")
    def _scale_keeps_the_signal(self) -> Self:
        if self.scale == 0:
            raise ValueError("scale = 0 would erase the signal")
        return self


class Split(FileModel):
    """How one recording is cut into runs: equal `blocks` of the range of `by`, or pieces of `period` (SI)."""

    by: str = TIME.name
    blocks: Annotated[int, Field(ge=2, le=MAX_BLOCKS)] | None = None
    period: Annotated[Number, Field(gt=0)] | None = None

    @model_validator(mode="after")
    def _one_way_to_cut(self) -> Self:
        if (self.blocks is None) == (self.period is None):
            raise ValueError("give either blocks or period")
        return self


class RunTable(RunFacts):
    """The `[run]` table: facts as in a sidecar, and the split."""

    split: Split | None = None


class ImportMap(FileModel):
    """A mapping file. `signals` maps contract names, `time` and `aux_NAME` to columns; `ignore` leaves columns out."""

    ignore: Annotated[tuple[str, ...], Field(strict=False)] = ()
    signals: Mapping[str, SignalMap] = {}
    run: RunTable = RunTable()

    @model_validator(mode="after")
    def _names_and_units_are_known(self) -> Self:
        mistakes = [text for name, item in self.signals.items() for text in _wrong(name, item)]
        split = self.run.split
        if split is not None and split.by not in (TIME.name, *BY_NAME):
            mistakes.append(f"run.split.by = '{split.by}' is no signal{_did_you_mean(split.by)}")
        if mistakes:
            raise ValueError("; ".join(mistakes))
        return self

    def facts(self) -> dict[str, str]:
        """Give the stated facts of the run as text."""
        facts = self.run.metadata()
        facts.pop("split", None)
        return facts


def load_map(path: Path) -> tuple[ImportMap, str]:
    """Read a mapping file; give it and its text. Raises ConfigError with every mistake."""
    text = read_text(path)
    return parse_toml(text, ImportMap, str(path)), text


def _wrong(name: str, item: SignalMap) -> list[str]:
    if name.startswith(AUXILIARY_PREFIX):
        plain = name.removeprefix(AUXILIARY_PREFIX)
        return [] if plain and plain == plain_name(plain) else [f"signals.'{name}' has letters that no log field takes"]
    if name != TIME.name and name not in BY_NAME:
        return [f"signals.{name} is no signal{_did_you_mean(name)}; call an auxiliary one aux_{plain_name(name)}"]
    wanted = TIME.unit if name == TIME.name else BY_NAME[name].unit
    unit = find_unit(item.unit if item.unit is not None else wanted)
    if unit is None or unit.si != wanted:
        return [f"signals.{name}.unit = '{item.unit}' should be one of {', '.join(spellings(wanted))}"]
    return []


def _did_you_mean(name: str) -> str:
    close = difflib.get_close_matches(name, [TIME.name, *BY_NAME], n=1)
    return f" (did you mean {close[0]}?)" if close else ""

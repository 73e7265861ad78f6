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

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from drivers.signals import AUXILIARY_PREFIX, BY_NAME, TIME
from drivers.spelling import did_you_mean
from rig.config.toml_file import (
    Conflict,
    FileModel,
    Number,
    Table,
    parse_toml,
    read_text,
)
from rig.log.csv_file import RunFacts
from rig.log.names import plain_name
from rig.log.units import find_unit, spellings

MAX_BLOCKS = 1000

_NAMES = (TIME.name, *BY_NAME)


class SignalMap(FileModel):
    """Where one signal comes from: value = `sign` * (`scale` * raw + `offset`) in `unit`."""

    column: Annotated[str, Field(min_length=1)]
    unit: str | None = None
    scale: Number = 1.0
    offset: Number = 0.0
    sign: Literal[1, -1] = 1

    @classmethod
    def conflicts(cls, table: Table) -> Iterator[Conflict]:
        """Check that the signal is not lost."""
        if table.get("scale") == 0:
            yield Conflict(("scale",), table["scale"], "would erase the signal")


class Split(FileModel):
    """How one recording is cut into runs: equal `blocks` of the range of `by`, or pieces of `period` (SI)."""

    by: str = TIME.name
    blocks: Annotated[int, Field(ge=2, le=MAX_BLOCKS)] | None = None
    period: Annotated[Number, Field(gt=0)] | None = None

    @classmethod
    def conflicts(cls, table: Table) -> Iterator[Conflict]:
        """Check that there is one way to cut."""
        if ("blocks" in table) == ("period" in table):
            yield Conflict((), dict(table), "give either blocks or period")


class RunTable(RunFacts):
    """The `[run]` table: facts as in a sidecar, and the split."""

    split: Split | None = None


class ImportMap(FileModel):
    """A mapping file. `signals` maps contract names, `time` and `aux_NAME` to columns; `ignore` leaves columns out."""

    ignore: Annotated[tuple[str, ...], Field(strict=False)] = ()
    signals: Mapping[str, SignalMap] = {}
    run: RunTable = RunTable()

    @classmethod
    def conflicts(cls, table: Table) -> Iterator[Conflict]:
        """Check that names and units are known, and that no column is two signals, as two readings would agree."""
        taken: dict[str, str] = {}
        for name, item in (table.get("signals") or {}).items():
            yield from _signal_conflicts(name, item or {})
            column = (item or {}).get("column")
            if isinstance(column, str):
                if column in taken:
                    yield Conflict(("signals", name, "column"), column, f"is taken for {taken[column]} already")
                taken.setdefault(column, name)
        by = ((table.get("run") or {}).get("split") or {}).get("by")
        if by is not None and by not in _NAMES:
            yield Conflict(("run", "split", "by"), by, f"is no signal{did_you_mean(by, _NAMES)}")

    def facts(self) -> dict[str, str]:
        """Give the stated facts of the run as text."""
        facts = self.run.metadata()
        facts.pop("split", None)
        return facts


def load_map(path: Path) -> tuple[ImportMap, str]:
    """Read a mapping file; give it and its text. Raises ConfigError with every mistake."""
    text = read_text(path)
    return parse_toml(text, ImportMap, str(path)), text


def _signal_conflicts(name: str, item: Table) -> Iterator[Conflict]:
    path = ("signals", name)
    if name.startswith(AUXILIARY_PREFIX):
        plain = name.removeprefix(AUXILIARY_PREFIX)
        if not plain or plain != plain_name(plain):
            yield Conflict(path, dict(item), "has letters that no log field takes")
        return
    if name != TIME.name and name not in BY_NAME:
        rule = f"is no signal{did_you_mean(name, _NAMES)}; call an auxiliary one aux_{plain_name(name)}"
        yield Conflict(path, dict(item), rule)
        return
    wanted = TIME.unit if name == TIME.name else BY_NAME[name].unit
    text = item.get("unit")
    unit = find_unit(text) if text is not None else None
    if text is not None and (unit is None or unit.si != wanted):
        yield Conflict((*path, "unit"), text, f"should be one of {', '.join(spellings(wanted))}")

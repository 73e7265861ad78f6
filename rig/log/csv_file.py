"""The contract CSV: header `name[unit]`, comma, decimal point; beside `x.csv` an optional sidecar `x.toml`."""

import csv
import json
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date, datetime, time
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import ConfigDict, Field, PlainValidator

from drivers.errors import DataError
from drivers.signals import BY_NAME, INTEGER_SIGNALS, TIME
from drivers.spelling import near_names
from rig.config.toml_file import FileModel, Number, parse_toml, plain_value, read_text
from rig.log.names import plain_name
from rig.log.rows import Rows
from rig.log.run import Floats, ProcedureName, Run
from rig.log.text_table import MISSING, TextTable, read_text_table, text_tables
from rig.log.timeline import constant_columns, make_run
from rig.log.units import find_unit, spellings, to_si

_HEADER = re.compile(r"(?P<name>[^\[\]]*?)\s*(\[(?P<unit>[^\[\]]*)\])?")
_UNFIT_FOR_HEADER = re.compile(r"[\[\]\r\n]")
_ROWS_AT_ONCE = 10_000

NEAR_FACT, NEAR_SIGNAL = 0.8, 0.85
"""How alike (1: the same) a key or column must be to a known name for one to be taken for a slip of the other."""


def _fact(value: object) -> object:
    return value if isinstance(value, datetime | date | time) else plain_value(value)


Fact = Annotated[str | bool | int | float | datetime | date | time, PlainValidator(_fact)]


class RunFacts(FileModel):
    """What a sidecar or the `[run]` table of a mapping says; any further key is kept as metadata."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Fact] = Field(init=False)

    procedure: Annotated[ProcedureName, Field(strict=False)] | None = None
    replicate: Annotated[str, Field(min_length=1, max_length=200)] | None = None
    start_angle: Number | None = None

    def metadata(self) -> dict[str, str]:
        """Give every fact that was stated, as text."""
        stated = self.model_dump(exclude_none=True)
        return {key: str(value) if isinstance(value, str) else _plain_text(value) for key, value in stated.items()}


def read_csv(path: Path, most_samples: int | None = None) -> Run:
    """Give the run in a contract CSV and its sidecar.

    A column with a contract name needs a unit of the right kind and becomes SI; any other column is kept as an
    auxiliary signal with its unit as written. `most_samples`: of a log with more samples means over samples are kept,
    see `Run.averaged`; None: all is kept. Raises DataError with column and row, ConfigError for the sidecar.
    """
    rows = Rows(path, most_samples)
    missing: Counter[str] = Counter()
    parts: list[tuple[int, TextTable]] = []
    heads: tuple[_Head, ...] = ()
    for table in [read_text_table(path)] if most_samples is None else text_tables(path):
        heads = heads or _heads(path, table.names)
        columns = _si_columns(path, heads, table)
        parts.append((rows.count, replace(table, values=table.values[:0])))
        missing.update(missing_in(columns))
        rows.add(columns.pop(TIME.name), columns)

    def row_of(index: int) -> int:
        first, part = next(item for item in reversed(parts) if item[0] <= index * rows.averaged)
        return part.row_of(index * rows.averaged - first)

    time, columns = rows.finish()
    units = {head.name: head.unit or "" for head in heads if head.auxiliary}
    warnings = [note for head in heads if head.auxiliary for note in near_miss_signal(split_header(head.header)[0])]
    warnings.extend(column_warnings(columns, missing, rows.count))
    sidecar = path.with_suffix(".toml")
    facts = read_facts(sidecar) if sidecar.is_file() else RunFacts()
    warnings.extend(near_miss_facts(facts))
    return make_run(
        path,
        time,
        {head.name: columns[head.name] for head in heads if head.name in columns and not head.auxiliary},
        {name: columns[name] for name in units},
        units,
        facts.metadata(),
        warnings=warnings,
        row_of=row_of,
        averaged=rows.averaged,
    )


@dataclass(frozen=True, slots=True)
class _Head:
    """One column: its header, the name of its signal and the unit as written, None where none is."""

    header: str
    name: str
    unit: str | None
    auxiliary: bool


def _heads(path: Path, headers: Sequence[str]) -> tuple[_Head, ...]:
    """Say what every column is. Raises DataError where a name stands twice, or none is the time."""
    heads: list[_Head] = []
    for header in headers:
        name, unit = split_header(header)
        auxiliary = name != TIME.name and name not in BY_NAME
        if any(header == head.header if auxiliary else name == head.name for head in heads):
            raise DataError(str(path), "the column is there twice", column=header, row=1, hint="Rename or remove one.")
        taken = {*BY_NAME, *(head.name for head in heads if head.auxiliary)}
        heads.append(_Head(header, plain_name(name, taken) if auxiliary else name, unit, auxiliary))
    if all(head.name != TIME.name for head in heads):
        raise DataError(
            str(path),
            f"there is no time column among {list(headers)[:8]}",
            column="time",
            expected="a column time[s]",
            hint="Rename the column, or bring a foreign log in with rig import --map.",
        )
    return tuple(heads)


def _si_columns(path: Path, heads: Sequence[_Head], table: TextTable) -> dict[str, Floats]:
    """Give the columns of a table by name, those of the contract in SI. Raises DataError with column and row."""
    columns: dict[str, Floats] = {}
    for index, head in enumerate(heads):
        column = np.ascontiguousarray(table.values[:, index])
        columns[head.name] = column if head.auxiliary else contract_column(path, head.name, head.unit, column)
        missing = np.flatnonzero(np.isnan(column))
        if head.name == TIME.name and len(missing):
            raise DataError(str(path), f"time is {MISSING}", column=head.header, row=table.row_of(int(missing[0])))
    refuse_overflow(path, {head.name: columns[head.name] for head in heads if not head.auxiliary}, table.row_of)
    return columns


def write_csv(run: Run, path: Path) -> None:
    """Write the run as contract CSV with shortest digits that read back exactly, and its sidecar beside it.

    Raises OSError if a file cannot be written, FileExistsError if one is there already.
    """
    columns = [(TIME.name, TIME.unit, run.time)]
    columns += [(name, BY_NAME[name].unit, column) for name, column in run.signals.items()]
    columns += [(name, run.auxiliary_units.get(name, ""), column) for name, column in run.auxiliary.items()]
    with path.with_suffix(".toml").open("x", encoding="utf-8", newline="\n") as handle:
        handle.write(_sidecar(run))
    with path.open("x", encoding="utf-8", newline="") as handle:
        header = csv.writer(handle, lineterminator="\n")
        header.writerow(f"{name}[{_UNFIT_FOR_HEADER.sub(' ', unit)}]" for name, unit, _ in columns)
        for start in range(0, len(run.time), _ROWS_AT_ONCE):
            part = [_cells(name, column[start : start + _ROWS_AT_ONCE]) for name, _, column in columns]
            handle.write("\n".join(map(",".join, zip(*part, strict=True))) + "\n")


def split_header(header: str) -> tuple[str, str | None]:
    """Give name and unit of a header `name[unit]`; the unit is None where there are no brackets."""
    match = _HEADER.fullmatch(header)
    if match is None:
        return header, None
    return match["name"], match["unit"]


def contract_column(path: Path, name: str, unit: str | None, column: Floats) -> Floats:
    """Convert a column of contract signal `name`, shape (n,), to SI. Raises DataError if the unit does not fit."""
    wanted = TIME.unit if name == TIME.name else BY_NAME[name].unit
    if unit is None and wanted == "1":
        return column
    found = None if unit is None else find_unit(unit)
    if found is None or found.si != wanted:
        what = "the column has no unit" if unit is None else f"the unit '{unit[:40]}' is not known"
        if found is not None:
            what = f"the unit '{unit}' does not fit"
        raise DataError(
            str(path),
            what,
            column=name,
            row=1,
            value=unit,
            expected=f"one of {', '.join(spellings(wanted))}, in brackets after the name",
        )
    return to_si(column, found)


def refuse_overflow(path: Path, columns: Mapping[str, Floats], row_of: Callable[[int], int]) -> None:
    """Raise DataError where a finite number of the file has no finite value in SI; columns of shape (n,)."""
    for name, column in columns.items():
        bad = np.flatnonzero(np.isinf(column))
        if len(bad):
            raise DataError(
                str(path),
                "the value is too large in SI",
                column=name,
                row=row_of(int(bad[0])),
                expected="a number below 1.8e308",
                hint="Check unit and scale.",
            )


def missing_in(columns: Mapping[str, Floats]) -> dict[str, int]:
    """Count the samples at which each column, shape (n,), is missing."""
    return {name: int(np.isnan(column).sum()) for name, column in columns.items()}


def column_warnings(columns: Mapping[str, Floats], missing: Mapping[str, int], samples: int) -> list[str]:
    """Tell of columns, shape (n,), that never change, and of those `missing` at some of the `samples` of the file."""
    notes = []
    constant = constant_columns(columns)
    if constant:
        notes.append(f"constant over the whole log: {', '.join(constant)}")
    notes.extend(f"{name} is missing in {missing[name]} of {samples} samples" for name in columns if missing[name])
    return notes


def read_facts(sidecar: Path) -> RunFacts:
    """Read a sidecar. Raises ConfigError with every mistake."""
    return parse_toml(read_text(sidecar), RunFacts, str(sidecar))


def near_miss_facts(facts: RunFacts) -> list[str]:
    """Tell of metadata keys that look like a misspelt `procedure`, `replicate` or `start_angle`."""
    known = list(RunFacts.model_fields)
    notes = []
    for key in facts.__pydantic_extra__ or {}:
        close = near_names(key, known, NEAR_FACT)
        if close:
            notes.append(f"metadata '{key}' is kept as it is; if '{close[0]}' was meant, correct the spelling")
    return notes


def near_miss_signal(name: str) -> list[str]:
    """Tell of an auxiliary column whose name looks like a misspelt contract signal, or is one without its unit."""
    if name in BY_NAME:
        return [f"column '{name}' is kept as auxiliary, since it states no unit; write {name}[{BY_NAME[name].unit}]"]
    close = near_names(name, [TIME.name, *BY_NAME], NEAR_SIGNAL)
    return [f"column '{name}' is kept as auxiliary; if '{close[0]}' was meant, correct the spelling"] if close else []


def _cells(name: str, column: Floats) -> list[str]:
    values = column.tolist()
    if name in INTEGER_SIGNALS:
        return [
            MISSING if value != value else str(int(value)) if value.is_integer() else repr(value) for value in values
        ]
    cells = list(map(repr, values))
    if np.isnan(column).any():
        cells = [MISSING if cell == "nan" else cell for cell in cells]
    return cells


def _sidecar(run: Run) -> str:
    facts = dict(run.metadata)
    facts["procedure"] = str(run.procedure)
    if run.replicate is not None:
        facts["replicate"] = run.replicate
    lines = [f"{_toml_string(key)} = {_toml_string(value)}" for key, value in facts.items() if key != "start_angle"]
    if run.start_angle is not None:
        lines.append(f"start_angle = {run.start_angle!r}")
    return "\n".join(lines) + "\n"


def _toml_string(text: str) -> str:
    # a JSON string is a TOML basic string, but for DEL, which TOML wants escaped
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007F")


def _plain_text(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return value.isoformat() if isinstance(value, datetime | date | time) else str(value)

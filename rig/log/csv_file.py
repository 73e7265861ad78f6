"""The contract CSV: header `name[unit]`, comma, decimal point; beside `x.csv` an optional sidecar `x.toml`."""

import csv
import json
import re
from collections.abc import Callable, Mapping
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
from rig.log.run import Floats, ProcedureName, Run
from rig.log.text_table import MISSING, read_text_table
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


def read_csv(path: Path) -> Run:
    """Give the run in a contract CSV and its sidecar.

    A column with a contract name needs a unit of the right kind and becomes SI; any other column is kept as an
    auxiliary signal with its unit as written. Raises DataError with column and row, ConfigError for the sidecar.
    """
    table = read_text_table(path)
    warnings: list[str] = []
    time: Floats | None = None
    signals: dict[str, Floats] = {}
    auxiliary: dict[str, Floats] = {}
    units: dict[str, str] = {}
    for index, header in enumerate(table.names):
        name, unit = split_header(header)
        column = np.ascontiguousarray(table.values[:, index])
        if name == TIME.name:
            _refuse_second(path, header, time is not None)
            time = contract_column(path, name, unit, column)
            missing = np.flatnonzero(np.isnan(time))
            if len(missing):
                raise DataError(str(path), f"time is {MISSING}", column=header, row=table.row_of(int(missing[0])))
        elif name in BY_NAME:
            _refuse_second(path, header, name in signals)
            signals[name] = contract_column(path, name, unit, column)
        else:
            _refuse_second(path, header, header in table.names[:index])
            plain = plain_name(name, {*BY_NAME, *auxiliary})
            auxiliary[plain], units[plain] = column, unit or ""
            warnings.extend(near_miss_signal(name))
    if time is None:
        raise DataError(
            str(path),
            f"there is no time column among {list(table.names)[:8]}",
            column="time",
            expected="a column time[s]",
            hint="Rename the column, or bring a foreign log in with rig import --map.",
        )
    refuse_overflow(path, {TIME.name: time, **signals}, table.row_of)
    warnings.extend(column_warnings(signals | auxiliary))
    sidecar = path.with_suffix(".toml")
    facts = read_facts(sidecar) if sidecar.is_file() else RunFacts()
    warnings.extend(near_miss_facts(facts))
    return make_run(path, time, signals, auxiliary, units, facts.metadata(), warnings=warnings, row_of=table.row_of)


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


def column_warnings(columns: Mapping[str, Floats]) -> list[str]:
    """Tell of columns, shape (n,), that never change, and of samples at which a signal is missing."""
    notes = []
    constant = constant_columns(columns)
    if constant:
        notes.append(f"constant over the whole log: {', '.join(constant)}")
    for name, column in columns.items():
        missing = int(np.isnan(column).sum())
        if missing:
            notes.append(f"{name} is missing in {missing} of {len(column)} samples")
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


def _refuse_second(path: Path, header: str, seen: bool) -> None:
    if seen:
        raise DataError(str(path), "the column is there twice", column=header, row=1, hint="Rename or remove one.")


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

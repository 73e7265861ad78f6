"""Bring foreign logs in: columns to signals by a mapping, one recording cut into runs, written as MCAP."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from drivers.errors import ConfigError, DataError
from drivers.signals import AUXILIARY_PREFIX, BY_NAME, INTEGER_SIGNALS, TIME
from drivers.types import Sample
from rig.log.csv_file import (
    column_warnings,
    contract_column,
    missing_in,
    near_miss_facts,
    near_miss_signal,
    read_facts,
    refuse_overflow,
    split_header,
)
from rig.log.foreign import ForeignTable, read_foreign
from rig.log.mapping import MAX_BLOCKS, ImportMap, SignalMap, Split, load_map
from rig.log.mcap_reader import IMPORT_WARNINGS
from rig.log.names import plain_name, safe_name
from rig.log.run import Floats, Run
from rig.log.timeline import check_stamps, make_run
from rig.log.units import find_unit, to_si
from rig.log.writer import LogWriter


@dataclass(frozen=True, slots=True)
class _Recording:
    """One file after the mapping: the whole run, and the boolean rows, shape (n,), of each run cut from it."""

    run: Run
    parts: tuple[NDArray[np.bool_], ...]


def import_files(files: Sequence[Path], mapping: Path | None, out: Path) -> list[Path]:
    """Write each recording in `files` to `out` as MCAP, `<name>.mcap` or, if split, `<name>-01.mcap` and so on.

    `mapping`: a mapping file; None where the columns have contract names and units. All files are read before the
    first is written. Each value of a mapped column, or of an unmapped one with contract name and unit, must be a
    finite number; in the latter a cell `NA` says that it was not measured. Any other column is kept as an auxiliary
    signal if all its cells are numbers. The sidecar `x.toml` of a CSV `x.csv` is read too; what `[run]` of the mapping
    says wins. Raises ConfigError for the mapping, a sidecar or an existing output, DataError with file, column and row.
    """
    rules, text = (ImportMap(), "") if mapping is None else load_map(mapping)
    recordings = [_cut(read_recording(file, rules, mapping), rules.run.split) for file in files]
    return [path for recording in recordings for path in _write(recording, rules.run.split, text, out)]


def read_recording(file: Path, rules: ImportMap, mapping: Path | None = None) -> Run:
    """Give a foreign recording as one run in SI. `mapping`: the file of the rules, which is no sidecar.

    Raises DataError with file, column and row, ConfigError for a sidecar.
    """
    wanted = {item.column for item in rules.signals.values()}
    table = read_foreign(file, lambda header: header in wanted or _is_taken_as_it_is(header, rules))
    missing = sorted((wanted | set(rules.ignore)) - set(table.columns))
    if missing:
        raise DataError(
            str(file),
            "the column named in the mapping is not in the file",
            column=missing[0],
            row=1,
            expected=f"one of {list(table.columns)[:12]}",
        )
    signals: dict[str, Floats] = {}
    auxiliary: dict[str, Floats] = {}
    units: dict[str, str] = {}
    warnings: list[str] = []
    for name, item in rules.signals.items():
        column = _mapped(file, table, name, item)
        if name.startswith(AUXILIARY_PREFIX):
            plain = name.removeprefix(AUXILIARY_PREFIX)
            auxiliary[plain], units[plain] = column, item.unit or split_header(item.column)[1] or ""
        else:
            signals[name] = column
    for header in table.columns:
        if header not in wanted and header not in rules.ignore:
            _take_unmapped(file, table, header, signals, auxiliary, units, warnings)
    if TIME.name not in signals:
        raise DataError(
            str(file),
            f"there is no time among the columns {list(table.columns)[:12]}",
            column="time",
            expected="[signals.time] in the mapping, or a column time[s]",
        )
    time = signals.pop(TIME.name)
    if not signals:
        raise DataError(str(file), "no column is a signal", expected="[signals.NAME] in the mapping")
    refuse_overflow(file, {TIME.name: time, **signals}, table.row_of)
    _refuse_other_length(file, time, signals, rules)
    for name in [name for name, column in auxiliary.items() if len(column) != len(time)]:
        warnings.append(f"column '{name}' left out: {len(auxiliary.pop(name))} values, time has {len(time)}")
    found = signals | auxiliary
    warnings.extend(column_warnings(found, missing_in(found), len(time)))
    beside, notes = _sidecar_facts(file, mapping, whole=rules.run.split is None)
    warnings.extend(notes)
    run = make_run(
        file,
        time,
        signals,
        auxiliary,
        {name: units[name] for name in auxiliary},
        {**beside, **rules.facts()},
        warnings=warnings,
        row_of=table.row_of,
    )
    # a log keeps whole nanoseconds
    check_stamps(len(run.time), len(np.unique(np.round(run.time * 1e9))), file)
    return run


def _sidecar_facts(file: Path, mapping: Path | None, *, whole: bool) -> tuple[dict[str, str], list[str]]:
    """Give what the sidecar of a CSV says, and warnings; of a recording that is cut not what holds for its whole only.

    Without a mapping the CSV is that of the contract and its sidecar must be right; beside a mapping another file may
    have that name.
    """
    sidecar = file.with_suffix(".toml")
    if file.suffix.lower() != ".csv" or not sidecar.is_file():
        return {}, []
    if mapping is not None and sidecar.resolve() == mapping.resolve():
        return {}, []
    try:
        found = read_facts(sidecar)
    except ConfigError:
        if mapping is None:
            raise
        return {}, [f"{sidecar.name} beside it is no sidecar and was not read"]
    facts = found.metadata()
    if not whole:
        facts = {key: value for key, value in facts.items() if key not in ("replicate", "start_angle", "run_id")}
    return facts, near_miss_facts(found)


def _has_contract_name(header: str) -> bool:
    """Tell whether a column is `name[unit]`, or a count without a unit, so that it needs no mapping."""
    name, unit = split_header(header)
    if name == TIME.name or name in BY_NAME:
        return unit is not None or name in INTEGER_SIGNALS
    return False


def _is_taken_as_it_is(header: str, rules: ImportMap) -> bool:
    """Tell whether a column becomes the signal whose name it bears: it is neither ignored nor mapped from another."""
    return header not in rules.ignore and _has_contract_name(header) and split_header(header)[0] not in rules.signals


def _mapped(file: Path, table: ForeignTable, name: str, item: SignalMap) -> Floats:
    raw = table.columns[item.column]
    bad = np.flatnonzero(~np.isfinite(raw))
    if len(bad):
        index = int(bad[0])
        raise DataError(
            str(file), "the value is not a finite number", column=item.column, row=table.row_of(index), value=raw[index]
        )
    if not len(raw):
        raise DataError(str(file), "the column holds no sample", column=item.column)
    with np.errstate(over="ignore"):  # what is too large then is refused by its row
        plain = (item.scale, item.offset, item.sign) == (1.0, 0.0, 1)
        value = raw if plain else item.sign * (item.scale * raw + item.offset)
    if name.startswith(AUXILIARY_PREFIX):
        return value
    bracket = split_header(item.column)[1]
    wanted = TIME.unit if name == TIME.name else BY_NAME[name].unit
    text = item.unit if item.unit is not None else bracket if bracket is not None else wanted
    unit = find_unit(text)
    if unit is None or unit.si != wanted:
        raise DataError(
            str(file),
            f"the unit '{text[:40]}' is not a unit of {name}",
            column=item.column,
            row=1,
            value=text,
            expected=f"a unit of {wanted}",
            hint="State the unit in the mapping.",
        )
    return to_si(value, unit)


def _take_unmapped(
    file: Path,
    table: ForeignTable,
    header: str,
    signals: dict[str, Floats],
    auxiliary: dict[str, Floats],
    units: dict[str, str],
    warnings: list[str],
) -> None:
    name, unit = split_header(header)
    column = table.columns[header]
    if name not in signals and _has_contract_name(header):
        signals[name] = contract_column(file, name, unit, column)
        return
    wrong = int((~np.isfinite(column)).sum())
    if wrong or not len(column):
        warnings.append(f"column '{header}' left out: {wrong} of {len(column)} cells are no finite number")
        return
    plain = plain_name(name, {TIME.name, *BY_NAME, *auxiliary})
    auxiliary[plain], units[plain] = column, unit or ""
    warnings.extend(near_miss_signal(name))


def _refuse_other_length(file: Path, time: Floats, signals: Mapping[str, Floats], rules: ImportMap) -> None:
    for name, column in signals.items():
        if len(column) != len(time):
            raise DataError(
                str(file),
                f"{name} has {len(column)} values, but time has {len(time)}",
                column=rules.signals[name].column if name in rules.signals else name,
                expected="columns of one length",
            )


def _cut(run: Run, split: Split | None) -> _Recording:
    if split is None:
        return _Recording(run, (np.ones(len(run.time), dtype=np.bool_),))
    if split.by != TIME.name and split.by not in run.signals:
        raise DataError(
            str(run.file),
            "the recording is to be split by a signal it lacks",
            column=split.by,
            expected="a mapped signal",
        )
    values = run.time if split.by == TIME.name else run.signals[split.by]
    if np.isnan(values).any():
        raise DataError(str(run.file), "the signal to split by is missing in some samples", column=split.by)
    low, high = float(values.min()), float(values.max())
    width = split.period if split.period is not None else (high - low) / (split.blocks or 1)
    if width <= 0 or math.ceil((high - low) / width) > MAX_BLOCKS:
        raise DataError(
            str(run.file),
            f"{split.by} runs from {low:.6g} to {high:.6g}, which blocks of {width:.3g} do not cut into runs",
            column=split.by,
            expected=f"between 2 and {MAX_BLOCKS} blocks",
        )
    index = np.floor((values - low) / width).astype(np.int64)
    if split.blocks is not None:
        index = np.minimum(index, split.blocks - 1)
    return _Recording(run, tuple(index == number for number in np.unique(index)))


def _write(recording: _Recording, split: Split | None, mapping: str, out: Path) -> list[Path]:
    run = recording.run
    written = []
    for number, rows in enumerate(recording.parts, start=1):
        name = safe_name(run.name) if split is None else f"{safe_name(run.name)}-{number:0{_digits(recording)}d}"
        facts = {
            "run_id": name,
            **run.metadata,
            "backend": "import",
            "source": run.file.name,
        }
        if run.warnings:
            facts[IMPORT_WARNINGS] = "; ".join(run.warnings)
        if split is not None:
            facts["recording"] = safe_name(run.name)
            facts["split"] = f"{number} of {len(recording.parts)} by {split.by}"
        path = out / f"{name}.mcap"
        _write_run(path, run, rows, facts, mapping)
        written.append(path)
    return written


def _digits(recording: _Recording) -> int:
    return max(2, len(str(len(recording.parts))))


def _write_run(path: Path, run: Run, rows: NDArray[np.bool_], facts: Mapping[str, str], mapping: str) -> None:
    time = run.time[rows]
    period = float(np.median(np.diff(run.time))) if len(run.time) > 1 else 1.0
    writer = LogWriter(
        path,
        facts,
        attachments={"map.toml": mapping.encode("utf-8")} if mapping else {},
        cycle_rate=1.0 / period,
        epoch_ns=0,
        auxiliary=tuple(run.auxiliary),
        auxiliary_units=run.auxiliary_units,
        without=tuple({"cycle", "late"} - set(run.signals)),
    )
    columns: dict[str, Sequence[float | int | None]] = {"cycle": range(len(time)), "late": [0] * len(time)}
    columns |= {name: _values(name, column[rows]) for name, column in run.signals.items()}
    further = {name: column[rows].tolist() for name, column in run.auxiliary.items()}
    # which signals there are is known only now, so their names cannot be checked as keywords
    sample: Callable[..., Sample] = Sample
    try:
        for index, moment in enumerate(time.tolist()):
            auxiliary = tuple((name, values[index]) for name, values in further.items())
            measured = {name: values[index] for name, values in columns.items()}
            writer.write(sample(time=moment, auxiliary=auxiliary, **measured))
        writer.close({"result": "imported", "samples": str(len(time))})
    except BaseException:  # also where a stop signal ends the import
        path.unlink()  # a part of a recording must not stand under the name of the whole
        raise


def _values(name: str, column: Floats) -> list[float | int | None]:
    whole = name in INTEGER_SIGNALS
    return [None if value != value else round(value) if whole else value for value in column.tolist()]

"""Export a run to HDF5 (that is also netCDF-4), CSV or Parquet, equal to the bit."""

import json
from collections.abc import Callable, Mapping
from datetime import UTC, datetime, timedelta
from enum import StrEnum
from pathlib import Path
from types import MappingProxyType

import h5py
import numpy as np
from numpy.typing import NDArray

from drivers.errors import ConfigError, Mistake
from drivers.signals import AUXILIARY_PREFIX, BY_NAME, INTEGER_SIGNALS, TIME
from rig.log.csv_file import write_csv
from rig.log.names import safe_name
from rig.log.run import Floats, Run

CHUNK_ROWS = 16_384
MAX_ATTRIBUTE_LETTERS = 15_000
"""HDF5 limits an attribute in the object header to 64 KiB, 4 bytes per letter; a longer text continues in the next."""


class ExportKind(StrEnum):
    """File formats of an export."""

    HDF5 = "hdf5"
    CSV = "csv"
    PARQUET = "parquet"


def export_run(run: Run, kind: ExportKind, folder: Path) -> Path:
    """Write the run to `folder` under its own name and give the file.

    Raises ConfigError if the file is there already, the folder cannot be written or Parquet support is missing.
    """
    suffix, write = EXPORTERS[kind]
    path = folder / f"{safe_name(run.name)}{suffix}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if path.exists():
            raise ConfigError(
                str(path),
                [Mistake("file", path.name, "exists already and is never overwritten")],
                hint="Choose another folder with -o or move the file away.",
            )
        write(run, path)
    except OSError as error:
        raise ConfigError(
            str(path),
            [Mistake("file", path.name, f"cannot be written: {error.strerror or error}")],
            hint="Choose another folder with -o.",
        ) from error
    return path


def write_hdf5(run: Run, path: Path) -> None:
    """Write one dataset per signal with `time` as dimension scale; auxiliary signals carry the prefix `aux_`.

    Readable as HDF5 and as netCDF-4 without a plug-in. Integer signals are int64 unless samples are missing.
    """
    with h5py.File(path, "x", libver=("earliest", "v110")) as file:
        for name, text in _attributes(run).items():
            _set_text(file, name, text)
        if "epoch_ns" in run.metadata and run.metadata["epoch_ns"].lstrip("-").isdigit():
            file.attrs["start_time_ns"] = np.int64(int(run.metadata["epoch_ns"]))
        time = _dataset(file, TIME.name, run.time, TIME.unit, TIME.meaning)
        time.make_scale(TIME.name)
        for name, column in run.signals.items():
            whole = name in INTEGER_SIGNALS and bool(np.isfinite(column).all())
            stored = column.astype(np.int64) if whole else column
            _dataset(file, name, stored, BY_NAME[name].unit, BY_NAME[name].meaning).dims[0].attach_scale(time)
        for name, column in run.auxiliary.items():
            unit = run.auxiliary_units.get(name, "")
            dataset = _dataset(file, AUXILIARY_PREFIX + name, column, unit, f"auxiliary signal {name}")
            dataset.dims[0].attach_scale(time)
        if run.events:
            _events(file, run)


def write_parquet(run: Run, path: Path) -> None:
    """Write one column `name[unit]` per signal and the metadata as file metadata. Needs the extra `parquet`."""
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError as error:
        raise ConfigError(
            "--to parquet",
            [Mistake("pyarrow", "not installed", "Parquet needs it")],
            hint="Install it with: pip install 'harmonic-rig[parquet]'",
        ) from error
    columns = {f"{TIME.name}[{TIME.unit}]": run.time}
    columns |= {f"{name}[{BY_NAME[name].unit}]": column for name, column in run.signals.items()}
    columns |= {f"{name}[{run.auxiliary_units.get(name, '')}]": column for name, column in run.auxiliary.items()}
    table = pyarrow.table(columns).replace_schema_metadata(_attributes(run))
    with path.open("xb") as handle:
        parquet.write_table(table, handle, compression="zstd")


EXPORTERS: Mapping[ExportKind, tuple[str, Callable[[Run, Path], None]]] = MappingProxyType(
    {
        ExportKind.HDF5: (".h5", write_hdf5),
        ExportKind.CSV: (".csv", write_csv),
        ExportKind.PARQUET: (".parquet", write_parquet),
    }
)
"""Suffix and function of each format."""


def _attributes(run: Run) -> dict[str, str]:
    facts = {
        "Conventions": "CF-1.8",
        "title": run.name,
        "procedure": str(run.procedure),
        "complete": "true" if run.complete else "false",
        "run_metadata": json.dumps(dict(run.metadata), ensure_ascii=False),
        "dut_toml": run.dut_text,
        "bench_toml": run.bench_text,
    }
    for name in ("run_id", "operator", "dut", "bench", "software", "git"):
        facts[name] = run.metadata.get(name, "")
    if run.replicate is not None:
        facts["replicate"] = run.replicate
    if run.start_angle is not None:
        facts["start_angle"] = repr(run.start_angle)
    started = run.metadata.get("epoch_ns", "")
    if started.isdigit() and int(started) > 0:
        moment = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=int(started) // 1000)
        facts["start_time"] = moment.isoformat()
    return {name: text for name, text in facts.items() if text}


def _set_text(file: h5py.File, name: str, text: str) -> None:
    clean = text.replace("\0", " ")
    for number, start in enumerate(range(0, len(clean), MAX_ATTRIBUTE_LETTERS), start=1):
        part = clean[start : start + MAX_ATTRIBUTE_LETTERS].encode("utf-8")
        # a fixed length: variable-length strings do not open in every reader
        file.attrs.create(
            name if number == 1 else f"{name}_{number}", np.array(part, dtype=h5py.string_dtype("utf-8", len(part)))
        )


def _dataset(file: h5py.File, name: str, column: Floats | NDArray[np.int64], unit: str, meaning: str) -> h5py.Dataset:
    if len(column):
        dataset = file.create_dataset(
            name,
            data=column,
            chunks=(min(CHUNK_ROWS, len(column)),),
            compression="gzip",
            compression_opts=4,
            shuffle=True,
        )
    else:
        dataset = file.create_dataset(name, data=column)
    for key, text in (("units", unit), ("long_name", meaning)):
        if text:
            data = text.encode("utf-8")
            dataset.attrs.create(key, np.array(data, dtype=h5py.string_dtype("utf-8", len(data))))
    return dataset


def _events(file: h5py.File, run: Run) -> None:
    time = _dataset(file, "event_time", np.array([event.time for event in run.events]), "s", "time of an event")
    time.make_scale("event_time")
    for name, texts in (
        ("event_kind", [event.kind for event in run.events]),
        ("event_text", [event.text for event in run.events]),
    ):
        data = [text.replace("\0", " ").encode("utf-8") for text in texts]
        kind = h5py.string_dtype("utf-8", max(1, *map(len, data)))
        file.create_dataset(name, data=np.array(data, dtype=kind)).dims[0].attach_scale(time)

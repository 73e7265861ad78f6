"""Columns of numbers out of CSV, HDF5, MAT and Parquet files that this software did not write.

A table or matrix gives one column per field (`table.field`) or per column (`matrix:0`); a nested group or struct is
joined by `/` (HDF5) or `.` (MAT). Nothing outside the file is followed.
"""

import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat
from scipy.io.matlab import MatReadError

from drivers.errors import ConfigError, DataError, Mistake
from rig.log.run import Floats
from rig.log.text_table import read_text_table

MAX_BYTES = 2 * 1024**3
MAX_COLUMNS = 1000

Strict = Callable[[str], bool]
"""Tells by a column's name whether each of its values must be a finite number."""


@dataclass(frozen=True, slots=True)
class ForeignTable:
    """`columns` by their name in the file, each of its own length; `row_of` the row of a sample as in an error."""

    columns: Mapping[str, Floats]
    row_of: Callable[[int], int]


def read_foreign(path: Path, strict: Strict) -> ForeignTable:
    """Give the numeric columns of a file; `strict` tells by its name whether each value of a column must be finite.

    In other columns a cell that is no number reads as NaN, in a strict one only the cell `NA` of a text file does.
    Raises DataError if the file is unreadable, of an unknown kind, or has a wrong value in a strict column,
    ConfigError if Parquet support is missing.
    """
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise DataError(
            str(path), f"'{path.suffix}' is no known kind of log", expected=f"one of {', '.join(sorted(READERS))}"
        )
    if not path.is_file():
        raise DataError(str(path), "there is no such file")
    table = reader(path, strict)
    if len(table.columns) > MAX_COLUMNS:
        raise DataError(str(path), f"the file has {len(table.columns)} columns", expected=f"at most {MAX_COLUMNS}")
    return table


def _read_text(path: Path, strict: Strict) -> ForeignTable:
    table = read_text_table(path, strict)
    twice = {name for name in table.names if strict(name) and table.names.count(name) > 1}
    if twice:
        raise DataError(str(path), "the column is there twice", column=min(twice), row=1)
    columns = {name: np.ascontiguousarray(table.values[:, index]) for index, name in enumerate(table.names)}
    return ForeignTable(MappingProxyType(columns), table.row_of)


def _read_hdf5(path: Path, strict: Strict) -> ForeignTable:
    columns: dict[str, Floats] = {}
    try:
        with h5py.File(path, "r") as file:
            total = 0
            for name, dataset in _datasets(file):
                if dataset.external or dataset.is_virtual:
                    raise DataError(str(path), "the dataset keeps its values in another file", column=name)
                total += dataset.nbytes
                if total > MAX_BYTES:
                    raise DataError(str(path), f"the file holds more than {MAX_BYTES} bytes", column=name)
                columns.update(_flatten(name, dataset[()]))
    except (OSError, RuntimeError, KeyError) as error:
        raise DataError(str(path), f"the file is no readable HDF5: {error}") from error
    return _from_arrays(path, columns, strict)


def _datasets(file: h5py.File) -> list[tuple[str, h5py.Dataset]]:
    found: list[tuple[str, h5py.Dataset]] = []

    def visit(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset) and not name.startswith("#"):
            found.append((name, item))

    file.visititems(visit)
    return found


def _read_mat(path: Path, strict: Strict) -> ForeignTable:
    if h5py.is_hdf5(path):
        return _read_hdf5(path, strict)
    try:
        variables = loadmat(path, simplify_cells=True)
    except (
        OSError,
        ValueError,
        TypeError,
        KeyError,
        IndexError,
        NotImplementedError,
        MatReadError,
        zlib.error,
        MemoryError,
        UnboundLocalError,  # what the reader itself stumbles over in damaged files
    ) as error:
        raise DataError(str(path), f"the file is no readable MAT file: {error}") from error
    columns: dict[str, Floats] = {}
    for name, value in variables.items():
        if not name.startswith("__"):
            columns.update(_flatten(name, value))
    return _from_arrays(path, columns, strict)


def _read_parquet(path: Path, strict: Strict) -> ForeignTable:
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError as error:
        raise ConfigError(
            str(path),
            [Mistake("pyarrow", "not installed", "Parquet needs it")],
            hint="Install it with: pip install 'harmonic-rig[parquet]'",
        ) from error
    try:
        table = parquet.read_table(path)
    except (OSError, pyarrow.ArrowException) as error:
        raise DataError(str(path), f"the file is no readable Parquet: {error}") from error
    columns: dict[str, Floats] = {}
    for name in table.column_names:
        kind = table.schema.field(name).type
        if pyarrow.types.is_integer(kind) or pyarrow.types.is_floating(kind):
            columns[name] = table.column(name).cast(pyarrow.float64(), safe=False).to_numpy().astype(np.float64)
    return _from_arrays(path, columns, strict)


READERS: Mapping[str, Callable[[Path, Strict], ForeignTable]] = MappingProxyType(
    {
        ".csv": _read_text,
        ".txt": _read_text,
        ".tsv": _read_text,
        ".h5": _read_hdf5,
        ".hdf5": _read_hdf5,
        ".nc": _read_hdf5,
        ".mat": _read_mat,
        ".parquet": _read_parquet,
    }
)
"""Reader of each file suffix."""


def _flatten(name: str, value: object) -> Iterator[tuple[str, Floats]]:
    """Give the numeric columns within a variable: itself, its fields, or the columns of a matrix."""
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _flatten(f"{name}.{key}", item)
        return
    if not isinstance(value, np.ndarray):
        return
    if value.dtype.names is not None:
        for field in value.dtype.names:
            yield from _flatten(f"{name}.{field}", value[field])
    elif value.dtype.kind in "fiub":
        yield from _matrix(name, value.astype(np.float64))


def _matrix(name: str, value: NDArray[np.float64]) -> Iterator[tuple[str, Floats]]:
    if value.ndim == 1:
        yield name, value
    elif value.ndim == 2 and 1 in value.shape:
        yield name, value.ravel()
    elif value.ndim == 2 and min(value.shape) <= MAX_COLUMNS:
        # a sample is along the longer side: HDF5 written by MATLAB is transposed
        columns = value if value.shape[0] >= value.shape[1] else value.T
        for index in range(columns.shape[1]):
            yield f"{name}:{index}", np.ascontiguousarray(columns[:, index])


def _from_arrays(path: Path, columns: Mapping[str, Floats], strict: Strict) -> ForeignTable:
    for name, column in columns.items():
        bad = np.flatnonzero(~np.isfinite(column))
        if strict(name) and len(bad):
            index = int(bad[0])
            raise DataError(
                str(path), "the value is not a finite number", column=name, row=index + 1, value=column[index]
            )
    return ForeignTable(MappingProxyType(dict(columns)), lambda index: index + 1)

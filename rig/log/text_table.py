"""Delimited text into columns of numbers, strictly: every wrong cell is named by column and row.

Rows count as in a text editor: the header is row 1. A cell `NA` says that the signal was not measured in that
sample; an empty cell, `nan` or `inf` is an error.
"""

import csv
import io
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from drivers.errors import DataError

MISSING = "NA"

MAX_FILE_BYTES = 2 * 1024**3
"""Largest file that is read as one table."""

BLOCK_BYTES = 32 * 1024**2
"""Bytes that are read at once of a file in parts."""

MAX_LINE_BYTES = 100_000
"""A line of 1 000 columns with 17 digits has 25 000 bytes."""

_DELIMITERS = (",", ";", "\t")
_NUMBER = re.compile(r"\s*[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?\s*", re.ASCII)
_NOT_FINITE = re.compile(r"\s*[-+]?(nan|inf|infinity)\s*", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class TextTable:
    """`names` as in the header; `values` of shape (rows, columns), NaN where a cell says NA; `row_of` the file row."""

    names: tuple[str, ...]
    values: NDArray[np.float64]
    row_of: Callable[[int], int]


def read_text_table(path: Path, strict: Callable[[str], bool] = lambda name: True) -> TextTable:
    """Read a table with a header from UTF-8 text, delimited by comma, semicolon or tab.

    `strict`: tells by a column's name whether a cell that is no number is an error; where not, it reads as NaN.
    Raises DataError, with column and row, for anything that is not a full table of finite numbers.
    """
    try:
        size = path.stat().st_size
    except OSError as error:
        raise _unreadable(path, error) from error
    if size > MAX_FILE_BYTES:
        raise DataError(str(path), f"the file is larger than {MAX_FILE_BYTES} bytes", hint="Cut it into parts.")
    return next(text_tables(path, strict, size + 1))


def text_tables(
    path: Path, strict: Callable[[str], bool] = lambda name: True, block_bytes: int = BLOCK_BYTES
) -> Iterator[TextTable]:
    """Read a table as `read_text_table` does, in parts of about so many bytes, one after the other."""
    names: tuple[str, ...] = ()
    delimiter, row, empty = ",", 1, True
    for text in _texts(path, block_bytes):
        body, first = text, row
        if not names:
            head, _, body = text.partition("\n")
            delimiter = max(_DELIMITERS, key=head.count)
            names = tuple(name.strip() for name in next(csv.reader([head], delimiter=delimiter), []))
            if not any(names):
                raise DataError(str(path), "the file has no header", row=1, expected="names such as time[s]")
            first = 2
        row = first + body.count("\n")
        if not body.strip():
            continue
        values = _parse_fast(body, len(names), delimiter)
        if values is None:
            values = _parse_strict(path, body, names, delimiter, [strict(name) for name in names], first)
        yield TextTable(names, values, _row_lookup(body, first))
        empty = False
    if empty:
        raise DataError(str(path), "the file holds a header but no sample", row=2)


def _texts(path: Path, block_bytes: int) -> Iterator[str]:
    """Give the text of a file in parts of whole lines; no part ends inside a quoted cell."""
    row = 1
    with _opened(path) as handle:
        rest, ended = b"", False
        while not ended:
            try:
                more = handle.read(block_bytes)
            except OSError as error:
                raise _unreadable(path, error) from error
            data, ended = rest + more, len(more) < block_bytes
            cut = len(data) if ended else _last_whole_line(data)
            part, rest = data[:cut], data[cut:]
            if row == 1 and ended and not part.strip():
                raise DataError(str(path), "the file is empty", expected="a header and at least one sample")
            if part:
                yield _decoded(path, part, row)
                row += part.count(b"\n")


def _opened(path: Path) -> BinaryIO:
    try:
        return path.open("rb")
    except OSError as error:
        raise _unreadable(path, error) from error


def _unreadable(path: Path, error: OSError) -> DataError:
    return DataError(str(path), f"the file cannot be read: {error.strerror or error}")


def _last_whole_line(data: bytes) -> int:
    """Give the place after the last line end that is not inside quotes, 0 where there is none."""
    cut = data.rfind(b"\n") + 1
    while cut and data.count(b'"', 0, cut) % 2:
        cut = data.rfind(b"\n", 0, cut - 1) + 1
    return cut


def _decoded(path: Path, data: bytes, first: int) -> str:
    ends = np.append(np.flatnonzero(np.frombuffer(data, dtype=np.uint8) == ord("\n")), len(data))
    lengths = np.diff(ends, prepend=-1) - 1
    longest = int(np.argmax(lengths))
    if lengths[longest] > MAX_LINE_BYTES:
        raise DataError(
            str(path),
            f"the line has {lengths[longest]} bytes",
            row=longest + first,
            expected=f"at most {MAX_LINE_BYTES} bytes per line",
        )
    try:
        text = data.decode("utf-8-sig" if first == 1 else "utf-8")
    except UnicodeDecodeError as error:
        row = data.count(b"\n", 0, error.start) + first
        raise DataError(
            str(path),
            f"byte 0x{data[error.start]:02X} is no UTF-8 text",
            row=row,
            expected="text in UTF-8",
            hint="Save the file as CSV UTF-8.",
        ) from error
    return text.replace("\r\n", "\n").replace("\r", "\n") if "\r" in text else text


def _parse_fast(body: str, columns: int, delimiter: str) -> NDArray[np.float64] | None:
    """Parse a faultless table; None if anything is unusual."""
    if '"' in body:
        return None
    try:
        values = np.loadtxt(io.StringIO(body), delimiter=delimiter, comments=None, ndmin=2)
    except ValueError:
        return None
    return values if values.shape[1] == columns and bool(np.isfinite(values).all()) else None


def _parse_strict(
    path: Path, body: str, names: Sequence[str], delimiter: str, strict: Sequence[bool], first: int
) -> NDArray[np.float64]:
    """Parse cell by cell, from row `first` of the file on, and raise DataError at the first that is wrong."""
    rows = []
    reader = csv.reader(io.StringIO(body), delimiter=delimiter, strict=True)
    try:
        for cells in reader:
            row = reader.line_num + first - 1
            if not any(cell.strip() for cell in cells) and len(cells) <= 1:
                continue
            if len(cells) != len(names):
                raise DataError(
                    str(path), f"the line has {len(cells)} fields", row=row, expected=f"{len(names)} as in the header"
                )
            rows.append([_number(path, *cell, row) for cell in zip(cells, names, strict, strict=True)])
    except csv.Error as error:
        raise DataError(str(path), f"the line is no CSV: {error}", row=reader.line_num + first - 1) from error
    return np.array(rows, dtype=np.float64)


def _number(path: Path, cell: str, name: str, strict: bool, row: int) -> float:
    if _NUMBER.fullmatch(cell):
        value = float(cell)
        if np.isfinite(value):
            return value
    if not strict or cell.strip() == MISSING:
        return np.nan
    if not cell.strip():
        what = "the cell is empty"
    elif _NOT_FINITE.fullmatch(cell) or _NUMBER.fullmatch(cell):
        what = f"'{cell.strip()}' is not a finite number"
    else:
        what = f"'{cell.strip()[:40]}' is not a number"
    raise DataError(
        str(path),
        what,
        column=name,
        row=row,
        value=cell[:40],
        expected=f"a number with a decimal point, or {MISSING} where the signal was not measured",
        hint="Mend the cell. A column that is no measurement: remove it, or `rig import` with a mapping that does not "
        "name it.",
    )


def _row_lookup(body: str, first: int) -> Callable[[int], int]:
    """Give the function from the index of a sample to its row in the file; blank lines hold no sample."""
    if "\n\n" not in body and not body.startswith("\n"):
        return lambda index: index + first
    rows = [number for number, line in enumerate(body.split("\n"), start=first) if line.strip()]
    return lambda index: rows[index]

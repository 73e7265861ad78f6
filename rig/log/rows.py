"""Rows of columns that come block by block: all of them, or means over so many in turn that they fit into memory."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.log.run import Floats
from rig.log.timeline import check_order, means

MOST_AVERAGED = 4096
"""Rows of one mean at most; a power of two, as every number of rows of a mean is."""


USUAL_COLUMNS = 32
"""Columns up to which a row counts as one."""


def size(rows: int, columns: int) -> float:
    """Give how many rows these are for the memory: those of more columns than usual count in proportion."""
    return rows * max(1.0, columns / USUAL_COLUMNS)


@dataclass(frozen=True, slots=True)
class _Block:
    """Rows: their times, shape (n,), and columns, shape (n,); a column that none of them has is absent."""

    time: NDArray[Any]
    columns: dict[str, Floats]

    @property
    def rows(self) -> int:
        return len(self.time)

    def part(self, start: int, stop: int) -> "_Block":
        return _Block(self.time[start:stop], {name: column[start:stop] for name, column in self.columns.items()})

    def averaged(self, over: int) -> "_Block":
        """Give the means over so many rows in turn; the last may be over fewer."""
        if over == 1 or not self.rows:
            return self
        starts = np.arange(0, self.rows, over)
        first = self.time[starts]
        shift = means("time", (self.time - np.repeat(first, over)[: self.rows]).astype(float), starts)
        if self.time.dtype.kind == "i":
            shift = np.round(shift)
        time = first + shift.astype(self.time.dtype)
        return _Block(time, {name: means(name, column, starts) for name, column in self.columns.items()})


class Rows:
    """Takes rows in the order of time and keeps them, or means of them, in bounded memory."""

    def __init__(self, file: Path, most_samples: int | None = None) -> None:
        """Keep no more than so many rows (see `size`); None: whatever comes. `file` is named in errors."""
        self._file, self._most = file, most_samples
        self._kept: list[_Block] = []
        self._rest = _Block(np.empty(0), {})
        self.count = 0
        """Rows that came."""
        self.averaged = 1
        """Rows of one mean."""

    def add(self, time: NDArray[Any], columns: Mapping[str, Floats]) -> None:
        """Append rows: `time` (s, or ns as integers) and columns, all of shape (n,), NaN where a value is missing.

        Raises DataError, with the row, where the time decreases and the number of rows is limited: no later check could
        see it inside a mean.
        """
        new = _Block(time, dict(columns))
        self.count += new.rows
        if self._most is None:
            self._kept.append(new)
            return
        rows = _joined([self._rest, new]) if self._rest.rows else new
        offset = self.count - rows.rows + 1
        seconds = rows.time / 1e9 if rows.time.dtype.kind == "i" else rows.time
        check_order(seconds, self._file, lambda index: index + offset)
        whole = rows.rows - rows.rows % MOST_AVERAGED
        self._rest = rows.part(whole, rows.rows)
        self._kept.append(rows.part(0, whole).averaged(self.averaged))
        while self._size() > self._most and self.averaged < MOST_AVERAGED:
            self._kept = [block.averaged(2) for block in self._kept]
            self.averaged *= 2

    def finish(self) -> tuple[NDArray[Any], dict[str, Floats]]:
        """Give the times and each column that any row had, shape (n,), NaN where a value was missing."""
        blocks = [*self._kept, self._rest.averaged(self.averaged)]
        self._kept, self._rest = [], _Block(np.empty(0), {})
        joined = _joined([block for block in blocks if block.rows])
        return joined.time, joined.columns

    def _size(self) -> float:
        names = {name for block in self._kept for name in block.columns}
        return size(sum(block.rows for block in self._kept), len(names))


def _joined(blocks: list[_Block]) -> _Block:
    """Put blocks one after the other, taking the columns out of them, so that no two copies of everything are held."""
    time = np.concatenate([block.time for block in blocks]) if blocks else np.empty(0)
    columns = {}
    for name in dict.fromkeys(name for block in blocks for name in block.columns):
        parts = [block.columns.pop(name) if name in block.columns else np.full(block.rows, np.nan) for block in blocks]
        columns[name] = np.concatenate(parts)
    return _Block(time, columns)

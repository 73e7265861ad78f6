"""Arrays of the signals that a procedure evaluates, collected sample by sample."""

from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from drivers.errors import DataError
from drivers.types import Sample

Floats = NDArray[np.float64]


class Recording:
    """Values of some signals over the cycles of a motion; NaN where a sample lacked one."""

    def __init__(self, *names: str) -> None:
        self._names = names
        self._read = attrgetter(*names)
        self._rows: list[object] = []

    def add(self, sample: Sample) -> None:
        """Append one sample."""
        self._rows.append(self._read(sample))

    def columns(self) -> tuple[Floats, ...]:
        """Give one array of shape (n,) per name, in order."""
        table = np.array(self._rows, dtype=np.float64).reshape(len(self._rows), len(self._names))
        return tuple(table[:, k] for k in range(len(self._names)))

    def __len__(self) -> int:
        return len(self._rows)


def measured(value: float | None, signal: str) -> float:
    """Give `value`; raise DataError if the bench did not measure `signal` in this cycle."""
    if value is None:
        raise DataError(
            "sample",
            f"{signal} is missing",
            column=signal,
            hint="The procedure steers by it: check the device that gives this signal in the bench file.",
        )
    return value

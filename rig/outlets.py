"""stdout and stderr that can be lost: a pipe whose reader has gone, a full disk, a descriptor that was never open.

Nobody needs to read stderr for a run to go on: what cannot be written there is dropped. stdout carries results, after
everything is done and in its files: a reader that stops early ends the command, any other failure is an error.
"""

import io
import os
import sys
from typing import Any, TextIO

from drivers.errors import ConfigError, Mistake


class NobodyReads(BaseException):
    """The reader of stdout has gone. Not an Exception, and no BrokenPipeError, which the libraries between handle."""


class _Outlet(io.FileIO):
    """One of the standard descriptors. After the first failure, which is told once, whatever is written is dropped."""

    def __init__(self, descriptor: int) -> None:
        super().__init__(descriptor, "w", closefd=False)
        self._lost = False

    def write(self, data: Any) -> int:
        if not self._lost:
            try:
                return super().write(data)
            except OSError as error:
                self._lost = True
                self.tell_loss(error)
        return memoryview(data).nbytes

    def tell_loss(self, error: OSError) -> None:
        """Say that nothing more can be written."""


class _Results(_Outlet):
    """stdout."""

    def tell_loss(self, error: OSError) -> None:
        """Raise NobodyReads, or ConfigError if it is not the reader that ended it."""
        if isinstance(error, BrokenPipeError):
            raise NobodyReads from error
        raise ConfigError(
            "stdout",
            [Mistake("output", "stdout", f"cannot be written: {error.strerror or error}")],
            hint="Files that the command wrote are complete; send its output elsewhere or free some space.",
        ) from error


def guard_outlets() -> None:
    """Put stdout and stderr of the process behind guards."""
    # the numbers of descriptors that were closed would be given to the next files that are opened, such as logs
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(descriptor)
    sys.stdout = _guarded(sys.stdout, _Results(1))
    sys.stderr = _guarded(sys.stderr, _Outlet(2))


def _guarded(stream: TextIO | None, outlet: _Outlet) -> TextIO:
    if stream is None:
        return io.TextIOWrapper(io.BufferedWriter(outlet), "utf-8", "backslashreplace")
    if not isinstance(stream, io.TextIOWrapper):
        return stream
    raw = getattr(stream.buffer, "raw", stream.buffer)
    if type(raw) is not io.FileIO:  # a console of Windows, which is no file
        return stream
    return io.TextIOWrapper(
        outlet if stream.write_through else io.BufferedWriter(outlet),
        stream.encoding,
        stream.errors,
        line_buffering=stream.line_buffering,
        write_through=stream.write_through,
    )

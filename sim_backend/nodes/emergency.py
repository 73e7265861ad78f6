"""Emergency producer: EMCY frames, error register 0x1001 and error history 0x1003 (CiA 301)."""

import struct
from collections.abc import Callable

from sim_backend.nodes.object_dictionary import (
    AbortCode,
    AbortError,
    Access,
    DataType,
    ObjectDictionary,
    ObjectSpec,
)

HISTORY = 8
"""Length of the error history."""

_EMCY = struct.Struct("<HB5s")
_GENERIC = 0x01
_REGISTER = {0x2: 0x02, 0x3: 0x04, 0x4: 0x08}
_COMMUNICATION = 0x10
_PROFILE = 0x20


def error_register(code: int) -> int:
    """Give the bits of 0x1001 that an error code sets: generic, and the class of its first digits."""
    if code >> 8 in (0x81, 0x82):
        return _GENERIC | _COMMUNICATION
    return _GENERIC | _REGISTER.get(code >> 12, _PROFILE)


def emergency_specs(node_id: int) -> list[ObjectSpec]:
    """List the entries that the producer serves."""
    slots = [ObjectSpec(0x1003, n, f"Error history {n}", DataType.U32) for n in range(1, HISTORY + 1)]
    return [
        ObjectSpec(0x1001, 0, "Error register", DataType.U8, mappable=True),
        ObjectSpec(0x1003, 0, "Error history: number of errors", DataType.U8, Access.RW),
        *slots,
        ObjectSpec(0x1014, 0, "COB-ID EMCY", DataType.U32, Access.CONST, 0x80 + node_id),
    ]


class Emergency:
    """Remembers which errors are present; sends one frame when an error comes and code 0 when the last has gone."""

    def __init__(self, dictionary: ObjectDictionary, node_id: int, send: Callable[[int, bytes], None]) -> None:
        self.last_code = 0
        self._can_id = 0x80 + node_id
        self._send = send
        self._present: set[int] = set()
        self._latched: set[int] = set()
        self._history: list[int] = []
        dictionary[0x1001, 0].read = self._register
        count = dictionary[0x1003, 0]
        count.read = lambda: len(self._history)
        count.check = self._check_clear
        count.changed = lambda _: self._history.clear()
        for slot in range(HISTORY):
            dictionary[0x1003, slot + 1].read = self._reader(slot)

    def reset(self) -> None:
        """Forget everything, as a restart does."""
        self.last_code = 0
        self._present.clear()
        self._latched.clear()
        self._history.clear()

    def raise_error(self, code: int, *, latched: bool = False) -> None:
        """Report that the error `code` is present; a repeated report is not sent again.

        A latched error stays until `clear_all`.
        """
        if latched:
            self._latched.add(code)
        if code in self._present:
            return
        self._present.add(code)
        self._history.insert(0, code)
        del self._history[HISTORY:]
        self.last_code = code
        self._send(self._can_id, _EMCY.pack(code, self._register(), bytes(5)))

    def clear_error(self, code: int) -> None:
        """Report that the error `code` has gone; a latched one stays."""
        if code in self._present and code not in self._latched:
            self._present.discard(code)
            self._send(self._can_id, _EMCY.pack(0, self._register(), bytes(5)))

    def clear_all(self) -> None:
        """Report that every error has gone, as a fault reset does."""
        self._latched.clear()
        if self._present:
            self._present.clear()
            self._send(self._can_id, _EMCY.pack(0, 0, bytes(5)))

    def _register(self) -> int:
        register = 0
        for code in self._present:
            register |= error_register(code)
        return register

    def _check_clear(self, value: int) -> None:
        if value != 0:
            raise AbortError(AbortCode.VALUE)

    def _reader(self, slot: int) -> Callable[[], int]:
        def read() -> int:
            if slot >= len(self._history):
                raise AbortError(AbortCode.NO_DATA)
            return self._history[slot]

        return read

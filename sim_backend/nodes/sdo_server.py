"""SDO server of a simulated device: expedited and segmented transfers of CiA 301.

Block transfer is answered with abort 0x05040001, as devices without it do. A new initiate request ends an
unfinished transfer, so a master that gave up can start again.
"""

import struct
from collections.abc import Callable

from sim_backend.nodes.object_dictionary import AbortCode, AbortError, NoAnswerError, ObjectDictionary, check_length

MAX_STRING = 256
"""Longest string that a segmented download may build up, bytes."""

_SEGMENT = 7
_HEADER = struct.Struct("<BHB4s")
_ABORT = struct.Struct("<BHBI")


class SdoServer:
    """One server channel. Give it each 8-byte request; it gives the 8-byte response, or None for silence."""

    def __init__(self, dictionary: ObjectDictionary) -> None:
        self._dictionary = dictionary
        self._handlers: dict[int, Callable[[bytes], bytes | None]] = {
            0: self._download_segment,
            1: self._download,
            2: self._upload,
            3: self._upload_segment,
            4: self._abort_from_client,
        }
        self._index = 0
        self._sub = 0
        self._toggle = 0
        self._outgoing: bytes | None = None
        self._incoming: bytearray | None = None
        self._announced: int | None = None

    def reset(self) -> None:
        """Forget an unfinished transfer."""
        self._index = self._sub = self._toggle = 0
        self._outgoing = self._incoming = self._announced = None

    def answer(self, request: bytes) -> bytes | None:
        """Serve one request. Frames that are not 8 bytes long are ignored."""
        if len(request) != 8:
            return None
        handler = self._handlers.get(request[0] >> 5)
        try:
            if handler is None:
                self._begin(request)
                raise AbortError(AbortCode.COMMAND)
            return handler(request)
        except AbortError as error:
            response = _ABORT.pack(0x80, self._index, self._sub, error.code)
            self.reset()
            return response
        except NoAnswerError:
            self.reset()
            return None

    def _begin(self, request: bytes) -> tuple[int, bytes]:
        self.reset()
        command, self._index, self._sub, data = _HEADER.unpack(request)
        return command, data

    def _initiated(self, command: int, data: bytes) -> bytes:
        response = _HEADER.pack(command, self._index, self._sub, data)
        if self._outgoing is None and self._incoming is None:
            self.reset()
        return response

    def _upload(self, request: bytes) -> bytes:
        self._begin(request)
        value = self._dictionary.upload(self._index, self._sub)
        if 1 <= len(value) <= 4:
            return self._initiated(0x43 | (4 - len(value)) << 2, value)
        self._outgoing = value
        return self._initiated(0x41, struct.pack("<I", len(value)))

    def _upload_segment(self, request: bytes) -> bytes:
        if self._outgoing is None:
            raise AbortError(AbortCode.COMMAND)
        self._check_toggle(request)
        part, self._outgoing = self._outgoing[:_SEGMENT], self._outgoing[_SEGMENT:]
        last = not self._outgoing
        response = bytes([self._toggle << 4 | (_SEGMENT - len(part)) << 1 | last]) + part.ljust(_SEGMENT, b"\0")
        self._toggle ^= 1
        if last:
            self.reset()
        return response

    def _download(self, request: bytes) -> bytes:
        command, data = self._begin(request)
        variable = self._dictionary.writable(self._index, self._sub)
        expedited, sized = command & 0x02, command & 0x01
        if not expedited:
            if sized:
                self._announced = int.from_bytes(data, "little")
                check_length(variable.spec.type, self._announced)
                if self._announced > MAX_STRING:
                    raise AbortError(AbortCode.TOO_LONG)
            self._incoming = bytearray()
        else:
            # 0x22 gives no size: the object's own length counts, as a public CiA 404 manual requires for autozero
            size = 4 - (command >> 2 & 3) if sized else min(variable.spec.type.size or 4, 4)
            self._dictionary.download(self._index, self._sub, data[:size])
        return self._initiated(0x60, bytes(4))

    def _download_segment(self, request: bytes) -> bytes:
        if self._incoming is None:
            raise AbortError(AbortCode.COMMAND)
        self._check_toggle(request)
        size = _SEGMENT - (request[0] >> 1 & 7)
        self._incoming += request[1 : 1 + size]
        limit = MAX_STRING if self._announced is None else self._announced
        if len(self._incoming) > limit:
            raise AbortError(AbortCode.TOO_LONG if self._announced is None else AbortCode.LENGTH)
        response = bytes([0x20 | self._toggle << 4]) + bytes(7)
        self._toggle ^= 1
        if request[0] & 1:
            if self._announced is not None and len(self._incoming) != self._announced:
                raise AbortError(AbortCode.LENGTH)
            self._dictionary.download(self._index, self._sub, bytes(self._incoming))
            self.reset()
        return response

    def _abort_from_client(self, request: bytes) -> None:
        self.reset()

    def _check_toggle(self, request: bytes) -> None:
        if request[0] >> 4 & 1 != self._toggle:
            raise AbortError(AbortCode.TOGGLE)

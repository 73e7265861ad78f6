"""A master's hand on one device: frames as hexadecimal text, objects as numbers."""

import struct
from collections.abc import Sequence

from sim_backend.nodes.communication import CanopenNode
from sim_backend.nodes.frame import Frame

TICK = 1e-3


def text(frames: Sequence[Frame]) -> list[str]:
    """Frames as `id data`, e.g. `581 60 17 10 00 00 00 00 00`."""
    return [f"{frame.can_id:03X} {frame.data.hex(' ').upper()}".strip() for frame in frames]


class AbortedError(Exception):
    """The device answered a transfer with an abort."""

    def __init__(self, code: int) -> None:
        super().__init__(f"{code:08X}")
        self.code = code


class Wire:
    """Powers the device up and keeps its time in ticks of 1 ms."""

    def __init__(self, node: CanopenNode) -> None:
        self.node = node
        self.ticks = 0
        self.boot = text(node.tick(0.0))

    @property
    def time(self) -> float:
        return self.ticks * TICK

    def send(self, frame: str) -> list[str]:
        """Send `id data`; give the answers."""
        can_id, _, data = frame.partition(" ")
        return text(self.node.on_frame(self.time, int(can_id, 16), bytes.fromhex(data)))

    def tick(self, count: int = 1) -> list[str]:
        """Let `count` ms pass; give the frames sent meanwhile."""
        sent: list[str] = []
        for _ in range(count):
            self.ticks += 1
            sent += text(self.node.tick(self.time))
        return sent

    def sync(self) -> list[str]:
        return self.send("080")

    def operational(self) -> list[str]:
        return self.send(f"000 01 {self.node.node_id:02X}")

    def write(self, index: int, sub: int, value: int, size: int) -> list[str]:
        """Write by expedited SDO; give the frames sent beside the acknowledgement. Raises AbortedError."""
        head = struct.pack("<BHB", 0x23 | (4 - size) << 2, index, sub)
        data = (value & (1 << 8 * size) - 1).to_bytes(4, "little")
        answers = self.send(f"{0x600 + self.node.node_id:03X} {(head + data).hex()}")
        acknowledgement, others = self._split(answers)
        if acknowledgement[0] == 0x80:
            raise AbortedError(int.from_bytes(acknowledgement[4:], "little"))
        assert acknowledgement == struct.pack("<BHB4x", 0x60, index, sub)
        return others

    def read(self, index: int, sub: int = 0, *, signed: bool = False) -> int:
        """Read by expedited SDO. Raises AbortedError."""
        request = struct.pack("<BHB4x", 0x40, index, sub)
        answer, _ = self._split(self.send(f"{0x600 + self.node.node_id:03X} {request.hex()}"))
        if answer[0] == 0x80:
            raise AbortedError(int.from_bytes(answer[4:], "little"))
        assert answer[1:4] == request[1:4]
        return int.from_bytes(answer[4 : 8 - (answer[0] >> 2 & 3)], "little", signed=signed)

    def remap(self, parameters: int, can_id: int, transmission: int, *entries: int) -> None:
        """The mapping procedure of CiA 301: disable, clear, write, count, type, enable."""
        self.write(parameters, 1, can_id | 0x80000000, 4)
        self.write(parameters + 0x200, 0, 0, 1)
        for number, entry in enumerate(entries, 1):
            self.write(parameters + 0x200, number, entry, 4)
        self.write(parameters + 0x200, 0, len(entries), 1)
        self.write(parameters, 2, transmission, 1)
        self.write(parameters, 1, can_id, 4)

    def _split(self, answers: list[str]) -> tuple[bytes, list[str]]:
        prefix = f"{0x580 + self.node.node_id:03X} "
        mine = [answer for answer in answers if answer.startswith(prefix)]
        assert len(mine) == 1, answers
        return bytes.fromhex(mine[0][4:]), [answer for answer in answers if answer not in mine]

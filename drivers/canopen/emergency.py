"""Emergency messages (CiA 301): frame to event, and texts of the codes.

Codes as named in vendor manuals of CiA 301, 402 and 406 devices; an unknown code keeps its number and its class.
"""

from dataclasses import dataclass

_TEXTS = {
    0x2310: "continuous over-current",
    0x2350: "I2t limit",
    0x3210: "over-voltage",
    0x3220: "under-voltage",
    0x4210: "device too hot",
    0x4310: "drive too hot",
    0x7300: "sensor",
    0x7305: "incremental encoder",
    0x8110: "CAN overrun",
    0x8120: "CAN error passive",
    0x8130: "heartbeat of the bench lost",
    0x8140: "recovered from bus-off",
    0x8210: "PDO too short",
    0x8220: "PDO too long",
    0x8240: "SYNC of unexpected length",
    0x8250: "RPDO time-out",
    0x8611: "following error",
    0xFF00: "device specific",
}

_CLASSES = {
    0x10: "generic error",
    0x20: "current",
    0x30: "voltage",
    0x40: "temperature",
    0x50: "hardware",
    0x60: "software",
    0x70: "additional modules",
    0x80: "monitoring",
    0x90: "external error",
    0xF0: "additional functions",
    0xFF: "device specific",
}


@dataclass(frozen=True, slots=True)
class Emergency:
    """One emergency message: error `code`, error `register` (0x1001), the five vendor bytes in `data`."""

    code: int
    register: int
    data: bytes

    @property
    def text(self) -> str:
        """Say what happened."""
        if not self.code >> 8:
            return "error reset or no error"
        return f"emergency 0x{self.code:04X} ({code_text(self.code)})"


def parse_emergency(frame: bytes) -> Emergency | None:
    """Read an emergency frame, None if it has not even an error code.

    A frame shorter than 8 bytes is read as far as it goes: a device in trouble must not be overheard.
    """
    if len(frame) < 2:
        return None
    register = frame[2] if len(frame) > 2 else 0
    return Emergency(int.from_bytes(frame[0:2], "little"), register, bytes(frame[3:8]))


def code_text(code: int) -> str:
    """Name an error code (U16, also object 0x603F); its class where the code itself is not known."""
    text = _TEXTS.get(code)
    if text is not None:
        return text
    high = code >> 8
    return _CLASSES.get(high) or _CLASSES.get(high & 0xF0) or "unknown class"

"""How a device turns numbers into integers of its own width."""

_I16_MIN, _I16_MAX = -(2**15), 2**15 - 1


def round_half_away(value: float) -> int:
    """Round to the nearest integer, a half away from zero."""
    return int(value + 0.5) if value >= 0 else int(value - 0.5)


def wrap_i32(value: int) -> int:
    """Wrap around as a signed 32-bit counter does."""
    return (value + 0x80000000 & 0xFFFFFFFF) - 0x80000000


def clamp_i16(value: int) -> int:
    """Saturate at the ends of a signed 16-bit integer."""
    return min(max(value, _I16_MIN), _I16_MAX)


def clamp_i32(value: int) -> int:
    """Saturate at the ends of a signed 32-bit integer."""
    return min(max(value, -0x80000000), 0x7FFFFFFF)

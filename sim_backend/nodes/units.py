"""How a device turns numbers into integers of its own width."""

_I16_MIN, _I16_MAX = -(2**15), 2**15 - 1
_I32_MIN, _I32_MAX = -(2**31), 2**31 - 1


def wrap_i32(value: int) -> int:
    """Wrap around as a signed 32-bit counter does."""
    return (value + 0x80000000 & 0xFFFFFFFF) - 0x80000000


def round_half_away(value: float) -> int:
    """Round to the nearest integer, a half away from zero."""
    return int(value + 0.5) if value >= 0 else int(value - 0.5)


def to_i16(value: float) -> int:
    """Round a half away from zero and saturate as a signed 16-bit integer."""
    rounded = int(value + 0.5) if value >= 0 else int(value - 0.5)
    return rounded if _I16_MIN <= rounded <= _I16_MAX else _I16_MAX if rounded > 0 else _I16_MIN


def to_i32(value: float) -> int:
    """Round a half away from zero and saturate as a signed 32-bit integer."""
    rounded = int(value + 0.5) if value >= 0 else int(value - 0.5)
    return rounded if _I32_MIN <= rounded <= _I32_MAX else _I32_MAX if rounded > 0 else _I32_MIN

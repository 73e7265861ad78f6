"""Units that files may use for the bench's signals, and their way to SI (temperature: degC)."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from rig.log.run import Floats


@dataclass(frozen=True, slots=True)
class Unit:
    """value in `si` = value * `factor` / `divisor` + `offset`; a divisor keeps 1 ms = 1/1000 s exact."""

    si: str
    factor: float = 1.0
    divisor: float = 1.0
    offset: float = 0.0


UNITS: Mapping[str, Unit] = MappingProxyType(
    {
        "s": Unit("s"),
        "ms": Unit("s", divisor=1e3),
        "us": Unit("s", divisor=1e6),
        "ns": Unit("s", divisor=1e9),
        "min": Unit("s", 60.0),
        "rad": Unit("rad"),
        "mrad": Unit("rad", divisor=1e3),
        "urad": Unit("rad", divisor=1e6),
        "deg": Unit("rad", math.pi, 180.0),
        "arcmin": Unit("rad", math.pi, 180.0 * 60),
        "arcsec": Unit("rad", math.pi, 180.0 * 3600),
        "rev": Unit("rad", 2 * math.pi),
        "rad/s": Unit("rad/s"),
        "deg/s": Unit("rad/s", math.pi, 180.0),
        "rev/s": Unit("rad/s", 2 * math.pi),
        "rpm": Unit("rad/s", math.pi, 30.0),
        "N*m": Unit("N*m"),
        "mN*m": Unit("N*m", divisor=1e3),
        "uN*m": Unit("N*m", divisor=1e6),
        "kN*m": Unit("N*m", 1e3),
        "N*cm": Unit("N*m", divisor=1e2),
        "A": Unit("A"),
        "mA": Unit("A", divisor=1e3),
        "uA": Unit("A", divisor=1e6),
        "V": Unit("V"),
        "mV": Unit("V", divisor=1e3),
        "kV": Unit("V", 1e3),
        "degC": Unit("degC"),
        "K": Unit("degC", offset=-273.15),
        "degF": Unit("degC", 5.0, 9.0, -160.0 / 9.0),
        "1": Unit("1"),
        "%": Unit("1", divisor=1e2),
    }
)

ALIASES: Mapping[str, str] = MappingProxyType(
    {
        "": "1",
        "-": "1",
        "Nm": "N*m",
        "N.m": "N*m",
        "N·m": "N*m",
        "N m": "N*m",
        "mNm": "mN*m",
        "uNm": "uN*m",
        "kNm": "kN*m",
        "Ncm": "N*cm",
        "sec": "s",
        "°": "deg",
        "°/s": "deg/s",
        "°C": "degC",
        "°F": "degF",
        "r/min": "rpm",
        "1/min": "rpm",
        "rps": "rev/s",
    }
)
"""Other spellings that cannot mean anything else."""


def find_unit(text: str) -> Unit | None:
    """Give the unit spelled `text`, None if it is not known."""
    plain = text.strip().replace("µ", "u").replace("μ", "u")
    return UNITS.get(ALIASES.get(plain, plain))


def spellings(si: str) -> tuple[str, ...]:
    """Give the units that convert to `si`, for an error message."""
    return tuple(name for name, unit in UNITS.items() if unit.si == si)


def to_si(values: Floats, unit: Unit) -> Floats:
    """Convert `values`, shape (n,), to the unit's SI unit; values that are SI already come back to the bit.

    What no longer is a finite number then comes back as infinity.
    """
    if unit == Unit(unit.si):
        return values
    with np.errstate(over="ignore"):
        return values * unit.factor / unit.divisor + unit.offset


MIXED_UP = 1.5
"""Factor within which numbers are those of another unit."""


def mixed_up(si: str, factor: float) -> str | None:
    """Give the unit in which numbers are about `factor` times those in `si`, None where none is."""
    scales = {name: unit.divisor / unit.factor for name, unit in UNITS.items() if unit.si == si and name != si}
    near = {name: abs(math.log(factor / scale)) for name, scale in scales.items()} if factor > 0.0 else {}
    best = min(near, key=lambda name: near[name], default=None)
    return best if best is not None and near[best] < math.log(MIXED_UP) else None

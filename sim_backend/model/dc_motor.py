"""Brushed DC motor on a supply of constant voltage.

    L di/dt = V - R i - k_e omega_m,   tau_m = k_t i,   k_t = k_e in SI

Speeds per voltage: Castejon, Garcia-Prada & Lara 2009, table 2. Resistance and inductance are not printed.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from sim_backend.errors import ModelError, shown
from sim_backend.model.checks import is_series
from sim_backend.model.limits import Limit, require_limit, require_within

RPM = 2.0 * math.pi / 60.0
"""rad/s."""

TABLE_2 = ((6.5, 310.0 * RPM), (12.0, 560.0 * RPM), (18.0, 840.0 * RPM), (24.0, 1120.0 * RPM))
"""Supply voltage (V) and motor speed (rad/s) as printed."""

CHOSEN_RESISTANCE = 1.0
"""ohm; not printed. A motor for 24 V and 1120 rpm, with 24 A at standstill."""

CHOSEN_INDUCTANCE = 1e-3
"""H; not printed. The current then follows within 1 ms, ten times faster than the speed."""

_WINDING = "L di/dt = V - R i - k_e omega_m"
_STEADY = "V = (k_e + R drag/k_e) omega_m at constant speed"
_TABLE = "k^2 - slope k + R drag = 0, slope = sum(V omega_m)/sum(omega_m^2) of the rows,"

LIMITS: Mapping[str, Limit] = {
    "resistance": Limit("ohm", 1e-9, 1e9, _WINDING),
    "inductance": Limit("H", 1e-12, 1e6, _WINDING),
    "constant": Limit("V*s/rad", 1e-10, 1e9, _WINDING),
    "voltage": Limit("V", -1e6, 1e6, _STEADY),
    "speed": Limit("rad/s", -1e6, 1e6, _STEADY),
    "drag": Limit("N*m*s/rad", 0.0, 1e6, _STEADY),
}
"""A motor, and what it is asked for: either direction, and a drag that brakes."""

ROW: Mapping[str, Limit] = {"voltage": Limit("V", 1e-3, 1e6, _TABLE), "speed": Limit("rad/s", 1e-3, 1e6, _TABLE)}
"""A row of a table: the direction in which both are positive. Its slope is a constant within its limits."""


@dataclass(frozen=True, slots=True)
class DcMotor:
    """Resistance ohm, inductance H, constant V*s/rad = N*m/A."""

    resistance: float
    inductance: float
    constant: float

    def __post_init__(self) -> None:
        require_within(LIMITS, {name: getattr(self, name) for name in ("resistance", "inductance", "constant")})


def steady_speed(motor: DcMotor, voltage: float, drag: float) -> float:
    """Give the speed at `voltage` (V) against a viscous `drag` (N*m*s/rad at the motor), rad/s.

    Raises ModelError if either is outside `LIMITS`.
    """
    require_within(LIMITS, {"voltage": voltage, "drag": drag})
    return voltage / (motor.constant + motor.resistance * drag / motor.constant)


def voltage_for(motor: DcMotor, speed: float, drag: float) -> float:
    """Give the voltage at which the motor turns with `speed` (rad/s) against `drag` (N*m*s/rad), V.

    Raises ModelError if either is outside `LIMITS`.
    """
    require_within(LIMITS, {"speed": speed, "drag": drag})
    return speed * (motor.constant + motor.resistance * drag / motor.constant)


def motor_from_speeds(
    rows: Sequence[tuple[float, float]],
    drag: float,
    resistance: float = CHOSEN_RESISTANCE,
    inductance: float = CHOSEN_INDUCTANCE,
) -> DcMotor:
    """Give the motor whose steady speeds are those of `rows` (V, rad/s) by least squares, against `drag`.

    Voltages and speeds are positive. The slope V/omega is k_e + R drag/k_e, so that k_e is a little less than the
    slope: the root of k^2 - slope k + R drag = 0 next to it. Raises ModelError without rows, for a row or another
    number outside its limits, or if the drag is too large for the slope.
    """
    _require_rows(rows)
    require_within(LIMITS, {"drag": drag, "resistance": resistance, "inductance": inductance})
    slope = sum(voltage * speed for voltage, speed in rows) / sum(speed * speed for _, speed in rows)
    rest = slope * slope - 4.0 * resistance * drag
    if rest < 0.0:
        raise ModelError(
            f"drag = {drag!r} N*m*s/rad with resistance = {resistance!r} ohm: at most "
            f"{slope**2 / 4.0 / resistance:.3g} N*m*s/rad leave a motor that turns 1 rad/s per {slope:.4g} V; "
            f"k^2 - slope k + R drag = 0 needs it."
        )
    return DcMotor(resistance, inductance, 0.5 * (float(slope) + math.sqrt(rest)))


def _require_rows(rows: Sequence[tuple[float, float]]) -> None:
    """Raise ModelError unless these are rows of a table, at least one, each within `ROW`."""
    parts = (f"a {name} ({limit.low:g} to {limit.high:g} {limit.unit})" for name, limit in ROW.items())
    pair = f"pair of {' and '.join(parts)}; {_TABLE} needs it."
    if not is_series(rows):
        raise ModelError(f"rows = {shown(rows)} is not possible: it must be a sequence with at least one {pair}")
    if len(rows) == 0:
        raise ModelError(f"rows is empty: it must have at least one {pair}")
    for place, row in enumerate(rows):
        if not is_series(row) or len(row) != len(ROW):
            raise ModelError(f"rows[{place}] = {shown(row)} is not possible: it must be a {pair}")
        for (name, limit), value in zip(ROW.items(), row, strict=True):
            require_limit(f"rows[{place}] {name}", value, limit)

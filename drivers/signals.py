"""Every signal of the bench: name, unit, suffix of its log field, meaning.

Inside the program all values are SI (temperature in degC) and carry no suffix; a suffix marks the log field.
Signs are those of an `opposed` harmonic drive in which positive output torque gives positive torsion.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True, slots=True)
class Signal:
    """One signal: `name` in the program, `unit` as written in files, `suffix` of its log field, `meaning`."""

    name: str
    unit: str
    suffix: str
    meaning: str

    @property
    def field(self) -> str:
        """Name of the log field, with the unit as suffix."""
        return self.name + self.suffix


TIME = Signal("time", "s", "", "since the run's first sample")

SIGNALS: tuple[Signal, ...] = (
    Signal("motor_position", "rad", "_rad", "wave-generator angle, unwrapped"),
    Signal("motor_velocity", "rad/s", "_rad_s", "wave-generator speed"),
    Signal("motor_position_command", "rad", "_rad", "commanded wave-generator angle"),
    Signal("motor_velocity_command", "rad/s", "_rad_s", "commanded wave-generator speed"),
    Signal("motor_torque", "N*m", "_nm", "torque driving the motor shaft, from measured current"),
    Signal("motor_torque_command", "N*m", "_nm", "commanded motor torque"),
    Signal("motor_current", "A", "_a", "torque-producing motor current"),
    Signal("output_position", "rad", "_rad", "flexspline (link) angle, unwrapped"),
    Signal("output_velocity", "rad/s", "_rad_s", "flexspline (link) speed"),
    Signal("output_torque", "N*m", "_nm", "torque acting on the output flange from outside"),
    Signal("load_torque", "N*m", "_nm", "torque of the load drive on the output"),
    Signal("load_torque_command", "N*m", "_nm", "commanded torque of the load drive"),
    Signal("load_position", "rad", "_rad", "angle of the load drive"),
    Signal("temperature", "degC", "_degc", "gear housing temperature"),
    Signal("motor_temperature", "degC", "_degc", "motor temperature"),
    Signal("bus_voltage", "V", "_v", "drive's DC-link voltage"),
    Signal("supply_voltage", "V", "_v", "supply voltage"),
    Signal("status_word", "1", "", "status word of the motor drive"),
    Signal("load_status_word", "1", "", "status word of the load drive"),
    Signal("cycle", "1", "", "control cycle index"),
    Signal("late", "1", "", "1 if the cycle was late, else 0"),
)

BY_NAME: Mapping[str, Signal] = MappingProxyType({s.name: s for s in SIGNALS})
BY_FIELD: Mapping[str, Signal] = MappingProxyType({s.field: s for s in SIGNALS})

INTEGER_SIGNALS: frozenset[str] = frozenset({"status_word", "load_status_word", "cycle", "late"})
"""Signals that are counts or bit fields; everything else is a real number."""

AUXILIARY_PREFIX = "aux_"
"""Log-field prefix of a signal that is not in the table."""

"""The seam between the simulated devices and the plant: what a node may command and what it may read.

All SI at the shaft concerned. Devices turn these numbers into counts and per mille, as real ones do.
"""

from enum import IntEnum
from typing import NamedTuple, Protocol


class AxisMode(IntEnum):
    """What a drive's inner loop regulates."""

    OFF = 0
    TORQUE = 1
    VELOCITY = 2
    POSITION = 3


class PlantReading(NamedTuple):
    """The instruments at one instant, before the devices quantise them: true value + the instrument's own errors.

    Angles rad (unwrapped), speeds rad/s, torques N*m, temperatures degC. `motor_torque` and `load_torque` come
    from the measured current; `output_torque` acts on the flange from outside.
    """

    motor_position: float
    motor_velocity: float
    motor_torque: float
    load_position: float
    load_velocity: float
    load_torque: float
    output_position: float
    output_torque: float
    temperature: float
    motor_temperature: float


class PlantPort(Protocol):
    """The plant as the devices and the simulated world see it. Axis "motor" or "load"."""

    @property
    def time(self) -> float:
        """Simulated time, s."""

    def advance_to(self, time: float) -> None:
        """Integrate up to `time` (s), the drives' inner loops included."""

    def command(self, axis: str, mode: AxisMode, target: float) -> None:
        """Set what the inner loop of `axis` regulates: N*m, rad/s or rad; OFF leaves the shaft without torque."""

    def set_torque_limit(self, axis: str, limit: float) -> None:
        """Bound the torque (N*m, magnitude) which the drive of `axis` can produce."""

    def torque_limited(self, axis: str) -> bool:
        """Tell whether that bound acted since the last call."""

    def read(self) -> PlantReading:
        """Read the instruments now; repeated reads at one instant give the same values."""

    def set_lock(self, locked: bool) -> None:
        """Clamp the output to the fixture where it stands, or let it go."""

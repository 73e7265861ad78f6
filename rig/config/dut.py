"""The device under test, `dut.toml`: what is known of gear, motor and output. Everything but the name is optional.

Values are priors and starting values, never hard limits; only what is physically impossible is an error.
"""

from collections.abc import Iterator
from enum import StrEnum
from pathlib import Path
from typing import Annotated

from pydantic import Field

from rig.config.toml_file import Conflict, FileModel, Number, Quantity, Table, parse_toml, read_text
from sim_backend.errors import ParameterError
from sim_backend.model.estimation import LOSS, PIECEWISE_EQUATION, check_torques

Positive = Annotated[Number, Field(gt=0, le=1e9)]
Ratio = Annotated[Number, Field(ge=1, le=1e6)]
Counts = Annotated[int, Field(ge=1, le=2**31)]

COUNTING = "angle = 2 pi counts / encoder_counts"


class Rotation(StrEnum):
    """Whether the output turns against the wave generator or with it."""

    OPPOSED = "opposed"
    SAME = "same"


class Gear(FileModel):
    """Harmonic drive: catalogue stiffnesses N*m/rad up to torques N*m, losses, and friction at both sides."""

    ratio: Annotated[Ratio | None, Quantity("", "theta_m = -N theta_o, Zhang (4),")] = None
    rotation: Annotated[Rotation, Field(strict=False)] = Rotation.OPPOSED
    rated_torque: Annotated[Positive | None, Quantity("N*m", "the torque up to which procedures load")] = None
    K1: Annotated[Positive | None, Quantity("N*m/rad", PIECEWISE_EQUATION)] = None
    K2: Annotated[Positive | None, Quantity("N*m/rad", PIECEWISE_EQUATION)] = None
    K3: Annotated[Positive | None, Quantity("N*m/rad", PIECEWISE_EQUATION)] = None
    T1: Annotated[Positive | None, Quantity("N*m", PIECEWISE_EQUATION)] = None
    T2: Annotated[Positive | None, Quantity("N*m", PIECEWISE_EQUATION)] = None
    hysteresis_loss: Annotated[Positive | None, Quantity("rad", LOSS)] = None
    starting_torque: Annotated[Positive | None, Quantity("N*m", LOSS)] = None
    backdriving_torque: Annotated[Positive | None, Quantity("N*m", "T_w = -(T_F -+ T_fb)/N, Zhang (36),")] = None

    @classmethod
    def conflicts(cls, table: Table) -> Iterator[Conflict]:
        """Check that the torques at which the stiffness changes are in order."""
        low, high = table.get("T1"), table.get("T2")
        if low is None or high is None:
            return
        try:
            check_torques(low, high)
        except ParameterError as error:
            yield Conflict((error.name,), error.value, error.rule)


class Motor(FileModel):
    """Motor: encoder counts per revolution (after evaluation of all edges), N*m/A, kg*m^2."""

    encoder_counts: Annotated[Counts | None, Quantity("1/rev", COUNTING)] = None
    torque_constant: Annotated[Positive | None, Quantity("N*m/A", "motor_torque = k_t i")] = None
    pole_pairs: Annotated[Counts | None, Quantity("", "the order 6 p of a torque ripple")] = None
    inertia: Annotated[Positive | None, Quantity("kg*m^2", "(J_m + J_wg) dw/dt = sum of torques, Castejon (15),")] = (
        None
    )


class Output(FileModel):
    """Output side: encoder counts per revolution, inertia kg*m^2."""

    encoder_counts: Annotated[Counts | None, Quantity("1/rev", COUNTING)] = None
    inertia: Annotated[Positive | None, Quantity("kg*m^2", "J_l dw/dt = sum of torques, Castejon (16),")] = None


class Dut(FileModel):
    """The device under test."""

    name: Annotated[str, Field(min_length=1, max_length=200)]
    gear: Gear = Gear()
    motor: Motor = Motor()
    output: Output = Output()


SHD_17_100 = """\
name = "SHD-17-100"
[gear]
ratio = 100
rotation = "opposed"
rated_torque = 16.0        # N*m
K1 = 8.4e3                 # N*m/rad
K2 = 9.4e3                 # N*m/rad
T1 = 3.9                   # N*m
T2 = 12.0                  # N*m
hysteresis_loss = 1.8e-4   # rad
starting_torque = 0.012    # N*m at the motor
backdriving_torque = 2.0   # N*m at the output
[motor]
encoder_counts = 16384     # per revolution
torque_constant = 0.321    # N*m/A
pole_pairs = 7
inertia = 2.2e-5           # kg*m^2
[output]
encoder_counts = 524288    # per revolution
inertia = 5e-4             # kg*m^2
"""
"""The device on the shipped simulated bench, as a dut file: the drive of Zhang, Ahmad & Liu 2014."""


def load_dut(path: Path) -> tuple[Dut, str]:
    """Read a dut file; give the model and the text as written. Raises ConfigError with every mistake."""
    text = read_text(path)
    return parse_toml(text, Dut, str(path)), text


def default_dut() -> tuple[Dut, str]:
    """Give the device on the shipped simulated bench and its text."""
    return parse_toml(SHD_17_100, Dut, "shipped dut 'SHD-17-100'"), SHD_17_100

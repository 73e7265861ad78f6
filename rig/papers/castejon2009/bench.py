"""The paper's bench in simulation: table 1 and 2, a pure error, and runs at the four speeds that items share."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.papers.item import Workbench
from sim_backend.model.dc_motor import RPM, TABLE_2, DcMotor, motor_from_speeds, voltage_for
from sim_backend.model.driven import STEP, DrivenRun, run_driven
from sim_backend.model.error_parts import ErrorParts, error_parts
from sim_backend.model.fourier_error import FourierError
from sim_backend.model.parameters import Rotation
from sim_backend.model.transmission import Transmission, hdc_40

Floats = NDArray[np.float64]

CHOSEN_ERROR = FourierError(
    a0=6.0e-5,
    a=(2.5e-5, -1.2e-4, 4.0e-6, 1.5e-5, -2.0e-6, 3.0e-6, 1.0e-6),
    b=(-3.0e-5, 1.6e-4, 5.0e-6, -2.0e-5, 2.0e-6, 4.0e-6, -2.0e-6),
)
"""rad. The paper prints no coefficient. Chosen here: order 2 with 0.2 mrad, the others as small as they are on size-17
to size-40 drives; all together stay within the 0.08 degrees that the paper quotes."""

ORDER_2 = FourierError(0.0, (0.0, 0.0), (0.0, 2.0e-4))
"""rad. Only the dominant order, for figures that are compared with closed forms."""

SPEEDS = tuple(speed for _, speed in TABLE_2)
"""rad/s."""

PRINTED_ACCURACY = np.deg2rad(0.08)
"""rad, "0.08 grados" of section 3."""

SECONDS, PERIOD = 4.0, 1e-3
"""s of a run, whose transform shows 10.25 Hz, and between its samples."""

DRAWN = 500
"""Samples in a motor turn that is drawn; those of a run are 54 in a turn at 1120 rpm."""


@dataclass(frozen=True, slots=True)
class AtSpeed:
    """A run at a steady `speed` (rad/s) and `voltage` (V): what was recorded, and the kinematic error taken apart."""

    speed: float
    voltage: float
    run: DrivenRun
    parts: ErrorParts


def paper_transmission() -> Transmission:
    """Give table 1 in the sense of (12) as printed, theta_m' + theta_l': a drive with its circular spline fixed."""
    return hdc_40(Rotation.OPPOSED)


def paper_motor() -> DcMotor:
    """Give the motor that meets the last three rows of table 2."""
    return motor_from_speeds(TABLE_2[1:], paper_transmission().drag)


def steady_run(series: FourierError, speed: float, *, seconds: float = SECONDS, period: float = PERIOD) -> AtSpeed:
    """Turn the transmission at `speed` (rad/s) for `seconds`, with the voltage this needs; a sample every `period`.

    Raises ModelError if `period` (s) is no multiple of the integrator's STEP, or a number is outside its limits.
    """
    transmission, motor = paper_transmission(), paper_motor()
    voltage = voltage_for(motor, speed, transmission.drag)
    run = run_driven(transmission, series, motor, voltage, seconds, period=period)
    return AtSpeed(speed, voltage, run, error_parts(run.motor_position, run.load_position, transmission.ratio, series))


def four_speeds(_: Workbench) -> tuple[AtSpeed, ...]:
    """Run all four speeds with the chosen error."""
    return tuple(steady_run(CHOSEN_ERROR, speed) for speed in SPEEDS)


def four_speeds_to_draw(_: Workbench) -> tuple[AtSpeed, ...]:
    """Run all four speeds with the chosen error for two motor turns, some DRAWN samples in each; for drawing only."""
    turns = [2.0 * np.pi / speed for speed in SPEEDS]
    return tuple(
        steady_run(CHOSEN_ERROR, speed, seconds=2.0 * turn, period=STEP * round(turn / DRAWN / STEP))
        for speed, turn in zip(SPEEDS, turns, strict=True)
    )


def four_speeds_order_2(_: Workbench) -> tuple[AtSpeed, ...]:
    """Run all four speeds with order 2 alone."""
    return tuple(steady_run(ORDER_2, speed) for speed in SPEEDS)


def rpm(speed: float) -> str:
    """Name a speed (rad/s)."""
    return f"{speed / RPM:.0f} rpm"

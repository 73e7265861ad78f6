"""Beyond both papers: one plant with the compliance and hysteresis of the one and the error and dynamics of the other.

The same configuration turns freely at the four speeds of the second paper, where its flexible part grows with speed,
and is swept against a locked output as in the first, where its torsion makes a loop.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rig.papers.castejon2009.bench import SPEEDS, rpm
from rig.papers.figures import label, new_figure
from rig.papers.item import Item, Outcome, Row, Workbench
from rig.papers.zhang2014.drive import HYSTERESIS_LOSS, paper_drive
from sim_backend.model.error_in_plant import kinematic_effects, series_of_torsion
from sim_backend.model.fourier_error import FourierError, identify, pure_error
from sim_backend.model.parameters import PlantConfig
from sim_backend.plant import Plant
from sim_backend.ports import AxisMode

Floats = NDArray[np.float64]

ERROR = FourierError(0.0, (1.0e-5, -6.0e-5, 0.0, 8.0e-6), (-1.5e-5, 8.0e-5, 0.0, -1.0e-5))
"""rad; order 2 with 0.1 mrad, which is usual for a drive of this size."""

ARM = 0.02
"""kg*m^2; an arm on the output, which puts the load's mode to about 90 Hz."""

VISCOUS = 1e-4
"""N*m*s at the motor."""

SLOW = 0.1 * SPEEDS[0]
"""rad/s; the run from which the pure error is taken."""

TURNS = 8
PEAK = 0.172
"""N*m at the motor: 16 N*m at the output and what friction takes."""

RATE, QUICK_RATE = 0.01, 0.1
"""N*m/s at the motor; 0.01 is slow."""

CYCLE = 1e-3
"""s."""


@dataclass(frozen=True, slots=True)
class Turning:
    """A free run: rad, shape (n,)."""

    motor_position: Floats
    torsion: Floats


def the_plant() -> Plant:
    """Give the one plant of this page: non-linear springs, friction in the mesh, kinematic error, an arm."""
    drive = replace(paper_drive(), viscous_friction=VISCOUS)
    return Plant(PlantConfig(drive, output_inertia=ARM), kinematic_effects(ERROR))


def one_model(bench: Workbench) -> Outcome:
    """Turn the plant at four speeds and sweep it against its lock."""
    slow = _free_run(SLOW)
    pure = identify(slow.motor_position, slow.torsion)
    shares, flexible = [], []
    figure, axes = new_figure("One plant: flexible part against speed, and hysteresis", panels=3)
    for speed in SPEEDS:
        run = _free_run(speed)
        part = run.torsion - pure_error(run.motor_position, pure)
        shares.append(float(np.ptp(part) / np.ptp(run.torsion)))
        flexible.append(float(np.ptp(part)))
        angle = run.motor_position - 2.0 * math.pi * math.floor(run.motor_position[0] / (2.0 * math.pi))
        turn = (angle >= 2.0 * math.pi) & (angle <= 4.0 * math.pi)
        axes[0].plot(angle[turn] - 2.0 * math.pi, (part[turn] - part.mean()) * 1e6, label=rpm(speed))
    label(axes[0], "motor angle [rad]", "flexible part [urad]")
    axes[1].plot([speed * 30.0 / math.pi for speed in SPEEDS], np.array(shares) * 100.0, "o-")
    label(axes[1], "motor speed [rpm]", "flexible part [% of total]")
    torque, torsion, work = _locked_sweep(QUICK_RATE if bench.quick else RATE)
    axes[2].plot(torque, torsion * 1e6, linewidth=0.8)
    label(axes[2], "output torque [N*m]", "torsion [urad]")
    known = series_of_torsion(ERROR)
    gap = np.max(np.abs(np.subtract(pure.coefficients[1:9], (*known.a, 0.0, 0.0, 0.0, 0.0))[:4]))
    rows = [
        Row(f"largest error of a_1 to a_4 identified at {rpm(SLOW)}", None, float(gap), "rad", "15 coefficients"),
        Row("flexible part grows with speed", "yes", "yes" if all(np.diff(flexible) > 0.0) else "no", "", "2009"),
        Row("share at 310 rpm, at most", 0.05, shares[0], "", "2009"),
    ]
    rows += [
        Row(f"share of the flexible part at {rpm(speed)}", None, share, "", f"with an arm of {ARM:g} kg*m^2")
        for speed, share in zip(SPEEDS, shares, strict=True)
    ]
    rows += [
        Row("width of the loop at no torque", HYSTERESIS_LOSS, _width(torque, torsion), "rad", _WIDTH_NOTE),
        Row("torsion at 16 N*m", None, float(np.interp(16.0, *_rising(torque, torsion))), "rad", "with T_w and error"),
        Row("work lost in a locked cycle", None, work, "J", "positive: friction takes it"),
    ]
    return Outcome(tuple(rows), {"": figure})


ITEMS: tuple[Item, ...] = (
    Item("both", "one model", "Flexible part against speed and hysteresis loop of one plant", one_model),
)

_WIDTH_NOTE = "2014; (33) makes 63 % of the measured loss, see docs/errata.md"


def _free_run(speed: float) -> Turning:
    """Turn with `speed` (rad/s) until the start has died out, then record whole turns and a little more."""
    plant = the_plant()
    plant.command("motor", AxisMode.VELOCITY, speed)
    plant.advance_to(1.0)
    period = min(CYCLE, 2.0 * math.pi / speed / 200.0)
    period = plant.config.step * round(period / plant.config.step)
    ratio, start, rows = plant.config.drive.ratio, plant.time, []
    for k in range(round((TURNS + 0.1) * 2.0 * math.pi / speed / period)):
        plant.advance_to(start + k * period)
        now = plant.truth()
        rows.append((now.motor_position, now.output_position + now.motor_position / ratio))
    motor_position, torsion = np.array(rows).T
    return Turning(np.ascontiguousarray(motor_position), np.ascontiguousarray(torsion))


def _locked_sweep(rate: float) -> tuple[Floats, Floats, float]:
    """Sweep the motor's torque against the lock; give output torque, torsion and work lost over the second cycle."""
    plant = the_plant()
    plant.set_lock(True)
    ratio, period, rows = plant.config.drive.ratio, 4.0 * PEAK / rate, []
    for k in range(round(1.25 * period / CYCLE)):
        phase = k * CYCLE / period
        plant.command("motor", AxisMode.TORQUE, PEAK * float(np.interp(phase % 1.0, _AT, _LEVEL)))
        plant.advance_to((k + 1) * CYCLE)
        now = plant.truth()
        rows.append((now.output_torque, now.output_position + now.motor_position / ratio, now.heat))
    output_torque, torsion, heat = np.array(rows).T[:, round(0.25 * period / CYCLE) :]
    return output_torque, torsion, float(heat[-1] - heat[0])


_AT, _LEVEL = (0.0, 0.25, 0.75, 1.0), (0.0, 1.0, -1.0, 0.0)


def _rising(torque: Floats, torsion: Floats) -> tuple[Floats, Floats]:
    """Give the branch from the lowest torque on."""
    begin = int(np.argmin(torque))
    return torque[begin:], torsion[begin:]


def _width(torque: Floats, torsion: Floats) -> float:
    """Give how far apart the branches are at no torque, rad."""
    turn = int(np.argmin(torque))
    falling = float(np.interp(0.0, torque[:turn][::-1], torsion[:turn][::-1]))
    return abs(falling - float(np.interp(0.0, *_rising(torque, torsion))))

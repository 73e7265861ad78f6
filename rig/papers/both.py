"""Beyond both papers: one plant with the compliance and hysteresis of the one and the error and dynamics of the other.

The same configuration turns freely at the four speeds of the second paper, where its flexible part grows with speed,
and is swept against a locked output as in the first, where its torsion makes a loop.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from rig.papers.castejon2009.bench import SPEEDS, rpm
from rig.papers.castejon2009.spectra import line_order, order_spectrum
from rig.papers.figures import label, new_figure, one_turn
from rig.papers.item import Item, Outcome, Row, Workbench
from rig.papers.zhang2014.drive import HYSTERESIS_LOSS, paper_drive
from sim_backend.model.error_in_plant import kinematic_effects, series_of_torsion
from sim_backend.model.fourier_error import FourierError, identify, pure_error
from sim_backend.model.parameters import PlantConfig
from sim_backend.plant import Plant
from sim_backend.ports import AxisMode

Floats = NDArray[np.float64]

ERROR = FourierError(
    a0=0.0, a=(1.0e-5, -6.0e-5, 0.0, 8.0e-6, 0.0, 0.0, 0.0), b=(-1.5e-5, 8.0e-5, 0.0, -1.0e-5, 0.0, 0.0, 0.0)
)
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


@dataclass(frozen=True, slots=True)
class Locked:
    """A full cycle against the lock: N*m and rad, shape (n,); the work lost in it, J."""

    output_torque: Floats
    torsion: Floats
    work_lost: float


def the_plant() -> Plant:
    """Give the one plant of this page: non-linear springs, friction in the mesh, kinematic error, an arm."""
    drive = replace(paper_drive(), viscous_friction=VISCOUS)
    return Plant(PlantConfig(drive, output_inertia=ARM), kinematic_effects(ERROR))


def one_model(bench: Workbench) -> Outcome:
    """Turn the plant at four speeds and sweep it against its lock."""
    slow = _free_run(SLOW)
    pure = identify(slow.motor_position, slow.torsion)
    runs = [_free_run(speed) for speed in SPEEDS]
    parts = [run.torsion - pure_error(run.motor_position, pure) for run in runs]
    flexible = [float(np.ptp(part)) for part in parts]
    shares = [span / float(np.ptp(run.torsion)) for span, run in zip(flexible, runs, strict=True)]
    loop = _locked_sweep(QUICK_RATE if bench.quick else RATE)
    # but for a_0, which is an encoder's zero
    gap = np.max(np.abs(np.subtract(pure.coefficients[1:], series_of_torsion(ERROR).coefficients[1:])))
    rows = [
        Row(
            f"largest error of a_1 to a_7, b_1 to b_7 identified at {rpm(SLOW)}",
            None,
            float(gap),
            "rad",
            "2009, (17) to (19); the largest coefficient is b_2, 80 urad",
        ),
        Row("dominant order", 2.0, float(np.argmax(pure.amplitudes) + 1), "1/rev", "2009, Fig. 8; put in"),
        *(
            Row(f"flexible part at {rpm(speed)}, peak to peak", None, span, "rad", "2009, Fig. 9")
            for speed, span in zip(SPEEDS, flexible, strict=True)
        ),
        Row("flexible part grows with speed", "yes", "yes" if all(np.diff(flexible) > 0.0) else "no", "", _GROWS),
        Row(
            "kinematic error at 310 rpm, peak to peak",
            None,
            float(np.ptp(runs[0].torsion)),
            "rad",
            "2009, Fig. 11; the printed 0.02 to 0.03 rad is no magnitude, see docs/errata.md",
        ),
        Row(
            "line of the error at 310 rpm",
            2.0,
            line_order(runs[0].motor_position, runs[0].torsion),
            "1/rev",
            "2009, Fig. 12; over the motor angle",
        ),
        *(
            Row(f"share of the flexible part at {rpm(speed)}", most, share, "", _CONCLUSIONS)
            for speed, share, most in zip(SPEEDS, shares, _MOST, strict=True)
        ),
        Row("torsion from end to end, locked", None, float(np.ptp(loop.torsion)), "rad", "2014, Fig. 11"),
        Row("width of the loop at no torque", HYSTERESIS_LOSS, _width(loop), "rad", _WIDTH_NOTE),
        Row("torsion at 16 N*m", None, float(np.interp(16.0, *_rising(loop))), "rad", "2014, (28); with the error"),
        Row("work lost in a locked cycle", None, loop.work_lost, "J", "positive: friction takes it"),
    ]
    figures = {
        "2009-fig-9": _draw_flexible(runs, parts),
        "2009-fig-12": _draw_orders(runs),
        "2009-conclusions": _draw_shares(shares),
        "2014-fig-2": _draw_loop(loop),
    }
    return Outcome(tuple(rows), figures)


def _draw_flexible(runs: list[Turning], parts: list[Floats]) -> Figure:
    """Draw the flexible part over one motor turn at all four speeds."""
    figure, (axes,) = new_figure("One plant, as Castejon 2009, Fig. 9: flexible part of the kinematic error")
    for speed, run, part in zip(SPEEDS, runs, parts, strict=True):
        angle = run.motor_position - 2.0 * math.pi * math.floor(run.motor_position[0] / (2.0 * math.pi))
        turn = (angle >= 2.0 * math.pi) & (angle <= 4.0 * math.pi)
        axes.plot(angle[turn] - 2.0 * math.pi, (part[turn] - part.mean()) * 1e6, label=rpm(speed))
    label(axes, "motor angle [rad]", "flexible part less its mean [urad]")
    one_turn(axes)
    return figure


def _draw_orders(runs: list[Turning]) -> Figure:
    """Draw the spectrum of the error over the motor angle at the slowest and the fastest speed."""
    figure, (axes,) = new_figure("One plant, as Castejon 2009, Fig. 12: spectrum of the kinematic error")
    orders = np.linspace(0.2, 8.0, 800)
    for speed, run in ((SPEEDS[0], runs[0]), (SPEEDS[-1], runs[-1])):
        axes.plot(orders, order_spectrum(run.motor_position, run.torsion, orders) * 1e6, label=rpm(speed))
    label(axes, "order [1/rev]", "amplitude [urad]")
    return figure


def _draw_shares(shares: list[float]) -> Figure:
    """Draw the share of the flexible part over the speed."""
    figure, (axes,) = new_figure("One plant, as Castejon 2009, conclusions: share of the flexible part against speed")
    axes.plot(
        [speed * 30.0 / math.pi for speed in SPEEDS],
        np.array(shares) * 100.0,
        "o-",
        label=f"with an arm of {ARM:g} kg*m^2",
    )
    axes.plot(SPEEDS[0] * 30.0 / math.pi, _MOST[0] * 100.0, "kv", label="printed, at most 5 %")
    label(axes, "motor speed [rpm]", "flexible part [% of total]")
    return figure


def _draw_loop(loop: Locked) -> Figure:
    """Draw the output torque over the torsion of the locked drive."""
    figure, (axes,) = new_figure("The same plant, as Zhang 2014, Fig. 2 and 14: hysteresis of the locked drive")
    axes.plot(loop.torsion * 1e3, loop.output_torque, linewidth=0.8)
    label(axes, "torsion [mrad]", "output torque [N*m]")
    return figure


ITEMS: tuple[Item, ...] = (
    Item("both", "one model", "Flexible part against speed and hysteresis loop of one plant", one_model),
)

_WIDTH_NOTE = "2014, Fig. 2 and 14; (33) makes 63 % of the measured loss, see docs/errata.md"
_MOST = (0.05, None, None, None)
"""Share of the flexible part that the second paper gives, at most."""

_CONCLUSIONS = f"2009, conclusions: at most 5 % at 310 rpm; with an arm of {ARM:g} kg*m^2"
_GROWS = "2009, Fig. 9 and conclusions"


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


def _locked_sweep(rate: float) -> Locked:
    """Sweep the motor's torque against the lock, a quarter of a cycle and then a whole one, which is given."""
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
    return Locked(output_torque, torsion, float(heat[-1] - heat[0]))


_AT, _LEVEL = (0.0, 0.25, 0.75, 1.0), (0.0, 1.0, -1.0, 0.0)


def _rising(loop: Locked) -> tuple[Floats, Floats]:
    """Give torque and torsion from the lowest torque on."""
    begin = int(np.argmin(loop.output_torque))
    return loop.output_torque[begin:], loop.torsion[begin:]


def _width(loop: Locked) -> float:
    """Give how far apart the branches are at no torque, rad."""
    turn = int(np.argmin(loop.output_torque))
    falling = float(np.interp(0.0, loop.output_torque[:turn][::-1], loop.torsion[:turn][::-1]))
    return abs(falling - float(np.interp(0.0, *_rising(loop))))

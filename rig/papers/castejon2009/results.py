"""Figures 8 to 12 and the conclusions: pure and flexible part against angle and speed, and their lines."""

import cmath
import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rig.papers.castejon2009.bench import (
    CHOSEN_ERROR,
    PRINTED_ACCURACY,
    AtSpeed,
    four_speeds,
    four_speeds_order_2,
    four_speeds_to_draw,
    paper_transmission,
    rpm,
    steady_run,
)
from rig.papers.castejon2009.spectra import amplitude_spectrum, highest_bin, line_order, order_spectrum
from rig.papers.castejon2009.tables import double_counts
from rig.papers.figures import label, new_figure, one_turn
from rig.papers.item import Outcome, Row, Workbench
from sim_backend.model.error_parts import flexible_share
from sim_backend.model.fourier_error import FourierError, identify, pure_error
from sim_backend.model.transmission import Transmission

Floats = NDArray[np.float64]

TURN = 2.0 * math.pi
PRINTED_LINE = 10.25
"""Hz at 310 rpm."""

PRINTED_SHARE = 0.05
"""Of the flexible part at 310 rpm, at most."""

ORDER_3 = FourierError(0.0, (0.0, 0.0, 2.0e-4), (0.0, 0.0, 0.0))
"""rad. An error that no harmonic drive has, to see what the paper's check would say of it."""


def fig_8(bench: Workbench) -> Outcome:
    """Draw the pure error over one motor turn at 310 rpm: identified, and as chosen."""
    at = bench.share(four_speeds)[0]
    found = identify(at.run.motor_position, at.parts.total)
    angle, turn = _first_turn(at)
    figure, (axes,) = new_figure("Castejon 2009, Fig. 8: pure kinematic error at 310 rpm")
    axes.plot(angle, at.parts.total[turn] * 1e6, ".", markersize=3, label="total, measured")
    axes.plot(angle, at.parts.pure[turn] * 1e6, label="pure")
    label(axes, "motor angle [rad]", "error [urad]")
    one_turn(axes)
    dominant = float(np.argmax(found.amplitudes) + 1)
    return Outcome(
        (
            Row("dominant order", 2.0, dominant, "1/rev", "largest of the identified coefficients"),
            Row("peak to peak", None, float(np.ptp(at.parts.pure)), "rad", "chosen; the paper prints no coefficient"),
        ),
        {"": figure},
    )


def fig_9(bench: Workbench) -> Outcome:
    """Draw the flexible part over one motor turn at all four speeds."""
    runs = bench.share(four_speeds)
    figure, (axes,) = new_figure("Castejon 2009, Fig. 9: flexible part of the kinematic error")
    rows = []
    for at, drawn in zip(runs, bench.share(four_speeds_to_draw), strict=True):
        angle, turn = _first_turn(drawn)
        axes.plot(angle, (drawn.parts.flexible[turn] - at.parts.flexible.mean()) * 1e6, label=rpm(at.speed))
        rows.append(Row(f"peak to peak at {rpm(at.speed)}", None, float(np.ptp(at.parts.flexible)), "rad", ""))
    label(axes, "motor angle [rad]", "flexible part less its mean [urad]")
    one_turn(axes)
    growth = [float(np.ptp(b.parts.flexible) / np.ptp(a.parts.flexible)) for a, b in pairwise(runs)]
    phases = [_phase_of_order_2(at) for at in runs]
    rows += [
        Row("grows with speed", "yes", "yes" if min(growth) > 1.0 else "no"),
        Row("periodic in the motor angle", "yes", "yes" if _periodic(runs[-1]) else "no"),
        Row("phase of order 2 behind the pure error, slowest", None, phases[0], "rad", "from the load's damping"),
        Row(
            "the same, fastest",
            None,
            phases[-1],
            "rad",
            "the paper says that its curves are shifted against each other; these hardly are",
        ),
    ]
    return Outcome(tuple(rows), {"": figure})


def fig_10(bench: Workbench) -> Outcome:
    """Draw the load angle around the ideal line at 1120 rpm."""
    at = bench.share(four_speeds)[-1]
    run, drawn, ratio = at.run, bench.share(four_speeds_to_draw)[-1], paper_transmission().ratio
    shown = drawn.run.time <= 1.5 * TURN / at.speed
    time, ideal, total = (
        values[shown] for values in (drawn.run.time, drawn.run.motor_position / ratio, drawn.parts.total)
    )
    figure, axes = new_figure("Castejon 2009, Fig. 10: load angle at 1120 rpm", panels=2)
    axes[0].plot(time, ideal, label="ideal")
    axes[0].plot(time, ideal - 100.0 * total, label="real, deviation times 100")
    label(axes[0], "time [s]", "load angle [rad]")
    axes[1].plot(time, -total * 1e6, label="real less ideal")
    flexible = at.parts.flexible - at.parts.flexible.mean()
    drawn_flexible = drawn.parts.flexible[shown] - at.parts.flexible.mean()
    axes[1].plot(time, -100.0 * drawn_flexible * 1e6, label="its flexible part, times 100")
    label(axes[1], "time [s]", "deviation [urad]")
    waves = 2.0 * (float(run.motor_position[-1]) - float(run.motor_position[0])) / TURN
    crossings = _crossings(flexible)
    return Outcome(
        (
            Row(
                "real around ideal, peak to peak", None, float(np.ptp(at.parts.total)), "rad", "pure and flexible part"
            ),
            Row("its flexible part", None, float(np.ptp(at.parts.flexible)), "rad", "what the paper draws"),
            Row("crossings of the flexible part per wave of order 2", 2.0, crossings / waves, "", "it undulates"),
        ),
        {"": figure},
    )


def fig_11(bench: Workbench) -> Outcome:
    """Draw the parts of the kinematic error at 310 rpm."""
    at = bench.share(four_speeds)[0]
    angle, turn = _first_turn(at)
    figure, axes = new_figure("Castejon 2009, Fig. 11: parts of the kinematic error at 310 rpm", panels=2)
    axes[0].plot(angle, at.parts.total[turn] * 1e6, label="total")
    axes[0].plot(angle, at.parts.pure[turn] * 1e6, "--", label="pure")
    label(axes[0], "motor angle [rad]", "error [urad]")
    axes[1].plot(angle, at.parts.flexible[turn] * 1e6, label="flexible")
    label(axes[1], "motor angle [rad]", "error [urad]")
    for panel in axes:
        one_turn(panel)
    note = "0.02 rad is 14 times the 0.08 degrees of the same paper; not taken as a magnitude"
    return Outcome(
        (
            Row("largest total error", "0.02 to 0.03", float(np.max(np.abs(at.parts.total))), "rad", note),
            Row("bound of the makers", float(PRINTED_ACCURACY), float(np.max(np.abs(at.parts.total))), "rad", "met"),
            Row("flexible part, peak to peak", None, float(np.ptp(at.parts.flexible)), "rad", ""),
        ),
        {"": figure},
    )


def fig_12(bench: Workbench) -> Outcome:
    """Find the line of the total error at 310 rpm, over time and over angle."""
    at = bench.share(four_speeds)[0]
    period = float(at.run.time[1])
    total = at.parts.total[:-1]
    frequency, amplitude = amplitude_spectrum(total, period)
    figure, axes = new_figure("Castejon 2009, Fig. 12: spectrum of the kinematic error at 310 rpm", panels=2)
    near = frequency <= 45.0
    twice = 2.0 * at.speed / TURN
    inset = axes[0].inset_axes((0.48, 0.3, 0.49, 0.42), xlim=(9.3, 11.2))
    for panel in (axes[0], inset):
        panel.plot(frequency[near], amplitude[near] * 1e6, ".-", linewidth=0.6, label="record of 4 s")
        panel.axvline(PRINTED_LINE, color="0.3", linewidth=0.8, label=f"printed {PRINTED_LINE:.2f} Hz")
        panel.axvline(twice, color="C3", linestyle="--", linewidth=0.8, label=f"twice the speed, {twice:.2f} Hz")
    inset.tick_params(labelsize=7)
    label(axes[0], "frequency [Hz]", "amplitude [urad]")
    orders = np.linspace(0.2, 8.0, 1000)
    axes[1].plot(orders, order_spectrum(at.run.motor_position, at.parts.total, orders) * 1e6, label="over the angle")
    label(axes[1], "order [1/rev]", "amplitude [urad]")
    order = line_order(at.run.motor_position, at.parts.total)
    rows = [
        Row("line over the motor angle", 2.0, order, "1/rev", "the order, whatever the speed and the record"),
        Row("its frequency", PRINTED_LINE, order * at.speed / TURN, "Hz", "2 x 310/60 Hz; printed: -0.8 %"),
        Row(
            "highest bin, record of 4 s", PRINTED_LINE, highest_bin(total, period), "Hz", "10.333 Hz lies between bins"
        ),
    ]
    longer = steady_run(CHOSEN_ERROR, at.speed, seconds=8.0).parts.total[:-1]
    for seconds in (1.0, 2.0, 8.0):
        part = longer[: round(seconds / period)]
        rows.append(Row(f"highest bin, record of {seconds:g} s", None, highest_bin(part, period), "Hz", ""))
    other = steady_run(ORDER_3, at.speed)
    rows.append(
        Row(
            "line of a pure error of order 3",
            None,
            line_order(other.run.motor_position, other.parts.total),
            "1/rev",
            "what is put in comes out: the line at twice the speed validates nothing",
        )
    )
    return Outcome(tuple(rows), {"": figure})


def conclusions(bench: Workbench) -> Outcome:
    """Give the share of the flexible part against speed, and what the double count of (27) would add."""
    runs, alone = bench.share(four_speeds), bench.share(four_speeds_order_2)
    shares = [flexible_share(at.parts) for at in runs]
    of_order_2 = [flexible_share(at.parts) for at in alone]
    doubled = double_counts(runs)
    rpms = [at.speed * 60.0 / TURN for at in runs]
    figure, axes = new_figure("Castejon 2009, conclusions: share of the flexible part against speed", panels=2)
    axes[0].plot(rpms, np.array(of_order_2) * 100.0, "o-", label="order 2 alone")
    axes[0].plot(rpms, np.array(shares) * 100.0, "s-", label="all orders")
    axes[0].plot(rpms[0], PRINTED_SHARE * 100.0, "kv", label="printed, at most 5 %")
    axes[0].set_yscale("log")
    ticks = (0.03, 0.1, 0.3, 1.0, 5.0)
    axes[0].set_yticks(ticks, labels=[f"{tick:g}" for tick in ticks])
    label(axes[0], "motor speed [rpm]", "flexible part [% of total]")
    axes[1].plot(rpms, np.array(doubled) * 1e6, "o-", label="N tau_m / K, counted twice by (27)")
    axes[1].plot(rpms, [np.ptp(at.parts.flexible) * 1e6 for at in runs], "s-", label="flexible part, peak to peak")
    label(axes[1], "motor speed [rpm]", "angle at the output [urad]")
    rows = [
        Row(f"share at {rpm(runs[0].speed)}, at most", PRINTED_SHARE, shares[0], "", "all orders"),
        Row("share grows with speed", "yes", "yes" if all(np.diff(shares) > 0.0) else "no"),
    ]
    rows += [
        Row(f"share at {rpm(at.speed)}, order 2 alone", None, share, "", "(2 omega)^2 J_l/K")
        for at, share in zip(alone, of_order_2, strict=True)
    ]
    rows += [
        Row(f"wind-up counted twice at {rpm(at.speed)}", None, double, "rad", "N tau_m/K of (27)")
        for at, double in zip(runs, doubled, strict=True)
    ]
    heavy = _load_for_share(PRINTED_SHARE, runs[0].speed)
    rows += [
        Row(
            "amplitude of which the double count is 5 % at 310 rpm",
            None,
            doubled[0] / PRINTED_SHARE,
            "rad",
            "the probable origin of the printed share",
        ),
        Row("load inertia for 5 % at 310 rpm", paper_transmission().load_inertia, heavy.load_inertia, "kg*m^2"),
        Row("mode of that load", None, heavy.load_mode / TURN, "Hz", "beside a line at 37.3 Hz at 1120 rpm"),
    ]
    return Outcome(tuple(rows), {"": figure})


def _load_for_share(share: float, speed: float) -> Transmission:
    """Give the transmission whose flexible part is `share` of the pure one at `speed` (rad/s) for order 2.

    r^2/(1 - r^2) = share, where r is twice the speed over the frequency of the load's mode.
    """
    transmission = paper_transmission()
    squared = share / (1.0 + share)
    return replace(transmission, load_inertia=squared * transmission.stiffness / (2.0 * speed) ** 2)


def _first_turn(at: AtSpeed) -> tuple[Floats, slice]:
    """Give the angle of the first motor turn and its samples."""
    angle = at.run.motor_position - at.run.motor_position[0]
    turn = slice(0, int(np.searchsorted(angle, TURN)) + 1)
    return angle[turn], turn


def _phase_of_order_2(at: AtSpeed) -> float:
    """Give by how much order 2 of the flexible part follows that of the pure one, rad."""
    flexible = identify(at.run.motor_position, at.parts.flexible)
    gain = complex(flexible.a[1], -flexible.b[1]) / complex(CHOSEN_ERROR.a[1], -CHOSEN_ERROR.b[1])
    return -cmath.phase(gain)


def _periodic(at: AtSpeed) -> bool:
    """Tell whether 99 % of the flexible part is a function of the motor angle."""
    flexible = at.parts.flexible - at.parts.flexible.mean()
    series = identify(at.run.motor_position, at.parts.flexible)
    left = at.parts.flexible - pure_error(at.run.motor_position, series)
    return float(np.var(left)) < 1e-4 * float(np.var(flexible))


def _crossings(values: Floats) -> float:
    return float(np.count_nonzero(np.diff(np.signbit(values))))

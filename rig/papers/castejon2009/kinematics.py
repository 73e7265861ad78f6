"""Equations (1)-(5), figures 2 and 3: ideal motion, the kinematic error and its parts."""

import math

import numpy as np

from rig.papers.castejon2009.bench import PRINTED_ACCURACY, four_speeds, paper_transmission, rpm
from rig.papers.figures import label, new_figure
from rig.papers.item import Outcome, Row, Workbench
from sim_backend.model.effects import CATALOGUE
from sim_backend.model.kinematics import Member, power_surplus, speed_ratio, torques
from sim_backend.model.kinematics import motion as ideal_motion


def ideal(_: Workbench) -> Outcome:
    """Turn the ideal drive with one member held, and balance its power."""
    N = paper_transmission().ratio
    speeds = ideal_motion(N, circular_spline=0.7, flexspline=-1.3)
    surplus = power_surplus(torques(N, wave_generator=0.2), speeds)
    wave_generator, flexspline = "wave generator over flexspline", "wave generator over circular spline"
    return Outcome(
        (
            Row(
                f"{wave_generator}, circular spline fixed",
                -N,
                speed_ratio(N, Member.CIRCULAR_SPLINE),
                "",
                "",
                "eq. (1)",
            ),
            Row(f"{flexspline}, flexspline fixed", N + 1, speed_ratio(N, Member.FLEXSPLINE), "", "", "eq. (2)"),
            Row("power in less power out", 0.0, surplus, "W", "any two members driven", "eq. (3)"),
        )
    )


def mechanism(_: Workbench) -> Outcome:
    """Turn the wave generator once, as figure 2 shows it, and count teeth."""
    N = paper_transmission().ratio
    half, whole = (
        2.0 * N * ideal_motion(N, wave_generator=turn, circular_spline=0.0).flexspline for turn in (0.5, 1.0)
    )
    note = f"of its {2.0 * N:g}, by (1)"
    return Outcome(
        (
            Row("teeth by which the flexspline falls behind in half a turn", 1.0, -half, "", note),
            Row("teeth by which it falls behind in a turn", 2.0, -whole, "", note),
        )
    )


def parts(bench: Workbench) -> Outcome:
    """Take the error at 1120 rpm apart, and hold its flexible part against the torque in the spring."""
    fastest = bench.share(four_speeds)[-1]
    error, name = fastest.parts, rpm(fastest.speed)
    deflection = fastest.run.transmitted_torque / paper_transmission().stiffness
    apart = float(np.sqrt(np.mean((error.total - error.pure - deflection) ** 2)))
    return Outcome(
        (
            Row(f"kinematic error at {name}, peak to peak", None, float(np.ptp(error.total)), "rad", "", "eq. (4)"),
            Row(
                "total less pure part less deflection of the spring, rms",
                0.0,
                apart,
                "rad",
                "printed as an approximation; what is left is the mesh's damping",
                "eq. (5)",
            ),
        )
    )


def typical_error(_: Workbench) -> Outcome:
    """Draw figure 3: two lines as near as the teeth are, over one turn of the output."""
    N = int(paper_transmission().ratio)
    effect = CATALOGUE["kinematic-error"].function
    orders = (2.0, 2.0 * (2 * N + 2) / (2 * N))
    angle = np.linspace(0.0, 2.0 * math.pi * N, 100 * N, endpoint=False)
    error = np.array([sum(effect(a, 1e-4, order, 0.0) for order in orders) for a in angle.tolist()])
    # every half period of order 2 is 25 samples: its largest magnitude is the envelope
    envelope = np.max(np.abs(error.reshape(-1, 25)), axis=1)
    cycles = int(np.argmax(np.abs(np.fft.rfft(envelope - envelope.mean()))))
    figure, (axes,) = new_figure("Castejon 2009, Fig. 3: a typical kinematic error over one output turn")
    axes.plot(angle / N, error * 1e6, linewidth=0.6)
    label(axes, "output angle [rad]", "kinematic error [urad]")
    return Outcome(
        (
            Row(
                "modulations per output turn",
                2.0,
                float(cycles),
                "",
                "what is put in comes out: lines 2 and 2 z_C/z_F = 2.04 per motor turn, 0.1 mrad each",
            ),
            Row(
                "largest error",
                float(PRINTED_ACCURACY),
                float(np.max(np.abs(error))),
                "rad",
                "printed: 0.08 degrees as an upper bound; obtained: of the curve drawn, whose lines are chosen",
            ),
        ),
        {"": figure},
    )

"""Equations (20)-(40): the linear state space, corrected and as printed."""

import math

import numpy as np
from numpy.typing import NDArray

from rig.papers.castejon2009.bench import CHOSEN_ERROR, AtSpeed, four_speeds, paper_transmission, rpm
from rig.papers.castejon2009.modes import decay, largest_real_part, mode, poles
from rig.papers.castejon2009.printed import matrix_35, matrix_of_28_to_31
from rig.papers.item import Outcome, Row, Workbench, definition
from sim_backend.model.driven import torque_driven
from sim_backend.model.fourier_error import FourierError, pure_error_slope
from sim_backend.model.state_space import state_space

Floats = NDArray[np.float64]

NO_ERROR = FourierError(0.0, (0.0,), (0.0,))
STATE = "[theta_l, theta_l', theta_m, theta_m']"


def general_form(_: Workbench) -> Outcome:
    """Give (20)-(25), which are the form of any state space."""
    return Outcome(
        (
            definition(20, "outputs over the first state and the inputs"),
            definition(21, "state over the first state and the inputs"),
            definition(22, "rates of the state"),
            definition(23, "outputs"),
            definition(24, "rates of a linear system", "(32) is computed"),
            definition(25, "outputs of a linear system", "(38) to (40) are what it is here"),
        )
    )


def matrices(bench: Workbench) -> Outcome:
    """Compare the linear model with the non-linear one, and the printed one with both."""
    t = paper_transmission()
    model, jacobian = state_space(t), _jacobian()
    printed, by_28 = poles(matrix_35(t)), poles(matrix_of_28_to_31(t))
    slowest = bench.share(four_speeds)[0]
    name = rpm(slowest.speed)
    identity = float(np.max(np.abs(model.A[0] - [0.0, 1.0, 0.0, 0.0])))
    rate = pure_error_slope(slowest.run.motor_position, CHOSEN_ERROR) * slowest.run.motor_velocity
    unstable = "as printed: unstable"
    return Outcome(
        (
            Row("inertia on theta_m''", t.motor_inertia, 1.0 / float(model.B[3, 0]), "kg*m^2", J_WG, "eq. (26)"),
            Row("tau_m on the load, over tau_m", t.ratio, float(model.B[1, 0]) * t.load_inertia, "", TWICE, "eq. (27)"),
            Row("row 1 of A less x_2", 0.0, identity, "", "", "eq. (28)"),
            Row("mode of (28)-(31)", None, mode(by_28), "Hz", "theta_m as an input, J_m alone", "eq. (29)"),
            Row("row 2 of A less the Jacobian of (16)", 0.0, _gap(model.A, jacobian, 1), "", OF_ROW, "eq. (29)"),
            Row(
                f"rate of theta_p at {name}, rms",
                0.0,
                float(np.sqrt(np.mean(rate**2))),
                "rad/s",
                "printed as at rest: nothing then grows with the speed",
                "eq. (30)",
            ),
            Row(
                "decay of the motor's speed",
                decay(by_28),
                decay(poles(model.A)),
                "1/s",
                "printed: J_m alone, theta_m an input",
                "eq. (31)",
            ),
            Row("row 4 of A less the Jacobian of (15)", 0.0, _gap(model.A, jacobian, 3), "", OF_ROW, "eq. (31)"),
            Row("A less the Jacobian of (15), (16)", 0.0, _gap(model.A, jacobian), "", OF_ROW, "eq. (32)"),
            definition(33, "rates of the four states"),
            definition(34, "the four states", f"here {STATE}, in print theta_p in place of theta_m"),
            Row("largest real part of A (35)", None, largest_real_part(printed), "1/s", unstable, "eq. (35)"),
            Row("second largest real part of A (35)", None, _second(printed), "1/s", unstable, "eq. (35)"),
            Row("largest real part of A", None, largest_real_part(poles(model.A)), "1/s", "corrected", "eq. (35)"),
            Row(
                "N/J_l of B", t.ratio / t.load_inertia, float(model.B[1, 0]), "1/(kg*m^2)", "counted twice", "eq. (36)"
            ),
            definition(37, "the inputs", "here [tau_m, tau_l, theta_p], in print [tau_m, theta_m]"),
            definition(38, "outputs of the linear model", "here [theta_l, transmitted torque]"),
            Row(
                "torque over theta_l in C",
                0.0,
                float(model.C[1, 0]),
                "N*m/rad",
                "the spring; a load that pulls is felt",
                "eq. (39)",
            ),
            Row("torque over tau_m in D", t.ratio, float(model.D[1, 0]), "", "the spring brings it", "eq. (40)"),
            Row(
                "transmitted torque less N tau_m, rms",
                0.0,
                _torque_gap(slowest),
                "N*m",
                f"tau_l = N v as printed has no dynamics; run at {name}",
                "eq. (40)",
            ),
        )
    )


J_WG = "printed: J_m alone"
TWICE = "printed: N, counted twice; the spring brings it"
OF_ROW = "relative to each row's largest"


def _jacobian() -> Floats:
    """Give the Jacobian of (15), (16) without a pure error, in the order of the state of A."""
    rates = torque_driven(paper_transmission(), NO_ERROR, lambda _: 0.0, lambda _: 0.0)
    places, columns = (2, 3, 0, 1), []
    for k, step in zip(places, (1e-4, 1.0, 1e-4, 1.0), strict=True):
        state = np.zeros(4)
        state[k] = step
        columns.append(np.array(rates(0.0, state.tolist()))[list(places)] / step)
    return np.column_stack(columns)


def _gap(A: Floats, jacobian: Floats, row: int | None = None) -> float:
    """Give the largest difference over each row's largest entry; of one row, or of all."""
    gaps = np.max(np.abs(jacobian - A), axis=1) / np.max(np.abs(A), axis=1)
    return float(np.max(gaps) if row is None else gaps[row])


def _second(values: NDArray[np.complex128]) -> float:
    """Give the real part of the next different pole."""
    return float(np.unique(np.round(values.real, 9))[-2])


def _torque_gap(at: AtSpeed) -> float:
    difference = at.run.transmitted_torque - paper_transmission().ratio * at.run.motor_torque
    return math.sqrt(float(np.mean(difference**2)))

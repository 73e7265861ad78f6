"""Equations (6)-(16) and (20)-(40), tables 1 and 2: the equations of motion, their matrices, modes and motor."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rig.papers.castejon2009.bench import (
    CHOSEN_ERROR,
    AtSpeed,
    four_speeds,
    paper_motor,
    paper_transmission,
    rpm,
)
from rig.papers.castejon2009.printed import double_count, matrix_35, matrix_of_28_to_31
from rig.papers.item import Outcome, Row, Workbench
from sim_backend.model import lagrange
from sim_backend.model.dc_motor import RPM, TABLE_2, steady_speed, voltage_for
from sim_backend.model.driven import laws, torque_driven
from sim_backend.model.fourier_error import FourierError
from sim_backend.model.parameters import Rotation
from sim_backend.model.state_space import state_space
from sim_backend.model.transmission import hdc_40

Floats = NDArray[np.float64]

NO_ERROR = FourierError(0.0, (0.0,), (0.0,))
STATES = 200
"""Random states at which an identity is checked."""


def equations_of_motion(bench: Workbench) -> Outcome:
    """Check (15) and (16) at random states, and the energy over a run."""
    c, k = laws(paper_transmission()), CHOSEN_ERROR.coefficients
    worst_power = worst_force = 0.0
    rng = np.random.default_rng(0)
    for theta_m, omega_m, bend, omega_l in rng.normal(0.0, [20.0, 100.0, 1e-3, 2.0], (STATES, 4)).tolist():
        theta_l = theta_m / c.N + bend
        alpha_m, alpha_l = lagrange.accelerations(theta_m, omega_m, theta_l, omega_l, 0.2, -3.0, k, c)
        error, slope = lagrange.error_and_slope(theta_m, k)
        e, p = theta_l - theta_m / c.N + error, slope - 1.0 / c.N
        gained = c.J * omega_m * alpha_m + c.J_l * omega_l * alpha_l + c.K * e * (omega_l + p * omega_m)
        taken = 2.0 * lagrange.dissipation(theta_m, omega_m, omega_l, k, c)
        worst_power = max(worst_power, abs(gained + taken - 0.2 * omega_m + 3.0 * omega_l))
        step = 1e-4
        energy = [lagrange.potential_energy(theta_m + s, theta_l, k, c) for s in (-step, step)]
        worst_force = max(worst_force, abs((energy[1] - energy[0]) / (2.0 * step) - c.K * e * p))
    at_rest = lagrange.potential_energy(0.0, 1e-3 - 0.5 * CHOSEN_ERROR.a0 - sum(CHOSEN_ERROR.a), k, c)
    fastest = bench.share(four_speeds)[-1]
    return Outcome(
        (
            Row("inertia at the motor", None, c.J, "kg*m^2", "(15) prints J_m alone, (9) J_m + J_wg", "eq. (9)"),
            Row("V at 1 mrad", -0.5 * c.K * 1e-6, at_rest, "J", "as printed the integral is negative", "eq. (10)"),
            Row("power in less stored and lost", 0.0, worst_power, "W", "worst of random states", "eq. (11)-(16)"),
            Row("force of V less K e p", 0.0, worst_force, "N*m", "by differences", "eq. (13)"),
            Row(
                "ripple of the motor's speed, peak to peak",
                None,
                float(np.ptp(fastest.run.motor_velocity)),
                "rad/s",
                f"at {rpm(fastest.speed)}, through dtheta_p/dtheta_m and the inertia of the load",
                "eq. (15)",
            ),
        )
    )


def matrices(bench: Workbench) -> Outcome:
    """Compare the linear model with the non-linear one, and the printed one with both."""
    t = paper_transmission()
    model = state_space(t)
    printed = _poles(matrix_35(t))
    by_28 = _poles(matrix_of_28_to_31(t))
    slowest = bench.share(four_speeds)[0]
    return Outcome(
        (
            Row("A less the Jacobian of (15), (16)", 0.0, _linearisation_gap(), "", "relative to each row's largest"),
            Row("mode of (28)-(31)", None, _mode(by_28), "Hz", "theta_m as an input, J_m alone", "eq. (28)-(31)"),
            Row("largest real part of A (35)", None, _largest(printed), "1/s", "as printed: unstable", "eq. (35)"),
            Row(
                "second largest real part of A (35)", None, _second(printed), "1/s", "as printed: unstable", "eq. (35)"
            ),
            Row("largest real part of A", None, _largest(_poles(model.A)), "1/s", "corrected", "eq. (35)"),
            Row(
                "N/J_l of B", t.ratio / t.load_inertia, float(model.B[1, 0]), "1/(kg*m^2)", "counted twice", "eq. (36)"
            ),
            Row(
                "transmitted torque less N tau_m, rms",
                0.0,
                _torque_gap(slowest),
                "N*m",
                f"tau_l = N v as printed has no dynamics; run at {rpm(slowest.speed)}",
                "eq. (39)-(40)",
            ),
        )
    )


def table_1(_: Workbench) -> Outcome:
    """Find the modes of the corrected matrix."""
    rows = []
    for rotation in Rotation:
        poles = _poles(state_space(hdc_40(rotation)).A)
        rigid = np.min(poles.real[np.abs(poles.imag) < 1.0])
        note = "(12) as printed" if rotation is Rotation.OPPOSED else "theta_m' - theta_l' in (12)"
        rows += [
            Row(f"torsional mode, {rotation}", None, _mode(poles), "Hz", note),
            Row(f"its decay, {rotation}", None, float(poles.real[np.argmax(poles.imag)]), "1/s", note),
            Row(f"decay of the speed, {rotation}", None, float(rigid), "1/s", note),
        ]
    J_m_alone = _poles(state_space(replace(paper_transmission(), wave_generator_inertia=0.0)).A)
    rows.append(Row("torsional mode, J_wg dropped", None, _mode(J_m_alone), "Hz", "as (15) prints it"))
    return Outcome(tuple(rows))


def table_2(_: Workbench) -> Outcome:
    """Give the speed at every voltage."""
    motor, drag = paper_motor(), paper_transmission().drag
    note = f"R = {motor.resistance:g} ohm, L = {motor.inductance:g} H chosen: not printed"
    rows = [
        Row(f"speed at {voltage:g} V", speed / RPM, steady_speed(motor, voltage, drag) / RPM, "rpm", note)
        for voltage, speed in TABLE_2
    ]
    voltage, speed = TABLE_2[0]
    off = "off the line of the other rows"
    rows.append(Row(f"voltage for {rpm(speed)}", voltage, voltage_for(motor, speed, drag), "V", off))
    rows.append(Row("back-EMF constant", None, motor.constant, "V*s/rad", "last three rows; at most 0.2046"))
    return Outcome(tuple(rows))


def double_counts(runs: tuple[AtSpeed, ...]) -> tuple[float, ...]:
    """Give the wind-up (rad) that the double count of (27) would add in every run."""
    return tuple(double_count(paper_transmission(), float(at.run.motor_torque.mean())) for at in runs)


def _poles(matrix: Floats) -> NDArray[np.complex128]:
    return np.linalg.eigvals(matrix).astype(np.complex128)


def _mode(poles: NDArray[np.complex128]) -> float:
    return float(np.max(poles.imag) / (2.0 * math.pi))


def _largest(poles: NDArray[np.complex128]) -> float:
    return float(np.max(poles.real))


def _second(poles: NDArray[np.complex128]) -> float:
    """Give the real part of the next different pole."""
    real = np.unique(np.round(poles.real, 9))
    return float(real[-2])


def _linearisation_gap() -> float:
    t = paper_transmission()
    rates = torque_driven(t, NO_ERROR, lambda _: 0.0, lambda _: 0.0)
    places, columns = (2, 3, 0, 1), []
    for k, step in zip(places, (1e-4, 1.0, 1e-4, 1.0), strict=True):
        state = np.zeros(4)
        state[k] = step
        columns.append(np.array(rates(0.0, state.tolist()))[list(places)] / step)
    A = state_space(t).A
    return float(np.max(np.abs(np.column_stack(columns) - A) / np.max(np.abs(A), axis=1, keepdims=True)))


def _torque_gap(at: AtSpeed) -> float:
    difference = at.run.transmitted_torque - paper_transmission().ratio * at.run.motor_torque
    return float(np.sqrt(np.mean(difference**2)))

"""Equations (6)-(16): Lagrange's equations of motion, against differences of their energies and a closed form."""

from collections.abc import Callable

import numpy as np

from rig.papers.castejon2009.bench import CHOSEN_ERROR, AtSpeed, four_speeds, paper_transmission, rpm
from rig.papers.item import Outcome, Row, Workbench, definition
from sim_backend.model import lagrange
from sim_backend.model.driven import flexible_series, laws
from sim_backend.model.fourier_error import pure_error
from sim_backend.model.lagrange import Laws

STATES = 200
"""Random states at which an identity is checked."""

TAU_M, TAU_L = 0.2, -3.0
"""N*m; torques at these states."""


def equations_of_motion(bench: Workbench) -> Outcome:
    """Check (12) to (14) at random states, (8) and (16) on a run at 1120 rpm."""
    c, k = laws(paper_transmission()), CHOSEN_ERROR.coefficients
    states = np.random.default_rng(0).normal(0.0, [20.0, 100.0, 1e-3, 2.0], (STATES, 4)).tolist()
    worst_m, worst_l = np.max(np.abs([_lagrange(state, c) for state in states]), axis=0).tolist()
    power = max(abs(_power(state, c)) for state in states)
    at_rest = lagrange.potential_energy(0.0, 1e-3 - 0.5 * CHOSEN_ERROR.a0 - sum(CHOSEN_ERROR.a), k, c)
    fastest = bench.share(four_speeds)[-1]
    name, differences = rpm(fastest.speed), "T, V and D by differences, theta'' of (15), (16); worst of random states"
    return Outcome(
        (
            definition(6, "Lagrange's equation in general", "(13) and (14) are computed"),
            definition(7, "generalised force from V and D", "part of (13) and (14)"),
            Row(
                f"theta_l by (8) less that of (15), (16) at {name}, rms",
                0.0,
                _load_angle_gap(fastest),
                "rad",
                "Delta theta from (17) and the closed form of its flexible part at constant speed",
                "eq. (8)",
            ),
            Row("inertia at the motor", None, c.J, "kg*m^2", "(15) prints J_m alone, (9) J_m + J_wg", "eq. (9)"),
            Row("V at 1 mrad", -0.5 * c.K * 1e-6, at_rest, "J", "as printed the integral is negative", "eq. (10)"),
            definition(11, "Rayleigh's function in general", "(12) is computed"),
            Row("power in less stored less 2 D", 0.0, power, "W", "worst of random states", "eq. (12)"),
            Row("left side of (13) less tau_m", 0.0, worst_m, "N*m", differences, "eq. (13)"),
            Row("left side of (14) less tau_l", 0.0, worst_l, "N*m", differences, "eq. (14)"),
            Row(
                "ripple of the motor's speed, peak to peak",
                None,
                float(np.ptp(fastest.run.motor_velocity)),
                "rad/s",
                f"at {name}, through dtheta_p/dtheta_m and the inertia of the load",
                "eq. (15)",
            ),
            Row(
                f"mean transmitted torque at {name} over the drag of load and bearing",
                1.0,
                float(fastest.run.transmitted_torque.mean()) / _drag(fastest, c),
                "1",
                "a load that is not accelerated takes B_l theta_l' + B_ml (theta_m' + theta_l')",
                "eq. (16)",
            ),
        )
    )


def _lagrange(state: list[float], c: Laws) -> tuple[float, float]:
    """Give the left sides of (13) and (14) less the torques, N*m, with the energies' slopes by differences."""
    theta_m, omega_m, bend, omega_l = state
    k, theta_l = CHOSEN_ERROR.coefficients, theta_m / c.N + bend
    alpha_m, alpha_l = lagrange.accelerations(theta_m, omega_m, theta_l, omega_l, TAU_M, TAU_L, k, c)

    def left(m: float, load: float) -> float:
        """Give the left side for the coordinate that goes `m` with theta_m and `load` with theta_l."""

        def momentum(t: float) -> float:
            w_m, w_l = omega_m + alpha_m * t, omega_l + alpha_l * t
            return _slope(lambda s: lagrange.kinetic_energy(w_m + s * m, w_l + s * load, c), 1.0)

        force = _slope(lambda s: lagrange.potential_energy(theta_m + s * m, theta_l + s * load, k, c), 1e-5)
        friction = _slope(lambda s: lagrange.dissipation(theta_m, omega_m + s * m, omega_l + s * load, k, c), 1e-2)
        return _slope(momentum, 1e-6) + force + friction

    return left(1.0, 0.0) - TAU_M, left(0.0, 1.0) - TAU_L


def _slope(function: Callable[[float], float], step: float) -> float:
    return (function(step) - function(-step)) / (2.0 * step)


def _power(state: list[float], c: Laws) -> float:
    """Give the power that the torques put in, less what is stored and what friction takes, W."""
    theta_m, omega_m, bend, omega_l = state
    k, theta_l = CHOSEN_ERROR.coefficients, theta_m / c.N + bend
    alpha_m, alpha_l = lagrange.accelerations(theta_m, omega_m, theta_l, omega_l, TAU_M, TAU_L, k, c)
    error, slope = lagrange.error_and_slope(theta_m, k)
    stretching = omega_l + (slope - 1.0 / c.N) * omega_m
    stored = c.J * omega_m * alpha_m + c.J_l * omega_l * alpha_l + c.K * (bend + error) * stretching
    taken = 2.0 * lagrange.dissipation(theta_m, omega_m, omega_l, k, c)
    return TAU_M * omega_m + TAU_L * omega_l - stored - taken


def _load_angle_gap(at: AtSpeed) -> float:
    """Give the rms of the load angle of (8) less that of the run, without their means, rad."""
    t, angle = paper_transmission(), at.run.motor_position
    flexible = pure_error(angle, flexible_series(t, CHOSEN_ERROR, at.speed))
    gap = angle / t.ratio - pure_error(angle, CHOSEN_ERROR) - flexible - at.run.load_position
    return float(np.std(gap))


def _drag(at: AtSpeed, c: Laws) -> float:
    """Give the torque that a steady turn of the load takes, N*m."""
    load = at.speed / c.N
    return c.B_l * load + c.s * c.B_ml * (at.speed + c.s * load)

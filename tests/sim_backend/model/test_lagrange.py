"""The two-mass model: against Lagrange's equations by numbers, against other integrators, and its energy."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sim_backend.errors import ModelError
from sim_backend.model import lagrange
from sim_backend.model.dc_motor import RPM, TABLE_2, motor_from_speeds, steady_speed
from sim_backend.model.driven import (
    flexible_series,
    laws,
    run_driven,
    steady_start,
    torque_driven,
)
from sim_backend.model.error_parts import error_parts, flexible_share
from sim_backend.model.fourier_error import FourierError, pure_error, pure_error_slope
from sim_backend.model.parameters import Rotation
from sim_backend.model.transmission import hdc_40
from tests.sim_backend.model.by_voltage import voltage_driven

SERIES = FourierError(
    a0=1e-3,
    a=(2e-5, -9e-5, 4e-6, 1e-5, -2e-6, 3e-6, 1e-6),
    b=(-3e-5, 1.8e-4, 5e-6, -3e-5, 2e-6, 1e-6, -2e-6),
)
NO_ERROR = FourierError(0.0, (0.0,), (0.0,))
ORDER_2 = FourierError(0.0, (0.0, 0.0), (0.0, 2.0e-4))
BOTH = pytest.mark.parametrize("rotation", list(Rotation))


def states(count: int = 50) -> np.ndarray:
    """Random theta_m, theta_m', theta_l, theta_l' whose spring is bent by some 1e-3 rad."""
    rng = np.random.default_rng(1)
    theta_m, omega_m = rng.uniform(-20.0, 20.0, count), rng.uniform(-150.0, 150.0, count)
    theta_l, omega_l = theta_m / 50.0 + rng.normal(0.0, 1e-3, count), rng.uniform(-3.0, 3.0, count)
    return np.column_stack([theta_m, omega_m, theta_l, omega_l])


def slope_of(function, at: float, step: float) -> float:
    """Derivative by differences of fourth order."""
    near, far = function(at + step) - function(at - step), function(at + 2 * step) - function(at - 2 * step)
    return (8.0 * near - far) / (12.0 * step)


@BOTH
def test_the_accelerations_are_those_of_lagranges_equations_for_the_energies_and_the_dissipation(rotation):
    """(13) and (14) with T, V and D differentiated by numbers."""
    c, k = laws(hdc_40(rotation)), SERIES.coefficients
    for theta_m, omega_m, theta_l, omega_l in states():
        tau_m, tau_l = 0.3, -4.0
        force_m = tau_m - slope_of(lambda x: lagrange.potential_energy(x, theta_l, k, c), theta_m, 1e-3)  # noqa: B023
        force_l = tau_l - slope_of(lambda x: lagrange.potential_energy(theta_m, x, k, c), theta_l, 1e-3)  # noqa: B023
        force_m -= slope_of(lambda v: lagrange.dissipation(theta_m, v, omega_l, k, c), omega_m, 1.0)  # noqa: B023
        force_l -= slope_of(lambda v: lagrange.dissipation(theta_m, omega_m, v, k, c), omega_l, 1.0)  # noqa: B023
        momentum_m = slope_of(lambda v: lagrange.kinetic_energy(v, omega_l, c), 1.0, 0.1)  # noqa: B023
        momentum_l = slope_of(lambda v: lagrange.kinetic_energy(omega_m, v, c), 1.0, 0.1)  # noqa: B023
        found = lagrange.accelerations(theta_m, omega_m, theta_l, omega_l, tau_m, tau_l, k, c)
        assert found == pytest.approx((force_m / momentum_m, force_l / momentum_l), rel=1e-7, abs=1e-5)


@BOTH
def test_power_in_is_stored_or_lost_at_every_state(rotation):
    c, k = laws(hdc_40(rotation)), SERIES.coefficients
    for theta_m, omega_m, theta_l, omega_l in states():
        tau_m, tau_l = -0.2, 3.0
        alpha_m, alpha_l = lagrange.accelerations(theta_m, omega_m, theta_l, omega_l, tau_m, tau_l, k, c)
        error, slope = lagrange.error_and_slope(theta_m, k)
        e, rate = theta_l - theta_m / c.N + error, omega_l + (slope - 1.0 / c.N) * omega_m
        stored = c.J * omega_m * alpha_m + c.J_l * omega_l * alpha_l + c.K * e * rate
        loss = lagrange.dissipation(theta_m, omega_m, omega_l, k, c)
        assert loss >= 0.0
        # the terms reach 100 W
        assert stored == pytest.approx(tau_m * omega_m + tau_l * omega_l - 2.0 * loss, abs=1e-10)


def test_energy_is_conserved_without_friction_and_falls_by_the_loss_with_it():
    for transmission in (
        dataclasses.replace(hdc_40(), motor_damping=0.0, bearing_damping=0.0, mesh_damping=0.0, load_damping=0.0),
        hdc_40(),
    ):
        c, k = laws(transmission), SERIES.coefficients
        rates = torque_driven(transmission, SERIES, lambda t: 0.0, lambda t: 0.0)

        def with_loss(t, y, rates=rates, c=c):
            return [*rates(t, y[:4]), 2.0 * lagrange.dissipation(y[0], y[1], y[3], SERIES.coefficients, c)]

        start = [0.0, 20.0, 1e-4, 0.0, 0.0]
        end = solve_ivp(with_loss, (0.0, 0.1), start, method="DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
        energies = [
            lagrange.kinetic_energy(y[1], y[3], c) + lagrange.potential_energy(y[0], y[2], k, c) for y in (start, end)
        ]
        assert energies[1] + end[4] == pytest.approx(energies[0], rel=1e-8)
        assert (end[4] == 0.0) == (transmission.motor_damping == 0.0)


def test_the_scalar_series_is_the_series():
    angles = np.linspace(-30.0, 30.0, 101)
    found = np.array([lagrange.error_and_slope(angle, SERIES.coefficients) for angle in angles.tolist()])
    assert found[:, 0] == pytest.approx(pure_error(angles, SERIES), abs=1e-16)
    assert found[:, 1] == pytest.approx(pure_error_slope(angles, SERIES), abs=1e-15)


def test_the_slope_of_the_error_drives_the_motor_with_its_share_of_the_transmitted_torque():
    """Held load: the ripple of the motor's acceleration is -K e dtheta_p/dtheta_m, which no linear model has."""
    c = laws(hdc_40())
    for angle in (0.1, 0.9, 2.0):
        flat, _ = lagrange.accelerations(angle, 0.0, 1e-3, 0.0, 0.0, 0.0, NO_ERROR.coefficients, c)
        error, slope = lagrange.error_and_slope(angle, ORDER_2.coefficients)
        with_error, _ = lagrange.accelerations(angle, 0.0, 1e-3 - error, 0.0, 0.0, 0.0, ORDER_2.coefficients, c)
        assert abs(slope) > 1e-5
        assert (with_error - flat) * c.J == pytest.approx(-c.K * (1e-3 - angle / c.N) * slope, rel=1e-9)


# ---- runs


@pytest.fixture(scope="module")
def motor():
    return motor_from_speeds(TABLE_2[1:], hdc_40().drag)


def test_the_runge_kutta_run_agrees_with_an_independent_integration_and_has_fourth_order(motor):
    t = hdc_40(Rotation.OPPOSED)
    start = [0.2, 10.0, 1e-4, 0.0, 0.0]
    reference = solve_ivp(
        voltage_driven(t, SERIES, motor, 6.5, 1.5), (0.0, 0.05), start, method="DOP853", rtol=1e-12, atol=1e-14
    ).y[:, -1]
    errors = []
    for step in (2e-5, 1e-5, 5e-6):
        run = run_driven(t, SERIES, motor, 6.5, 0.05, load_torque=1.5, step=step, start=np.array(start))
        errors.append(abs(run.load_position[-1] - reference[2]))
        assert run.load_velocity[-1] == pytest.approx(reference[3], abs=1e-3 * step / 2e-5)
        assert run.current[-1] == pytest.approx(reference[4], rel=1e-5)
    # the load swings by 3.5 mrad: (w h)^5/120 = 2e-8 of it a step, over 2500 steps
    assert errors[0] < 5e-5 * 3.5e-3
    assert errors[0] / errors[1] > 14.0
    assert errors[1] / errors[2] > 14.0


def test_compiled_and_plain_python_agree(motor):
    runs = [run_driven(hdc_40(), SERIES, motor, 12.0, 0.02, compiled=compiled) for compiled in (True, False)]
    for a, b in zip(*runs, strict=True):
        assert a == pytest.approx(b, rel=1e-9, abs=1e-12)


@BOTH
def test_a_steady_start_is_steady(rotation):
    """Nothing of the mode at 602 Hz is struck: a record of 0.2 s is that of the same angles 5 s later."""
    t = hdc_40(rotation)
    motor = motor_from_speeds(TABLE_2[1:], t.drag)
    run = run_driven(t, SERIES, motor, 24.0, 6.0)
    assert run.motor_velocity == pytest.approx(steady_speed(motor, 24.0, t.drag), rel=1e-4)
    flexible = error_parts(run.motor_position, run.load_position, t.ratio, SERIES).flexible
    assert np.ptp(flexible[:200]) == pytest.approx(np.ptp(flexible[-200:]), rel=1e-3)
    assert run.motor_torque.mean() == pytest.approx(t.drag * run.motor_velocity.mean(), rel=1e-3)


@pytest.mark.parametrize("rpm", [310, 560, 840, 1120])
def test_the_flexible_part_is_the_inertia_of_the_load_on_the_spring(rpm, motor):
    """theta_s/dtheta = (2 omega)^2 J_l / K for order 2; damping changes it by 1e-4 of itself."""
    t = hdc_40()
    voltage = rpm * RPM / steady_speed(motor, 1.0, t.drag)
    run = run_driven(t, ORDER_2, motor, voltage, 1.0)
    parts = error_parts(run.motor_position, run.load_position, t.ratio, ORDER_2)
    assert flexible_share(parts) == pytest.approx((2.0 * rpm * RPM) ** 2 * 5e-4 / 7160.0, rel=2e-3)
    # 1000 samples of 10 turns: every extremum is met within 0.2 %
    expected = flexible_series(t, ORDER_2, rpm * RPM)
    assert np.ptp(parts.flexible) == pytest.approx(2.0 * expected.amplitudes[1], rel=3e-3)


def test_a_light_spring_meets_its_resonance_and_the_damping_bounds_it():
    t = dataclasses.replace(hdc_40(), load_inertia=0.5, load_damping=5.0)
    at_resonance = flexible_series(t, ORDER_2, t.load_mode / 2.0).amplitudes[1]
    # K/(B w): 7160 / (5 * 119.7), with the order's own unity in quadrature
    assert at_resonance / 2e-4 == pytest.approx(7160.0 / (5.0 * t.load_mode), rel=0.02)


def test_the_parts_of_the_error_add_up():
    angle = np.linspace(0.0, 12.0, 400)
    load = angle / 50.0 - pure_error(angle, SERIES) - 3e-6
    parts = error_parts(angle, load, 50.0, SERIES)
    assert parts.pure + parts.flexible == pytest.approx(parts.total, abs=1e-18)
    assert parts.flexible == pytest.approx(np.full(400, 3e-6), abs=1e-15)


@BOTH
def test_a_torque_on_the_load_twists_the_spring_by_itself_over_the_stiffness(rotation):
    t = hdc_40(rotation)
    rates = torque_driven(t, NO_ERROR, lambda _: -2.0 / 50.0, lambda _: 2.0)
    assert rates(0.0, [0.0, 0.0, 2.0 / 7160.0, 0.0]) == pytest.approx([0.0, 0.0, 0.0, 0.0], abs=1e-9)
    assert lagrange.transmitted_torque(0.0, 0.0, 2.0 / 7160.0, 0.0, NO_ERROR.coefficients, laws(t)) == pytest.approx(
        -2.0
    )


def test_the_bearing_turns_with_the_difference_of_the_speeds_as_the_sense_has_it():
    only = {"motor_damping": 0.0, "mesh_damping": 0.0, "load_damping": 0.0}
    for rotation, loss in ((Rotation.SAME, 48.0**2), (Rotation.OPPOSED, 52.0**2)):
        t = dataclasses.replace(hdc_40(rotation), **only)
        found = 2.0 * lagrange.dissipation(0.0, 50.0, 2.0, NO_ERROR.coefficients, laws(t))
        assert found == pytest.approx(1.3e-5 * loss, rel=1e-12)


@pytest.mark.parametrize(
    ("name", "value", "equation"),
    [
        ("motor_inertia", 0.0, r"kg\*m\^2; \(15\) needs it"),
        ("load_inertia", math.nan, r"\(16\)"),
        ("bearing_damping", -1e-9, r"N\*m\*s/rad; \(12\)"),
        ("stiffness", -7160.0, r"N\*m/rad; \(10\)"),
        ("ratio", 0.5, r"at least 1; \(8\)"),
    ],
)
def test_a_transmission_that_cannot_be_is_refused_with_the_equation(name, value, equation):
    with pytest.raises(ModelError, match=f"{name} = {value!r}.*{equation}"):
        dataclasses.replace(hdc_40(), **{name: value})


def test_a_run_that_cannot_be_is_refused(motor):
    with pytest.raises(ModelError, match=r"step = 0.0001 s is not possible.*at most 3\.96"):
        run_driven(hdc_40(), SERIES, motor, 6.5, 1.0, step=1e-4)
    with pytest.raises(ModelError, match="whole multiple"):
        run_driven(hdc_40(), SERIES, motor, 6.5, 1.0, period=1e-4, step=3e-5)
    with pytest.raises(ModelError, match="duration = 0"):
        run_driven(hdc_40(), SERIES, motor, 6.5, 0.0)


def test_the_start_holds_at_any_angle(motor):
    t = hdc_40()
    run = run_driven(t, SERIES, motor, 12.0, 0.3, start=steady_start(t, SERIES, motor, 12.0, angle=2.5))
    flexible = error_parts(run.motor_position, run.load_position, t.ratio, SERIES).flexible
    expected = flexible_series(t, SERIES, 560.0 * RPM)
    at = pure_error(run.motor_position, expected)
    assert flexible - flexible.mean() == pytest.approx(at - at.mean(), abs=5e-3 * np.ptp(at))

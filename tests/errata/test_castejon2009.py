"""What Castejon, Garcia-Prada & Lara 2009 print wrongly: the shipped form is right, the printed one fails.

The printed forms are written here; `rig papers castejon2009` has (28) to (31) and (35) as printed, too, to give their
poles. docs/errata.md lists the mistakes.
"""

import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from rig.papers.castejon2009.spectra import line_order
from sim_backend.model import lagrange
from sim_backend.model.dc_motor import RPM, TABLE_2, motor_from_speeds, steady_speed, voltage_for
from sim_backend.model.driven import flexible_series, laws, run_driven, torque_driven
from sim_backend.model.error_parts import error_parts
from sim_backend.model.fourier_error import FourierError, identify, pure_error
from sim_backend.model.parameters import Rotation
from sim_backend.model.state_space import state_space
from sim_backend.model.transmission import Transmission, hdc_40

HDC = hdc_40(Rotation.OPPOSED)
"""Table 1 in the sense of (12) as printed."""
J_M, J_L, B_M, B_ML, B_SP, B_L, K, N = 2.9e-4, 5.0e-4, 1.7e-4, 1.3e-5, 1.0e-4, 5.0e-4, 7160.0, 50.0
SERIES = FourierError(0.0, (2e-5, -9e-5, 0.0, 1e-5, 0.0, 0.0, 0.0), (-3e-5, 1.8e-4, 0.0, -3e-5, 0.0, 0.0, 0.0))
NO_ERROR = FourierError(0.0, (0.0,), (0.0,))
ORDER_2 = FourierError(0.0, (0.0, 0.0), (0.0, 2.0e-4))
MOTOR = motor_from_speeds(TABLE_2[1:], HDC.drag)


def poles(matrix: np.ndarray) -> np.ndarray:
    return np.linalg.eigvals(matrix)


def mode(values: np.ndarray) -> float:
    return float(np.max(values.imag)) / (2.0 * math.pi)


def slowest(values: np.ndarray) -> float:
    """The real pole that is not zero."""
    return float(values.real[(np.abs(values.imag) < 1.0) & (np.abs(values) > 1e-6)][0])


def printed_29_31(t: float, x: np.ndarray, v: float, speed: float) -> list[float]:
    """(28)-(31): states theta_l, theta_l', theta_p, theta_m'; inputs v = tau_m and w = theta_m = speed t."""
    x1, x2, x3, x4 = x
    w, crossed = speed * t, B_ML - B_SP / N
    load = -K * x1 - (B_L + B_ML + B_SP) * x2 - K * x3 - crossed * x4 + v * N + K * w / N
    motor = K / N * x1 - crossed * x2 + K / N * x3 - (B_M + B_ML + B_SP / N**2) * x4 - K / N**2 * w + v
    return [x2, load / J_L, 0.0, motor / J_M]


def printed_after(seconds: float, speed: float, v: float, start: list[float]) -> np.ndarray:
    """State of (28)-(31) a while after `start`, for w = speed t; theta_l counts from w/N, so that time drops out."""
    affine = np.zeros((5, 5))
    affine[:4, :4] = np.column_stack([printed_29_31(0.0, unit, 0.0, 0.0) for unit in np.eye(4)])
    affine[:4, 4] = printed_29_31(0.0, np.zeros(4), v, 0.0)
    affine[0, 4] = -speed / N
    return (expm(affine * seconds) @ [*start, 1.0])[:4]


# ---- energies and inertias


def test_the_potential_energy_of_10_is_negative_and_would_push_the_load_away():
    c, k = laws(HDC), NO_ERROR.coefficients
    bend, step = 1e-3, 1e-6
    # integral of K sigma from -theta_s to 0
    printed = -0.5 * K * bend**2
    assert lagrange.potential_energy(0.0, bend, k, c) == pytest.approx(-printed)
    rise = lagrange.potential_energy(0.0, bend + step, k, c) - lagrange.potential_energy(0.0, bend - step, k, c)
    _, alpha = lagrange.accelerations(0.0, 0.0, bend, 0.0, 0.0, 0.0, k, c)
    assert alpha * J_L == pytest.approx(-rise / (2.0 * step), rel=1e-6)
    assert alpha < 0.0
    # (14) with the printed V has the load run away at 3784 1/s
    runaway = poles(np.array([[0.0, 1.0], [K / J_L, -(B_L + B_ML + B_SP) / J_L]]))
    assert np.max(runaway.real) == pytest.approx(3784.0, abs=1.0)


def test_the_wave_generator_s_inertia_counts_in_the_equations_as_in_the_energy():
    c = laws(HDC)
    assert pytest.approx(2.9e-4 + 1.6e-4) == c.J
    alpha, _ = lagrange.accelerations(0.0, 0.0, 0.0, 0.0, 1.0, 0.0, NO_ERROR.coefficients, c)
    assert alpha == pytest.approx(1.0 / 4.5e-4)
    shipped = poles(state_space(HDC).A)
    printed = poles(state_space(dataclasses.replace(HDC, wave_generator_inertia=0.0)).A)
    assert (mode(shipped), mode(printed)) == pytest.approx((602.4, 602.5), abs=0.05)
    assert (slowest(shipped), slowest(printed)) == pytest.approx((-0.408, -0.633), abs=5e-4)


@pytest.mark.parametrize("rotation", list(Rotation))
def test_the_stiffness_of_the_load_acts_as_the_torsional_stiffness_of_the_drive(rotation):
    """A static torque on the load twists the drive by itself over K; the catalogue of this size is 14 times stiffer."""
    model = state_space(hdc_40(rotation))
    torque = 2.0
    bent = np.array([torque / K, 0.0, 0.0, 0.0])
    assert model.A @ bent + model.B @ [-torque / N, torque, 0.0] == pytest.approx(np.zeros(4), abs=1e-9)
    # with the catalogue's stiffness the mode is where the root of 14 puts it
    stiff, shipped = (poles(state_space(dataclasses.replace(HDC, stiffness=k)).A) for k in (1.0e5, K))
    assert mode(stiff) / mode(shipped) == pytest.approx(math.sqrt(14.0), rel=5e-3)


def test_the_bearing_of_a_drive_that_turns_the_same_way_does_not_brake_a_common_turn():
    """(8) has theta_l = theta_m/N, (12) keeps theta_m' + theta_l' of the opposed sense."""
    bearing_alone = {"motor_damping": 0.0, "mesh_damping": 0.0, "load_damping": 0.0}
    same = dataclasses.replace(hdc_40(Rotation.SAME), **bearing_alone)
    assert lagrange.dissipation(0.0, 10.0, 10.0, NO_ERROR.coefficients, laws(same)) == 0.0
    printed = 0.5 * B_ML * (10.0 + 10.0) ** 2
    opposed = dataclasses.replace(HDC, **bearing_alone)
    assert lagrange.dissipation(0.0, 10.0, 10.0, NO_ERROR.coefficients, laws(opposed)) == pytest.approx(printed)
    assert printed > 0.0


# ---- identification


def test_the_sine_coefficients_of_19_are_pi_times_too_large():
    angle = np.linspace(0.0, 4.0 * math.pi, 2001)
    error = pure_error(angle, SERIES)
    shipped = identify(angle, error)
    assert shipped.b == pytest.approx(SERIES.b, abs=1e-9)
    turn = angle <= 2.0 * math.pi + 1e-9
    printed = float(np.trapezoid(error[turn] * np.sin(2.0 * angle[turn]), angle[turn]))
    assert printed / SERIES.b[1] == pytest.approx(3.14, abs=5e-3)
    # with it the pure error is not even that of the record from which it was taken
    rebuilt = dataclasses.replace(shipped, b=tuple(math.pi * b for b in shipped.b))
    assert np.std(pure_error(angle, rebuilt) - error) > 1.5 * np.std(error)
    assert np.std(pure_error(angle, shipped) - error) < 1e-3 * np.std(error)


def test_the_pure_error_is_geometry_and_no_friction():
    """Section 3.1 has it contain all friction terms: with ten times the damping it comes out the same."""
    rough = dataclasses.replace(
        HDC, motor_damping=10 * B_M, bearing_damping=10 * B_ML, mesh_damping=10 * B_SP, load_damping=10 * B_L
    )
    found = []
    for t in (HDC, rough):
        run = run_driven(t, SERIES, MOTOR, voltage_for(MOTOR, 31.0 * RPM, t.drag), 4.0)
        found.append(identify(run.motor_position, run.motor_position / t.ratio - run.load_position))
    # what is left is the flexible part: B w/K = 5e-3 * 6.5 / 7160 = 5e-6 of 0.2 mrad
    assert found[1].coefficients[1:] == pytest.approx(found[0].coefficients[1:], rel=0.0, abs=2e-9)
    assert found[1].coefficients[1:] == pytest.approx(SERIES.coefficients[1:], rel=0.0, abs=3e-9)


# ---- the linear model


def test_the_motor_s_torque_on_the_load_would_count_its_energy_twice():
    """(27), (29), (36): with v N on the load the system gains what the motor gives once more."""
    c, k = laws(HDC), NO_ERROR.coefficients
    speed = 310.0 * RPM
    tau = HDC.drag * speed
    bend = -(B_L * speed / N + B_ML * speed * (1.0 + 1.0 / N)) / K
    state = (0.0, speed, bend, speed / N)

    def gained(alpha_m: float, alpha_l: float) -> float:
        """Power stored and lost; B_sp rests, the spring keeps its length."""
        return (
            c.J * speed * alpha_m + J_L * speed / N * alpha_l + 2.0 * lagrange.dissipation(0.0, speed, speed / N, k, c)
        )

    shipped = lagrange.accelerations(*state, tau, 0.0, k, c)
    assert gained(*shipped) == pytest.approx(tau * speed, rel=1e-9)
    printed = (shipped[0], shipped[1] + N * tau / J_L)
    assert gained(*printed) / (tau * speed) == pytest.approx(2.0, rel=1e-9)


@pytest.mark.parametrize(("rpm", "windup"), [(310, 4.15e-5), (560, 7.5e-5), (840, 1.12e-4), (1120, 1.50e-4)])
def test_the_double_count_winds_the_spring_up_for_nothing(rpm, windup):
    """(28)-(31) with the torque v that the motor's damping needs: nothing pulls on the load, but the spring is bent."""
    speed = rpm * RPM
    turning = [0.0, speed / N, 0.0, speed]
    bend, idle = (printed_after(30.0, speed, v, turning)[0] for v in ((B_M + B_ML) * speed, 0.0))
    assert bend - idle == pytest.approx(windup, rel=1e-2)
    run = run_driven(HDC, NO_ERROR, MOTOR, voltage_for(MOTOR, speed, HDC.drag), 0.1)
    shipped = error_parts(run.motor_position, run.load_position, N, NO_ERROR).flexible
    assert abs(shipped.mean()) < 4e-3 * windup


def test_with_the_motor_s_angle_as_an_input_its_speed_is_another_one():
    """(26)-(31): w = theta_m turns on while the state x4 = theta_m' comes to rest."""
    speed, seconds = 30.0, 8.0
    end = printed_after(seconds, speed, 0.0, [0.0, speed / N, 0.0, speed])
    assert end[1] == pytest.approx(speed / N, rel=1e-2)
    assert end[3] == pytest.approx(speed * math.exp(-0.632 * seconds), abs=0.01 * speed)
    model = state_space(HDC)
    assert model.A[2] == pytest.approx([0.0, 0.0, 0.0, 1.0])
    assert np.all(model.B[2] == 0.0)


def test_a_pure_error_that_rests_in_the_state_leaves_nothing_that_grows_with_speed():
    """(30): x3' = 0. However they start, (28)-(31) end with the load at rest against w/N, at every speed."""
    for rpm in (310, 1120):
        speed = rpm * RPM
        struck = [0.0, speed / N, 2.0e-4, speed]
        quarters = [30.0 + k * 0.25 * math.pi / speed for k in range(4)]
        bends = [printed_after(seconds, speed, 0.0, struck)[0] for seconds in quarters]
        assert np.ptp(bends) < 1e-9
        # x3 is all that it is off by, but for the load's damping
        assert np.mean(bends) == pytest.approx(-2.0e-4, abs=2e-6)
    spans = []
    for rpm in (310, 1120):
        run = run_driven(HDC, ORDER_2, MOTOR, voltage_for(MOTOR, rpm * RPM, HDC.drag), 1.0)
        spans.append(np.ptp(error_parts(run.motor_position, run.load_position, N, ORDER_2).flexible))
    assert spans[1] / spans[0] == pytest.approx((1120 / 310) ** 2, rel=0.01)


def test_the_slope_of_the_pure_error_that_15_has_and_31_lost_ripples_the_motor_s_speed():
    run = run_driven(HDC, ORDER_2, MOTOR, 24.0, 1.0)
    # the load's inertia through the ratio and through the slope 4e-4: -K e p
    flexible = flexible_series(HDC, ORDER_2, 1120.0 * RPM)
    flat = run_driven(HDC, NO_ERROR, MOTOR, 24.0, 1.0)
    assert np.ptp(flat.motor_velocity) < 1e-9
    ripple = K * flexible.amplitudes[1] / N
    # against the rotor's inertia and the current that the ripple drives through the winding
    w = 2.0 * 1120.0 * RPM
    winding = MOTOR.constant**2 / (MOTOR.resistance + 1j * w * MOTOR.inductance)
    held = abs(1j * w * 4.5e-4 + HDC.drag + winding)
    steady = run.motor_velocity[200:]
    assert np.ptp(steady) == pytest.approx(2.0 * ripple / held, rel=0.01)
    assert np.ptp(steady) > 2e-3


def test_the_printed_matrix_35_is_unstable_and_the_shipped_one_is_not():
    crossed = B_ML - B_SP / N
    printed = np.array(
        [
            [0.0, 1.0, 0.0, 0.0],
            [-K / J_L, (B_L + B_ML + B_SP) / J_L, -K / J_L, crossed / J_L],
            [0.0, 0.0, 0.0, 0.0],
            [-K / J_M, crossed / J_M, -K / J_M, (B_M + B_ML + B_SP / N**2) / J_M],
        ]
    )
    found = poles(printed)
    assert sorted(found.real) == pytest.approx([0.0, 0.593, 0.632, 0.632], abs=5e-4)
    assert np.max(found.imag) == pytest.approx(3784.2, abs=0.05)
    # (29), (31) as they are written: stable
    by_equations = np.column_stack([printed_29_31(0.0, unit, 0.0, 0.0) for unit in np.eye(4)])
    assert np.max(poles(by_equations).real) < 1e-9
    assert mode(poles(by_equations)) == pytest.approx(602.3, abs=0.05)
    for rotation in Rotation:
        assert np.max(poles(state_space(hdc_40(rotation)).A).real) < 1e-9


def test_the_motor_s_torque_enters_the_load_nowhere_in_the_shipped_input_matrix():
    """(36) prints N/J_l there, as (29) does; its fourth row agrees with (31)."""
    printed = np.array([[0.0, 0.0], [N / J_L, K / (N * J_L)], [0.0, 0.0], [1.0 / J_M, -K / (N**2 * J_M)]])
    rest = np.zeros(4)
    by_equations = np.column_stack([printed_29_31(0.0, rest, 1.0, 0.0), printed_29_31(1.0, rest, 0.0, 1.0)])
    assert by_equations == pytest.approx(printed)
    # a motor that pushes on a load at rest would throw it forward before its spring is bent
    thrown = printed_after(1e-6, 0.0, 1.0, [0.0] * 4)
    assert thrown[1] / 1e-6 == pytest.approx(1e5, rel=1e-3)
    _, alpha = lagrange.accelerations(0.0, 0.0, 0.0, 0.0, 1.0, 0.0, NO_ERROR.coefficients, laws(HDC))
    assert alpha == 0.0
    B = state_space(HDC).B
    assert B[1, 0] == 0.0
    assert B[1, 1] == pytest.approx(1.0 / J_L)
    assert B[3, 0] == pytest.approx(1.0 / 4.5e-4)


def test_the_outputs_are_listed_as_angle_and_torque_and_the_torque_has_dynamics():
    """(39), (40) print [torque; angle] with torque = N v: a load that pulls on a resting motor would not be felt."""
    model = state_space(HDC)
    printed_C = np.array([[0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]])
    printed_D = np.array([[N, 0.0], [0.0, 0.0]])
    pulled = np.array([2.0 / K, 0.0, 0.0, 0.0])
    assert model.C @ pulled == pytest.approx([2.0 / K, -2.0])
    assert printed_C @ pulled + printed_D @ [0.0, 0.0] == pytest.approx([0.0, 2.0 / K])
    # a step of the motor's torque reaches the load only with the spring's wave: T/2 of the mode until the peak
    rates = torque_driven(HDC, NO_ERROR, lambda _: 1.0, lambda _: 0.0)
    times = np.linspace(0.0, 1.0 / 602.4, 101)
    found = solve_ivp(rates, (0.0, times[-1]), [0.0] * 4, t_eval=times, rtol=1e-9, atol=1e-13).y
    transmitted = model.C[1] @ found[[2, 3, 0, 1]]
    assert transmitted[0] == 0.0
    assert abs(int(np.argmax(transmitted)) - 50) <= 1
    # and its mean is what accelerates the load, 4.4e-4 of N tau_m
    assert np.max(transmitted) < 1e-3 * N


# ---- results


def test_the_line_at_twice_the_speed_is_the_series_that_was_put_in():
    for order in (2, 3):
        a = tuple(2e-4 if n == order else 0.0 for n in (1, 2, 3))
        series = FourierError(0.0, a, (0.0, 0.0, 0.0))
        run = run_driven(HDC, series, MOTOR, 12.0, 2.0)
        total = error_parts(run.motor_position, run.load_position, N, series).total
        assert line_order(run.motor_position, total) == pytest.approx(order, abs=1e-3)


def test_an_error_of_2_to_3_hundredths_of_a_radian_contradicts_the_paper_s_own_accuracy():
    printed = np.array([0.02, 0.03])
    accuracy = math.radians(0.08)
    assert printed / accuracy == pytest.approx([14.3, 21.5], abs=0.05)
    assert np.degrees(printed) * 60.0 == pytest.approx([68.75, 103.1], abs=0.05)
    run = run_driven(HDC, SERIES, MOTOR, 24.0, 1.0)
    shipped = error_parts(run.motor_position, run.load_position, N, SERIES).total
    assert np.ptp(shipped) < accuracy


def test_a_flexible_part_of_5_percent_at_310_rpm_does_not_come_out_of_table_1():
    run = run_driven(HDC, ORDER_2, MOTOR, voltage_for(MOTOR, 310.0 * RPM, HDC.drag), 1.0)
    parts = error_parts(run.motor_position, run.load_position, N, ORDER_2)
    assert np.ptp(parts.flexible) / np.ptp(parts.total) == pytest.approx(3e-4, rel=0.03)

    def share(t: Transmission) -> float:
        return flexible_series(t, ORDER_2, 310.0 * RPM).amplitudes[1] / 2.0e-4

    heavy = dataclasses.replace(HDC, load_inertia=0.081)
    assert share(heavy) == pytest.approx(0.05, rel=5e-3)
    assert heavy.load_mode / (2.0 * math.pi) == pytest.approx(47.0, abs=0.5)


def test_310_rpm_do_not_lie_on_the_line_of_the_other_voltages():
    for voltage, speed in TABLE_2[1:]:
        assert steady_speed(MOTOR, voltage, HDC.drag) == pytest.approx(speed)
    assert steady_speed(MOTOR, 6.5, HDC.drag) / RPM == pytest.approx(303.3, abs=0.05)
    assert voltage_for(MOTOR, 310.0 * RPM, HDC.drag) == pytest.approx(6.64, abs=5e-3)

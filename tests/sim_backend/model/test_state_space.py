"""The linear state-space model: the linearisation of the non-linear one, its eigenvalues and its outputs."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.optimize import brentq

from sim_backend.model import lagrange
from sim_backend.model.driven import flexible_series, laws, torque_driven
from sim_backend.model.fourier_error import FourierError, pure_error_slope
from sim_backend.model.parameters import Rotation
from sim_backend.model.state_space import INPUTS, OUTPUTS, STATES, state_space
from sim_backend.model.transmission import hdc_40

NO_ERROR = FourierError(0.0, (0.0,), (0.0,))
ORDER = (2, 3, 0, 1)
"""Where theta_l, theta_l', theta_m, theta_m' are in the state of the non-linear model."""
BOTH = pytest.mark.parametrize("rotation", list(Rotation))


def jacobian(function, at: np.ndarray, steps: np.ndarray) -> np.ndarray:
    columns = []
    for k, step in enumerate(steps):
        shift = np.zeros_like(at)
        shift[k] = step
        columns.append((np.array(function(at + shift)) - np.array(function(at - shift))) / (2.0 * step))
    return np.column_stack(columns)


def nonlinear(rotation: Rotation, series: FourierError):
    """Rates of x = [theta_l, theta_l', theta_m, theta_m'] as a function of x and u, whose theta_p is added to a_0/2."""

    def rates(z):
        x, (tau_m, tau_l, error) = z[:4], z[4:]
        moved = dataclasses.replace(series, a0=series.a0 + 2.0 * error)
        f = torque_driven(hdc_40(rotation), moved, lambda _: tau_m, lambda _: tau_l)
        found = f(0.0, [x[2], x[3], x[0], x[1]])
        return np.array(found)[list(ORDER)]

    return rates


@BOTH
@pytest.mark.parametrize("series", [NO_ERROR, FourierError(2e-4, (1e-5, -4e-5), (3e-5, 1.9e-4))], ids=["none", "some"])
def test_the_matrices_are_the_linearisation_of_the_nonlinear_model(rotation, series):
    """At rest without load, at an angle where the error has no slope: there nothing was dropped."""
    angle = brentq(lambda x: float(pure_error_slope(np.array(x), series)), 0.5, 2.0) if series.a0 else 0.3
    error, slope = lagrange.error_and_slope(angle, series.coefficients)
    assert abs(slope) < 1e-12
    at = np.array([angle / 50.0 - error, 0.0, angle, 0.0, 0.0, 0.0, 0.0])
    steps = np.array([1e-4, 1.0, 1e-4, 1.0, 1.0, 1.0, 1e-4])
    found = jacobian(nonlinear(rotation, series), at, steps)
    model = state_space(hdc_40(rotation))
    # with an error the spring's force on the motor changes its arm by 1e-4 * d2theta_p: 1e-8 of the stiffness
    scale = np.max(np.abs(model.A), axis=1, keepdims=True)
    assert np.max(np.abs(found[:, :4] - model.A) / scale) < 1e-6
    scale = np.max(np.abs(model.B), axis=1, keepdims=True) + 1e-300
    assert np.max(np.abs(found[:, 4:] - model.B) / scale) < 1e-6


@BOTH
def test_the_outputs_are_the_load_angle_and_what_spring_and_damper_transmit(rotation):
    c, model = laws(hdc_40(rotation)), state_space(hdc_40(rotation))
    rng = np.random.default_rng(2)
    for _ in range(20):
        x, error = rng.normal(0.0, [1.0, 3.0, 50.0, 100.0]), rng.normal(0.0, 1e-3)
        series = dataclasses.replace(NO_ERROR, a0=2.0 * error)
        y = model.C @ x + model.D @ [0.3, -1.0, error]
        torque = lagrange.transmitted_torque(x[2], x[3], x[0], x[1], series.coefficients, c)
        assert y == pytest.approx([x[0], torque], rel=1e-9)


def test_shapes_follow_the_names():
    model = state_space(hdc_40())
    assert model.A.shape == (len(STATES), len(STATES))
    assert model.B.shape == (len(STATES), len(INPUTS))
    assert model.C.shape == (len(OUTPUTS), len(STATES))
    assert model.D.shape == (len(OUTPUTS), len(INPUTS))


@BOTH
def test_a_model_without_springs_to_the_ground_has_one_free_motion_and_otherwise_decays(rotation):
    poles = np.sort_complex(np.linalg.eigvals(state_space(hdc_40(rotation)).A))
    assert np.max(poles.real) < 1e-9
    assert np.sum(np.abs(poles) < 1e-9) == 1
    # two masses on a spring: K (1/J_l + 1/(N^2 J))
    frequency = math.sqrt(7160.0 * (1.0 / 5e-4 + 1.0 / (2500.0 * 4.5e-4))) / (2.0 * math.pi)
    assert np.max(np.abs(poles.imag)) / (2.0 * math.pi) == pytest.approx(frequency, rel=1e-6)
    # the drag of the steady run brakes both inertias
    rigid = hdc_40(rotation).drag / (4.5e-4 + 5e-4 / 2500.0)
    assert np.min(np.abs(poles + rigid)) < 2e-4 * rigid


def test_the_flexible_part_at_a_constant_speed_is_the_transfer_function_from_the_error():
    """With the motor held to its speed, the error drives the load alone: theta_s = -theta_l - theta_p."""
    t = hdc_40()
    model = state_space(t)
    # mesh damping acts on the rate of the error, too, which the linear model of the paper drops: B_sp w / K = 1e-6
    # beside 3e-4 at the lowest speed
    for speed in (32.0, 117.0, 1000.0):
        load = np.linalg.solve(2j * speed * np.eye(2) - model.A[:2, :2], model.B[:2, 2])
        flexible = flexible_series(t, FourierError(0.0, (0.0, 1.0), (0.0, 0.0)), speed)
        found = complex(flexible.a[1], -flexible.b[1])
        assert found == pytest.approx(-load[0] - 1.0, rel=5e-3)

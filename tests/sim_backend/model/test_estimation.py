"""Parameters from catalogue values: (29)-(35), what the paper printed instead, and the cubic's constants."""

import math

import numpy as np
import pytest

from sim_backend.errors import ModelError
from sim_backend.model.compliance import (
    cubic_torque,
    flexspline_stiffness,
    flexspline_torsion,
    wave_generator_torsion,
)
from sim_backend.model.estimation import cubic_from_catalogue, flexspline_from_catalogue, wave_generator_from_tests

CATALOGUE = {"K1": 8.4e3, "K2": 9.4e3, "T1": 3.9, "T2": 12.0}


def test_the_printed_curvature_does_not_return_the_catalogue_it_came_from():
    K_F0, C_F = flexspline_from_catalogue(**CATALOGUE)
    middles = np.array([3.9 / 2, (3.9 + 12.0) / 2])
    assert flexspline_stiffness(middles, K_F0, C_F) == pytest.approx([8400.0, 9400.0], rel=1e-12)
    printed = 0.089
    # reference: 8587 and 12 509 N*m/rad, torsion at 12 N*m short by 16 %
    assert flexspline_stiffness(middles, K_F0, printed) == pytest.approx([8587.0, 12509.0], abs=1.0)
    assert flexspline_torsion(12.0, K_F0, printed) / flexspline_torsion(12.0, K_F0, C_F) == pytest.approx(
        0.84, abs=0.005
    )
    # the leading 2 of (32) applied twice
    assert printed == pytest.approx(2.0 * C_F, rel=0.011)


def test_the_wave_generator_s_two_parameters_are_one_number_and_the_starting_torque():
    for loss in (1e-4, 1.8e-4, 4e-4):
        K_w0, C_w = wave_generator_from_tests(100.0, loss, 0.012)
        assert C_w == 1.0 / 0.012
        assert C_w == pytest.approx(2.0 / (100.0 * K_w0 * loss))  # (35) as printed
    # the printed 83.5 is (35) with the rounded 1.33
    rounded = 2.0 / (100.0 * 1.33 * 1.8e-4)
    assert rounded == pytest.approx(83.5, abs=0.05)


def test_at_the_starting_torque_the_wave_generator_has_taken_63_percent_of_half_the_loss():
    # (33) is linear and would give all of it there
    K_w0, C_w = wave_generator_from_tests(100.0, 1.8e-4, 0.012)
    share = wave_generator_torsion(0.012, K_w0, C_w) / 100.0 / 0.9e-4
    assert share == pytest.approx(1.0 - math.exp(-1.0))
    assert 0.012 / K_w0 / 100.0 / 0.9e-4 == pytest.approx(1.0)


def test_the_cubic_has_the_catalogue_stiffnesses_at_its_own_torsions():
    a1, a3 = cubic_from_catalogue(**CATALOGUE)
    # a root found by numpy, not by the closed form
    for torque, stiffness in ((3.9 / 2, 8.4e3), ((3.9 + 12.0) / 2, 9.4e3)):
        (torsion,) = (x.real for x in np.roots([a3, 0.0, a1, -torque]) if abs(x.imag) < 1e-9)
        assert cubic_torque(torsion, a1, a3) == pytest.approx(torque)
        assert a1 + 3.0 * a3 * torsion**2 == pytest.approx(stiffness, rel=1e-10)


def test_the_cubic_becomes_straight_where_the_catalogue_does():
    a1, a3 = cubic_from_catalogue(8.4e3, 8.4e3 * (1 + 1e-9), 3.9, 12.0)
    assert a1 == pytest.approx(8.4e3, rel=1e-8)
    assert a3 * (12.0 / 8.4e3) ** 2 < 1e-4


@pytest.mark.parametrize(
    ("estimate", "highest"),
    [(flexspline_from_catalogue, 8.4e3 * (15.9 / 3.9) ** 2), (cubic_from_catalogue, 8.4e3 * (15.9 / 3.9) ** (2 / 3))],
)
def test_a_stiffening_that_the_law_cannot_have_is_refused_with_its_range(estimate, highest):
    estimate(**{**CATALOGUE, "K2": 0.999 * highest})
    for K2 in (8.4e3, 8e3, 1.001 * highest, math.nan, None, "1"):
        with pytest.raises(
            ModelError, match=rf"^K2 = .* must be .*above 8400 and below {highest:.6g} N\*m/rad; .*Zhang \("
        ):
            estimate(**{**CATALOGUE, "K2": K2})


@pytest.mark.parametrize("name", ["K1", "T1"])
@pytest.mark.parametrize("estimate", [flexspline_from_catalogue, cubic_from_catalogue])
def test_a_catalogue_value_that_cannot_be_is_refused_by_name(estimate, name):
    for value in (0.0, -1.0, math.inf):
        with pytest.raises(ModelError, match=rf"^{name} = {value!r}"):
            estimate(**{**CATALOGUE, name: value})


@pytest.mark.parametrize(("loss", "torque"), [(0.0, 0.012), (1.8e-4, 0.0), (math.nan, 0.012), (1.8e-4, math.inf)])
def test_a_loss_or_starting_torque_that_cannot_be_is_refused(loss, torque):
    with pytest.raises(ModelError, match=r"\(33\)"):
        wave_generator_from_tests(100.0, loss, torque)

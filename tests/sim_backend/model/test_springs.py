"""The plant's springs invert the compliance laws, and go on smoothly in a straight line."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import quad

from sim_backend.model import springs
from sim_backend.model.compliance import cubic_torque, flexspline_torsion, piecewise_torque, wave_generator_torsion
from sim_backend.model.constants import derive
from sim_backend.model.parameters import Cubic, Piecewise, PlantConfig
from sim_backend.model.springs import (
    cubic_flexspline_torque,
    flexspline_torque,
    piecewise_flexspline_torque,
    wave_generator_torque,
)
from tests.sim_backend.model.test_parameters import DRIVE

C = derive(PlantConfig(DRIVE))
CUBIC = derive(PlantConfig(DRIVE, flexspline=Cubic(8e3, 4e8)))
LINEAR = derive(PlantConfig(DRIVE, flexspline=Cubic(8e3, 0.0)))
PIECEWISE = derive(PlantConfig(DRIVE, flexspline=Piecewise(8.4e3, 9.4e3, 1.2e4, 3.9, 12.0)))


@pytest.mark.parametrize("torque", [-50.0, -16.0, -1e-6, 0.0, 3.9, 24.0, 65.0])
def test_the_flexspline_spring_inverts_equation_24(torque):
    windup = float(flexspline_torsion(torque, DRIVE.K_F0, DRIVE.C_F))
    assert flexspline_torque(windup, C)[0] == pytest.approx(torque, rel=1e-12, abs=1e-15)


@pytest.mark.parametrize("windup", [-3e-3, -1e-9, 0.0, 4e-4, 4.7e-4, 1.4e-3, 2.9e-3])
def test_the_older_laws_of_the_flexspline_give_the_torques_of_equations_10_and_11(windup):
    assert cubic_flexspline_torque(windup, CUBIC)[0] == pytest.approx(float(cubic_torque(windup, 8e3, 4e8)), rel=1e-12)
    assert cubic_flexspline_torque(windup, LINEAR) == pytest.approx((8e3 * windup, 8e3), rel=1e-12)
    torque = float(piecewise_torque(windup, 8.4e3, 9.4e3, 1.2e4, 3.9, 12.0))
    assert piecewise_flexspline_torque(windup, PIECEWISE)[0] == pytest.approx(torque, rel=1e-12)


@pytest.mark.parametrize(("name", "c"), [("flexspline", C), ("cubic_flexspline", CUBIC), ("cubic_flexspline", LINEAR)])
def test_the_stiffening_of_a_smooth_law_is_the_largest_relative_change_of_its_stiffness_over_the_torque(name, c):
    spring = getattr(springs, f"{name}_torque")
    windups = np.linspace(0.0, min(c.flexspline_knee, 0.01), 20_001)[:-1]
    torque, stiffness = np.array([spring(float(windup), c) for windup in windups]).T
    largest = np.max(np.abs(np.diff(np.log(stiffness)) / np.diff(torque)))
    assert c.flexspline_stiffening == pytest.approx(largest, rel=1e-6)


def test_the_stiffening_of_the_piecewise_law_is_its_larger_jump_over_the_torque_of_the_first():
    assert PIECEWISE.flexspline_stiffening == pytest.approx((1.2e4 / 9.4e3 - 1.0) / 3.9)


ENERGIES = [
    ("flexspline", C),
    ("cubic_flexspline", CUBIC),
    ("cubic_flexspline", LINEAR),
    ("piecewise_flexspline", PIECEWISE),
    ("wave_generator", C),
]


@pytest.mark.parametrize(("name", "c"), ENERGIES)
@pytest.mark.parametrize("windup", [-0.02, 3e-4, 1.2e-3, 4e-3, 0.0089, 0.02])
def test_the_energy_of_a_spring_is_the_integral_of_its_torque(name, c, windup):
    torque, energy = getattr(springs, f"{name}_torque"), getattr(springs, f"{name}_energy")
    knees = [k for k in (c.flexspline_knee, c.wave_generator_knee, c.torsion_1, c.torsion_2) if 0 < k < abs(windup)]
    integral, _ = quad(lambda x: torque(x, c)[0], 0.0, windup, points=[math.copysign(k, windup) for k in knees] or None)
    assert energy(windup, c) == pytest.approx(integral, rel=1e-7)


@pytest.mark.parametrize("softening", [1e-9, 1e-8, 1e-7, 1e-5])
@pytest.mark.parametrize("torque", [1e-3, 0.1, 16.0])
def test_a_spring_that_hardly_stiffens_keeps_all_digits_of_its_energy(softening, torque):
    # T^2/(2 K) (1 - (C T)^2/2) and, after (27), T^2/(2 K) (1 - 2 C T/3): what comes next is below 1e-7 of it
    c = derive(PlantConfig(dataclasses.replace(DRIVE, C_F=softening, C_w=softening)))
    flexspline = 0.5 * torque**2 / DRIVE.K_F0 * (1.0 - 0.5 * (softening * torque) ** 2)
    windup = math.atan(softening * torque) / (softening * DRIVE.K_F0)
    assert springs.flexspline_energy(windup, c) == pytest.approx(flexspline, rel=1e-12)
    wave_generator = 0.5 * torque**2 / DRIVE.K_w0 * (1.0 - 2.0 / 3.0 * softening * torque)
    windup = -math.expm1(-softening * torque) / (softening * DRIVE.K_w0)
    assert springs.wave_generator_energy(windup, c) == pytest.approx(wave_generator, rel=1e-7)


def test_the_two_forms_of_the_wave_generator_s_energy_meet():
    at = 1e-3 / (C.C_w * C.K_w0)
    below, above = (springs.wave_generator_energy(factor * at, C) for factor in (1.0 - 1e-12, 1.0 + 1e-12))
    assert above == pytest.approx(below, rel=1e-11)


@pytest.mark.parametrize("torque", [-0.079, -0.012, -1e-9, 0.0, 0.02, 0.079])
def test_the_wave_generator_spring_inverts_equation_27(torque):
    windup = float(wave_generator_torsion(torque, DRIVE.K_w0, DRIVE.C_w))
    assert wave_generator_torque(windup, C)[0] == pytest.approx(torque, rel=1e-9, abs=1e-15)


@pytest.mark.parametrize(
    ("spring", "c", "knee", "cap"),
    [
        (flexspline_torque, C, C.flexspline_knee, C.flexspline_cap),
        (cubic_flexspline_torque, CUBIC, CUBIC.flexspline_knee, CUBIC.flexspline_cap),
        (wave_generator_torque, C, C.wave_generator_knee, C.wave_generator_cap),
    ],
)
def test_the_straight_line_continues_torque_and_stiffness(spring, c, knee, cap):
    below, above = spring(math.nextafter(knee, 0.0), c), spring(knee, c)
    assert above == pytest.approx(below, rel=1e-9)
    assert above[1] == cap
    further = spring(-2.0 * knee, c)
    assert further == pytest.approx((-(above[0] + cap * knee), cap), rel=1e-12)


@pytest.mark.parametrize(
    ("spring", "c"),
    [
        (flexspline_torque, C),
        (cubic_flexspline_torque, CUBIC),
        (piecewise_flexspline_torque, PIECEWISE),
        (wave_generator_torque, C),
    ],
)
def test_the_stiffness_is_the_derivative_of_the_torque(spring, c):
    for windup in (1e-5, 5e-4, 1.5e-3, -8e-4, 8.8e-3, 0.05):
        step = 1e-8
        numerical = (spring(windup + step, c)[0] - spring(windup - step, c)[0]) / (2 * step)
        # central difference: relative error ~ (step / distance to the singularity)^2
        assert spring(windup, c)[1] == pytest.approx(numerical, rel=1e-5)

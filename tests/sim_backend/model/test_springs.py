"""The plant's springs invert the compliance laws, and go on smoothly in a straight line."""

import math

import pytest

from sim_backend.model.compliance import flexspline_torsion, wave_generator_torsion
from sim_backend.model.constants import derive
from sim_backend.model.parameters import PlantConfig
from sim_backend.model.springs import flexspline_torque, wave_generator_torque
from tests.sim_backend.model.test_parameters import DRIVE

C = derive(PlantConfig(DRIVE))


@pytest.mark.parametrize("torque", [-50.0, -16.0, -1e-6, 0.0, 3.9, 24.0, 73.0])
def test_the_flexspline_spring_inverts_equation_24(torque):
    windup = float(flexspline_torsion(torque, DRIVE.K_F0, DRIVE.C_F))
    assert flexspline_torque(windup, C)[0] == pytest.approx(torque, rel=1e-12, abs=1e-15)


@pytest.mark.parametrize("torque", [-0.079, -0.012, -1e-9, 0.0, 0.02, 0.079])
def test_the_wave_generator_spring_inverts_equation_27(torque):
    windup = float(wave_generator_torsion(torque, DRIVE.K_w0, DRIVE.C_w))
    assert wave_generator_torque(windup, C)[0] == pytest.approx(torque, rel=1e-9, abs=1e-15)


@pytest.mark.parametrize(
    ("spring", "knee", "cap"),
    [
        (flexspline_torque, C.flexspline_knee, C.flexspline_cap),
        (wave_generator_torque, C.wave_generator_knee, C.wave_generator_cap),
    ],
)
def test_the_straight_line_continues_torque_and_stiffness(spring, knee, cap):
    below, above = spring(math.nextafter(knee, 0.0), C), spring(knee, C)
    assert above == pytest.approx(below, rel=1e-9)
    assert above[1] == cap
    further = spring(-2.0 * knee, C)
    assert further == pytest.approx((-(above[0] + cap * knee), cap), rel=1e-12)


@pytest.mark.parametrize("spring", [flexspline_torque, wave_generator_torque])
def test_the_stiffness_is_the_derivative_of_the_torque(spring):
    for windup in (1e-5, 5e-4, 1.5e-3, -8e-4, 8.8e-3, 0.05):
        step = 1e-8
        numerical = (spring(windup + step, C)[0] - spring(windup - step, C)[0]) / (2 * step)
        # central difference: relative error ~ (step / distance to the singularity)^2
        assert spring(windup, C)[1] == pytest.approx(numerical, rel=1e-5)

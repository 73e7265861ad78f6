"""The rim sticks inside its friction level and slides exactly on it."""

import dataclasses

import pytest

from sim_backend.model.constants import derive
from sim_backend.model.parameters import PlantConfig
from sim_backend.model.rim import move_rim
from sim_backend.model.springs import flexspline_torque, wave_generator_torque
from tests.sim_backend.model.test_parameters import DRIVE

QUIET = {"wave_generator_damping": 0.0, "flexspline_damping": 0.0}
C = derive(PlantConfig(DRIVE, **QUIET))


def force(rim: float, output: float, motor: float, c=C) -> float:
    return flexspline_torque(output - rim, c)[0] + c.ratio * wave_generator_torque(-motor - c.ratio * rim, c)[0]


def test_the_rim_sticks_while_the_springs_pull_less_than_its_friction():
    assert abs(force(0.0, 1e-4, -1e-3)) < 1.2
    slip, _, T_F, T_w = move_rim(0.0, 0.0, 1e-4, 0.0, -1e-3, 0.0, 1.2, C)
    assert slip == 0.0
    assert T_F + C.ratio * T_w == pytest.approx(force(0.0, 1e-4, -1e-3))


@pytest.mark.parametrize(("output", "motor"), [(1e-3, 0.0), (-2e-3, 0.01), (0.0, 0.05), (0.003, -0.3), (0.0, 1.0)])
@pytest.mark.parametrize("last_slip", [0.0, 1e-6, -1e-6])
def test_the_rim_slides_until_the_pull_equals_its_friction(output, motor, last_slip):
    before = force(0.0, output, motor)
    slip, _, T_F, T_w = move_rim(last_slip, 0.0, output, 0.0, motor, 0.0, 1.2, C)
    # 1e-10 N*m: the accuracy to which the rim's law is solved
    assert T_F + C.ratio * T_w == pytest.approx(1.2 if before > 0 else -1.2, abs=1e-9)
    assert slip * before > 0.0
    assert force(slip, output, motor) == pytest.approx(T_F + C.ratio * T_w, abs=1e-8)


def test_sliding_at_constant_speed_adds_the_viscous_torque():
    c = derive(PlantConfig(dataclasses.replace(DRIVE, viscous_friction=1e-4), **QUIET))
    speed, slip, rim = 0.5, 0.0, 0.0
    for k in range(1, 2001):
        slip, _, T_F, T_w = move_rim(slip, rim, speed * c.step * k, speed, -100.0 * speed * c.step * k, 0.0, 1.2, c)
        rim += slip
    assert T_F + c.ratio * T_w == pytest.approx(1.2 + 1e-4 * 100.0**2 * speed, rel=1e-9)

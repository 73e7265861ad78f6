"""The plant does what the catalogue's five base terms say, though it does not call their functions.

Its springs need torque over windup where the catalogue gives windup over torque, its friction is that of a moving rim,
and its inertia is that of an equation of motion. Here both are held together.
"""

import dataclasses

import numpy as np
import pytest

from sim_backend.model import springs
from sim_backend.model.arrays import evaluate
from sim_backend.model.constants import derive
from sim_backend.model.effects import CATALOGUE
from sim_backend.model.parameters import HarmonicDrive, PlantConfig
from sim_backend.plant import Plant
from sim_backend.ports import AxisMode

DRIVE = HarmonicDrive(100.0, 8336.0, 0.0449, 1.333, 83.3, friction_torque=1.2, viscous_friction=1e-4)
CONFIG = PlantConfig(DRIVE)
SHARES = np.linspace(-0.999, 0.999, 41)


def test_the_flexspline_inverts_its_base_term():
    c = derive(CONFIG)
    for windup in SHARES * c.flexspline_knee:
        torque, _ = springs.flexspline_torque(windup, c)
        assert CATALOGUE["flexspline-compliance"].function(torque, DRIVE.K_F0, DRIVE.C_F) == pytest.approx(windup)


def test_the_wave_generator_inverts_its_base_term():
    c = derive(CONFIG)
    term = CATALOGUE["wave-generator-compliance"].function
    for windup in SHARES * c.wave_generator_knee:
        torque, _ = springs.wave_generator_torque(windup, c)
        assert term(torque, DRIVE.K_w0, DRIVE.C_w, 100.0) * 100.0 == pytest.approx(windup)


def test_a_slow_locked_sweep_follows_the_play_of_the_base_term():
    plant = Plant(CONFIG)
    plant.set_lock(True)
    rows = []
    for first, last in ((0.0, 0.1), (0.1, -0.1), (-0.1, 0.06)):
        for target in np.linspace(first, last, 1000):
            plant.command("motor", AxisMode.TORQUE, float(target))
            plant.advance_to(plant.time + 4e-3)
            rows.append(plant.truth())
    M, T_F = np.array([(row.motor_torque, row.flexspline_torque) for row in rows]).T
    expected = evaluate(CATALOGUE["coulomb-friction"], {"motor_torque": M}, (0.012, 100.0), step=4e-3)
    # the rotor follows a sweep of 5 N*m/s with a little inertia and viscous friction
    assert np.sqrt(np.mean((T_F - expected) ** 2)) < 0.02
    assert np.ptp(expected) > 15.0


def test_running_friction_is_dry_friction_and_the_viscous_base_term():
    plant, term = Plant(CONFIG), CATALOGUE["viscous-friction"].function
    for speed in (20.0, -20.0, 150.0):
        plant.command("motor", AxisMode.VELOCITY, speed)
        plant.advance_to(plant.time + 1.0)
        expected = np.copysign(0.012, speed) + term(speed, 1e-4)
        assert plant.truth().motor_torque == pytest.approx(expected, rel=1e-4)


def test_without_friction_the_motor_torque_is_the_inertial_base_term():
    drive = dataclasses.replace(DRIVE, friction_torque=0.0, viscous_friction=0.0)
    plant = Plant(dataclasses.replace(CONFIG, drive=drive))
    plant.command("motor", AxisMode.TORQUE, 0.02)
    plant.advance_to(0.1)
    before = plant.truth().motor_velocity
    plant.advance_to(0.2)
    acceleration = (plant.truth().motor_velocity - before) / 0.1
    # the output turns with the motor: its inertia over the ratio squared
    J = CONFIG.motor_inertia + CONFIG.output_inertia / 100.0**2
    assert CATALOGUE["inertia"].function(acceleration, J) == pytest.approx(0.02, rel=1e-3)

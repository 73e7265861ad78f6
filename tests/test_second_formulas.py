"""The model against second formulas which were written from the physics without it.

Both may be wrong in the same way only if the physics was read wrongly twice. Points are random with fixed seeds.
"""

import inspect

import numpy as np
import pytest

from sim_backend.model import compliance, constants, rim, springs
from sim_backend.model.effects import CATALOGUE, Enters
from sim_backend.model.parameters import HarmonicDrive, PlantConfig
from tests.independent import laws
from tests.independent.effects import SECOND_FORMULAS, SECOND_SLOPES

POINTS = 200
DRIVES = ((8336.0, 0.0449, 1.333, 83.3), (5e3, 0.02, 0.5, 30.0), (2e4, 0.08, 5.0, 200.0))
"""K_F0, C_F, K_w0, C_w: the paper's drive and the ends of the working ranges."""

RANGES = {
    "motor_position": 2000.0,
    "output_position": 20.0,
    "motor_velocity": 300.0,
    "output_velocity": 3.0,
    "motor_torque": 0.2,
    "output_torque": 20.0,
}
"""Largest magnitude of each signal on a size-17 bench, SI."""


@pytest.mark.parametrize(("K_F0", "C_F", "K_w0", "C_w"), DRIVES)
def test_the_compliances_are_the_integrals_of_the_reciprocal_stiffnesses(K_F0, C_F, K_w0, C_w):
    rng = np.random.default_rng(1)
    torque = rng.uniform(-24.0, 24.0, POINTS)
    by_model = compliance.flexspline_torsion(torque, K_F0, C_F)
    assert by_model == pytest.approx(laws.flexspline_torsion(torque, K_F0, C_F), rel=1e-11)
    torque = rng.uniform(-0.2, 0.2, POINTS)
    by_model = compliance.wave_generator_torsion(torque, K_w0, C_w)
    assert by_model == pytest.approx(laws.wave_generator_torsion(torque, K_w0, C_w), rel=1e-11)


@pytest.mark.parametrize(("K_F0", "C_F", "K_w0", "C_w"), DRIVES)
def test_the_stiffnesses_agree(K_F0, C_F, K_w0, C_w):
    torque = np.random.default_rng(2).uniform(-24.0, 24.0, POINTS)
    by_model = compliance.flexspline_stiffness(torque, K_F0, C_F)
    assert by_model == pytest.approx(laws.flexspline_stiffness(torque, K_F0, C_F), rel=1e-14)
    by_model = compliance.wave_generator_stiffness(torque / 100.0, K_w0, C_w)
    assert by_model == pytest.approx(laws.wave_generator_stiffness(torque / 100.0, K_w0, C_w), rel=1e-14)


def drive_of(K_F0: float, C_F: float, K_w0: float, C_w: float) -> HarmonicDrive:
    return HarmonicDrive(ratio=100.0, K_F0=K_F0, C_F=C_F, K_w0=K_w0, C_w=C_w, friction_torque=1.2)


@pytest.mark.parametrize("values", DRIVES)
def test_the_springs_of_the_plant_invert_the_compliances(values):
    K_F0, C_F, K_w0, C_w = values
    c = constants.derive(PlantConfig(drive=drive_of(*values), wave_generator_stiffness_cap=1000.0))
    rng = np.random.default_rng(3)
    for windup in rng.uniform(-0.999, 0.999, 20) * c.flexspline_knee:
        torque, stiffness = springs.flexspline_torque(windup, c)
        assert torque == pytest.approx(laws.flexspline_torque(windup, K_F0, C_F), rel=1e-9)
        assert stiffness == pytest.approx(float(laws.flexspline_stiffness(np.array(torque), K_F0, C_F)), rel=1e-9)
    for windup in rng.uniform(-0.999, 0.999, 20) * c.wave_generator_knee:
        torque, stiffness = springs.wave_generator_torque(windup, c)
        assert torque == pytest.approx(laws.wave_generator_torque(windup, K_w0, C_w), rel=1e-9)
        assert stiffness == pytest.approx(float(laws.wave_generator_stiffness(np.array(torque), K_w0, C_w)), rel=1e-9)


@pytest.mark.parametrize("start_angle", [0.0, 3.0])
def test_the_rim_of_the_plant_is_a_play_between_the_two_torques(start_angle: float):
    """Turning the motor slowly against a locked output: T_F follows -N T_w with a play of the friction level."""
    config = PlantConfig(drive=drive_of(*DRIVES[0]), wave_generator_damping=0.0, flexspline_damping=0.0)
    c = constants.derive(config)
    corners = start_angle + np.array([0.0, 0.12, -0.12, 0.07, -0.05, 0.02])
    position = np.interp(np.arange(5001) / 1000.0, np.arange(6), corners)
    rim_angle, slip, torques = -start_angle / 100.0, 0.0, []
    for motor_position in position.tolist():
        slip, T_F, T_w = rim.move_rim(slip, rim_angle, -start_angle / 100.0, 0.0, motor_position, 0.0, 1.2, c)
        rim_angle += slip
        torques.append((T_F, T_w))
    output_torque, T_w = np.array(torques).T
    assert np.ptp(output_torque) > 15.0
    # the linear last step of the rim leaves 1e-10 N*m a step by its own account; 5000 steps do not add up
    assert output_torque == pytest.approx(laws.play(-100.0 * T_w, 1.2), abs=1e-6)
    torsion = -start_angle / 100.0 + position / 100.0
    drive = laws.Drive(100.0, *DRIVES[0], T_fs=0.012, T_fb=1.2, T_c=0.012, b=0.0)
    below_knee = np.abs(T_w) < c.wave_generator_knee_torque
    expected = laws.total_torsion(output_torque, -T_w, drive)
    assert below_knee.mean() > 0.5
    assert torsion[below_knee] == pytest.approx(expected[below_knee], abs=1e-9)


def test_the_catalogue_estimate_agrees():
    rng = np.random.default_rng(4)
    for _ in range(50):
        K1, T1, loss, T_fs = rng.uniform([5e3, 2.0, 1e-4, 5e-3], [2e4, 6.0, 4e-4, 3e-2])
        K2, T2 = K1 * rng.uniform(1.05, 2.0), T1 * rng.uniform(2.0, 5.0)
        by_model = HarmonicDrive.from_catalogue(80.0, K1, K2, T1, T2, loss, T_fs)
        second = (*laws.flexspline_from_catalogue(K1, K2, T1, T2), *laws.wave_generator_from_tests(80.0, loss, T_fs))
        assert (by_model.K_F0, by_model.C_F, by_model.K_w0, by_model.C_w) == pytest.approx(second, rel=1e-9)


@pytest.mark.parametrize("effect_id", list(CATALOGUE))
def test_every_effect_has_a_second_formula(effect_id: str):
    assert effect_id in SECOND_FORMULAS, f"write {effect_id} in tests/independent/effects.py from the physics"
    if CATALOGUE[effect_id].slope is not None:
        assert effect_id in SECOND_SLOPES, f"write the slope of {effect_id} in tests/independent/effects.py"


@pytest.mark.parametrize("effect_id", list(CATALOGUE))
def test_every_effect_agrees_with_its_second_formula(effect_id: str):
    effect = CATALOGUE[effect_id]
    rng = np.random.default_rng(5)
    for _ in range(POINTS):
        signals = {name: float(rng.uniform(-1.0, 1.0)) * RANGES[name] for name in effect.signals}
        values = {
            p.name: float(
                rng.uniform(max(p.low, -10.0 * abs(p.typical) - 1.0), min(p.high, 10.0 * abs(p.typical) + 1.0))
            )
            for p in effect.parameters
        }
        size = abs(values[effect.amplitudes[0]])
        by_model = effect.function(*signals.values(), *values.values())
        second = float(SECOND_FORMULAS[effect_id](**signals, **values))
        # angles of 2000 rad times orders of 840: the last digit of their product is 2e-10 rad
        assert by_model == pytest.approx(second, abs=1e-8 * size)
        if effect.slope is not None:
            by_model = effect.slope(*signals.values(), *values.values())
            second = float(SECOND_SLOPES[effect_id](**signals, **values))
            assert by_model == pytest.approx(second, abs=1e-6 * size)


def test_an_effect_that_reacts_on_the_motor_states_its_slope():
    for effect in CATALOGUE.values():
        if effect.enters is Enters.TORSION and "motor_position" in effect.signals:
            assert effect.slope is not None, effect.id
            assert inspect.signature(effect.slope) == inspect.signature(effect.function)

"""The model against second formulas which were written from the physics without it.

Both may be wrong in the same way only if the physics was read wrongly twice. Points are random with fixed seeds.
"""

import inspect
import math
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import ks_2samp

from sim_backend.model import compliance, constants, rim, springs
from sim_backend.model.arrays import evaluate
from sim_backend.model.effects import CATALOGUE, Effect, Enters
from sim_backend.model.parameters import HarmonicDrive, PlantConfig
from tests.independent import laws
from tests.independent.draws import draw, draw_drive
from tests.independent.effects import SECOND_FORMULAS, SECOND_SLOPES
from tests.slopes import evaluate_slope

PAGE = Path(__file__).parents[1] / "docs" / "effects.md"
POINTS = 3000
DRIVES = ((8336.0, 0.0449, 1.333, 83.3), (5e3, 0.02, 0.5, 30.0), (2e4, 0.08, 5.0, 200.0))
"""K_F0, C_F, K_w0, C_w: the paper's drive and the ends of the working ranges."""

MISSED = "encoder-missed-counts"

RANGES = {
    "motor_position": (0.0, 2000.0),
    "output_position": (0.0, 20.0),
    "motor_velocity": (0.0, 300.0),
    "motor_acceleration": (0.0, 1000.0),
    "output_velocity": (0.0, 3.0),
    "motor_torque": (0.0, 0.2),
    "motor_current": (0.0, 0.6),
    "output_torque": (0.0, 20.0),
    "temperature": (40.0, 25.0),
    "motor_temperature": (60.0, 40.0),
    "flexspline_torsion": (0.0, 2e-3),
    "base_friction": (0.02, 0.02),
}
"""Middle and reach of each signal on a size-17 bench, SI."""


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
        slip, _, T_F, T_w = rim.move_rim(slip, rim_angle, -start_angle / 100.0, 0.0, motor_position, 0.0, 1.2, c)
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


def names_of(formula) -> set[str]:
    return set(inspect.signature(formula).parameters)


@pytest.mark.parametrize("effect_id", list(CATALOGUE))
def test_every_effect_has_a_second_formula_of_the_same_arguments(effect_id: str):
    effect = CATALOGUE[effect_id]
    assert effect_id in SECOND_FORMULAS, f"write {effect_id} in tests/independent/ from the physics"
    wanted = {*effect.signals, *(parameter.name for parameter in effect.parameters)}
    # a record that remembers needs its time where the model counts steps
    assert names_of(SECOND_FORMULAS[effect_id]) - {"time"} == wanted - {"time"}
    assert ("time" in names_of(SECOND_FORMULAS[effect_id])) >= ("time" in wanted)
    assert (effect.slope is not None) == (effect_id in SECOND_SLOPES)


UNSEEN = "at the 0.1 % of full scale of a good cell, 0.03 N*m, the loop finds nothing on the standard campaign"
NOT_USUAL = {"torque-sensor-nonlinearity": {"even": (0.15, 0.3, UNSEEN), "odd": (0.15, 0.3, UNSEEN)}}
"""What is drawn larger than usual: lowest and highest magnitude, and why. docs/effects.md says so in its remarks."""


@pytest.mark.parametrize("effect_id", [e.id for e in CATALOGUE.values() if e.enters is not Enters.BASE] + ["inertia"])
def test_effects_are_drawn_within_their_usual_ranges(effect_id: str):
    usual = {parameter.name: parameter.usual for parameter in CATALOGUE[effect_id].parameters}
    larger = NOT_USUAL.get(effect_id, {})
    for seed in range(100):
        for values in draw(effect_id, np.random.default_rng(seed)).of(effect_id):
            for name, value in values.items():
                low, high = usual[name]
                if name in larger:
                    assert max(high, larger[name][0]) <= abs(value) <= larger[name][1], (name, value, larger[name][2])
                else:
                    assert low <= value <= high, (name, value)


def test_the_page_says_of_which_size_an_effect_is_that_is_drawn_larger_than_usual():
    section = PAGE.read_text("utf-8").partition("## What a campaign establishes")[2]
    for effect_id, larger in NOT_USUAL.items():
        (remarks,) = re.findall(rf"^\| {effect_id} \| .* \| (.*) \|$", section, flags=re.M)
        for low, high, _ in larger.values():
            assert f"drawn at {low:g} to {high:g} " in remarks
            assert "usual" in remarks


def test_drives_are_drawn_within_the_usual_ranges_of_the_base_terms():
    usual = {parameter.name: parameter.usual for e in CATALOGUE.values() for parameter in e.parameters}
    for seed in range(100):
        drive = draw_drive(np.random.default_rng(seed))
        for name in ("K_F0", "C_F", "K_w0", "C_w", "T_fs", "b"):
            low, high = usual[name]
            assert low <= getattr(drive, name) <= high, (name, drive)


def record(name: str, rng: np.random.Generator, time: np.ndarray) -> np.ndarray:
    """Give a signal that runs smoothly and jumps now and then, up to the size of its kind."""
    if name == "time":
        return time
    waves = sum(
        rng.normal() * np.sin(2.0 * np.pi * rng.uniform(0.05, 3.0) * time + rng.uniform(0.0, 6.0)) for _ in range(5)
    )
    corners = np.sort(rng.choice(time.size, 6, replace=False))
    jumps = rng.normal(size=7)[np.searchsorted(corners, np.arange(time.size), side="right")]
    mixed = waves + jumps
    mixed = mixed / np.max(np.abs(mixed))
    if name == "locked":
        return np.where(jumps > 0.0, 1.0, 0.0)
    middle, reach = RANGES[name]
    return middle + reach * mixed


def values_of(effect: Effect, rng: np.random.Generator) -> dict[str, float]:
    """Draw parameters around their typical sizes; base terms in the working ranges of the drive."""
    spread = math.log(2.4 if effect.enters is Enters.BASE else 5.0)
    values = {}
    for parameter in effect.parameters:
        value = parameter.typical * math.exp(rng.uniform(-spread, spread))
        if parameter.name == "phase":
            value = rng.uniform(-6.0, 6.0)
        elif parameter.low < 0.0 and parameter.name != "reference":
            value *= rng.choice([-1.0, 1.0])
        values[parameter.name] = float(min(max(value, parameter.low), parameter.high))
    return values


@pytest.mark.parametrize("effect_id", [name for name in CATALOGUE if name != MISSED])
def test_every_effect_agrees_with_its_second_formula(effect_id: str):
    effect = CATALOGUE[effect_id]
    rng = np.random.default_rng(5)
    for step in (1e-3, 2e-3, 5e-3, 2e-2):
        time = np.arange(POINTS) * step
        signals = {name: record(name, rng, time) for name in effect.signals}
        values = values_of(effect, rng)
        formulas = [(evaluate, SECOND_FORMULAS[effect_id])]
        if effect.slope is not None:
            formulas.append((evaluate_slope, SECOND_SLOPES[effect_id]))
        for by_model, second in formulas:
            arguments = signals | {"time": time} if "time" in names_of(second) else signals
            expected = second(**arguments, **values)
            given = by_model(effect, signals, tuple(values.values()), step=step, compiled=False)
            # angles of 2000 rad times orders of 400: the last digit of their product is 1e-10 rad
            assert np.max(np.abs(given - expected)) <= 1e-8 * np.max(np.abs(expected)) + 1e-15, (step, values)
            assert np.max(np.abs(expected)) > 0.0


def test_a_long_delay_is_read_from_a_ring_with_the_error_of_its_spacing():
    """More steps than places: straight lines over several steps, h^2/8 times the second derivative at most."""
    step, delay, speed = 1e-4, 0.0837, 2.0 * np.pi * 3.0
    time = np.arange(20_000) * step
    torque = 10.0 * np.sin(speed * time)
    given = evaluate(CATALOGUE["channel-delay"], {"output_torque": torque}, (delay,), step=step)
    expected = SECOND_FORMULAS["channel-delay"](time, torque, delay)
    spacing = 4.0 * step
    assert np.max(np.abs(given - expected)) <= 1.01 * spacing**2 / 8.0 * 10.0 * speed**2


def test_missed_counts_are_distributed_as_those_of_the_second_formula():
    """Two generators of random numbers: the numbers of events, the waits between them and the signs are compared."""
    time = np.arange(40_000) * 5e-3
    amplitude, rate, counts = 30.0, 0.3, 16384.0
    events: dict[str, list[int]] = {"model": [], "second": []}
    waits: dict[str, list[float]] = {"model": [], "second": []}
    ups: dict[str, int] = {"model": 0, "second": 0}
    for seed in range(1, 61):
        angles = {
            "model": evaluate(
                CATALOGUE[MISSED], {"time": time}, (amplitude, rate, float(seed), counts), step=5e-3, compiled=True
            ),
            "second": SECOND_FORMULAS[MISSED](time, amplitude, rate, float(seed), counts),
        }
        for kind, angle in angles.items():
            steps = np.diff(angle / (amplitude * 2.0 * np.pi / counts))
            assert np.allclose(steps, np.round(steps), rtol=0.0, atol=1e-9)
            at = time[1:][np.abs(steps) > 0.5]
            events[kind].append(at.size)
            waits[kind] += np.diff(at).tolist()
            ups[kind] += int(np.sum(steps > 0.5))
            assert angle[0] == 0.0
    for kind in ("model", "second"):
        # 60 events a record: 60 records have 3600 +- 60
        assert np.mean(events[kind]) == pytest.approx(60.0, abs=4.0)
        assert ups[kind] / sum(events[kind]) == pytest.approx(0.5, abs=0.04)
    # two-sample Kolmogorov-Smirnov: a fixed seed that is not one of the worst thousand
    assert ks_2samp(waits["model"], waits["second"]).pvalue > 1e-3
    assert ks_2samp(events["model"], events["second"]).pvalue > 1e-3


def test_an_effect_that_reacts_on_the_motor_states_its_slope():
    for effect in CATALOGUE.values():
        if effect.enters is Enters.TORSION and "motor_position" in effect.signals:
            assert effect.slope is not None, effect.id
            assert inspect.signature(effect.slope) == inspect.signature(effect.function)

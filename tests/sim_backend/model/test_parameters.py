"""Catalogue estimates against the paper's worked numbers (with its errata), and what a bench cannot be."""

import dataclasses
import math
import re

import pytest

from sim_backend.errors import ModelError, shown
from sim_backend.model import limits
from sim_backend.model.compliance import flexspline_stiffness, flexspline_torsion, wave_generator_torsion
from sim_backend.model.constants import derive
from sim_backend.model.estimation import cubic_from_catalogue, flexspline_from_catalogue, wave_generator_from_tests
from sim_backend.model.parameters import Cubic, HarmonicDrive, Piecewise, PlantConfig, Rotation

CATALOGUE = {
    "ratio": 100.0,
    "K1": 8.4e3,
    "K2": 9.4e3,
    "T1": 3.9,
    "T2": 12.0,
    "hysteresis_loss": 1.8e-4,
    "starting_torque": 0.012,
}
DRIVE = HarmonicDrive.from_catalogue(**CATALOGUE)


def test_the_papers_drive_comes_out_with_the_corrected_curvature():
    assert pytest.approx(8335.98, abs=0.01) == DRIVE.K_F0
    assert pytest.approx(0.044940, abs=1e-6) == DRIVE.C_F
    assert pytest.approx(4.0 / 3.0) == DRIVE.K_w0
    assert pytest.approx(1.0 / 0.012) == DRIVE.C_w
    assert pytest.approx(1.2) == DRIVE.friction_torque


def test_the_estimate_returns_the_catalogue_stiffnesses_in_the_middle_of_their_ranges():
    assert flexspline_stiffness(3.9 / 2, DRIVE.K_F0, DRIVE.C_F) == pytest.approx(8400.0)
    assert flexspline_stiffness((3.9 + 12.0) / 2, DRIVE.K_F0, DRIVE.C_F) == pytest.approx(9400.0)


@pytest.mark.parametrize(
    ("torque", "torsion", "tolerance"),
    [(3.9, 4.631e-4, 5e-8), (12.0, 1.3202e-3, 5e-8), (16.0, 1.6641e-3, 5e-8), (24.0, 2.1974e-3, 5e-8)],
)
def test_the_flexspline_twists_as_worked_out_by_hand(torque, torsion, tolerance):
    assert flexspline_torsion(torque, DRIVE.K_F0, DRIVE.C_F) == pytest.approx(torsion, abs=tolerance)


def test_the_wave_generator_twists_by_half_the_hysteresis_loss_at_most():
    full = wave_generator_torsion(10.0, DRIVE.K_w0, DRIVE.C_w) / DRIVE.ratio
    assert full == pytest.approx(9.0e-5)
    at_starting_torque = wave_generator_torsion(0.012, DRIVE.K_w0, DRIVE.C_w) / DRIVE.ratio
    assert 2 * at_starting_torque == pytest.approx(1.14e-4, abs=5e-7)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("ratio", 0.5),
        ("K1", 0.0),
        ("K2", 8.4e3),
        ("K2", 2e5),
        ("T1", -1.0),
        ("T2", 3.9),
        ("hysteresis_loss", 0.0),
        ("starting_torque", math.nan),
    ],
)
def test_a_catalogue_that_no_drive_can_have_is_refused_by_name_and_value(name, value):
    with pytest.raises(ModelError, match=rf"^{name} = {value!r}"):
        HarmonicDrive.from_catalogue(**{**CATALOGUE, name: value})


@pytest.mark.parametrize("name", [field.name for field in dataclasses.fields(HarmonicDrive)])
@pytest.mark.parametrize("value", [-1.0, math.inf])
def test_a_drive_refuses_what_is_not_physical(name, value):
    with pytest.raises(ModelError, match=rf"^{name} = {value!r}"):
        dataclasses.replace(DRIVE, **{name: value})


@pytest.mark.parametrize(
    "name", [f.name for f in dataclasses.fields(PlantConfig) if f.name not in ("drive", "rotation", "flexspline")]
)
def test_a_bench_refuses_every_number_that_is_not_finite(name):
    with pytest.raises(ModelError, match=name):
        PlantConfig(DRIVE, **{name: math.nan})


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: dataclasses.replace(DRIVE, ratio=0.5),
            r"ratio = 0.5 .* at least 1 and at most 1e\+06; theta_w = -N theta_F, Zhang \(4\)",
        ),
        (lambda: dataclasses.replace(DRIVE, C_F=0.0), r"C_F = 0.0 1/\(N\*m\) .* at least 1e-09 .* Zhang \(24\)"),
        (
            lambda: HarmonicDrive.from_catalogue(**{**CATALOGUE, "K2": 8e3}),
            r"K2 = 8000.0 N\*m/rad .* above 8400 .*\(32\)",
        ),
        (
            lambda: Cubic(0.0, 1.0),
            r"a1 = 0.0 N\*m/rad .* at least 0.001 and at most 1e\+09 N\*m/rad; T = a1 f \+ a3 f\^3, Zhang \(10\)",
        ),
        (lambda: Cubic(1.0, -1.0), r"a3 = -1.0 N\*m/rad\^3 .* at least 0 .* Zhang \(10\)"),
        (lambda: Piecewise(1.0, 1.0, math.inf, 1.0, 2.0), r"K3 = inf N\*m/rad .* Zhang \(11\)"),
        (lambda: Piecewise(1.0, 1.0, 1.0, 2.0, 1.0), r"T2 = 1.0 N\*m .* above 2 N\*m; .* Zhang \(11\)"),
        (lambda: PlantConfig(DRIVE, output_inertia=0.0), r"output_inertia = 0.0 kg\*m\^2 .* J_l dw/dt"),
        (lambda: PlantConfig(DRIVE, winding_resistance=-1.0), r"winding_resistance = -1.0 ohm .* R i\^2"),
        (
            lambda: PlantConfig(DRIVE, ambient_temperature=-300.0),
            r"ambient_temperature = -300.0 degC .* at least -273.15",
        ),
        (lambda: PlantConfig(DRIVE, flexspline_stiffness_cap=8e3), r"cap = 8000.0 .* above 8335.98 .* Zhang \(22\)"),
        (lambda: PlantConfig(DRIVE, flexspline=Cubic(2e5, 0.0)), r"cap = 80000.0 .* a1 = 200000 .* Zhang \(10\)"),
        (lambda: PlantConfig(DRIVE, wave_generator_stiffness_cap=1.0), r"cap = 1.0 .* K_w0 = 1.33333 .* Zhang \(25\)"),
    ],
)
def test_a_refusal_names_parameter_value_unit_range_and_the_equation_that_needs_it(make, message):
    with pytest.raises(ModelError, match=message):
        make()


def test_the_other_rotation_sense_is_refused_with_a_way_out():
    with pytest.raises(ModelError, match="mirror the motor's signals"):
        PlantConfig(DRIVE, rotation=Rotation.SAME)


def test_a_step_that_the_stiffest_spring_does_not_allow_is_refused_with_the_body_and_the_limit():
    with pytest.raises(ModelError, match=r"output inertia of 0.0001 .* at most 1.89e-05 s; .* needs h\^2 K/J <= 1"):
        PlantConfig(DRIVE, output_inertia=1e-4)
    with pytest.raises(ModelError, match=r"motor inertia of 8e-07"):
        PlantConfig(DRIVE, rotor_inertia=1e-7, wave_generator_inertia=7e-7, wave_generator_stiffness_cap=1e4)


def test_the_drive_loops_run_on_whole_steps():
    with pytest.raises(ModelError, match=r"step = 3e-05 s: loop_period = 0.0001 s .* whole multiple .* drive loops"):
        PlantConfig(DRIVE, step=3e-5)


# ---- every number has a range, and no number inside it breaks a formula

BENCH = PlantConfig(DRIVE)
CUBIC = Cubic(8e3, 4e8)
PIECEWISE = Piecewise(8.4e3, 9.4e3, 1.2e4, 3.9, 12.0)
BOUNDED = {
    f"{type(of).__name__}.{name}": (of, name, table[name])
    for of, table in (
        (DRIVE, limits.DRIVE),
        (BENCH, limits.BENCH),
        (CUBIC, limits.CUBIC),
        (PIECEWISE, limits.PIECEWISE),
    )
    for name in table
}


def constants_with(changed) -> tuple[float, ...]:
    """Give the constants of a bench with this drive, bench, or law of the flexspline."""
    match changed:
        case HarmonicDrive():
            return derive(PlantConfig(changed))
        case PlantConfig():
            return derive(changed)
        case _:
            return derive(PlantConfig(DRIVE, flexspline=changed))


@pytest.mark.parametrize("parameter", BOUNDED)
def test_a_number_outside_its_range_is_refused_with_value_unit_and_both_ends(parameter):
    of, name, (unit, low, high, equation) = BOUNDED[parameter]
    for value in (
        math.nextafter(low, -math.inf),
        math.nextafter(high, math.inf),
        math.nan,
        math.inf,
        1e300,
        -1e300,
        10**400,
    ):
        with pytest.raises(ModelError) as refused:
            dataclasses.replace(of, **{name: value})
        message = str(refused.value)
        assert message.startswith(f"{name} = {shown(value)} {unit}".rstrip())
        assert f"at least {low:g} and at most {high:g}" in message
        assert equation in message


@pytest.mark.parametrize("parameter", BOUNDED)
def test_at_the_ends_of_a_range_every_constant_of_the_plant_is_a_number_or_the_bench_is_refused_in_words(parameter):
    of, name, (_, low, high, _) = BOUNDED[parameter]
    for value in (low, high):
        try:
            constants = constants_with(dataclasses.replace(of, **{name: value}))
        except ModelError:
            continue
        assert not any(math.isnan(constant) for constant in constants)


@pytest.mark.parametrize("value", ["1", None, True, 1j, [1.0]])
@pytest.mark.parametrize("parameter", BOUNDED)
def test_what_is_no_number_is_refused_by_name(parameter, value):
    of, name, _ = BOUNDED[parameter]
    if name == "winding_resistance" and value is None:
        return  # None asks for the rated one
    with pytest.raises(ModelError, match=rf"^{name} = .* is no number"):
        dataclasses.replace(of, **{name: value})


@pytest.mark.parametrize("value", [1e-200, 1e300, 10**400, "1", None])
@pytest.mark.parametrize("name", limits.CATALOGUE)
def test_a_catalogue_of_absurd_values_is_refused_by_name(name, value):
    with pytest.raises(ModelError, match=rf"^{name} = "):
        HarmonicDrive.from_catalogue(**{**CATALOGUE, name: value})
    stiffnesses = {key: CATALOGUE[key] for key in ("K1", "K2", "T1", "T2")}
    tests = {key: CATALOGUE[key] for key in ("ratio", "hysteresis_loss", "starting_torque")}
    for estimate, values in (
        (flexspline_from_catalogue, stiffnesses),
        (cubic_from_catalogue, stiffnesses),
        (wave_generator_from_tests, tests),
    ):
        if name in values:
            with pytest.raises(ModelError, match=rf"^{name} = "):
                estimate(**{**values, name: value})


@pytest.mark.parametrize("value", [1.0, "", 10**5000], ids=["number", "text", "huge"])
@pytest.mark.parametrize("name", ["flexspline", "drive", "rotation"])
def test_a_part_of_another_kind_is_refused(name, value):
    with pytest.raises(ModelError, match=rf"^{name} = {re.escape(shown(value))}"):
        dataclasses.replace(BENCH, **{name: value})


@pytest.mark.parametrize(
    "name",
    [
        "rotor_viscous_friction",
        "wave_generator_damping",
        "output_viscous_friction",
        "flexspline_damping",
        "fixture_damping",
    ],
)
def test_a_damper_too_strong_for_the_step_is_refused_with_the_body_the_damping_and_the_longest_step(name):
    body = "motor" if name in ("rotor_viscous_friction", "wave_generator_damping") else "output"
    with pytest.raises(ModelError, match=rf"{body} inertia .* dampers \(.*{name} = 60.* at most .* less damping"):
        PlantConfig(DRIVE, **{name: 60.0})


@pytest.mark.parametrize("damping", [0.2, 15.0, 17.0, 19.0])
def test_the_stiffness_that_the_step_can_take_is_that_up_to_which_a_bench_is_accepted(damping):
    bench = PlantConfig(DRIVE, flexspline_damping=damping)
    most = bench.stiffness_for_step
    dataclasses.replace(bench, flexspline_stiffness_cap=(1.0 - 1e-9) * most)
    with pytest.raises(ModelError, match=r"^step = 2e-05 s is too long for the output inertia"):
        dataclasses.replace(bench, flexspline_stiffness_cap=(1.0 + 1e-9) * most)


def test_the_rotation_may_be_given_by_its_name():
    assert PlantConfig(DRIVE, rotation="opposed").rotation == Rotation.OPPOSED
    with pytest.raises(ModelError, match="rotation = 'same'"):
        PlantConfig(DRIVE, rotation="same")

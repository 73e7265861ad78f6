"""The three laws of the flexspline, (10), (11), (24), and the wave generator's (27): inverses, slopes, shape."""

import math

import numpy as np
import pytest

from sim_backend.errors import ModelError, shown
from sim_backend.model import compliance, limits
from sim_backend.model.compliance import (
    LAWS,
    Compliance,
    cubic_torque,
    flexspline_torque,
    piecewise_stiffness,
    piecewise_torsion,
    total_torsion,
    wave_generator_stiffness,
    wave_generator_torque,
    wave_generator_torsion,
)
from sim_backend.model.estimation import cubic_from_catalogue, flexspline_from_catalogue, wave_generator_from_tests

K1, K2, K3, T1, T2 = 8.4e3, 9.4e3, 1.2e4, 3.9, 12.0
"""SHD-17-100 as printed; K3 is not, it is chosen."""

PARAMETERS = {
    Compliance.ARCTAN: flexspline_from_catalogue(K1, K2, T1, T2),
    Compliance.CUBIC: cubic_from_catalogue(K1, K2, T1, T2),
    Compliance.PIECEWISE: (K1, K2, K3, T1, T2),
}
TORQUE = np.linspace(-24.0, 24.0, 4801)


@pytest.fixture(params=list(Compliance))
def law(request):
    return LAWS[request.param], PARAMETERS[request.param]


def test_every_law_can_be_chosen_by_its_name():
    assert set(LAWS) == set(Compliance)
    for name, law in LAWS.items():
        assert len(law.parameters) == len(law.units) == len(PARAMETERS[name])


def test_torque_and_torsion_are_each_other_s_inverse(law):
    law, values = law
    assert law.torque(law.torsion(TORQUE, *values), *values) == pytest.approx(TORQUE, abs=1e-10)


def test_the_law_is_odd_and_rises(law):
    law, values = law
    torsion = law.torsion(TORQUE, *values)
    assert law.torsion(-TORQUE, *values) == pytest.approx(-torsion, abs=1e-18)
    assert np.all(np.diff(torsion) > 0.0)
    assert law.torsion(np.array([0.0]), *values) == 0.0


def test_the_stiffness_is_the_slope_of_the_law(law):
    law, values = law
    torque = np.array([-20.0, -8.0, -1.0, 0.5, 3.0, 7.95, 11.0, 20.0])  # away from the corners of the straight lines
    slope = 2e-4 / (law.torsion(torque + 1e-4, *values) - law.torsion(torque - 1e-4, *values))
    assert law.stiffness(torque, *values) == pytest.approx(slope, rel=1e-6)


def test_every_law_has_the_catalogue_stiffness_in_the_middle_of_its_ranges(law):
    law, values = law
    assert law.stiffness(np.array([T1 / 2, (T1 + T2) / 2]), *values) == pytest.approx([K1, K2], rel=1e-12)


def test_the_three_lines_pass_through_their_corners():
    corners = piecewise_torsion(np.array([T1, T2, T2 + 4.0]), *PARAMETERS[Compliance.PIECEWISE])
    expected = np.array([T1 / K1, T1 / K1 + (T2 - T1) / K2, T1 / K1 + (T2 - T1) / K2 + 4.0 / K3])
    assert corners == pytest.approx(expected, rel=1e-14)
    at_corners = piecewise_stiffness(np.array([T1, T1 + 1e-9, T2 - 1e-9, T2]), *PARAMETERS[Compliance.PIECEWISE])
    assert at_corners.tolist() == [K1, K2, K2, K3]


def test_the_cubic_is_solved_to_the_last_digits_also_for_a_small_curvature():
    for a3 in (0.0, 1e-3, 1e9, 1e15):
        torsion = np.array([1e-9, 1e-4, 2e-3, 0.1])
        torque = cubic_torque(torsion, 8.3e3, a3)
        assert LAWS[Compliance.CUBIC].torsion(torque, 8.3e3, a3) == pytest.approx(torsion, rel=1e-12)


def test_a_torsion_that_no_torque_reaches_is_refused():
    K_F0, C_F = PARAMETERS[Compliance.ARCTAN]
    # reference: the arctan law ends at 4.20e-3 rad, the wave generator's at 9.0e-3 rad
    assert flexspline_torque(np.array([4.19e-3]), K_F0, C_F) > 1000.0
    with pytest.raises(ModelError, match=r"0\.0042 rad must be below 0\.00419"):
        flexspline_torque(np.array([0.0, -4.2e-3]), K_F0, C_F)
    K_w0, C_w = wave_generator_from_tests(100.0, 1.8e-4, 0.012)
    with pytest.raises(ModelError, match=r"must be below 0\.009 rad"):
        wave_generator_torque(np.array([9.0e-3 + 1e-12]), K_w0, C_w)


def test_the_wave_generator_s_law_inverts_and_stiffens_as_25_says():
    K_w0, C_w = wave_generator_from_tests(100.0, 1.8e-4, 0.012)
    torque = np.linspace(-0.1, 0.1, 401)
    torsion = wave_generator_torsion(torque, K_w0, C_w)
    assert wave_generator_torque(torsion, K_w0, C_w) == pytest.approx(torque, abs=1e-12)
    at = np.array([-0.05, -0.012, 0.012, 0.03])
    slope = 2e-7 / (wave_generator_torsion(at + 1e-7, K_w0, C_w) - wave_generator_torsion(at - 1e-7, K_w0, C_w))
    assert wave_generator_stiffness(at, K_w0, C_w) == pytest.approx(slope, rel=1e-5)


def test_both_springs_add_up_to_the_torsion_of_the_drive():
    drive = (100.0, *wave_generator_from_tests(100.0, 1.8e-4, 0.012))
    # (28) with T_w negative: the motor drives; at full torque the wave generator's share is half the hysteresis loss
    assert total_torsion(np.array([1.6641e-3]), np.array([-1.0]), *drive) == pytest.approx(1.6641e-3 + 9.0e-5)


@pytest.mark.parametrize(
    ("law", "values", "message"),
    [
        (
            compliance.flexspline_torsion,
            (0.0, 0.0),
            r"^K_F0 = 0\.0 N\*m/rad is not possible: .* at least 0\.001 and at most 1e\+09 N\*m/rad; .*\(22\)",
        ),
        (compliance.flexspline_stiffness, (8e3, -0.1), r"^C_F = -0\.1 1/\(N\*m\) .*\(24\)"),
        (
            compliance.flexspline_torque,
            (8e3, math.nan),
            r"^C_F = nan .* must be finite, at least 1e-09 and at most 1e\+06 1/\(N\*m\)",
        ),
        (compliance.wave_generator_torsion, (0.0, 83.3), r"^K_w0 = 0\.0 N\*m/rad .*\(25\)"),
        (
            compliance.wave_generator_stiffness,
            (1.3, math.inf),
            r"^C_w = inf .* finite, at least 1e-09 and at most 1e\+06 1/\(N\*m\); .*\(27\)",
        ),
        (compliance.wave_generator_torque, (1.3, 0.0), r"^C_w = 0\.0"),
        (compliance.cubic_torque, (0.0, 1.0), r"^a1 = 0\.0 N\*m/rad .*\(10\)"),
        (compliance.cubic_torsion, (8e3, -1.0), r"^a3 = -1\.0 N\*m/rad\^3 .*\(10\)"),
        (compliance.piecewise_torsion, (8e3, 9e3, 0.0, 4.0, 12.0), r"^K3 = 0\.0 N\*m/rad .*\(11\)"),
        (compliance.piecewise_torque, (8e3, 9e3, 1e4, 4.0, 4.0), r"^T2 = 4\.0 N\*m .* above 4 N\*m"),
        (
            compliance.piecewise_stiffness,
            (8e3, 9e3, 1e4, 0.0, 12.0),
            r"^T1 = 0\.0 N\*m .* at least 1e-09 and at most 1e\+09 N\*m",
        ),
    ],
)
def test_parameters_that_no_spring_can_have_are_refused(law, values, message):
    with pytest.raises(ModelError, match=message):
        law(np.array([0.0]), *values)


def test_a_ratio_below_one_is_refused():
    with pytest.raises(
        ModelError, match=r"^ratio = 0\.0 is not possible: it must be at least 1 and at most 1e\+06; .*\(28\)"
    ):
        compliance.total_torsion(np.zeros(1), np.zeros(1), 0.0, 1.3, 83.3)


RANGES = {
    Compliance.ARCTAN: {name: limits.DRIVE[name] for name in ("K_F0", "C_F")},
    Compliance.CUBIC: limits.CUBIC,
    Compliance.PIECEWISE: limits.PIECEWISE,
}
WAVE_GENERATOR = {name: limits.DRIVE[name] for name in ("K_w0", "C_w")}


def functions_with_ranges():
    """Give every function of a law with the ranges of its parameters, in order, and values inside them."""
    for name, law in LAWS.items():
        ranges = {parameter: RANGES[name][parameter] for parameter in law.parameters}
        for function in (law.torsion, law.torque, law.stiffness):
            yield function, ranges, PARAMETERS[name]
    for function in (wave_generator_torsion, wave_generator_torque, wave_generator_stiffness):
        yield function, WAVE_GENERATOR, wave_generator_from_tests(100.0, 1.8e-4, 0.012)


FUNCTIONS = [pytest.param(*item, id=item[0].__name__) for item in functions_with_ranges()]


@pytest.mark.parametrize("value", [None, "1", True, 1j, [1.0], {}, 10**400, -1.0, 1e308, math.nan])
@pytest.mark.parametrize(("function", "ranges", "values"), FUNCTIONS)
def test_what_is_no_parameter_of_a_law_is_refused_by_name_range_and_equation(function, ranges, values, value):
    for place, (name, (unit, low, high, equation)) in enumerate(ranges.items()):
        with pytest.raises(ModelError) as refused:
            function(np.array([0.0]), *values[:place], value, *values[place + 1 :])
        told = str(refused.value)
        assert told.startswith(f"{name} = {shown(value)} ")
        assert f"{low:g}" in told
        assert f"{high:g} {unit}" in told
        assert told.endswith(f"{equation} needs it.")


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("function", "ranges", "values"), FUNCTIONS)
def test_at_the_ends_of_every_range_a_law_gives_numbers(function, ranges, values):
    for place, (_, low, high, _) in enumerate(ranges.values()):
        for end in (low, high, math.nextafter(low, math.inf)):
            changed = [*values[:place], end, *values[place + 1 :]]
            if len(changed) == 5 and changed[3] >= changed[4]:
                continue  # T1 at or above T2
            assert np.all(np.isfinite(function(np.array([-1e-13, 0.0, 1e-13]), *changed)))


@pytest.mark.filterwarnings("error")
def test_a_cubic_of_the_smallest_curvature_is_the_straight_line():
    for a3 in (5e-324, 1e-300, 1e-30):
        assert LAWS[Compliance.CUBIC].torsion(TORQUE, 8e3, a3) == pytest.approx(TORQUE / 8e3, rel=1e-12)


@pytest.mark.parametrize("ratio", [None, "100", 1j, 10**400, 1e7])
def test_a_ratio_that_is_no_number_or_too_large_is_refused(ratio):
    with pytest.raises(ModelError, match=r"^ratio = .* at least 1 and at most 1e\+06; .*\(28\)"):
        total_torsion(np.zeros(1), np.zeros(1), ratio, 1.3, 83.3)

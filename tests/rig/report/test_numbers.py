import pytest

from rig.report.numbers import change_text, error_scale, interval_in, probability_text, scaled, shown_as, unit_text


@pytest.mark.parametrize(
    ("name", "value", "ci95", "unit", "expected"),
    [
        ("amplitude", 1.980652e-4, (1.98018e-4, 1.981124e-4), "rad", ("198.065", "198.018 to 198.112", "µrad")),
        ("K_F0", 8327.236, (8310.0, 8345.0), "N*m/rad", ("8327", "8310 to 8345", "N·m/rad")),
        ("T_fs", 0.01199913, (0.0119957, 0.0120025), "N*m", ("11.9991", "11.9957 to 12.0025", "mN·m")),
        ("T_0", -1.72e-5, (-3.57e-4, 3.23e-4), "N*m", ("−20", "−360 to 320", "µN·m")),
        ("phase", 0.0187, (0.018, 0.0194), "rad", ("0.01870", "0.01800 to 0.01940", "rad")),
        ("J_r", 2.99e-5, (2.92e-5, 3.06e-5), "kg*m^2", ("2.99e−05", "2.92e−05 to 3.06e−05", "kg·m²")),
        ("stiffness", 8335.985, None, "N*m/rad", ("8335.985", "–", "N·m/rad")),
        ("order", None, None, "1/rev", ("–", "–", "1/rev")),
        ("amplitude", 0.0495932, (0.04945, 0.04973), "1", ("0.04959", "0.04945 to 0.04973", "")),
    ],
)
def test_an_estimate_is_printed_to_the_second_digit_of_its_interval(name, value, ci95, unit, expected) -> None:
    shown = shown_as(name, value, ci95, unit)
    assert (shown.text(value), interval_in(shown, ci95), shown.unit) == expected


def test_another_value_of_the_same_parameter_is_printed_in_its_unit() -> None:
    shown = shown_as("T_cr", 27e-6, (-27e-6, 82e-6), "N*m")
    assert shown.unit == "µN·m"
    assert shown.text(-1.108e-3) == "−1108"


def test_errors_are_shown_in_the_units_of_the_table() -> None:
    assert error_scale("rad") == ("µrad", 1e6)
    assert error_scale("N*m") == ("mN·m", 1e3)
    assert error_scale("V") == ("V", 1.0)
    assert unit_text("degC") == "°C"


@pytest.mark.parametrize(
    ("before", "after", "expected"),
    [(2.0, 0.5, "75 %"), (1.0, 1.45, "−45 %"), (1.0, 1.0 + 1e-9, "0 %"), (None, 1.0, "–"), (0.0, 1.0, "–")],
)
def test_what_was_removed_is_a_share_of_the_error_before(before, after, expected) -> None:
    assert change_text(before, after) == expected


@pytest.mark.parametrize(
    ("value", "digits", "expected"),
    [
        (6692.4, 3, "6690"),
        (13812.0, 3, "13800"),
        (0.0012345, 3, "0.00123"),
        (3.2e9, 3, "3.2e+09"),
        (-20.26, 3, "−20.3"),
    ],
)
def test_an_error_has_no_exponent_as_long_as_it_can_be_read(value, digits, expected) -> None:
    assert scaled(value, 1.0, digits) == expected
    assert scaled(None, 1.0, digits) == "–"


def test_a_probability_that_no_number_holds_is_a_bound() -> None:
    assert probability_text(0.0) == "< 1e-300"
    assert probability_text(3e-32) == "3e-32"
    assert probability_text(None) == "–"

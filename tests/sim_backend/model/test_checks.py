"""What a refused number says of itself."""

import math
from fractions import Fraction

import numpy as np
import pytest

from sim_backend.errors import ModelError
from sim_backend.model.checks import is_series, require, require_all


@pytest.mark.parametrize(
    ("value", "limits", "wanted"),
    [
        (-1.0, {"above": 0.0}, "above 0 rad"),
        (math.inf, {"above": 0.0}, "finite and above 0 rad"),
        (math.nan, {"low": 1.0, "high": 2.0}, "finite, at least 1 and at most 2 rad"),
        (3.0, {"low": 1.0, "high": 2.0}, "at least 1 and at most 2 rad"),
        (2.0, {"above": 1.0, "below": 2.0}, "above 1 and below 2 rad"),
        (-math.inf, {}, "finite"),
    ],
)
def test_a_refusal_says_what_the_number_would_have_to_be(value, limits, wanted):
    with pytest.raises(ModelError) as error:
        require("x", value, "rad", "(1)", **limits)
    assert str(error.value) == f"x = {value!r} rad is not possible: it must be {wanted}; (1) needs it."


@pytest.mark.parametrize(
    ("value", "limits", "message"),
    [
        (10**400, {}, "about 1e+400 rad is not possible: it must be at most 1.79769e+308 rad"),
        (-(10**400), {}, "about -1e+400 rad is not possible: it must be at least -1.79769e+308 rad"),
        (
            10**5000,
            {"above": 0.0},
            "about 1e+5000 rad is not possible: it must be above 0 and at most 1.79769e+308 rad",
        ),
        (
            10**400,
            {"low": 0.0, "high": 1.0},
            "about 1e+400 rad is not possible: it must be at least 0 and at most 1 rad",
        ),
        (10**400, {"below": 1.0}, "about 1e+400 rad is not possible: it must be below 1 rad"),
        (
            Fraction(10**400),
            {"low": 0.0},
            f"Fraction({10**50}... rad is not possible: it must be at least 0 and at most 1.79769e+308 rad",
        ),
        (996 * 10**398, {"high": 1.0}, "about 1e+401 rad is not possible: it must be at most 1 rad"),
        (-26 * 10**398, {"low": 0.0}, "about -1e+399 rad is not possible: it must be at least 0 rad"),
        (None, {"above": 0.0}, "None is no number: it must be one, above 0 rad"),
        ("1", {}, "'1' is no number: it must be one, finite rad"),
        (1j, {"low": 0.0}, "1j is no number: it must be one, at least 0 rad"),
        (True, {"low": 0.0}, "True is no number: it must be one, at least 0 rad"),
        ([10**5000], {"low": 0.0}, "a list is no number: it must be one, at least 0 rad"),
        ([1.0] * 50, {"low": 0.0}, f"{str([1.0] * 50)[:60]}... is no number: it must be one, at least 0 rad"),
    ],
    ids=range(14),
)
def test_what_is_no_number_or_too_large_for_one_is_refused_in_the_same_words(value, limits, message):
    with pytest.raises(ModelError) as error:
        require("x", value, "rad", "(1)", **limits)
    assert str(error.value) == f"x = {message}; (1) needs it."


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([0.0, 10**400], r"^x\[1\] = about 1e\+400 rad is not possible: it must be at most 2 rad; \(1\) needs it"),
        ([0.0, "1"], r"^x\[1\] = '1' is no number"),
        (["1", 0.0], r"^x\[0\] = '1' is no number"),
        ([[0.0], [None]], r"^x\[1, 0\] = None is no number"),
        ([1j], r"^x\[0\] = 1j is no number"),
        (np.array([True]), r"^x\[0\] = True is no number"),
        (None, r"^x = None is no number"),
        ([[0.0], [0.0, 1.0]], r"^x = .* is no series of numbers: .* rows of one length"),
        ([0.0, 3.0], r"^x\[1\] = 3\.0 rad is not possible: it must be at most 2 rad"),
    ],
)
def test_of_a_series_too_the_first_that_is_no_number_is_named_with_its_place(values, message):
    with pytest.raises(ModelError, match=message):
        require_all("x", values, "rad", "(1)", high=2.0)


@pytest.mark.parametrize("values", [(), [1.0], range(3), np.zeros(2), np.zeros((0, 2)), np.array([None])], ids=range(6))
def test_several_values_are_a_tuple_a_list_or_an_array(values):
    assert is_series(values)


@pytest.mark.parametrize(
    "values",
    ["", "12", b"", b"12", bytearray(2), memoryview(b"12"), None, 1.0, {}, {1.0}, iter(()), np.array(1.0)],
    ids=range(12),
)
def test_text_bytes_and_single_values_are_not_several(values):
    assert not is_series(values)


def test_whole_numbers_and_numpys_are_numbers():
    for value in (1, np.float32(1.0), np.int64(1), Fraction(1, 2)):
        require("x", value, "rad", "(1)", low=0.0, high=1.0)
        require_all("x", [value, value], "rad", "(1)", low=0.0, high=1.0)


def test_what_is_possible_passes():
    require("x", 1.0, "rad", "(1)", low=1.0, high=1.0, above=0.0, below=2.0)
    require_all("x", np.array([[0.0, 1.0]]), "rad", "(1)", low=0.0)
    require_all("x", np.zeros(0), "rad", "(1)", above=0.0)


def test_of_many_values_the_first_wrong_one_is_named():
    with pytest.raises(ModelError, match=r"^x\[1, 0\] = nan rad .* finite and at least 0 rad"):
        require_all("x", np.array([[0.0, 1.0], [math.nan, -1.0]]), "rad", "(1)", low=0.0)
    with pytest.raises(ModelError, match=r"^x = -1\.0 rad"):
        require_all("x", -1.0, "rad", "(1)", low=0.0)

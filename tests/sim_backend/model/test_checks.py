"""What a refused number says of itself."""

import math

import numpy as np
import pytest

from sim_backend.errors import ModelError
from sim_backend.model.checks import require, require_all


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


def test_what_is_possible_passes():
    require("x", 1.0, "rad", "(1)", low=1.0, high=1.0, above=0.0, below=2.0)
    require_all("x", np.array([[0.0, 1.0]]), "rad", "(1)", low=0.0)
    require_all("x", np.zeros(0), "rad", "(1)", above=0.0)


def test_of_many_values_the_first_wrong_one_is_named():
    with pytest.raises(ModelError, match=r"^x\[1, 0\] = nan rad .* finite and at least 0 rad"):
        require_all("x", np.array([[0.0, 1.0], [math.nan, -1.0]]), "rad", "(1)", low=0.0)
    with pytest.raises(ModelError, match=r"^x = -1\.0 rad"):
        require_all("x", -1.0, "rad", "(1)", low=0.0)

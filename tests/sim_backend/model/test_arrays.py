"""Effects over arrays: the columns of a fit."""

import dataclasses

import numpy as np
import pytest

from sim_backend.errors import ModelError
from sim_backend.model.arrays import evaluate
from sim_backend.model.effects import CATALOGUE
from tests.slopes import evaluate_slope

ANGLE = np.linspace(-30.0, 30.0, 1001)
ERROR = CATALOGUE["kinematic-error"]


@pytest.mark.parametrize("compiled", [True, False])
def test_an_effect_is_evaluated_at_every_sample(compiled):
    values = evaluate(ERROR, {"motor_position": ANGLE, "unused": ANGLE}, (1e-4, 2.02, 0.3), compiled=compiled)
    # 1e-4 rad times the rounding of an argument of 60 rad
    assert values == pytest.approx(1e-4 * np.sin(2.02 * ANGLE + 0.3), abs=1e-18 * 1e3)


def test_the_slope_is_evaluated_at_every_sample():
    slope = evaluate_slope(ERROR, {"motor_position": ANGLE}, (1e-4, 2.0, 0.3))
    assert slope == pytest.approx(2e-4 * np.cos(2.0 * ANGLE + 0.3), abs=1e-15)


def test_an_empty_run_gives_an_empty_column():
    assert evaluate(ERROR, {"motor_position": np.zeros(0)}, (1.0, 2.0, 0.0)).shape == (0,)


def test_a_strided_view_gives_the_same_values():
    whole = evaluate(ERROR, {"motor_position": ANGLE}, (1.0, 2.0, 0.0))
    assert np.array_equal(evaluate(ERROR, {"motor_position": ANGLE[::3]}, (1.0, 2.0, 0.0)), whole[::3])


def test_a_missing_signal_is_named():
    with pytest.raises(ModelError, match="kinematic-error needs motor_position; given are output_torque"):
        evaluate(ERROR, {"output_torque": ANGLE}, (1.0, 2.0, 0.0))


def test_a_wrong_number_of_values_is_refused():
    with pytest.raises(ModelError, match=r"takes 3 values \(amplitude, order, phase\); 2 were given"):
        evaluate(ERROR, {"motor_position": ANGLE}, (1.0, 2.0))


def test_a_signal_with_two_dimensions_is_refused():
    with pytest.raises(ModelError, match="shapes"):
        evaluate(ERROR, {"motor_position": np.zeros((3, 2))}, (1.0, 2.0, 0.0))


def lag(output_torque, step, memory, amplitude, time_constant):
    if memory[1] == 0.0:
        memory[0], memory[1] = output_torque, 1.0
    memory[0] += (output_torque - memory[0]) * step / (time_constant + step)
    return amplitude * memory[0]


REMEMBERING = dataclasses.replace(ERROR, id="lag", function=lag, slope=None, memory=2, parameters=ERROR.parameters[:2])


@pytest.mark.parametrize("compiled", [True, False])
def test_an_effect_remembers_from_sample_to_sample_and_anew_in_every_run(compiled):
    jump = np.where(np.arange(5) < 2, 1.0, 2.0)
    for _ in range(2):
        values = evaluate(REMEMBERING, {"output_torque": jump}, (1.0, 0.1), step=0.1, compiled=compiled)
        assert values == pytest.approx([1.0, 1.0, 1.5, 1.75, 1.875], rel=1e-15)


@pytest.mark.parametrize("step", [None, 0.0, -1.0, np.nan])
def test_an_effect_with_memory_must_know_the_time_between_samples(step):
    with pytest.raises(ModelError, match=r"lag remembers and needs the step .* step = .* s"):
        evaluate(REMEMBERING, {"output_torque": ANGLE}, (1.0, 0.1), step=step)

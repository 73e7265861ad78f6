"""The DC motor: table 2, its own equations, and what is refused."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sim_backend.errors import ModelError
from sim_backend.model.dc_motor import (
    RPM,
    TABLE_2,
    DcMotor,
    motor_from_speeds,
    steady_speed,
    voltage_for,
)
from sim_backend.model.fourier_error import FourierError
from sim_backend.model.parameters import Rotation
from sim_backend.model.transmission import hdc_40
from tests.sim_backend.model.by_voltage import voltage_driven

NO_ERROR = FourierError(0.0, (0.0,), (0.0,))


@pytest.mark.parametrize("resistance", [0.1, 1.0, 10.0])
def test_the_last_three_rows_of_table_2_are_met_whatever_the_resistance(resistance):
    drag = hdc_40().drag
    motor = motor_from_speeds(TABLE_2[1:], drag, resistance)
    for voltage, speed in TABLE_2[1:]:
        assert steady_speed(motor, voltage, drag) == pytest.approx(speed, rel=1e-12)
    # 12 V / 560 rpm bounds the constant from above, the drag takes a little of it
    assert motor.constant < 0.20463
    assert motor.constant == pytest.approx(0.20463 - resistance * drag / 0.2046, abs=5e-4)


def test_the_first_row_lies_off_that_line():
    drag = hdc_40().drag
    motor = motor_from_speeds(TABLE_2[1:], drag)
    assert steady_speed(motor, 6.5, drag) / RPM == pytest.approx(303.3, abs=0.05)
    assert voltage_for(motor, 310.0 * RPM, drag) == pytest.approx(6.643, abs=5e-4)


@pytest.mark.parametrize("rotation", list(Rotation))
def test_from_standstill_the_motor_reaches_its_steady_speed(rotation):
    t = hdc_40(rotation)
    motor = motor_from_speeds(TABLE_2[1:], t.drag)
    rates = voltage_driven(t, NO_ERROR, motor, 12.0)
    end = solve_ivp(rates, (0.0, 0.5), [0.0] * 5, method="LSODA", rtol=1e-8, atol=1e-10).y[:, -1]
    assert end[1] == pytest.approx(560.0 * RPM, rel=1e-6)
    # the start struck the load's mode, which dies out in seconds
    assert end[3] == pytest.approx(560.0 * RPM / 50.0, rel=1e-3)
    assert motor.constant * end[4] == pytest.approx(t.drag * end[1], rel=1e-3)


def test_the_chosen_winding_follows_ten_times_faster_than_the_speed():
    t = hdc_40()
    motor = motor_from_speeds(TABLE_2[1:], t.drag)
    mechanical = t.shaft_inertia * motor.resistance / motor.constant**2
    assert mechanical / (motor.inductance / motor.resistance) == pytest.approx(10.8, abs=0.1)


def test_a_motor_that_cannot_be_is_refused():
    with pytest.raises(ModelError, match=r"resistance = 0.0 ohm is not possible.*L di/dt"):
        DcMotor(0.0, 1e-3, 0.2)
    with pytest.raises(ModelError, match="constant = nan"):
        DcMotor(1.0, 1e-3, math.nan)
    with pytest.raises(ModelError, match=r"inductance = about 1e\+400 H is not possible.*at most 1e\+06 H"):
        DcMotor(1.0, 10**400, 0.2)
    with pytest.raises(ModelError, match=r"drag = 1.0 N\*m\*s/rad with resistance = 1.0 ohm: at most 0.0105"):
        motor_from_speeds(TABLE_2[1:], 1.0)


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ([], r"rows is empty: it must have at least one pair of a voltage \(0\.001 to 1e\+06 V\)"),
        ([(12.0, 0.0)], r"rows\[0\] speed = 0\.0 rad/s is not possible: it must be at least 0\.001"),
        ([(12.0, 58.0), (-18.0, 88.0)], r"rows\[1\] voltage = -18\.0 V is not possible.*at most 1e\+06 V"),
        (5.0, r"rows = 5\.0 is not possible: it must be a sequence with at least one pair of a voltage"),
        (None, r"rows = None is not possible: .* \(0\.001 to 1e\+06 rad/s\)"),
        ("12", r"rows = '12' is not possible"),
        ([12.0, 58.0], r"rows\[0\] = 12\.0 is not possible: it must be a pair of a voltage"),
        ([(12.0, 58.0), (18.0,)], r"rows\[1\] = \(18\.0,\) is not possible: .* speed \(0\.001"),
        (b"12", r"rows = b'12' is not possible"),
        ([b"12"], r"rows\[0\] = b'12' is not possible"),
        (["12"], r"rows\[0\] = '12' is not possible"),
        ([(10**400, 58.0)], r"rows\[0\] voltage = about 1e\+400 V is not possible"),
        ([(math.nan, 58.0)], r"rows\[0\] voltage = nan V"),
        (
            [("12", 58.0)],
            r"rows\[0\] voltage = '12' is no number: it must be one, at least 0\.001 and at most 1e\+06 V",
        ),
    ],
)
def test_a_row_that_no_motor_has_is_named_with_its_place(rows, words):
    with pytest.raises(ModelError, match=rf"{words}.*k\^2 - slope k \+ R drag = 0.* needs it"):
        motor_from_speeds(rows, 1e-4)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda motor: steady_speed(motor, 12.0, -5.0), r"drag = -5\.0 N\*m\*s/rad .* at least 0 and at most 1e\+06"),
        (lambda motor: steady_speed(motor, math.inf, 1e-4), "voltage = inf V"),
        (lambda motor: voltage_for(motor, math.nan, 1e-4), "speed = nan rad/s"),
        (lambda motor: voltage_for(motor, 30.0, math.nan), r"drag = nan N\*m\*s/rad"),
        (lambda motor: motor_from_speeds(TABLE_2[1:], -1e-4), r"drag = -0\.0001 N\*m\*s/rad"),
    ],
)
def test_a_speed_or_voltage_is_computed_of_possible_numbers_only(call, words):
    with pytest.raises(ModelError, match=rf"{words}.*V = \(k_e \+ R drag/k_e\) omega_m"):
        call(motor_from_speeds(TABLE_2[1:], hdc_40().drag))


def test_a_resistance_that_is_none_is_named_before_the_drag_is_held_against_it():
    with pytest.raises(ModelError, match=r"resistance = nan ohm .* L di/dt"):
        motor_from_speeds(TABLE_2[1:], 1e-4, math.nan)


def test_rows_may_be_an_array():
    motor = motor_from_speeds(np.array(TABLE_2[1:]), 1e-4)
    assert motor == motor_from_speeds(TABLE_2[1:], 1e-4)
    assert type(motor.constant) is float
    with pytest.raises(ModelError, match=r"^rows is empty"):
        motor_from_speeds(np.zeros((0, 2)), 1e-4)


def test_a_motor_turns_backwards_as_fast_as_forwards():
    motor = motor_from_speeds(TABLE_2[1:], 1e-4)
    assert steady_speed(motor, -12.0, 1e-4) == -steady_speed(motor, 12.0, 1e-4)
    assert voltage_for(motor, -30.0, 1e-4) == -voltage_for(motor, 30.0, 1e-4)

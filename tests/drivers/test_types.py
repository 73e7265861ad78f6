"""Values that travel."""

import dataclasses
import inspect
from enum import StrEnum

from drivers import types
from drivers.types import DriveState, Sample


def test_the_motor_may_carry_torque_in_three_states_only() -> None:
    energised = {state for state in DriveState if state.energised}
    assert energised == {DriveState.ENABLED, DriveState.QUICK_STOP, DriveState.FAULT_REACTION}


def test_what_was_not_measured_is_absent_and_not_zero() -> None:
    sample = Sample(time=0.0, cycle=0)
    measured = {name for name, value in sample._asdict().items() if value is not None}
    assert measured == {"time", "cycle", "late", "auxiliary"}


def test_every_value_that_travels_is_frozen_and_slotted() -> None:
    values = [cls for _, cls in inspect.getmembers(types, inspect.isclass) if cls.__module__ == types.__name__]
    values = [cls for cls in values if not issubclass(cls, StrEnum)]
    assert {"Setpoint", "DriveReading", "SensorReading", "Sample", "Limits"} <= {cls.__name__ for cls in values}
    for cls in values:
        tuple_like = issubclass(cls, tuple) and vars(cls).get("__slots__") == ()
        frozen = dataclasses.is_dataclass(cls) and cls.__dataclass_params__.frozen and "__slots__" in vars(cls)
        assert tuple_like or frozen, cls.__name__

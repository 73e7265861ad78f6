"""The signal table."""

from drivers.signals import AUXILIARY_PREFIX, BY_FIELD, BY_NAME, INTEGER_SIGNALS, SIGNALS, TIME
from drivers.types import Sample

SUFFIX_OF_UNIT = {
    "rad": "_rad",
    "rad/s": "_rad_s",
    "N*m": "_nm",
    "A": "_a",
    "V": "_v",
    "degC": "_degc",
    "1": "",
}


def test_names_and_log_fields_are_unique() -> None:
    assert len(BY_NAME) == len(BY_FIELD) == len(SIGNALS)


def test_the_suffix_of_a_log_field_tells_its_unit() -> None:
    assert {s.name: s.suffix for s in SIGNALS} == {s.name: SUFFIX_OF_UNIT[s.unit] for s in SIGNALS}


def test_every_signal_is_a_field_of_the_sample_and_the_other_way_round() -> None:
    fields = set(Sample._fields) - {"auxiliary"}
    assert fields == {s.name for s in SIGNALS} | {TIME.name}


def test_integer_signals_are_dimensionless_signals_of_the_table() -> None:
    assert {s.name for s in SIGNALS if s.unit == "1"} == INTEGER_SIGNALS


def test_no_log_field_can_be_taken_for_an_auxiliary_one() -> None:
    assert not [field for field in BY_FIELD if field.startswith(AUXILIARY_PREFIX)]


def test_the_fields_of_the_log_contract_are_there() -> None:
    # spot checks against the published contract, so that a rename does not go unnoticed
    assert BY_NAME["output_torque"].field == "output_torque_nm"
    assert BY_NAME["motor_velocity_command"].field == "motor_velocity_command_rad_s"
    assert BY_NAME["motor_temperature"].field == "motor_temperature_degc"
    assert BY_NAME["status_word"].field == "status_word"

"""The output encoder (CiA 406) and the torque transducer (CiA 404)."""

import math
import struct

import pytest

from sim_backend.errors import ModelError
from sim_backend.nodes.bench import OUTPUT_ENCODER, TORQUE_TRANSDUCER
from sim_backend.nodes.encoder406 import EncoderConfig, encoder_node
from sim_backend.nodes.torque404 import ZERO, TorqueConfig, torque_node
from tests.sim_backend.fake_plant import FakePlant
from tests.sim_backend.nodes.wire import AbortedError, Wire

COUNT = math.tau / 524288  # rad
RANGE = 524288 * 4096


@pytest.fixture
def plant() -> FakePlant:
    return FakePlant()


@pytest.fixture
def encoder(plant: FakePlant) -> Wire:
    return Wire(encoder_node(OUTPUT_ENCODER, plant))


@pytest.fixture
def torque(plant: FakePlant) -> Wire:
    return Wire(torque_node(TORQUE_TRANSDUCER, plant))


@pytest.mark.parametrize(
    ("angle", "position"),
    [
        (0.0, 0),
        (10.5 * COUNT, 10),
        (-0.5 * COUNT, RANGE - 1),  # wraps below zero
        (math.tau * 4096 + 3.5 * COUNT, 3),  # and above the range
    ],
)
def test_position_is_the_floor_of_the_angle_within_the_measuring_range(
    encoder: Wire, plant: FakePlant, angle: float, position: int
) -> None:
    plant.show(output_position=angle)
    assert encoder.read(0x6004) == position


def test_resolution_and_turns_can_be_read(encoder: Wire) -> None:
    assert encoder.read(0x6501) == 524288
    assert encoder.read(0x6502) == 4096
    assert encoder.read(0x6002) == RANGE


def test_a_preset_makes_the_position_jump_and_shows_in_the_offset(encoder: Wire, plant: FakePlant) -> None:
    plant.show(output_position=100.5 * COUNT)
    encoder.write(0x6003, 0, 40, 4)
    assert encoder.read(0x6004) == 40
    assert encoder.read(0x6509, signed=True) == -60
    plant.show(output_position=0.5 * COUNT)
    assert encoder.read(0x6004) == RANGE - 60
    with pytest.raises(AbortedError, match="06090031"):
        encoder.write(0x6003, 0, RANGE, 4)


def test_scaling_and_code_sequence_act_only_when_switched_on(encoder: Wire, plant: FakePlant) -> None:
    plant.show(output_position=1.25 * math.tau)
    encoder.write(0x6001, 0, 3600, 4)
    encoder.write(0x6002, 0, 36000, 4)
    assert encoder.read(0x6004) == 655360
    encoder.write(0x6000, 0, 0x0004, 2)
    assert encoder.read(0x6004) == 4500
    encoder.write(0x6000, 0, 0x0005, 2)
    assert encoder.read(0x6004) == 36000 - 4500
    assert encoder.read(0x6500) == 0x0005
    with pytest.raises(AbortedError, match="06090030"):
        encoder.write(0x6000, 0, 0x0008, 2)  # measuring direction is for linear scales


def test_the_cyclic_timer_is_the_event_timer_of_the_first_pdo(encoder: Wire) -> None:
    encoder.write(0x6200, 0, 20, 2)
    assert encoder.read(0x1800, 5) == 20
    encoder.write(0x1800, 5, 0, 2)
    assert encoder.read(0x6200) == 0
    encoder.write(0x6200, 0, 10, 2)
    encoder.operational()
    encoder.tick()
    assert encoder.tick(30) == ["183 00 00 00 00"] * 3


def test_a_reset_forgets_the_preset(encoder: Wire) -> None:
    encoder.write(0x6003, 0, 40, 4)
    encoder.send("000 81 03")
    encoder.tick(20)
    assert encoder.read(0x6004) == 0


def test_an_encoder_beyond_32_bits_is_an_error() -> None:
    with pytest.raises(ModelError, match="2\\^32"):
        EncoderConfig(encoder_counts=2**20, turns=2**13)


@pytest.mark.parametrize(("value", "raw"), [(1.23456, 12346), (-0.00005, -1), (0.00004, 0), (99.0, 400_000)])
def test_the_process_value_has_the_stated_digits_and_is_clipped_at_full_scale(
    torque: Wire, plant: FakePlant, value: float, raw: int
) -> None:
    plant.show(output_torque=value)
    assert torque.read(0x6132, 1) == 4
    assert torque.read(0x9130, 1, signed=True) == raw


def test_the_other_widths_show_the_same_value(torque: Wire, plant: FakePlant) -> None:
    plant.show(output_torque=-2.5)
    assert torque.read(0x7130, 1, signed=True) == -25000
    assert struct.unpack("<f", torque.read(0x6130, 1).to_bytes(4, "little"))[0] == -2.5
    plant.show(output_torque=30.0)
    assert torque.read(0x7130, 1, signed=True) == 32767  # 300000 does not fit 16 bits


def test_a_change_of_digits_rescales_every_reading(torque: Wire, plant: FakePlant) -> None:
    plant.show(output_torque=1.5)
    torque.write(0x6132, 1, 2, 1)
    assert torque.read(0x9130, 1) == 150
    with pytest.raises(AbortedError, match="06090031"):
        torque.write(0x6132, 1, 7, 1)


@pytest.mark.parametrize(("value", "status"), [(0.0, 0), (40.0, 2), (-41.0, 4)])
def test_over_and_under_range_show_in_the_status(torque: Wire, plant: FakePlant, value: float, status: int) -> None:
    plant.show(output_torque=value)
    assert torque.read(0x6150, 1) == status


def test_autozero_moves_the_offset_so_that_the_process_value_becomes_zero(torque: Wire, plant: FakePlant) -> None:
    plant.show(output_torque=0.25)
    assert torque.read(0x9124, 1) == 0
    torque.write(0x6125, 1, ZERO, 4)
    assert torque.read(0x9130, 1) == 0
    assert torque.read(0x9124, 1, signed=True) == -2500
    plant.show(output_torque=0.75)
    assert torque.read(0x9130, 1) == 5000
    torque.write(0x6125, 1, ZERO, 4)
    assert torque.read(0x9124, 1, signed=True) == -7500


def test_autozero_needs_its_signature(torque: Wire) -> None:
    with pytest.raises(AbortedError, match="08000020"):
        torque.write(0x6125, 1, ZERO + 1, 4)


def test_autozero_outside_its_range_times_out_by_abort_and_keeps_the_offset(torque: Wire, plant: FakePlant) -> None:
    plant.show(output_torque=8.1)
    with pytest.raises(AbortedError, match="05040000"):
        torque.write(0x6125, 1, ZERO, 4)
    assert torque.read(0x9124, 1) == 0


def test_autozero_outside_its_range_times_out_by_silence(plant: FakePlant) -> None:
    wire = Wire(torque_node(TorqueConfig(refuse_tare_by_silence=True), plant))
    plant.show(output_torque=-8.1)
    assert wire.send("604 22 25 61 01 7A 65 72 6F") == []
    assert wire.read(0x9124, 1) == 0


@pytest.mark.parametrize("settings", [{"digits": 7}, {"digits": -1}, {"full_scale": 1e6}, {"full_scale": -1.0}])
def test_an_impossible_transducer_is_an_error(settings: dict[str, float]) -> None:
    with pytest.raises(ModelError, match="torque transducer"):
        TorqueConfig(**settings)

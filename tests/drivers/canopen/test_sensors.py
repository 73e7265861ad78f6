"""Encoder and torque transducer against the simulated CiA 406 and 404 devices."""

import math
from dataclasses import replace

import pytest

from drivers.errors import ConfigError, DriveFaultError, NotConnectedError, RigTimeoutError
from sim_backend.buses.hooks import corrupt, process_data_of
from sim_backend.nodes.communication import NodeOptions
from sim_backend.nodes.encoder406 import EncoderConfig
from sim_backend.nodes.frame import Frame
from sim_backend.nodes.torque404 import TorqueConfig
from tests.drivers.canopen.bench import CYCLE_TIME, ENCODER, TORQUE, device_config, simulated_bench

TURN = 2 * math.pi


def test_the_encoder_gives_the_angle_within_one_count() -> None:
    bench = simulated_bench(ENCODER)
    info = bench.encoder.connect()
    assert info.resolution == pytest.approx(TURN / 524288)
    for angle in (0.25, 1.0, -0.3, 7.5):
        bench.plant.set(output_position=angle)
        bench.cycles(1)
        value = bench.encoder.read().value
        assert math.remainder(value - angle, 4096 * TURN) == pytest.approx(0.0, abs=TURN / 524288)


def test_the_encoder_is_unwrapped_over_many_turns_of_a_single_turn_device() -> None:
    bench = simulated_bench(ENCODER, encoder=EncoderConfig(encoder_counts=4096, turns=1))
    bench.plant.set(output_position=0.0)
    bench.connect()
    for k in range(1, 51):
        bench.plant.set(output_position=0.2 * k * TURN)
        bench.cycles(1)
    reading = bench.encoder.read()
    assert reading.value == pytest.approx(10 * TURN, abs=TURN / 4096)
    assert reading.valid


def test_a_jump_of_more_than_a_quarter_range_is_not_valid() -> None:
    bench = simulated_bench(ENCODER, encoder=EncoderConfig(encoder_counts=4096, turns=1))
    bench.plant.set(output_position=0.0)
    bench.connect()
    bench.plant.set(output_position=0.3 * TURN)
    bench.cycles(1)
    assert not bench.encoder.read().valid


def test_scaling_in_the_encoder_is_respected() -> None:
    bench = simulated_bench(ENCODER)
    dictionary = bench.node(3).dictionary
    dictionary[0x6001, 0].value = 1000
    dictionary[0x6002, 0].value = 4000
    dictionary[0x6000, 0].value = 0x0004
    info = bench.encoder.connect()
    assert info.resolution == pytest.approx(TURN / 1000)
    assert info.full_scale == pytest.approx(4 * TURN)


def test_an_encoder_too_fast_to_unwrap_is_refused() -> None:
    fastest = 0.26 * TURN / CYCLE_TIME
    bench = simulated_bench(
        replace(ENCODER, options={"max_velocity": fastest}), encoder=EncoderConfig(encoder_counts=4096, turns=1)
    )
    with pytest.raises(ConfigError, match=r"options.max_velocity.*quarter of the range"):
        bench.encoder.connect()


def test_the_sign_of_a_sensor_applies() -> None:
    bench = simulated_bench(
        replace(ENCODER, sign={"output_position": -1}), replace(TORQUE, sign={"output_torque": -1})
    ).connect()
    assert bench.encoder.read().value == pytest.approx(-0.25, abs=2e-5)
    assert bench.torque.read().value == pytest.approx(-3.0, abs=1e-4)


def test_the_encoder_is_read_on_sync_only_and_put_back_when_closed() -> None:
    bench = simulated_bench(ENCODER)
    entries = [(0x1800, 1), (0x1800, 2), (0x1A00, 1), (0x1017, 0), (0x6200, 0)]
    before = [bench.value(3, *entry) for entry in entries]
    bench.connect()
    assert bench.value(3, 0x1800, 2) == 1
    assert bench.value(3, 0x1A00, 1) == 0x60040020
    bench.encoder.close()
    assert [bench.value(3, *entry) for entry in entries] == before


@pytest.mark.parametrize("name", ["output_encoder", "torque_sensor"])
def test_a_sensor_that_does_not_answer_is_not_connected(name: str) -> None:
    driver = {"output_encoder": "cia406", "torque_sensor": "cia404"}[name]
    bench = simulated_bench(device_config(name, driver, 99))
    with pytest.raises(NotConnectedError, match="node 99"):
        bench.devices[name].connect()
    bench.devices[name].close()


@pytest.mark.parametrize("digits", [0, 2, 4])
def test_the_torque_is_scaled_by_the_decimal_digits(digits: int) -> None:
    bench = simulated_bench(TORQUE, torque=TorqueConfig(digits=digits))
    info = bench.torque.connect()
    bench.cycles(1)
    assert info.resolution == pytest.approx(10.0**-digits)
    assert bench.torque.read().value == pytest.approx(3.0, abs=0.5 * 10.0**-digits)


def test_the_unit_comes_from_the_bench_file() -> None:
    bench = simulated_bench(replace(TORQUE, options={"unit": "mN*m"})).connect()
    assert bench.torque.read().value == pytest.approx(3.0e-3)
    # 1 lbf = 4.4482216152605 N exactly, 1 in = 0.0254 m exactly
    bench = simulated_bench(replace(TORQUE, options={"unit": "lbf*in"})).connect()
    assert bench.torque.read().value == pytest.approx(3.0 * 4.4482216152605 * 0.0254)


def test_a_reading_at_full_scale_is_not_valid() -> None:
    bench = simulated_bench(replace(TORQUE, options={"full_scale": 40.0})).connect()
    assert bench.torque.read().valid
    bench.plant.set(output_torque=55.0)
    bench.cycles(1)
    assert not bench.torque.read().valid


@pytest.mark.parametrize("data", ["ff ff ff 7f", "00 00 00 80"])
def test_a_reading_at_the_end_of_the_number_format_is_not_valid(data: str) -> None:
    bench = simulated_bench(TORQUE).connect()
    bench.world.bus.add_hook(corrupt(process_data_of(4), lambda sent: Frame(sent.can_id, bytes.fromhex(data))))
    bench.cycles(1)
    assert not bench.torque.read().valid


def test_tare_gives_the_torque_it_removed_and_reports_both_offsets() -> None:
    bench = simulated_bench(TORQUE).connect()
    assert bench.torque.tare() == pytest.approx(3.0)
    bench.cycles(1)
    assert bench.torque.read().value == pytest.approx(0.0, abs=1e-4)
    assert "offset object 0 -> -30000" in bench.bus.events()[0].text


@pytest.mark.parametrize("silent", [True, False])
def test_a_refused_tare_is_a_time_out_that_tells_the_old_offset(silent: bool) -> None:
    bench = simulated_bench(TORQUE, torque=TorqueConfig(refuse_tare_by_silence=silent)).connect()
    bench.plant.set(output_torque=12.0)
    bench.cycles(1)
    with pytest.raises(RigTimeoutError, match=r"to zero itself.*it shows 12 N\*m and its offset object is 0"):
        bench.torque.tare()
    bench.cycles(1)
    assert bench.torque.read().value == pytest.approx(12.0)


def test_decimal_digits_that_change_behind_the_bench_are_noticed_at_the_tare() -> None:
    bench = simulated_bench(TORQUE).connect()
    bench.node(4).dictionary[0x6132, 1].value = 2
    with pytest.raises(DriveFaultError, match="decimal digits from 4 to 2"):
        bench.torque.tare()


def test_a_transducer_without_offset_object_can_still_be_zeroed() -> None:
    bench = simulated_bench(TORQUE, options=NodeOptions(hidden=frozenset({0x9124}))).connect()
    assert bench.torque.tare() == pytest.approx(3.0)

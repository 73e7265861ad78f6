"""A drive against the simulated CiA 402 device."""

import math
from dataclasses import replace

import pytest

from drivers.errors import ConfigError, DriveFaultError, LimitError, NotConnectedError, RigTimeoutError
from drivers.types import DriveState, Mode
from sim_backend.buses.hooks import drop, from_node
from sim_backend.faults import FAULTS
from sim_backend.nodes.bench import MOTOR_DRIVE
from sim_backend.nodes.communication import NodeOptions
from sim_backend.nodes.drive402_objects import CST, TorqueUnit, VelocityUnit
from sim_backend.ports import AxisMode
from tests.drivers.canopen.bench import CYCLE_TIME, HEARTBEAT_TIME, LOAD, MOTOR, device_config, simulated_bench

COUNTS = MOTOR_DRIVE.encoder_counts
RATED = MOTOR_DRIVE.rated_torque


def test_connecting_sets_up_watchdog_process_data_and_heartbeat() -> None:
    bench = simulated_bench(MOTOR).connect()
    assert bench.value(1, 0x1016, 1) == 127 << 16 | round(HEARTBEAT_TIME * 1000)
    assert bench.value(1, 0x6007) == 3
    assert bench.value(1, 0x605A) == 2
    assert bench.value(1, 0x1017) == round(HEARTBEAT_TIME * 1000 / 4)
    assert [bench.value(1, 0x1A00, k) for k in (1, 2, 3)] == [0x60410010, 0x60640020, 0x60770010]
    assert [bench.value(1, 0x1600, k) for k in (1, 2)] == [0x60400010, 0x60710010]
    assert [bench.value(1, 0x1601, k) for k in (1, 2)] == [0x60400010, 0x607A0020]
    assert [bench.value(1, 0x1602, k) for k in (1, 2)] == [0x60400010, 0x60FF0020]
    for communication in (0x1800, 0x1400, 0x1401, 0x1402):
        assert bench.value(1, communication, 2) == 1
        assert not bench.value(1, communication, 1) & 0x80000000
    for other in (0x1801, 0x1802, 0x1803, 0x1403):
        assert bench.value(1, other, 1) & 0x80000000


def test_connecting_leaves_the_drive_disabled_and_the_motor_without_command() -> None:
    bench = simulated_bench(MOTOR).connect()
    assert bench.motor.read().state is DriveState.SWITCH_ON_DISABLED
    assert bench.plant.commands.get("motor", (AxisMode.OFF, 0.0))[0] is AxisMode.OFF


def test_the_drive_tells_who_it_is_and_what_was_changed() -> None:
    bench = simulated_bench(MOTOR)
    info = bench.motor.connect()
    assert dict(info.identity)["device type"] == "0x00020192"
    assert info.resolution == pytest.approx(RATED / 1000)
    assert info.full_scale == pytest.approx(MOTOR_DRIVE.max_torque, rel=1e-3)
    changed = {what: (old, new) for what, old, new in info.changed}
    assert changed["0x6007:00 (abort connection option)"] == ("1", "3")
    assert {"TPDO1", "RPDO1", "RPDO2", "RPDO3", "0x1016:01 (heartbeat consumer)"} <= set(changed)


def test_closing_puts_every_changed_parameter_back() -> None:
    bench = simulated_bench(MOTOR)
    entries = [(0x1016, 1), (0x1017, 0), (0x6007, 0), (0x605A, 0), (0x6072, 0), (0x6080, 0)]
    for communication in (0x1400, 0x1401, 0x1402, 0x1403, 0x1800, 0x1801, 0x1802, 0x1803):
        entries += [(communication, 1), (communication, 2), (communication + 0x200, 0), (communication + 0x200, 1)]
    before = [bench.value(1, index, sub) for index, sub in entries]
    bench.connect()
    assert [bench.value(1, index, sub) for index, sub in entries] != before
    bench.motor.close()
    assert [bench.value(1, index, sub) for index, sub in entries] == before


def test_limits_from_the_bench_file_are_set_in_the_drive() -> None:
    limited = replace(MOTOR, options={"max_torque": 0.1, "max_velocity": 100.0})
    bench = simulated_bench(limited).connect()
    assert bench.value(1, 0x6072) == math.floor(1000 * 0.1 / RATED)
    assert bench.value(1, 0x6080) == math.floor(100.0 * 60 / (2 * math.pi))


def test_the_drive_keeps_the_limits_of_the_bench_with_a_tenth_more() -> None:
    bench = simulated_bench(replace(MOTOR, max_torque=0.25, max_velocity=220.0))
    before = bench.value(1, 0x6072), bench.value(1, 0x6080)
    info = bench.motor.connect()
    assert bench.value(1, 0x6072) == math.floor(1000 * 1.1 * 0.25 / RATED)
    assert bench.value(1, 0x6080) == math.floor(1.1 * 220.0 * 60 / (2 * math.pi))
    assert info.full_scale == pytest.approx(0.275, abs=RATED / 1000)
    bench.motor.close()
    assert (bench.value(1, 0x6072), bench.value(1, 0x6080)) == before


def test_a_lower_limit_of_the_drive_is_left_as_it_is() -> None:
    bench = simulated_bench(replace(MOTOR, max_torque=10.0, max_velocity=1e4)).connect()
    assert bench.value(1, 0x6072) == round(1000 * MOTOR_DRIVE.max_torque / RATED)
    assert bench.value(1, 0x6080) == round(MOTOR_DRIVE.max_speed * 60 / (2 * math.pi))


def test_a_drive_that_keeps_no_limits_connects_with_a_warning() -> None:
    bare = NodeOptions(hidden=frozenset({0x6072, 0x6080}))
    bench = simulated_bench(replace(MOTOR, max_torque=0.25, max_velocity=220.0), options=bare)
    told = " ".join(bench.motor.connect().warnings)
    assert "no limit of 0.25 by itself" in told
    assert "no limit of 220 by itself" in told


def test_a_drive_leaves_operational_when_the_bench_falls_silent_whatever_it_was_set_to() -> None:
    bench = simulated_bench(MOTOR)
    bench.node(1).dictionary[0x1029, 1].value = 1  # stay as it is
    bench.motor.connect()
    assert bench.value(1, 0x1029, 1) == 0
    bench.motor.close()
    assert bench.value(1, 0x1029, 1) == 1


def test_a_limit_that_the_drive_cannot_hold_is_a_configuration_error() -> None:
    bench = simulated_bench(replace(MOTOR, options={"max_torque": 1e-5}))
    with pytest.raises(ConfigError, match=r"devices\.motor\.options\.max_torque = 1e-05.*0x6072"):
        bench.motor.connect()


def test_an_option_that_the_drive_refuses_is_named_as_the_bench_file_has_it() -> None:
    bench = simulated_bench(replace(MOTOR, options={"quick_stop_option": 99}))
    with pytest.raises(ConfigError, match=r"devices\.motor\.options\.quick_stop_option = 99: refused.*0x605A") as got:
        bench.motor.connect()
    assert got.value.exit_code == 2
    bench.motor.close()


def test_a_silent_node_is_not_connected_and_closing_it_sends_nothing() -> None:
    bench = simulated_bench(device_config("motor", "cia402", 77))
    with pytest.raises(NotConnectedError, match=r"node 77 on simulated 'bench'.*0x1000") as got:
        bench.motor.connect()
    assert list(got.value.missing) == ["motor"]
    sent = len(bench.tap.sent)
    bench.motor.close()
    assert len(bench.tap.sent) == sent


def test_another_kind_of_device_is_refused() -> None:
    bench = simulated_bench(device_config("motor", "cia402", 3))
    with pytest.raises(ConfigError, match=r"profile 406 .*the driver needs 402"):
        bench.motor.connect()


def test_a_drive_in_fault_connects_with_a_warning() -> None:
    bench = simulated_bench(MOTOR)
    bench.drive_node().fault(0x2310)
    bench.world.advance_to(0.5)
    info = bench.motor.connect()
    assert any("0x2310 (continuous over-current)" in warning for warning in info.warnings)


def test_readings_are_si_values_at_the_shaft() -> None:
    bench = simulated_bench(MOTOR).connect()
    reading = bench.motor.read()
    assert reading.position == pytest.approx(1.0, abs=2 * math.pi / COUNTS)  # one encoder count
    assert reading.torque == pytest.approx(0.02, abs=RATED / 1000)  # one per mille of rated torque
    assert reading.age == 0
    assert not reading.limit_active


def test_signs_apply_to_readings_and_to_setpoints() -> None:
    bench = simulated_bench(replace(MOTOR, sign={"motor_position": -1, "motor_torque": -1})).connect()
    reading = bench.motor.read()
    assert reading.position == pytest.approx(-1.0, abs=2 * math.pi / COUNTS)
    assert reading.torque == pytest.approx(-0.02, abs=RATED / 1000)
    for mode, axis_mode, value in (
        (Mode.TORQUE, AxisMode.TORQUE, 0.05),
        (Mode.VELOCITY, AxisMode.VELOCITY, 3.0),
        (Mode.POSITION, AxisMode.POSITION, 2.0),
    ):
        bench.motor.disable()
        bench.motor.enable(mode)
        bench.motor.write(value)
        bench.cycles(2)
        commanded = bench.plant.commands["motor"]
        assert commanded[0] is axis_mode
        assert commanded[1] == pytest.approx(-value, abs=5e-3 * value)


def test_a_position_beyond_the_drives_32_bits_is_unwrapped_both_ways() -> None:
    bench = simulated_bench(MOTOR)
    turn = 2 * math.pi
    edge = (2**31 - 100) / COUNTS * turn
    bench.plant.set(motor_position=edge)
    bench.connect()
    bench.plant.set(motor_position=edge + turn)
    bench.cycles(1)
    assert bench.motor.read().position == pytest.approx(edge + turn, abs=turn / COUNTS)
    bench.motor.enable(Mode.POSITION)
    bench.motor.write(edge + turn)
    bench.cycles(2)
    raw = round((edge + turn) * COUNTS / turn)
    assert bench.value(1, 0x607A) == (raw + 2**31) % 2**32 - 2**31


@pytest.mark.parametrize("mode", list(Mode))
def test_enable_clears_old_targets_and_holds_the_position(mode: Mode) -> None:
    bench = simulated_bench(MOTOR).connect()
    bench.node(1).dictionary[0x6071, 0].value = 500
    bench.node(1).dictionary[0x60FF, 0].value = 10_000
    bench.motor.enable(mode)
    assert bench.value(1, 0x6071) == 0
    assert bench.value(1, 0x60FF) == 0
    assert bench.value(1, 0x607A) == pytest.approx(COUNTS / (2 * math.pi), abs=1)
    assert bench.value(1, 0x6060) == {Mode.TORQUE: 10, Mode.VELOCITY: 9, Mode.POSITION: 8}[mode]


@pytest.mark.parametrize("silent", [False, True])
def test_a_refused_mode_is_an_error_and_the_drive_stays_without_torque(silent: bool) -> None:
    stubborn = replace(MOTOR_DRIVE, refuse_modes=(CST,), refuse_by_silence=silent)
    bench = simulated_bench(MOTOR, motor=stubborn).connect()
    how = "0x6061:00" if silent else "SDO abort"
    with pytest.raises(DriveFaultError, match=f"refused mode torque.*{how}.*supported modes"):
        bench.motor.enable(Mode.TORQUE)
    assert bench.motor.disable() is DriveState.SWITCH_ON_DISABLED
    bench.motor.enable(Mode.VELOCITY)
    assert bench.motor.armed


def test_the_mode_changes_in_operation_only_at_standstill() -> None:
    bench = simulated_bench(MOTOR).connect()
    bench.motor.enable(Mode.TORQUE)
    bench.plant.set(motor_velocity=10.0)
    bench.cycles(1)
    with pytest.raises(DriveFaultError, match=r"turns at 10 rad/s, so its mode was not changed to velocity"):
        bench.motor.enable(Mode.VELOCITY)
    bench.plant.set(motor_velocity=0.0)
    bench.cycles(1)
    bench.motor.enable(Mode.VELOCITY)
    bench.motor.write(2.0)
    bench.cycles(2)
    assert bench.plant.commands["motor"][0] is AxisMode.VELOCITY


def test_enabling_again_in_the_same_mode_changes_nothing() -> None:
    bench = simulated_bench(MOTOR).connect()
    bench.motor.enable(Mode.TORQUE)
    bench.motor.write(0.05)
    bench.cycles(1)
    bench.motor.enable(Mode.TORQUE)
    assert bench.value(1, 0x6071) == round(0.05 / RATED * 1000)


def test_enable_before_the_first_exchange_is_refused_because_nothing_watches_the_drive() -> None:
    bench = simulated_bench(MOTOR)
    bench.motor.connect()
    with pytest.raises(DriveFaultError, match=r"never heard the bench's heartbeat"):
        bench.motor.enable(Mode.TORQUE)
    assert bench.drive_node().config.axis not in bench.plant.commands or (
        bench.plant.commands["motor"][0] is AxisMode.OFF
    )


def test_enable_after_a_pause_of_the_control_loop_is_refused() -> None:
    bench = simulated_bench(MOTOR).connect()
    bench.clock.sleep_until(bench.clock.now() + 2 * HEARTBEAT_TIME)
    with pytest.raises(DriveFaultError, match=r"last heard it 0\.2 s ago"):
        bench.motor.enable(Mode.TORQUE)


def test_enable_before_connect_is_refused() -> None:
    bench = simulated_bench(MOTOR)
    with pytest.raises(DriveFaultError, match=r"is not connected"):
        bench.motor.enable(Mode.TORQUE)
    assert bench.tap.sent == []


def test_a_drive_without_watchdog_connects_but_is_not_enabled() -> None:
    bench = simulated_bench(MOTOR, options=NodeOptions(hidden=frozenset({0x6007})))
    info = bench.motor.connect()
    assert any("it has no watchdog" in warning for warning in info.warnings)
    bench.cycles(1)
    with pytest.raises(DriveFaultError, match=r"has no watchdog that stops it when the bench dies"):
        bench.motor.enable(Mode.TORQUE)


def test_a_declared_external_watchdog_stands_in() -> None:
    declared = replace(MOTOR, options={"external_watchdog": True})
    bench = simulated_bench(declared, options=NodeOptions(hidden=frozenset({0x6007}))).connect()
    bench.motor.enable(Mode.TORQUE)
    assert bench.motor.armed


def test_a_profile_with_another_velocity_unit_is_refused() -> None:
    bench = simulated_bench(MOTOR, motor=replace(MOTOR_DRIVE, velocity_unit=VelocityUnit.RPM))
    with pytest.raises(DriveFaultError, match=r"states speeds in rpm \(0x60A9\), profile 'generic' takes counts/s"):
        bench.motor.connect()


def test_a_setpoint_to_a_disabled_drive_is_refused_and_not_sent() -> None:
    bench = simulated_bench(MOTOR).connect()
    with pytest.raises(DriveFaultError, match=r"is not enabled, so the setpoint 0\.05 was not sent"):
        bench.motor.write(0.05)
    bench.cycles(1)
    assert bench.tap.sent_to(0x201) == []


@pytest.mark.parametrize("value", [1e3, -1e3, math.inf, math.nan])
def test_a_setpoint_beyond_the_number_format_is_refused_and_not_sent(value: float) -> None:
    bench = simulated_bench(MOTOR).connect()
    bench.motor.enable(Mode.TORQUE)
    with pytest.raises(LimitError, match=r"number format"):
        bench.motor.write(value)
    bench.cycles(1)
    assert bench.tap.sent_to(0x201) == []


def test_the_internal_limit_of_the_drive_is_shown() -> None:
    bench = simulated_bench(MOTOR).connect()
    bench.motor.enable(Mode.TORQUE)
    bench.plant.limited = True
    bench.cycles(2)
    assert bench.motor.read().limit_active


def test_closing_an_enabled_drive_takes_the_torque_away_first() -> None:
    bench = simulated_bench(MOTOR).connect()
    bench.motor.enable(Mode.TORQUE)
    bench.motor.write(0.1)
    bench.cycles(2)
    bench.motor.close()
    assert bench.plant.commands["motor"][0] is AxisMode.OFF
    bench.motor.close()


def test_a_drive_that_does_not_let_itself_be_disabled_keeps_its_watchdog_when_it_is_closed() -> None:
    watchdog_time = 2.0  # s, longer than the 0.5 s for which a state is awaited
    patient = replace(MOTOR, heartbeat_time=watchdog_time)
    bench = simulated_bench(patient, replace(LOAD, heartbeat_time=watchdog_time)).connect()
    bench.motor.enable(Mode.TORQUE)
    bench.motor.write(0.1)
    bench.cycles(2)
    FAULTS["ignore-control-word"].inject(bench.world, 1, bench.world.time)
    with pytest.raises(RigTimeoutError, match=r"'motor' to reach a state without torque.*not remote") as got:
        bench.motor.close()
    assert [bench.value(1, *key) for key in ((0x1016, 1), (0x6007, 0), (0x605A, 0))] == [
        127 << 16 | 2000,
        3,
        2,
    ]
    left = " ".join(got.value.__notes__)
    assert "Not restored on 'motor'" in left
    assert "heartbeat consumer" in left
    assert bench.plant.commands["motor"][0] is AxisMode.TORQUE
    # the control loop goes on for the load drive, and must not feed the motor's watchdog
    bench.cycles(round(watchdog_time / CYCLE_TIME))
    assert bench.plant.commands["motor"][0] is AxisMode.OFF


def test_closing_a_drive_that_went_silent_says_what_was_not_restored() -> None:
    bench = simulated_bench(MOTOR).connect()
    bench.world.bus.add_hook(drop(from_node(1)))
    with pytest.raises(RigTimeoutError, match=r"0x6040") as got:
        bench.motor.close()
    assert any("Not restored on 'motor'" in note and "0x6007" in note for note in got.value.__notes__)


def test_closing_a_half_open_drive_restores_what_was_changed_so_far() -> None:
    # the process data object RPDO3 is missing, so connecting fails after the watchdog was set
    bench = simulated_bench(MOTOR, options=NodeOptions(hidden=frozenset({0x1402})))
    with pytest.raises(DriveFaultError, match=r"has no RPDO3"):
        bench.motor.connect()
    assert bench.value(1, 0x6007) == 3
    bench.motor.close()
    assert bench.value(1, 0x6007) == 1
    assert bench.value(1, 0x1016, 1) == 0


def test_a_fault_is_reset_and_the_drive_stays_disabled() -> None:
    bench = simulated_bench(MOTOR).connect()
    bench.drive_node().fault(0x2310)
    bench.cycles(500)
    assert bench.motor.read().state is DriveState.FAULT
    with pytest.raises(DriveFaultError, match=r"cannot be enabled.*0x2310"):
        bench.motor.enable(Mode.TORQUE)
    assert bench.motor.fault_reset() is DriveState.SWITCH_ON_DISABLED
    bench.cycles(2)
    assert bench.motor.read().state is DriveState.SWITCH_ON_DISABLED


def test_a_rated_torque_in_micro_newton_metres_would_be_read_a_thousand_times_too_large() -> None:
    # the trap which makes the unit of 0x6076 a matter of the profile; the generic profile says mN*m
    bench = simulated_bench(MOTOR, motor=replace(MOTOR_DRIVE, torque_unit=TorqueUnit.MICRO))
    assert bench.motor.connect().resolution == pytest.approx(RATED)

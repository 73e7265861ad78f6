"""One control cycle: what is sent, what is collected, and what is raised."""

import can
import pytest

from drivers.errors import DriveFaultError, NotConnectedError, RigError, RigTimeoutError
from drivers.types import DriveState, Mode
from sim_backend.buses.hooks import delay, drop, from_node, process_data_of
from sim_backend.faults import FAULTS
from sim_backend.ports import AxisMode
from tests.drivers.canopen.bench import CYCLE_TIME, HEARTBEAT_TIME, LOAD, MOTOR, SimulatedBench, simulated_bench
from tests.drivers.canopen.wire import frame

BENCH_HEARTBEAT = 0x77F
SYNC = 0x080


@pytest.fixture
def bench() -> SimulatedBench:
    return simulated_bench().connect()


@pytest.fixture
def armed() -> SimulatedBench:
    """Motor and load in torque mode."""
    bench = simulated_bench().connect()
    bench.motor.enable(Mode.TORQUE)
    bench.load.enable(Mode.TORQUE)
    bench.cycles(1)
    bench.bus.events()
    return bench


def test_a_cycle_is_heartbeat_setpoints_sync_in_that_order(armed: SimulatedBench) -> None:
    armed.clock.sleep_until(armed.clock.now() + HEARTBEAT_TIME / 4)
    armed.tap.sent.clear()
    armed.motor.write(0.05)
    armed.load.write(-2.0)
    armed.bus.exchange()
    assert armed.tap.sent == [
        (BENCH_HEARTBEAT, b"\x05"),  # the bench is operational
        (0x201, bytes.fromhex("0f 00 0a 01")),  # motor: enable operation, 266 per mille of 0.188 N*m
        (0x202, bytes.fromhex("0f 00 9c ff")),  # load: enable operation, -100 per mille of 20 N*m
        (SYNC, b""),
    ]


def test_a_setpoint_acts_from_the_sync_of_its_cycle(armed: SimulatedBench) -> None:
    armed.load.write(-2.0)
    armed.bus.exchange()
    assert armed.plant.commands["load"] == (AxisMode.TORQUE, pytest.approx(-2.0))


def test_a_setpoint_is_sent_once(armed: SimulatedBench) -> None:
    armed.motor.write(0.05)
    armed.cycles(5)
    assert len(armed.tap.sent_to(0x201)) == 1


def test_every_device_is_read_at_the_same_sync(bench: SimulatedBench) -> None:
    bench.cycles(1)
    assert [bench.devices[name].read().age for name in bench.devices] == [0, 0, 0, 0]


def test_the_bench_heartbeat_comes_four_times_per_watchdog_time(bench: SimulatedBench) -> None:
    bench.tap.sent.clear()
    cycles = 1000
    bench.cycles(cycles)
    expected = cycles * CYCLE_TIME / (HEARTBEAT_TIME / 4)
    assert len(bench.tap.sent_to(BENCH_HEARTBEAT)) == pytest.approx(expected, rel=0.1)


def test_the_bench_heartbeat_comes_from_the_exchange_and_from_nothing_else() -> None:
    bench = simulated_bench()
    for device in bench.devices.values():
        device.connect()
    bench.clock.sleep_until(bench.clock.now() + 1.0)
    assert bench.tap.sent_to(BENCH_HEARTBEAT) == []
    bench.cycles(1)
    assert len(bench.tap.sent_to(BENCH_HEARTBEAT)) == 1
    bench.motor.enable(Mode.TORQUE)
    bench.torque.tare()
    bench.clock.sleep_until(bench.clock.now() + 1.0)
    bench.motor.disable()
    bench.motor.quick_stop()
    bench.bus.close()
    assert len(bench.tap.sent_to(BENCH_HEARTBEAT)) == 1


def test_listening_takes_in_what_the_devices_report_and_sends_nothing(armed: SimulatedBench) -> None:
    armed.motor.write(0.05)
    armed.tap.sent.clear()
    armed.tap.inject(frame(0x081, "10 43 08 00 00 00 00 00"))
    armed.clock.sleep_until(armed.clock.now() + HEARTBEAT_TIME / 2)
    armed.bus.listen()
    assert armed.tap.sent == []
    assert [event.text for event in armed.bus.events()] == ["emergency 0x4310 (drive too hot)"]


def test_the_drives_stop_by_themselves_when_the_exchange_stops(armed: SimulatedBench) -> None:
    armed.motor.write(0.1)
    armed.cycles(2)
    assert armed.plant.commands["motor"][0] is AxisMode.TORQUE
    armed.world.advance_to(armed.world.time + HEARTBEAT_TIME + 0.01)
    # 0x605A = 2: a quick-stop ramp, over at once at standstill
    assert armed.plant.commands["motor"][0] is AxisMode.OFF


def test_a_missing_reading_grows_old_and_raises_nothing(bench: SimulatedBench) -> None:
    bench.cycles(1)
    hook = drop(process_data_of(3))
    bench.world.bus.add_hook(hook)
    bench.cycles(3)
    assert bench.encoder.read().age == 3
    assert bench.motor.read().age == 0
    bench.world.bus.remove_hook(hook)
    bench.cycles(1)
    assert bench.encoder.read().age == 0


def test_waiting_for_a_missing_reading_ends_after_two_fifths_of_the_cycle(bench: SimulatedBench) -> None:
    bench.world.bus.add_hook(drop(process_data_of(3)))
    begin = bench.clock.now()
    bench.bus.exchange()
    assert bench.clock.now() - begin == pytest.approx(0.4 * CYCLE_TIME)


def test_a_late_reading_counts_as_one_cycle_old(bench: SimulatedBench) -> None:
    bench.world.bus.add_hook(delay(process_data_of(3), 0.7 * CYCLE_TIME))
    bench.plant.set(output_position=0.5)
    bench.cycles(1)
    assert bench.encoder.read().age == 1
    bench.plant.set(output_position=0.75)
    bench.cycles(1)
    late = bench.encoder.read()
    assert late.age == 1
    assert late.value == pytest.approx(0.5, abs=2e-5)  # one count is 1.2e-5 rad


@pytest.mark.parametrize(("node", "can_id"), [("motor", 0x181), ("output_encoder", 0x183), ("torque_sensor", 0x184)])
@pytest.mark.parametrize("data", ["", "01 02 03", "01 02 03 04 05 06 07"])
def test_process_data_of_a_wrong_length_is_an_error_and_no_value(
    bench: SimulatedBench, node: str, can_id: int, data: str
) -> None:
    device = bench.devices[node]
    before = device.read()
    bench.tap.inject(frame(can_id, data))
    with pytest.raises(DriveFaultError, match=rf"'{node}' sent TPDO1 with {len(bytes.fromhex(data))} bytes"):
        bench.bus.exchange()
    after = device.read()
    assert getattr(after, "value", 0.0) == getattr(before, "value", 0.0)
    assert getattr(after, "position", 0.0) == getattr(before, "position", 0.0)


def test_a_drive_whose_process_data_became_short_is_stopped_and_can_be_disabled(armed: SimulatedBench) -> None:
    FAULTS["short-pdo"].inject(armed.world, 1, armed.world.time)
    with pytest.raises(DriveFaultError, match="instead of 8"):
        armed.cycles(1)
    with pytest.raises(DriveFaultError, match="is not enabled"):
        armed.motor.write(0.01)
    assert armed.motor.disable() is DriveState.SWITCH_ON_DISABLED


def test_a_fault_in_operation_is_raised_with_its_code(armed: SimulatedBench) -> None:
    armed.motor.write(0.05)
    armed.cycles(1)
    FAULTS["drive-fault"].inject(armed.world, 1, armed.world.time)
    with pytest.raises(DriveFaultError, match="'motor'") as got:
        armed.cycles(3)
    assert got.value.error_code == 0x2310
    assert got.value.error_register != 0
    assert any("left operation enabled by itself" in text for text in [str(got.value), *got.value.__notes__])


def test_a_fault_is_raised_once_and_every_way_out_still_works(armed: SimulatedBench) -> None:
    FAULTS["drive-fault"].inject(armed.world, 1, armed.world.time)
    with pytest.raises(DriveFaultError):
        armed.cycles(3)
    armed.load.write(0.0)
    armed.cycles(50)
    assert not armed.motor.disable().energised
    assert armed.load.quick_stop() in (DriveState.QUICK_STOP, DriveState.SWITCH_ON_DISABLED)
    armed.bus.close()
    assert armed.plant.commands["motor"][0] is AxisMode.OFF
    assert armed.plant.commands["load"][0] is AxisMode.OFF


def test_a_drive_that_silently_leaves_operation_is_an_error(armed: SimulatedBench) -> None:
    # someone else on the bus disables the drive
    armed.world.bus.send(frame(0x601, "2b 40 60 00 00 00 00 00"))
    with pytest.raises(DriveFaultError, match=r"left operation enabled by itself: switch-on disabled.*no emergency"):
        armed.cycles(1)
    with pytest.raises(DriveFaultError, match="is not enabled"):
        armed.motor.write(0.01)


def test_an_emergency_while_armed_is_an_error_that_carries_code_and_register(armed: SimulatedBench) -> None:
    armed.tap.inject(frame(0x081, "10 43 08 01 02 03 04 05"))
    with pytest.raises(DriveFaultError, match=r"reported emergency 0x4310 \(drive too hot\)") as got:
        armed.cycles(1)
    assert (got.value.error_code, got.value.error_register) == (0x4310, 0x08)
    event = armed.bus.events()[0]
    assert (event.device, event.code, event.register, event.data) == ("motor", 0x4310, 0x08, b"\x01\x02\x03\x04\x05")


def test_a_drive_that_reports_an_emergency_but_goes_on_can_be_ramped_down(armed: SimulatedBench) -> None:
    armed.motor.write(0.1)
    armed.cycles(1)
    armed.tap.inject(frame(0x081, "10 43 08 00 00 00 00 00"))
    with pytest.raises(DriveFaultError):
        armed.cycles(1)
    armed.motor.write(0.05)
    armed.cycles(1)
    assert armed.plant.commands["motor"][1] == pytest.approx(0.05, abs=1e-4)


def test_an_emergency_of_a_sensor_while_a_drive_is_armed_is_an_error_too(armed: SimulatedBench) -> None:
    armed.tap.inject(frame(0x083, "00 73 21 00 00 00 00 00"))
    with pytest.raises(DriveFaultError, match=r"Device 'output_encoder' reported emergency 0x7300"):
        armed.cycles(1)


def test_an_emergency_while_nothing_is_armed_is_an_event_only(bench: SimulatedBench) -> None:
    bench.tap.inject(frame(0x081, "10 43 08 00 00 00 00 00"))
    bench.cycles(3)
    assert [event.text for event in bench.bus.events()] == ["emergency 0x4310 (drive too hot)"]
    assert bench.bus.events() == ()


def test_an_emergency_shorter_than_eight_bytes_is_heard(armed: SimulatedBench) -> None:
    armed.tap.inject(frame(0x081, "30 81"))
    with pytest.raises(DriveFaultError, match="heartbeat of the bench lost"):
        armed.cycles(1)


def test_the_end_of_an_error_is_an_event_and_no_error(armed: SimulatedBench) -> None:
    armed.tap.inject(frame(0x081, "00 00 00 00 00 00 00 00"))
    armed.cycles(1)
    assert [event.text for event in armed.bus.events()] == ["error reset or no error"]


def test_a_boot_up_while_armed_is_an_error_and_the_drive_must_be_connected_again(armed: SimulatedBench) -> None:
    FAULTS["reboot"].inject(armed.world, 1, armed.world.time)
    with pytest.raises(DriveFaultError, match=r"'motor' restarted by itself \(boot-up\)"):
        armed.cycles(200)
    assert any("boot-up" in event.text for event in armed.bus.events())
    assert armed.load.armed
    with pytest.raises(DriveFaultError, match="has restarted and lost its configuration"):
        armed.motor.enable(Mode.TORQUE)
    with pytest.raises(DriveFaultError, match="has restarted and lost its configuration"):
        armed.motor.fault_reset()
    assert armed.motor.disable() is DriveState.SWITCH_ON_DISABLED


def test_a_boot_up_of_a_sensor_while_armed_is_an_error(armed: SimulatedBench) -> None:
    FAULTS["reboot"].inject(armed.world, 4, armed.world.time)
    with pytest.raises(DriveFaultError, match="'torque_sensor' restarted by itself"):
        armed.cycles(200)


def test_a_restarted_drive_can_be_closed_and_connected_again(armed: SimulatedBench) -> None:
    FAULTS["reboot"].inject(armed.world, 1, armed.world.time)
    with pytest.raises(DriveFaultError):
        armed.cycles(200)
    armed.load.disable()
    armed.motor.close()
    armed.motor.connect()
    armed.cycles(1)
    armed.motor.enable(Mode.TORQUE)
    armed.motor.write(0.05)
    armed.cycles(2)
    assert armed.plant.commands["motor"][1] == pytest.approx(0.05, abs=1e-4)


@pytest.mark.parametrize("node_id", [1, 3, 4])
def test_a_lost_heartbeat_is_an_error_after_three_periods(bench: SimulatedBench, node_id: int) -> None:
    bench.cycles(50)
    FAULTS["mute"].inject(bench.world, node_id, bench.world.time)
    begin = bench.clock.now()
    with pytest.raises(NotConnectedError, match="no heartbeat for") as got:
        bench.cycles(1000)
    period = HEARTBEAT_TIME / 4
    # the last heartbeat may have come up to one period before the loss
    assert 2 * period <= bench.clock.now() - begin <= 3 * period + 3 * CYCLE_TIME
    assert len(got.value.missing) == 1
    assert any("heartbeat lost" in event.text for event in bench.bus.events())


def test_a_lost_heartbeat_is_raised_once_and_the_lost_drive_takes_no_setpoint(armed: SimulatedBench) -> None:
    FAULTS["mute"].inject(armed.world, 1, armed.world.time)
    with pytest.raises(NotConnectedError):
        armed.cycles(1000)
    armed.cycles(100)
    with pytest.raises(DriveFaultError, match="is not enabled"):
        armed.motor.write(0.0)
    with pytest.raises(RigTimeoutError):
        armed.motor.disable()
    assert armed.load.disable() is DriveState.SWITCH_ON_DISABLED


def test_two_devices_that_fail_at_once_are_both_named(armed: SimulatedBench) -> None:
    armed.tap.inject(frame(0x081, "10 43 08 00 00 00 00 00"))
    armed.tap.inject(frame(0x082, "10 23 02 00 00 00 00 00"))
    with pytest.raises(DriveFaultError, match="'motor' reported") as got:
        armed.cycles(1)
    assert any("'load' reported" in note for note in got.value.__notes__)


def test_a_node_that_leaves_operational_while_armed_is_an_error(armed: SimulatedBench) -> None:
    armed.world.bus.send(frame(0x000, "80 01"))
    with pytest.raises(RigError, match="'motor'") as got:
        armed.cycles(100)
    assert any("pre-operational" in text for text in [str(got.value), *getattr(got.value, "__notes__", ())]) or (
        got.value.facts["state"] != "operation enabled"
    )


@pytest.mark.parametrize("error", [can.CanOperationError("adapter unplugged"), OSError(19, "no such device")])
def test_a_broken_transport_is_communication_lost(armed: SimulatedBench, error: Exception) -> None:
    armed.tap.broken = error
    with pytest.raises(NotConnectedError, match="communication lost on simulated 'bench'") as got:
        armed.bus.exchange()
    assert set(got.value.missing) == {"motor", "load", "output_encoder", "torque_sensor"}
    with pytest.raises(NotConnectedError, match="communication lost"):
        armed.motor.disable()
    with pytest.raises(NotConnectedError, match="communication lost"):
        armed.bus.close()
    armed.tap.broken = None
    armed.world.advance_to(armed.world.time + HEARTBEAT_TIME + 0.01)
    assert armed.plant.commands["motor"][0] is AxisMode.OFF


def test_error_frames_are_an_error_while_armed_and_an_event_otherwise(bench: SimulatedBench) -> None:
    bench.tap.inject(can.Message(arbitration_id=0x20, is_error_frame=True, is_extended_id=False))
    bench.cycles(1)
    assert "error frame" in bench.bus.events()[0].text
    bench.motor.enable(Mode.TORQUE)
    bench.tap.inject(can.Message(arbitration_id=0x20, is_error_frame=True, is_extended_id=False))
    with pytest.raises(NotConnectedError, match="communication disturbed"):
        bench.cycles(1)


@pytest.mark.parametrize(
    "stranger",
    [
        can.Message(arbitration_id=0x181, is_extended_id=True, data=bytes(3)),
        can.Message(arbitration_id=0x701, is_remote_frame=True, is_extended_id=False),
        can.Message(arbitration_id=0x1FF, is_extended_id=False, data=bytes(8)),
    ],
    ids=["extended identifier", "remote frame", "unknown identifier"],
)
def test_frames_of_others_are_ignored(armed: SimulatedBench, stranger: can.Message) -> None:
    armed.tap.inject(stranger)
    armed.cycles(1)
    assert armed.motor.read().age == 0
    assert armed.bus.events() == ()


def test_enabling_one_drive_keeps_the_other_within_its_watchdog() -> None:
    bench = simulated_bench(MOTOR, LOAD).connect()
    bench.load.enable(Mode.POSITION)
    bench.load.write(0.5)
    bench.cycles(30)
    begin = bench.clock.now()
    bench.motor.enable(Mode.TORQUE)
    took = bench.clock.now() - begin
    bench.cycles(100)
    assert took < HEARTBEAT_TIME / 4
    assert bench.load.read().state is DriveState.ENABLED
    assert bench.bus.events() == ()


def test_nobody_is_waited_for_after_it_was_closed(bench: SimulatedBench) -> None:
    bench.encoder.close()
    begin = bench.clock.now()
    bench.bus.exchange()
    assert bench.clock.now() == begin


def test_a_muted_device_that_was_never_connected_does_not_disturb_the_others() -> None:
    bench = simulated_bench()
    bench.world.bus.add_hook(drop(from_node(3)))
    bench.motor.connect()
    with pytest.raises(NotConnectedError):
        bench.encoder.connect()
    bench.cycles(500)
    assert bench.motor.read().age == 0

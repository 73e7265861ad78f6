import contextlib
import itertools
import math
from collections.abc import Callable

import pytest

from drivers.errors import (
    AbortedError,
    ConfigError,
    CycleError,
    DriveFaultError,
    LimitError,
    NotConnectedError,
    ReadingError,
    RigError,
    RigTimeoutError,
)
from drivers.types import Mode, Sample, Setpoint
from procedures.intents import Ask, Command, Mark, Measurement, Result, SetLock, Steps, Tare
from rig.bench import Stopped
from rig.runner import Status, execute
from rig.stop import Stop
from sim_backend.buses.hooks import MASTER, Delivery, Hook, corrupt, drop, process_data_of
from sim_backend.faults import FAULTS
from sim_backend.nodes.frame import Frame
from tests.rig.bench import MemoryLog, run_on, sim_bench


def hold_torque(value: float, cycles: int) -> Steps:
    yield SetLock(True)
    yield Mark("hold")
    for _ in range(cycles):
        yield Command(motor=Setpoint(Mode.TORQUE, value))
    return lambda: Result((Measurement("cycles", cycles, "1"),))


def released(sim) -> bool:
    """True if neither simulated drive drives its shaft, seen from the plant and not from what the drives report."""
    before = sim.plant.truth()
    return abs(before.motor_torque) < 1e-3 and abs(before.load_torque) < 1e-3


PATIENT = ("heartbeat_time = 0.2", "heartbeat_time = 2.0")
"""A watchdog that waits longer than the 0.5 s for which a state is awaited."""


class Peak:
    """Largest true speed (rad/s) and torque (N*m) of the motor at the samples of a run, whatever its drive reports."""

    def __init__(self, sim) -> None:
        self._sim = sim
        self.speed = self.torque = 0.0

    def see(self, _sample: Sample) -> None:
        truth = self._sim.plant.truth()
        self.speed = max(self.speed, abs(truth.motor_velocity))
        self.torque = max(self.torque, abs(truth.motor_torque))


@pytest.fixture
def sim():
    bench = sim_bench()
    bench.bench.open()
    yield bench
    bench.bench.close()


def test_a_run_gives_its_result_and_ends_with_a_confirmed_safe_state(sim):
    log = MemoryLog()
    outcome = run_on(sim, hold_torque(0.02, 100), log)
    assert outcome.status is Status.DONE
    assert outcome.evaluate().measurements[0].value == 100
    assert outcome.safe_state.confirmed
    assert set(outcome.safe_state.states) == {"motor", "load"}
    assert released(sim)
    assert log.texts("phase") == ["hold"]
    assert len(log.texts("safe state")) == 1


def test_every_cycle_is_logged_once_with_its_index_and_simulated_time(sim):
    log = MemoryLog()
    run_on(sim, hold_torque(0.02, 50), log)
    assert [sample.cycle for sample in log.samples] == list(range(len(log.samples)))
    steps = [b.time - a.time for a, b in zip(log.samples, log.samples[1:], strict=False)]
    # the drive takes two cycles to switch its mode; from then on the pace is exact
    assert steps[0] == pytest.approx(3e-3, abs=1e-9)
    assert steps[1:] == pytest.approx([1e-3] * (len(steps) - 1), abs=1e-9)


def test_setpoint_reaches_the_shaft_and_comes_back_measured(sim):
    log = MemoryLog()
    run_on(sim, hold_torque(0.05, 300), log)
    sample = log.samples[250]
    assert sample.motor_torque_command == 0.05
    # 0.188 mN*m resolution of the drive's per mille, 0.2 mN*m rms of current noise: five sigma
    assert sample.motor_torque == pytest.approx(0.05, abs=1.2e-3)


def test_torque_is_ramped_down_and_not_cut_when_a_run_ends(sim):
    log = MemoryLog()
    run_on(sim, hold_torque(0.1, 200), log)
    commands = [sample.motor_torque_command for sample in log.samples if sample.motor_torque_command is not None]
    drops = [a - b for a, b in itertools.pairwise(commands)]
    # 0.1 N*m in 0.2 s at 1 kHz is 0.5 mN*m a cycle; the first step goes down to what the motor really gives, which
    # 0.2 mN*m rms of current noise may put 1 mN*m lower
    assert sorted(drops)[-2] == pytest.approx(0.1 / 200, rel=0.02)
    assert max(drops) < 0.1 / 200 + 1e-3
    assert commands[-1] == 0.0


def test_a_setpoint_above_the_limit_is_refused_before_it_is_sent(sim):
    log = MemoryLog()
    outcome = run_on(sim, hold_torque(0.26, 10), log)
    assert outcome.status is Status.LIMIT
    assert isinstance(outcome.error, LimitError)
    assert (outcome.error.value, outcome.error.limit, outcome.error.unit) == (0.26, 0.25, "N*m")
    assert all(sample.motor_torque_command is None for sample in log.samples)
    assert outcome.safe_state.confirmed


def test_a_runaway_in_torque_mode_is_stopped_by_the_speed_limit(sim):
    def run_away() -> Steps:
        while True:
            yield Command(motor=Setpoint(Mode.TORQUE, 0.1))

    log, peak = MemoryLog(), Peak(sim)
    log.on_sample = peak.see
    outcome = run_on(sim, run_away(), log)
    assert isinstance(outcome.error, LimitError)
    assert outcome.error.signal == "motor_velocity"
    assert outcome.error.exit_code == 3
    assert outcome.error.reaction == "quick-stop"
    # the speed is a mean over 10 cycles, so it is 5 cycles old, and four more pass until the drive brakes:
    # 9 ms at 2000 rad/s^2
    assert peak.speed < 220.0 + 18.0
    assert outcome.safe_state.confirmed
    # the drive's own ramp was let end: nothing turns on after it
    assert abs(sim.plant.truth().motor_velocity) < 1.0
    sim.world.advance_to(sim.world.time + 2e-3)
    assert released(sim)


def test_a_limit_that_is_broken_while_the_torque_is_ramped_down_makes_the_drives_stop(sim):
    def until_nearly_too_fast() -> Steps:
        sample = yield Command(motor=Setpoint(Mode.TORQUE, 0.1))
        start = sample.motor_position
        while sample.motor_position - start < 4.0:  # about 150 rad/s
            sample = yield Command(motor=Setpoint(Mode.TORQUE, 0.1))
        return Result

    log, peak = MemoryLog(), Peak(sim)
    log.on_sample = peak.see
    outcome = run_on(sim, until_nearly_too_fast(), log)
    assert isinstance(outcome.error, LimitError)
    assert outcome.error.signal == "motor_velocity"
    assert outcome.error.reaction == "ramp, quick-stop"
    assert peak.speed < 220.0 + 18.0
    assert outcome.safe_state.confirmed


def test_a_speed_is_ramped_down_from_what_the_shaft_does_and_not_from_what_it_was_told(sim):
    """A load that was to turn at 9 rad/s is stopped in its second cycle: it must not be driven any faster."""

    def too_soon() -> Steps:
        for _ in range(2):
            yield Command(load=Setpoint(Mode.VELOCITY, 9.0))
        return Result

    log, fastest = MemoryLog(), []
    log.on_sample = lambda _: fastest.append(abs(sim.plant.truth().output_velocity))
    outcome = run_on(sim, too_soon(), log)
    assert max(fastest) == max(fastest[:6])
    assert outcome.safe_state.confirmed


def test_a_torque_that_broke_its_limit_is_still_ramped_down():
    sim = sim_bench(("output_torque = 30.0", "output_torque = 5.0"))
    sim.bench.open()

    def wind_up() -> Steps:
        yield SetLock(True)
        for k in range(2000):
            yield Command(motor=Setpoint(Mode.TORQUE, 1e-4 * k))

    log = MemoryLog()
    outcome = run_on(sim, wind_up(), log)
    assert outcome.error.signal == "output_torque"
    assert outcome.error.reaction == "ramp"
    assert log.samples[-1].motor_torque_command == 0.0
    sim.bench.close()


def test_a_load_drive_that_runs_away_is_stopped_by_its_own_speed_limit():
    sim = sim_bench(("load_velocity = 10.0", "load_velocity = 0.5"))
    sim.bench.open()

    def break_loose() -> Steps:
        while True:
            yield Command(load=Setpoint(Mode.TORQUE, 8.0))

    outcome = run_on(sim, break_loose(), MemoryLog())
    assert isinstance(outcome.error, LimitError)
    assert outcome.error.signal == "load_velocity"
    assert outcome.safe_state.confirmed
    sim.bench.close()


def test_a_position_setpoint_that_jumps_is_refused_before_it_is_sent(sim):
    def jump() -> Steps:
        yield Command(motor=Setpoint(Mode.POSITION, 1.0))

    outcome = run_on(sim, jump(), MemoryLog())
    assert isinstance(outcome.error, LimitError)
    assert outcome.error.signal == "motor_position_command"
    assert outcome.error.limit == pytest.approx(0.22)  # 220 rad/s for 1 ms
    assert sim.plant.truth().motor_torque == 0.0


def test_an_output_torque_above_its_limit_stops_the_run():
    sim = sim_bench(("output_torque = 30.0", "output_torque = 5.0"))
    sim.bench.open()
    outcome = run_on(sim, hold_torque(0.1, 500), MemoryLog())
    assert outcome.error.signal == "output_torque"
    sim.bench.close()


def test_travel_is_counted_from_where_the_run_began():
    sim = sim_bench(("motor_velocity = 220.0", "motor_velocity = 220.0\nmotor_travel = 1.0"))
    sim.bench.open()

    def turn() -> Steps:
        while True:
            yield Command(motor=Setpoint(Mode.VELOCITY, 5.0))

    outcome = run_on(sim, turn(), MemoryLog())
    assert outcome.error.signal == "motor_position"
    assert "travelled" in str(outcome.error)
    sim.bench.close()


def test_a_stop_request_ends_the_run_in_the_next_cycle_and_leaves_it_safe(sim):
    stop, log = Stop(), MemoryLog()
    log.on_sample = lambda sample: stop.request("SIGINT") if sample.cycle == 40 else None
    outcome = run_on(sim, hold_torque(0.05, 1000), log, stop)
    assert outcome.status is Status.ABORTED
    assert isinstance(outcome.error, AbortedError)
    assert outcome.error.by == "SIGINT"
    assert outcome.error.exit_code == 4
    assert max(s.cycle for s in log.samples if s.motor_torque_command == 0.05) <= 41
    assert outcome.safe_state.confirmed
    assert released(sim)


def test_a_stop_request_before_the_first_cycle_moves_nothing(sim):
    stop, log = Stop(), MemoryLog()
    stop.request("SIGTERM")
    outcome = run_on(sim, hold_torque(0.05, 10), log, stop)
    assert outcome.status is Status.ABORTED
    assert log.samples == []


def test_a_bug_in_a_procedure_is_raised_after_the_bench_was_made_safe(sim):
    def broken() -> Steps:
        yield SetLock(True)
        for _ in range(20):
            yield Command(motor=Setpoint(Mode.TORQUE, 0.05))
        raise ZeroDivisionError("a bug")

    log = MemoryLog()
    with pytest.raises(ZeroDivisionError):
        run_on(sim, broken(), log)
    assert "confirmed" in log.texts("safe state")[0]
    assert released(sim)


def test_a_mode_change_that_is_refused_leaves_the_old_setpoint_to_be_ramped_down(sim):
    def change_while_turning() -> Steps:
        for _ in range(30):
            yield Command(motor=Setpoint(Mode.TORQUE, 0.03))
        yield Command(motor=Setpoint(Mode.VELOCITY, 2.0))

    log, peak = MemoryLog(), Peak(sim)
    log.on_sample = peak.see
    outcome = run_on(sim, change_while_turning(), log)
    assert isinstance(outcome.error, DriveFaultError)
    assert "so its mode was not changed" in str(outcome.error)
    assert peak.torque == pytest.approx(0.03, abs=2e-4)  # one per mille of the drive's rated torque
    assert log.samples[-1].motor_torque_command == 0.0
    assert outcome.safe_state.confirmed


@pytest.mark.parametrize("intent", [SetLock(False), Tare(), Ask("anything")])
def test_hands_on_the_bench_only_at_zero_torque(sim, intent):
    def careless() -> Steps:
        yield SetLock(True)
        yield Command(motor=Setpoint(Mode.TORQUE, 0.02))
        yield intent

    outcome = run_on(sim, careless(), MemoryLog())
    assert isinstance(outcome.error, ConfigError)
    assert "zero torque" in str(outcome.error)


def sweep_torque(value: float, cycles: int) -> Steps:
    """Twist the locked output to and fro, once a second."""
    yield SetLock(True)
    for k in range(cycles):
        yield Command(motor=Setpoint(Mode.TORQUE, value * math.sin(2e-3 * math.pi * k)))
    return Result


def wind_up_and_unlock() -> Steps:
    """Leave in the gear what its friction holds when the motor is released at 20 mN*m: 0.55 N*m at the output."""
    yield SetLock(True)
    for k in range(200):
        yield Command(motor=Setpoint(Mode.TORQUE, 1e-4 * k))
    for _ in range(200):
        yield Command()
    yield SetLock(False)
    yield Mark("unlocked")
    return Result


def test_an_output_that_carries_torque_is_not_unlocked():
    sim = sim_bench(("output_torque = 30.0", "output_torque = 5.0"))
    sim.bench.open()
    log = MemoryLog()
    outcome = run_on(sim, wind_up_and_unlock(), log)
    assert isinstance(outcome.error, LimitError)
    assert "it was not opened" in str(outcome.error)
    assert (outcome.error.signal, outcome.error.limit, outcome.error.unit) == ("output_torque", 0.25, "N*m")
    assert outcome.error.value == pytest.approx(0.55, abs=0.1)  # 20 mN*m rms of noise
    assert sim.plant.locked
    sim.bench.close()


def test_an_output_that_carries_little_torque_is_unlocked(sim):
    outcome = run_on(sim, wind_up_and_unlock(), log := MemoryLog())
    assert outcome.error is None
    assert log.texts("phase") == ["unlocked"]


def disturbed(sim, torque: float) -> Callable[[], None]:
    """Make the torque sensor show `torque` N*m, without noise, from the call of what this returns."""
    raw = round(torque * 10_000).to_bytes(4, "little", signed=True)
    load = corrupt(process_data_of(4), lambda frame: Frame(frame.can_id, raw))
    return lambda: sim.world.bus.add_hook(load)


def after(cycles: int, act: Callable[[], None]) -> Callable[[], bool]:
    """Answer an operator's question after so many looks, of which the last one acts."""
    looks = itertools.count(1)

    def answered() -> bool:
        if (look := next(looks)) == cycles:
            act()
        return look > cycles

    return answered


def test_torque_that_rises_while_the_operator_is_asked_keeps_the_output_locked(sim):
    class Slow:
        def ask(self, request: str) -> Callable[[], bool]:
            return after(50, disturbed(sim, 8.0))

    def ask_and_unlock() -> Steps:
        yield SetLock(True)
        for _ in range(20):
            yield Command()
        yield Ask("look at it")
        yield SetLock(False)
        return Result

    outcome = execute(sim.bench, ask_and_unlock(), MemoryLog(), Slow(), Stop())
    assert isinstance(outcome.error, LimitError)
    assert (outcome.error.value, outcome.error.limit) == (8.0, 1.5)
    assert "it was not opened" in str(outcome.error)
    assert sim.plant.locked


def test_torque_that_appears_after_the_last_cycle_keeps_the_output_locked(sim):
    load = disturbed(sim, 8.0)

    def wait_and_unlock() -> Steps:
        yield SetLock(True)
        yield Command()
        load()
        yield SetLock(False)
        return Result

    outcome = run_on(sim, wait_and_unlock(), MemoryLog())
    assert isinstance(outcome.error, LimitError)
    assert sim.plant.locked


def test_torque_that_rises_until_the_operator_has_opened_the_lock_ends_the_run(sim):
    class ByHand:
        def set_lock(self, locked: bool) -> Callable[[], bool]:
            return after(50, disturbed(sim, 8.0) if not locked else lambda: None)

    sim.bench.fixture = ByHand()
    outcome = run_on(sim, wind_up_and_unlock(), log := MemoryLog())
    assert isinstance(outcome.error, LimitError)
    assert outcome.error.value == 8.0
    assert "when its lock was said to be open" in str(outcome.error)
    assert log.texts("phase") == []
    assert outcome.safe_state.confirmed


def test_a_procedure_gets_the_sample_of_the_last_cycle_whatever_it_asked_for(sim):
    got = []

    def ask() -> Steps:
        got.append((yield Ask("anything")))
        return Result

    class Slow:
        def ask(self, request: str) -> Callable[[], bool]:
            return after(50, lambda: None)

    log = MemoryLog()
    execute(sim.bench, ask(), log, Slow(), Stop())
    assert got == [log.samples[50]]


BAD_SENSOR = {"mute": "No answer from", "reboot": "restarted by itself", "short-pdo": "instead of 4"}
"""Fault of a sensor, and what its error says."""

FAULT_CASES = [
    ("drive-fault", 1, DriveFaultError),
    ("reboot", 1, RigError),
    ("mute", 1, RigError),
    ("mute", 3, RigError),
    ("mute", 4, RigError),
    ("short-pdo", 1, RigError),
    ("short-pdo", 4, RigError),
    ("freeze-pdo", 1, ReadingError),
    ("freeze-pdo", 4, ReadingError),
]


@pytest.mark.parametrize(("fault", "node", "kind"), FAULT_CASES)
def test_a_fault_in_motion_ends_the_run_with_the_motor_released_and_the_log_kept(fault, node, kind):
    sim = sim_bench()
    sim.bench.open()
    FAULTS[fault].inject(sim.world, node, sim.world.time + 0.2)
    log = MemoryLog()
    outcome = run_on(sim, sweep_torque(0.05, 2000), log)
    assert outcome.status in (Status.FAULT, Status.ERROR)
    assert isinstance(outcome.error, kind)
    assert outcome.error.exit_code == 3
    assert 150 <= len(log.samples) < 1000
    # a mute drive cannot confirm; its own watchdog must then have taken the torque: heartbeat time 0.2 s and its ramp
    sim.world.advance_to(sim.world.time + 1.0)
    assert released(sim)
    assert log.texts("safe state")
    with contextlib.suppress(RigError):  # what a device no longer answers cannot be restored, and is said
        sim.bench.close()


def test_an_encoder_that_jumps_ends_the_run_and_is_not_logged(sim):
    """5 * 2^27 + 2^30 counts, as a preset does it: the wrapped angle would be -4825 rad."""

    def jump(frame: Frame) -> Frame:
        counts = (int.from_bytes(frame.data, "little") + 5 * 2**27 + 2**30) % 2**31
        return Frame(frame.can_id, counts.to_bytes(4, "little"))

    sim.world.schedule(sim.world.time + 0.2, lambda: sim.world.bus.add_hook(corrupt(process_data_of(3), jump)))
    log = MemoryLog()
    outcome = run_on(sim, sweep_torque(0.05, 2000), log)
    assert isinstance(outcome.error, ReadingError)
    assert outcome.error.device == "output_encoder"
    assert "jumped to -4825" in str(outcome.error)
    assert outcome.safe_state.confirmed
    before = [sample.output_position for sample in log.samples if sample.time < 0.19]
    assert max(map(abs, before)) < 0.01


def test_a_jump_of_the_encoder_that_its_motor_might_make_is_noticed(sim):
    """0.5 rad: the motor may turn by 2.2 rad in ten cycles, the output by 0.1 rad."""
    counts = round(0.5 / (2 * math.pi) * 2**19)

    def jump(frame: Frame) -> Frame:
        return Frame(frame.can_id, ((int.from_bytes(frame.data, "little") + counts) % 2**31).to_bytes(4, "little"))

    sim.world.schedule(sim.world.time + 0.2, lambda: sim.world.bus.add_hook(corrupt(process_data_of(3), jump)))
    outcome = run_on(sim, sweep_torque(0.05, 2000), MemoryLog())
    assert isinstance(outcome.error, ReadingError)
    assert "jumped to 0." in str(outcome.error)


def turn(mode: Mode, value: float, axis: str = "motor") -> Steps:
    while True:
        yield Command(**{axis: Setpoint(mode, value)})


FROZEN_CASES = [
    ("motor", 1, lambda: turn(Mode.TORQUE, 0.1)),
    ("motor", 1, lambda: turn(Mode.TORQUE, 0.02)),
    ("motor", 1, lambda: turn(Mode.VELOCITY, 5.0)),
    ("motor", 1, lambda: turn(Mode.VELOCITY, 1.0)),
    ("load", 2, lambda: turn(Mode.TORQUE, 6.0, "load")),
    ("load", 2, lambda: turn(Mode.VELOCITY, 0.2, "load")),
    ("output_encoder", 3, lambda: turn(Mode.VELOCITY, 5.0)),
    ("torque_sensor", 4, lambda: sweep_torque(0.1, 3000)),
]


@pytest.mark.parametrize(("device", "node", "steps"), FROZEN_CASES)
def test_a_frozen_reading_is_noticed_before_the_shaft_it_hides_is_too_fast(device, node, steps):
    sim = sim_bench()
    sim.bench.open()
    FAULTS["freeze-pdo"].inject(sim.world, node, sim.world.time + 0.03)
    log, peak = MemoryLog(), Peak(sim)
    log.on_sample = peak.see
    outcome = run_on(sim, steps(), log)
    assert isinstance(outcome.error, ReadingError), outcome.error
    assert outcome.error.device == device
    assert outcome.error.exit_code == 3
    assert outcome.error.facts["reaction"] == "quick-stop"
    assert peak.speed < 220.0
    assert outcome.safe_state.confirmed
    sim.world.advance_to(sim.world.time + 2e-3)
    assert released(sim)
    sim.bench.close()


def without(role: str, driver: str, node: int, comment: str = "") -> tuple[str, str]:
    block = (
        f'[devices.{role}]{comment}\ndriver = "{driver}"\ninterface = "simulated"\nchannel = "bench"\nnode = {node}\n'
    )
    return block, ""


def test_a_frozen_motor_that_no_other_device_shows_is_held_by_the_speed_limit_in_its_drive():
    sim = sim_bench(
        without("load", "cia402", 2, "                    # the load drive, on the output"),
        without("output_encoder", "cia406", 3),
        without("torque_sensor", "cia404", 4),
    )
    sim.bench.open()
    FAULTS["freeze-pdo"].inject(sim.world, 1, sim.world.time + 0.03)
    log, peak = MemoryLog(), Peak(sim)
    log.on_sample = peak.see
    stop = Stop()
    sim.world.schedule(sim.world.time + 0.5, lambda: stop.request("SIGINT"))
    outcome = run_on(sim, turn(Mode.TORQUE, 0.1), log, stop)
    assert isinstance(outcome.error, AbortedError)
    assert peak.speed < 1.1 * 220.0 + 3.0  # what 0.1 N*m adds in the drive's cycle of 1 ms
    sim.bench.close()


def speed_up(value: float) -> Steps:
    """Turn the motor at `value` rad/s, reached in 0.4 s: its torque limit allows no step."""
    for k in itertools.count(1):
        yield Command(motor=Setpoint(Mode.VELOCITY, value * min(k / 400, 1.0)))


SENSORS = {"output_encoder": 3, "torque_sensor": 4}


def fail(sim, fault: str, node: int, time: float) -> None:
    """Let a sensor go bad for good at `time` s: one of the named faults, or a process value at the end of its range."""
    if fault != "saturated":
        FAULTS[fault].inject(sim.world, node, time)
        return
    full = corrupt(process_data_of(node), lambda frame: Frame(frame.can_id, b"\xff\xff\xff\x7f"))
    sim.world.schedule(time, lambda: sim.world.bus.add_hook(full))


def speed_when_let_go(sim) -> list[float]:
    """Note the true speed (rad/s) of the motor whenever its drive is told to disable the voltage."""
    speeds = []
    disable = bytes.fromhex("2b4060 00") + bytes(4)

    def look(sender, frame):
        if sender == MASTER and frame == (0x601, disable):
            speeds.append(sim.plant.truth().motor_velocity)
        return (Delivery(frame),)

    sim.world.bus.add_hook(look)
    return speeds


@pytest.mark.parametrize("reaction", ["ramp", "quick-stop"])
@pytest.mark.parametrize(
    ("fault", "sensor", "first"),
    [
        *((fault, sensor, first) for fault, first in BAD_SENSOR.items() for sensor in SENSORS),
        ("saturated", "torque_sensor", "end of its range"),
    ],
)
def test_a_sensor_that_stays_bad_does_not_keep_the_drives_from_stopping_the_shaft(fault, sensor, first, reaction):
    sim = sim_bench(('reaction = "ramp"', f'reaction = "{reaction}"'))
    sim.bench.open()
    fail(sim, fault, SENSORS[sensor], sim.world.time + 0.5)
    speeds, peak = speed_when_let_go(sim), Peak(sim)
    log = MemoryLog()
    log.on_sample = peak.see
    outcome = run_on(sim, speed_up(100.0), log)
    assert first in str(outcome.error) or any(first in note for note in outcome.error.__notes__)
    assert sensor.split("_")[0] in str(outcome.error)
    assert peak.speed == pytest.approx(100.0, abs=5.0)
    assert outcome.safe_state.reaction == reaction
    assert outcome.safe_state.confirmed
    told = " ".join((str(outcome.error), *outcome.error.__notes__))
    assert told.count("Check the device's power") <= 1
    assert outcome.safe_state.problem == ""  # the sensor's trouble is the error itself
    # a velocity loop still follows the last step of its ramp, 0.5 rad/s; a quick stop ends in the drive itself
    assert abs(speeds[0]) < 1.0
    with contextlib.suppress(RigError):  # what a device no longer answers cannot be restored, and is said
        sim.bench.close()


def test_a_shaft_that_follows_positions_is_stopped_by_its_drive_and_the_record_says_so():
    sim = sim_bench(("motor_torque = 0.25", "motor_torque = 0.5"))  # the position loop swings
    sim.bench.open()

    def follow() -> Steps:
        """Reach 50 rad/s in 0.4 s and end there."""
        sample = yield Command()
        position = sample.motor_position
        for k in range(401):
            position += 1e-3 * 50.0 * k / 400
            yield Command(motor=Setpoint(Mode.POSITION, position))
        return Result

    speeds, peak = speed_when_let_go(sim), Peak(sim)
    log = MemoryLog()
    log.on_sample = peak.see
    outcome = run_on(sim, follow(), log)
    assert outcome.error is None
    assert peak.speed > 45.0
    assert outcome.safe_state.reaction == "quick-stop"
    assert abs(speeds[-1]) < 1.0
    sim.bench.close()


def test_the_record_says_that_nothing_was_ramped_where_both_axes_were_released(sim):
    def rest() -> Steps:
        yield Command()
        return Result

    outcome = run_on(sim, rest(), MemoryLog())
    assert outcome.error is None
    assert outcome.safe_state.reaction == "disable"
    assert outcome.safe_state.confirmed


def test_a_drive_that_refuses_its_quick_stop_does_not_keep_the_other_from_ending_its_own():
    sim = sim_bench(('reaction = "ramp"', 'reaction = "quick-stop"'))
    sim.bench.open()
    quick_stop = bytes.fromhex("2b4060 00 0200 0000")
    refused = corrupt(
        lambda sender, frame: sender == MASTER and frame == (0x602, quick_stop),
        lambda frame: Frame(frame.can_id, bytes.fromhex("234060 00 0200 0000")),  # four bytes for two: an abort at once
    )
    sim.world.bus.add_hook(refused)

    def both() -> Steps:
        for k in range(500):
            load = Setpoint(Mode.TORQUE, 0.0)
            yield Command(motor=Setpoint(Mode.VELOCITY, 100.0 * min(k / 400, 1.0)), load=load)
        return Result

    speeds = speed_when_let_go(sim)
    outcome = run_on(sim, both(), MemoryLog())
    assert isinstance(outcome.error, DriveFaultError)
    assert outcome.error.device == "load"
    assert abs(speeds[0]) < 1.0
    assert outcome.safe_state.confirmed
    sim.bench.close()


def test_a_log_that_cannot_be_written_does_not_keep_the_drives_from_stopping_the_shaft(sim):
    speeds, log = speed_when_let_go(sim), MemoryLog()

    def fill_the_disk(sample: Sample) -> None:
        if sample.cycle >= 500:
            raise OSError("no space left on device")

    log.on_sample = fill_the_disk
    with pytest.raises(OSError, match="no space left"):
        run_on(sim, speed_up(100.0), log)
    assert abs(speeds[0]) < 1.0
    assert log.texts("safe state") == ["ramp: motor switch-on disabled, load switch-on disabled; confirmed"]


def test_a_restart_in_motion_is_named_as_such():
    sim = sim_bench()
    sim.bench.open()
    FAULTS["reboot"].inject(sim.world, 1, sim.world.time + 0.2)
    log = MemoryLog()
    outcome = run_on(sim, hold_torque(0.05, 2000), log)
    assert any("restart" in note for note in outcome.error.__notes__)
    assert any("restart" in event.text for event in log.device_events)
    with contextlib.suppress(RigError):
        sim.bench.close()


def refusing(node: int, control_word: int) -> Hook:
    """Let a control word by SDO become enable operation on its way to a drive."""
    wanted = bytes.fromhex("2b4060 00") + control_word.to_bytes(2, "little") + bytes(2)
    return corrupt(
        lambda sender, frame: sender == MASTER and frame == (0x600 + node, wanted),
        lambda frame: Frame(frame.can_id, bytes.fromhex("2b4060 000f000000")),
    )


def test_a_drive_that_never_lets_go_is_an_error_although_the_run_went_as_planned():
    sim = sim_bench(PATIENT)
    sim.bench.open()
    log = MemoryLog()
    log.on_sample = lambda s: FAULTS["ignore-control-word"].inject(sim.world, 1, 0.0) if s.cycle == 150 else None
    outcome = run_on(sim, hold_torque(0.05, 200), log)
    assert outcome.status is Status.FAULT
    assert isinstance(outcome.error, DriveFaultError)
    assert "'motor' did not confirm" in str(outcome.error)
    assert outcome.error.state == "not confirmed"
    assert outcome.error.exit_code == 3
    assert not outcome.safe_state.confirmed
    assert outcome.safe_state.states == {"motor": "not confirmed", "load": "switch-on disabled"}
    assert "operation enabled" in outcome.safe_state.problem
    with contextlib.suppress(RigError):
        sim.bench.close()
    sim.world.advance_to(sim.world.time + 2.5)
    assert released(sim)


def test_a_drive_that_only_obeys_the_quick_stop_is_confirmed_by_it_and_an_error():
    sim = sim_bench(PATIENT)
    sim.bench.open()
    sim.world.bus.add_hook(hook := refusing(1, 0))
    outcome = run_on(sim, hold_torque(0.05, 200), MemoryLog())
    sim.world.bus.remove_hook(hook)
    assert outcome.safe_state.confirmed
    assert outcome.safe_state.states["motor"] == "switch-on disabled"
    assert isinstance(outcome.error, RigTimeoutError)
    assert released(sim)
    sim.bench.close()


def test_no_watchdog_is_fed_while_the_cause_of_a_failure_is_listened_for(sim):
    sent = []

    def note(sender, frame):
        if sender == MASTER and frame.can_id in (0x080, 0x77F):  # SYNC, heartbeat of the bench
            sent.append(sim.world.time)
        return (Delivery(frame),)

    sim.world.bus.add_hook(note)
    sim.world.schedule(0.5, lambda: sim.world.bus.add_hook(drop(process_data_of(4))))
    outcome = run_on(sim, hold_torque(0.05, 2000), MemoryLog())
    assert isinstance(outcome.error, CycleError)
    # 0.5 s of listening end the run; half a cycle for rounding
    assert sim.world.time - sent[-1] >= 0.5 - 5e-4


def test_a_silent_drive_does_not_hide_the_state_of_the_other():
    sim = sim_bench()
    sim.bench.open()
    FAULTS["mute"].inject(sim.world, 2, sim.world.time + 0.2)
    log = MemoryLog()
    outcome = run_on(sim, hold_torque(0.05, 2000), log)
    assert outcome.safe_state.states == {"motor": "switch-on disabled", "load": "not confirmed"}
    assert not outcome.safe_state.confirmed
    assert log.texts("safe state") == ["ramp, quick-stop: motor switch-on disabled, load not confirmed; NOT CONFIRMED"]
    with contextlib.suppress(RigError):
        sim.bench.close()


@pytest.mark.parametrize("node", [1, 2])
def test_a_drive_that_is_in_fault_is_refused_when_the_bench_is_opened(node):
    sim = sim_bench()
    FAULTS["drive-fault"].inject(sim.world, node, 0.0)
    sim.world.advance_to(0.05)
    with pytest.raises(DriveFaultError, match=r"is in fault, so nothing is moved.*over-current.*reset it") as caught:
        sim.bench.open()
    assert caught.value.device == ("motor", "load")[node - 1]
    assert caught.value.exit_code == 3
    sim.bench.close()


def test_no_axis_is_enabled_while_another_drive_is_in_fault(sim):
    """The load drive, of which nothing is asked, goes to fault after the bench was opened."""
    FAULTS["drive-fault"].inject(sim.world, 2, sim.world.time)

    def wait_and_turn() -> Steps:
        for _ in range(10):
            yield Command()
        yield Command(motor=Setpoint(Mode.TORQUE, 0.02))

    outcome = run_on(sim, wait_and_turn(), MemoryLog())
    assert isinstance(outcome.error, DriveFaultError)
    assert outcome.error.device == "load"
    assert sim.plant.truth().motor_torque == 0.0
    assert outcome.safe_state.confirmed


def test_a_refused_mode_is_an_error_and_nothing_moves(sim):
    FAULTS["refuse-mode"].inject(sim.world, 1, sim.world.time)
    log = MemoryLog()
    outcome = run_on(sim, hold_torque(0.05, 100), log)
    assert isinstance(outcome.error, DriveFaultError)
    assert "mode" in str(outcome.error)
    assert sim.plant.truth().motor_torque == 0.0


def test_a_bench_that_stops_cycling_is_stopped_by_its_drives(sim):
    """The program is gone: no cycle, no heartbeat. The drive's own watchdog must take the torque away."""
    steps = hold_torque(0.05, 10**6)

    class GoneError(BaseException):
        pass

    log = MemoryLog()

    def vanish(sample: Sample) -> None:
        if sample.cycle == 300:
            raise GoneError

    log.on_sample = vanish
    bench = sim.bench
    bench.disable = lambda: Stopped({})  # nobody is left to disable the drives
    sim.bench.quick_stop = lambda: Stopped({})
    with pytest.raises(GoneError):
        run_on(sim, steps, log)
    del bench.disable, sim.bench.quick_stop
    assert not released(sim)
    # heartbeat time 0.2 s, then the quick-stop ramp
    sim.world.advance_to(sim.world.time + 0.5)
    assert released(sim)


def test_missing_readings_are_absent_from_the_log_and_counted():
    sim = sim_bench(("missing_cycles = 0", "missing_cycles = 3"))
    sim.bench.open()
    dropped = []

    def lose_two(sender, frame):
        if frame.can_id == 0x184 and len(dropped) < 2 and sim.world.time > 0.5:
            dropped.append(frame)
            return ()
        return (Delivery(frame),)

    sim.world.bus.add_hook(lose_two)
    log = MemoryLog()
    outcome = run_on(sim, hold_torque(0.01, 1000), log)
    assert outcome.status is Status.DONE
    assert outcome.missing == 2
    assert [sample.output_torque for sample in log.samples].count(None) == 2
    sim.bench.close()


def test_more_missing_readings_than_allowed_end_the_run(sim):
    log = MemoryLog()
    log.on_sample = lambda s: sim.world.bus.add_hook(drop(lambda _, f: f.can_id == 0x184)) if s.cycle == 50 else None
    outcome = run_on(sim, hold_torque(0.01, 1000), log)
    assert isinstance(outcome.error, CycleError)
    assert outcome.error.missing == 1
    assert outcome.error.limit == 0
    assert str(outcome.error).startswith("No answer from 'torque_sensor' (node 4 on bench) at 0.05")
    assert "limits.missing_cycles" in str(outcome.error)


def test_late_cycles_are_counted_and_more_than_allowed_end_the_run():
    sim = sim_bench(("late_cycles = 0", "late_cycles = 1"))
    sim.bench.open()
    log = MemoryLog()
    log.on_sample = lambda s: sim.world.advance_to(sim.world.time + 2e-3) if s.cycle in (50, 60) else None
    outcome = run_on(sim, hold_torque(0.01, 1000), log)
    assert isinstance(outcome.error, CycleError)
    assert (outcome.error.late, outcome.error.missing, outcome.error.limit) == (2, 0, 1)
    assert outcome.error.worst_age == pytest.approx(1e-3)  # 2 ms lost, of which the cycle takes one
    assert str(outcome.error).startswith("Too many late cycles at 0.06")
    assert "lower cycle_rate" in str(outcome.error)
    sim.bench.close()


def test_all_devices_that_do_not_answer_are_named_in_one_error():
    sim = sim_bench()
    for node in (3, 4):
        FAULTS["mute"].inject(sim.world, node, 0.0)
    sim.world.advance_to(0.001)
    with pytest.raises(NotConnectedError) as caught:
        sim.bench.open()
    assert set(caught.value.missing) == {"output_encoder", "torque_sensor"}
    sim.bench.close()


def hold_against_the_load(torque: float) -> Steps:
    """Hold the motor's angle while the load torque rises to `torque` N*m within a second."""
    sample = yield Command()
    assert sample.motor_position is not None
    for k in itertools.count():
        load = Setpoint(Mode.TORQUE, torque * min(k / 1000, 1.0))
        yield Command(motor=Setpoint(Mode.POSITION, sample.motor_position), load=load)


def test_a_load_that_nothing_holds_any_more_is_stopped_by_its_drive_at_once():
    """With the motor gone, 16 N*m at the output would take it to 240 rad/s within a ramp of 0.2 s."""
    sim = sim_bench()
    sim.bench.open()
    FAULTS["drive-fault"].inject(sim.world, 1, sim.world.time + 1.5)
    log, peak = MemoryLog(), Peak(sim)
    log.on_sample = peak.see
    outcome = run_on(sim, hold_against_the_load(16.0), log)
    assert isinstance(outcome.error, DriveFaultError)
    assert outcome.safe_state.reaction == "quick-stop"
    assert outcome.safe_state.confirmed
    assert peak.speed < 60.0

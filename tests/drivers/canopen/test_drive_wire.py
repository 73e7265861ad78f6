"""A drive's changes of state on the wire: every frame is listed with what it means.

The drive is set up on the simulated device first; from then on the script is the drive.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from drivers.errors import DriveFaultError, RigTimeoutError
from drivers.types import DriveState, Mode
from tests.drivers.canopen.bench import MOTOR, SimulatedBench, simulated_bench
from tests.drivers.canopen.wire import Line, ScriptedBus


class BenchClock:
    """Lets a script move the bench's own simulated time."""

    def __init__(self, bench: SimulatedBench) -> None:
        self._bench = bench

    @property
    def time(self) -> float:
        return self._bench.world.time

    @time.setter
    def time(self, value: float) -> None:
        self._bench.world.advance_to(value)


@pytest.fixture
def bench() -> SimulatedBench:
    return simulated_bench(MOTOR).connect()


@contextmanager
def script(bench: SimulatedBench, lines: list[Line]) -> Iterator[None]:
    """Let `lines` be the bus; all of them must be used."""
    scripted = ScriptedBus(lines, BenchClock(bench))
    bench.world.bus.recv(0.0)
    bench.tap.target, real = scripted, bench.tap.target
    yield
    scripted.finish()
    bench.tap.target = real


def write(data: str, meaning: str) -> list[Line]:
    """An expedited write and its acknowledgement."""
    return [(">", 0x601, data, meaning), ("<", 0x581, f"60 {data[3:11]} 00 00 00 00", "done")]


def read(mux: str, answer: str, meaning: str) -> list[Line]:
    """A read and its answer."""
    return [(">", 0x601, f"40 {mux} 00 00 00 00", "read"), ("<", 0x581, answer, meaning)]


def status(low: str, high: str, meaning: str) -> list[Line]:
    return read("41 60 00", f"4b 41 60 00 {low} {high} 00 00", meaning)


CLEAR_TARGETS: list[Line] = [
    *write("2b 71 60 00 00 00 00 00", "target torque 0"),
    *read("71 60 00", "4b 71 60 00 00 00 00 00", "target torque reads back 0"),
    *write("23 ff 60 00 00 00 00 00", "target velocity 0"),
    *read("ff 60 00", "43 ff 60 00 00 00 00 00", "target velocity reads back 0"),
    *read("64 60 00", "43 64 60 00 10 27 00 00", "the shaft stands at 10000"),
    *write("23 7a 60 00 10 27 00 00", "target position 10000"),
    *read("7a 60 00", "43 7a 60 00 10 27 00 00", "target position reads back 10000"),
]

TO_SWITCHED_ON: list[Line] = [
    *status("50", "02", "switch-on disabled"),
    *write("2b 40 60 00 06 00 00 00", "control word: shutdown"),
    *status("31", "02", "ready to switch on"),
    *status("31", "02", "ready to switch on"),
    *write("2b 40 60 00 07 00 00 00", "control word: switch on"),
    *status("33", "02", "switched on"),
    *status("33", "02", "switched on"),
]


def test_enable_clears_the_targets_verifies_the_mode_and_takes_one_transition_at_a_time(bench: SimulatedBench) -> None:
    lines = [
        *status("50", "02", "switch-on disabled"),
        *CLEAR_TARGETS,
        *write("2f 60 60 00 0a 00 00 00", "mode 10: cyclic synchronous torque"),
        *read("61 60 00", "4f 61 60 00 0a 00 00 00", "mode 10 is active"),
        *TO_SWITCHED_ON,
        *write("2b 40 60 00 0f 00 00 00", "control word: enable operation"),
        *status("37", "12", "operation enabled"),
        *status("37", "12", "operation enabled"),
    ]
    with script(bench, lines):
        bench.motor.enable(Mode.TORQUE)
    assert bench.motor.armed


def test_enable_in_position_mode_takes_the_position_again_just_before_it_energises(bench: SimulatedBench) -> None:
    lines = [
        *status("50", "02", "switch-on disabled"),
        *CLEAR_TARGETS,
        *write("2f 60 60 00 08 00 00 00", "mode 8: cyclic synchronous position"),
        *read("61 60 00", "4f 61 60 00 08 00 00 00", "mode 8 is active"),
        *TO_SWITCHED_ON,
        *read("64 60 00", "43 64 60 00 11 27 00 00", "the shaft was moved to 10001"),
        *write("23 7a 60 00 11 27 00 00", "target position 10001"),
        *read("7a 60 00", "43 7a 60 00 11 27 00 00", "target position reads back 10001"),
        *write("2b 40 60 00 0f 00 00 00", "control word: enable operation"),
        *status("37", "12", "operation enabled"),
        *status("37", "12", "operation enabled"),
    ]
    with script(bench, lines):
        bench.motor.enable(Mode.POSITION)


def test_a_drive_in_fault_is_neither_enabled_nor_reset(bench: SimulatedBench) -> None:
    lines = [
        *status("18", "02", "fault"),
        *read("3f 60 00", "4b 3f 60 00 10 23 00 00", "error code 0x2310"),
        *read("3f 60 00", "4b 3f 60 00 10 23 00 00", "error code 0x2310"),
    ]
    with (
        script(bench, lines),
        pytest.raises(DriveFaultError, match=r"cannot be enabled.*continuous over-current") as got,
    ):
        bench.motor.enable(Mode.TORQUE)
    assert got.value.error_code == 0x2310
    assert got.value.state == "fault"


def test_a_mode_refused_by_an_abort_is_an_error_with_the_supported_modes(bench: SimulatedBench) -> None:
    lines: list[Line] = [
        *status("50", "02", "switch-on disabled"),
        *CLEAR_TARGETS,
        (">", 0x601, "2f 60 60 00 0a 00 00 00", "mode 10"),
        ("<", 0x581, "80 60 60 00 30 00 09 06", "abort 06090030: value range"),
        *read("02 65 00", "43 02 65 00 80 01 00 00", "supported: cyclic position and velocity"),
        *status("50", "02", "switch-on disabled"),
        *write("2b 40 60 00 00 00 00 00", "control word: disable voltage"),
        *status("50", "02", "switch-on disabled"),
    ]
    with (
        script(bench, lines),
        pytest.raises(DriveFaultError, match=r"refused mode torque.*0x06090030.*cyclic velocity"),
    ):
        bench.motor.enable(Mode.TORQUE)
    assert not bench.motor.armed


def test_disable_takes_the_voltage_away_and_reads_the_state_back(bench: SimulatedBench) -> None:
    lines = [
        *write("2b 40 60 00 00 00 00 00", "control word: disable voltage"),
        *status("37", "12", "still enabled"),
        *status("50", "02", "switch-on disabled"),
    ]
    with script(bench, lines):
        assert bench.motor.disable() is DriveState.SWITCH_ON_DISABLED


def test_a_drive_that_stays_enabled_makes_disable_fail_with_its_state_and_bits(bench: SimulatedBench) -> None:
    lines = write("2b 40 60 00 00 00 00 00", "control word: disable voltage")
    for _ in range(502):  # 0.5 s at one look per ms, and the last look after the time-out
        lines += status("37", "0a", "still enabled, internal limit")
    clock = BenchClock(bench)
    scripted = ScriptedBus(lines, clock)
    bench.tap.target = scripted
    begin = clock.time
    with pytest.raises(RigTimeoutError, match=r"operation enabled.*0x0A37.*internal limit active") as got:
        bench.motor.disable()
    assert clock.time - begin == pytest.approx(0.5, abs=2e-3)
    assert isinstance(got.value, TimeoutError)


@pytest.mark.parametrize(
    ("low", "state"),
    [
        pytest.param("17", DriveState.QUICK_STOP, id="stays in quick stop active"),
        pytest.param("50", DriveState.SWITCH_ON_DISABLED, id="has left it already"),
    ],
)
def test_quick_stop_accepts_both_ends(bench: SimulatedBench, low: str, state: DriveState) -> None:
    lines = [*write("2b 40 60 00 02 00 00 00", "control word: quick stop"), *status(low, "02", "stopped")]
    with script(bench, lines):
        assert bench.motor.quick_stop() is state


def test_fault_reset_is_an_edge_is_verified_and_goes_no_further(bench: SimulatedBench) -> None:
    lines = [
        *status("18", "02", "fault"),
        *write("2b 40 60 00 00 00 00 00", "control word with bit 7 clear"),
        *write("2b 40 60 00 80 00 00 00", "rising edge of bit 7"),
        *status("50", "02", "switch-on disabled"),
    ]
    with script(bench, lines):
        assert bench.motor.fault_reset() is DriveState.SWITCH_ON_DISABLED


def test_fault_reset_does_nothing_where_there_is_no_fault(bench: SimulatedBench) -> None:
    with script(bench, status("50", "02", "switch-on disabled")):
        assert bench.motor.fault_reset() is DriveState.SWITCH_ON_DISABLED


def test_a_status_word_that_is_no_state_is_an_error(bench: SimulatedBench) -> None:
    with (
        script(bench, status("01", "00", "no state")),
        pytest.raises(DriveFaultError, match=r"impossible state.*0x0001"),
    ):
        bench.motor.enable(Mode.TORQUE)

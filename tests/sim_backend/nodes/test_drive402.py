"""The drive's modes, targets, limits, stops and supervision."""

import math

import pytest

from sim_backend.errors import ModelError
from sim_backend.nodes.bench import LOAD_DRIVE
from sim_backend.nodes.drive402 import FOLLOWING_ERROR, STOP_TIME_OUT, Drive402, drive_node
from sim_backend.nodes.drive402_objects import DriveConfig, TorqueUnit, VelocityUnit
from sim_backend.ports import AxisMode
from tests.sim_backend.fake_plant import FakePlant
from tests.sim_backend.nodes.wire import AbortedError, Wire

COUNTS = 16384 / math.tau  # per rad
ENABLED, FOLLOWS, LIMIT, MODE_ERROR = 0x0027, 0x1000, 0x0800, 0x2000


class Bench:
    """One motor drive, its plant and its wire."""

    def __init__(self, config: DriveConfig | None = None, *, obedient: bool = True) -> None:
        self.plant = FakePlant(obedient=obedient)
        self.wire = Wire(drive_node(config or DriveConfig(), self.plant))
        device = self.wire.node.device
        assert isinstance(device, Drive402)
        self.drive = device
        self.axis = self.drive.config.axis

    def enable(self, mode: int) -> "Bench":
        self.wire.write(0x6060, 0, mode, 1)
        self.wire.tick(3)
        for word in (0x06, 0x07, 0x0F):
            self.wire.write(0x6040, 0, word, 2)
        return self

    @property
    def command(self) -> tuple[AxisMode, float]:
        return self.plant.commands[self.axis]

    @property
    def status(self) -> int:
        return self.wire.read(0x6041)


def test_a_drive_starts_without_torque_and_with_its_limit_set() -> None:
    bench = Bench()
    assert bench.command == (AxisMode.OFF, 0.0)
    assert bench.plant.limits == {"motor": pytest.approx(0.564)}
    assert bench.status & 0x4F == 0x40


@pytest.mark.parametrize(
    ("mode", "index", "raw", "size", "inner", "target"),
    [
        (10, 0x6071, -250, 2, AxisMode.TORQUE, -0.25 * 0.188),
        (9, 0x60FF, 16384, 4, AxisMode.VELOCITY, math.tau),
        (8, 0x607A, -1000, 4, AxisMode.POSITION, (-1000 + 0.5) / COUNTS),
    ],
)
def test_cyclic_modes_hand_their_target_to_the_inner_loop_in_si(
    mode: int, index: int, raw: int, size: int, inner: AxisMode, target: float
) -> None:
    bench = Bench().enable(mode)
    bench.wire.write(index, 0, raw, size)
    assert bench.command == (inner, pytest.approx(target, rel=1e-12))
    assert bench.status & (FOLLOWS | ENABLED) == FOLLOWS | ENABLED


def test_the_torque_offset_adds_to_the_target() -> None:
    bench = Bench().enable(10)
    bench.wire.write(0x6071, 0, 100, 2)
    bench.wire.write(0x60B2, 0, -40, 2)
    assert bench.command == (AxisMode.TORQUE, pytest.approx(0.06 * 0.188))
    assert bench.wire.read(0x6074, signed=True) == 60


def test_nothing_is_commanded_before_operation_is_enabled() -> None:
    bench = Bench()
    bench.wire.write(0x6060, 0, 10, 1)
    bench.wire.write(0x6071, 0, 500, 2)
    bench.wire.tick(5)
    for word in (0x06, 0x07):
        bench.wire.write(0x6040, 0, word, 2)
        assert bench.command == (AxisMode.OFF, 0.0)
    bench.wire.write(0x6040, 0, 0x0F, 2)
    assert bench.command == (AxisMode.TORQUE, pytest.approx(0.094))  # the stale target acts: as in a real drive


def test_the_mode_display_follows_when_the_mode_is_really_active() -> None:
    bench = Bench()
    bench.wire.write(0x6060, 0, 9, 1)
    assert (bench.wire.read(0x6060), bench.wire.read(0x6061)) == (9, 0)
    bench.wire.tick(2)
    assert bench.wire.read(0x6061) == 9


def test_supported_modes_are_the_three_cyclic_ones() -> None:
    assert Bench().wire.read(0x6502) == 0x380


@pytest.mark.parametrize("mode", [1, 3, 4, 6, 7, -1])
def test_unsupported_modes_are_refused_by_an_abort(mode: int) -> None:
    with pytest.raises(AbortedError, match="06090030"):
        Bench().wire.write(0x6060, 0, mode, 1)


def test_a_mode_can_be_refused_by_silence() -> None:
    bench = Bench(DriveConfig(refuse_modes=(9,), refuse_by_silence=True))
    bench.wire.write(0x6060, 0, 9, 1)  # acknowledged
    bench.wire.tick(100)
    assert bench.wire.read(0x6061) == 0  # and never active


def test_a_mode_can_be_refused_although_it_is_listed() -> None:
    bench = Bench(DriveConfig(refuse_modes=(10,)))
    with pytest.raises(AbortedError, match="06090030"):
        bench.wire.write(0x6060, 0, 10, 1)
    assert bench.wire.read(0x6502) == 0x380


@pytest.mark.parametrize(
    ("angle", "counts"),
    [(0.0, 0), (0.999 / COUNTS, 0), (-1e-9, -1), (1.001 / COUNTS, 1), (2**31 / COUNTS + 1e-4, -(2**31))],
)
def test_position_is_the_floor_of_the_angle_and_wraps_at_32_bits(angle: float, counts: int) -> None:
    bench = Bench()
    bench.plant.show(motor_position=angle)
    assert bench.wire.read(0x6064, signed=True) == counts


def test_a_target_beyond_the_wrap_is_reached_the_short_way() -> None:
    bench = Bench().enable(8)
    bench.plant.show(motor_position=(2**31 - 10) / COUNTS)
    bench.wire.write(0x607A, 0, -(2**31) + 5, 4)
    # 15 counts on
    assert bench.command == (AxisMode.POSITION, pytest.approx((2**31 + 5.5) / COUNTS, rel=1e-14))


@pytest.mark.parametrize(
    ("torque", "per_mille"), [(0.188 * 0.0005, 1), (-0.188 * 0.0005, -1), (0.188 * 0.00049, 0), (-9.0, -32768)]
)
def test_torque_is_per_mille_of_rated_rounded_half_away_and_saturated(torque: float, per_mille: int) -> None:
    bench = Bench()
    bench.plant.show(motor_torque=torque)
    assert bench.wire.read(0x6077, signed=True) == per_mille
    assert bench.wire.read(0x6078, signed=True) == per_mille


def test_the_load_drive_reads_and_commands_its_own_axis() -> None:
    plant = FakePlant()
    wire = Wire(drive_node(LOAD_DRIVE, plant))
    plant.show(load_position=1.0, load_torque=2.0, load_velocity=-0.5, motor_position=9.0, motor_torque=9.0)
    assert wire.read(0x6064, signed=True) == math.floor(1048576 / math.tau)
    assert wire.read(0x6077, signed=True) == 100
    assert wire.read(0x606C, signed=True) == round(-0.5 * 1048576 / math.tau)
    assert plant.commands == {"load": (AxisMode.OFF, 0.0)}


def test_rated_values_and_scales_can_be_read() -> None:
    wire = Bench().wire
    assert wire.read(0x6076) == 188  # mN*m
    assert wire.read(0x6075) == 586  # mA = 0.188 / 0.321
    assert (wire.read(0x608F, 1), wire.read(0x608F, 2)) == (16384, 1)
    assert wire.read(0x6079) == 48000


def test_other_makes_state_torque_in_micronewton_metres_and_speed_in_rpm() -> None:
    bench = Bench(DriveConfig(torque_unit=TorqueUnit.MICRO, velocity_unit=VelocityUnit.RPM)).enable(9)
    assert bench.wire.read(0x6076) == 188_000
    assert bench.wire.read(0x60A9) == 0x00B44700
    bench.wire.write(0x60FF, 0, 60, 4)
    assert bench.command == (AxisMode.VELOCITY, pytest.approx(math.tau))
    assert bench.wire.read(0x606C) == 60


def test_the_torque_limit_is_the_smallest_of_the_four_objects() -> None:
    bench = Bench()
    for index, per_mille in ((0x6072, 900), (0x6073, 800), (0x60E0, 700), (0x60E1, 600)):
        bench.wire.write(index, 0, per_mille, 2)
        assert bench.plant.limits["motor"] == pytest.approx(0.188 * per_mille / 1000)


def test_bit_11_is_set_while_the_torque_limit_acts() -> None:
    bench = Bench().enable(10)
    bench.plant.limited.add("motor")
    bench.wire.tick()
    assert bench.status & LIMIT
    bench.plant.limited.clear()
    bench.wire.tick()
    assert not bench.status & LIMIT


def test_above_the_maximum_speed_torque_in_that_direction_is_taken_away() -> None:
    bench = Bench().enable(10)
    bench.wire.write(0x6080, 0, 1000, 4)  # rpm
    bench.wire.write(0x6071, 0, 200, 2)
    bench.plant.show(motor_velocity=1001 * math.tau / 60)
    bench.wire.tick()
    assert bench.command == (AxisMode.TORQUE, 0.0)
    assert bench.status & (LIMIT | FOLLOWS) == LIMIT
    bench.wire.write(0x6071, 0, -200, 2)  # braking is allowed
    assert bench.command == (AxisMode.TORQUE, pytest.approx(-0.2 * 0.188))
    bench.wire.write(0x6071, 0, 200, 2)
    bench.plant.show(motor_velocity=999 * math.tau / 60)
    bench.wire.tick()
    assert bench.command == (AxisMode.TORQUE, pytest.approx(0.2 * 0.188))


def test_the_speed_target_is_bounded_by_the_maximum_speed() -> None:
    bench = Bench().enable(9)
    bench.wire.write(0x6080, 0, 60, 4)
    bench.wire.write(0x60FF, 0, -100 * 16384, 4)
    assert bench.command == (AxisMode.VELOCITY, pytest.approx(-math.tau))


def test_travel_limits_bound_position_targets_and_stop_outward_torque() -> None:
    bench = Bench().enable(8)
    bench.wire.write(0x607D, 1, -100, 4)
    bench.wire.write(0x607D, 2, 100, 4)
    bench.wire.write(0x607A, 0, 5000, 4)
    assert bench.command == (AxisMode.POSITION, pytest.approx(100.5 / COUNTS))
    bench = Bench().enable(10)
    bench.wire.write(0x607D, 1, -100, 4)
    bench.wire.write(0x6071, 0, -300, 2)
    bench.plant.show(motor_position=-200 / COUNTS)
    bench.wire.tick()
    assert bench.command == (AxisMode.TORQUE, 0.0)
    bench.wire.write(0x6071, 0, 300, 2)
    assert bench.command == (AxisMode.TORQUE, pytest.approx(0.3 * 0.188))


def test_a_lasting_following_error_is_a_fault() -> None:
    bench = Bench().enable(8)
    bench.wire.write(0x6065, 0, 500, 4)
    bench.wire.write(0x6066, 0, 10, 2)
    bench.wire.write(0x607A, 0, 501, 4)
    assert bench.wire.read(0x60F4, signed=True) == 501
    assert bench.wire.tick(10) == []
    assert bench.status & MODE_ERROR
    frames = bench.wire.tick(1)
    assert frames == ["081 11 86 21 00 00 00 00 00"]
    bench.wire.tick(2)
    assert bench.status & 0x4F == 0x08
    assert bench.wire.read(0x603F) == FOLLOWING_ERROR


def test_a_short_following_error_is_forgiven_and_a_window_of_all_ones_watches_nothing() -> None:
    bench = Bench().enable(8)
    bench.wire.write(0x6066, 0, 10, 2)
    bench.wire.write(0x6065, 0, 500, 4)
    bench.wire.write(0x607A, 0, 501, 4)
    bench.wire.tick(9)
    bench.wire.write(0x607A, 0, 500, 4)
    bench.wire.tick(2)
    bench.wire.write(0x6065, 0, 0xFFFFFFFF, 4)
    bench.wire.write(0x607A, 0, 1_000_000, 4)
    assert bench.wire.tick(100) == []
    assert bench.status & 0x6F == ENABLED


@pytest.mark.parametrize(
    ("option", "index", "seconds"),
    [(1, 0x6084, 0.2), (2, 0x6085, 0.05), (5, 0x6084, 0.2), (6, 0x6085, 0.05)],
)
def test_quick_stop_brakes_with_the_ramp_of_its_option_code(option: int, index: int, seconds: float) -> None:
    bench = Bench().enable(9)
    bench.wire.write(0x605A, 0, option, 2)
    bench.wire.write(index, 0, round(100 * COUNTS / seconds), 4)
    bench.wire.write(0x60FF, 0, round(100 * COUNTS), 4)  # 100 rad/s
    bench.wire.write(0x6040, 0, 0x02, 2)
    assert bench.status & 0x6F == 0x07
    bench.wire.tick(round(seconds * 500))  # half of the ramp
    assert bench.command == (AxisMode.VELOCITY, pytest.approx(50.0, abs=0.01))  # counts/s^2 are rounded
    bench.wire.tick(round(seconds * 500) + 2)
    if option <= 4:
        assert bench.status & 0x4F == 0x40
        assert bench.command == (AxisMode.OFF, 0.0)
    else:
        assert bench.status & 0x6F == 0x07
        assert bench.command == (AxisMode.VELOCITY, 0.0)


@pytest.mark.parametrize("option", [3, 4])
def test_quick_stop_at_the_current_limit_asks_for_standstill_at_once(option: int) -> None:
    bench = Bench(obedient=False).enable(10)
    bench.wire.write(0x605A, 0, option, 2)
    bench.plant.show(motor_velocity=100.0)
    bench.wire.write(0x6040, 0, 0x02, 2)
    assert bench.command == (AxisMode.VELOCITY, 0.0)
    bench.wire.tick(10)
    assert bench.status & 0x6F == 0x07
    bench.plant.show(motor_velocity=0.1)
    bench.wire.tick()
    assert bench.status & 0x4F == 0x40


def test_a_shaft_that_cannot_be_stopped_is_switched_off_all_the_same() -> None:
    bench = Bench(obedient=False).enable(10)
    bench.plant.show(motor_velocity=100.0)
    bench.wire.write(0x6040, 0, 0x02, 2)
    ramp = 100.0 / 4000.0
    bench.wire.tick(round((ramp + STOP_TIME_OUT) * 1000))
    assert bench.status & 0x6F == 0x07
    bench.wire.tick(2)
    assert bench.status & 0x4F == 0x40
    assert bench.command == (AxisMode.OFF, 0.0)


@pytest.mark.parametrize(("word", "index", "end"), [(0x07, 0x605C, 0x23), (0x06, 0x605B, 0x21)])
def test_disable_operation_and_shutdown_ramp_down_if_their_option_says_so(word: int, index: int, end: int) -> None:
    bench = Bench().enable(9)
    bench.wire.write(index, 0, 1, 2)
    bench.wire.write(0x60FF, 0, round(100 * COUNTS), 4)  # 100 rad/s, 0.1 s at 1000 rad/s^2
    bench.wire.write(0x6040, 0, word, 2)
    bench.wire.tick(50)
    assert bench.status & 0x6F == ENABLED
    bench.wire.write(0x6040, 0, word, 2)  # the same command again changes nothing
    assert bench.command == (AxisMode.VELOCITY, pytest.approx(50.0, abs=0.01))
    bench.wire.tick(52)
    assert bench.status & 0x6F == end
    assert bench.command == (AxisMode.OFF, 0.0)


def test_enable_operation_takes_back_a_ramp_that_has_not_ended() -> None:
    bench = Bench().enable(9)
    bench.wire.write(0x60FF, 0, round(100 * COUNTS), 4)
    bench.wire.write(0x6040, 0, 0x07, 2)
    bench.wire.tick(20)
    bench.wire.write(0x6040, 0, 0x0F, 2)
    assert bench.command == (AxisMode.VELOCITY, pytest.approx(100.0, abs=0.01))
    bench.wire.tick(200)
    assert bench.status & 0x6F == ENABLED


def test_without_option_shutdown_takes_the_torque_away_at_once() -> None:
    bench = Bench().enable(10)
    bench.wire.write(0x6071, 0, 300, 2)
    bench.wire.write(0x605B, 0, 0, 2)
    bench.wire.write(0x6040, 0, 0x06, 2)
    assert bench.command == (AxisMode.OFF, 0.0)


def test_halt_brakes_and_release_of_halt_goes_on() -> None:
    bench = Bench().enable(9)
    bench.wire.write(0x60FF, 0, round(100 * COUNTS), 4)
    bench.wire.write(0x6040, 0, 0x010F, 2)
    bench.wire.tick(150)
    assert bench.command == (AxisMode.VELOCITY, 0.0)
    assert bench.status & (0x6F | 0x0400) == ENABLED | 0x0400
    bench.wire.write(0x6040, 0, 0x000F, 2)
    assert bench.command == (AxisMode.VELOCITY, pytest.approx(100.0, abs=0.01))


def test_a_drive_enabled_with_halt_set_does_not_follow() -> None:
    bench = Bench()
    bench.wire.write(0x6060, 0, 10, 1)
    bench.wire.tick(3)
    bench.wire.write(0x6071, 0, 300, 2)
    for word in (0x0106, 0x0107, 0x010F):
        bench.wire.write(0x6040, 0, word, 2)
    assert bench.command == (AxisMode.VELOCITY, 0.0)


@pytest.mark.parametrize(("option", "reaction"), [(0, 0x08), (1, 0x0F), (2, 0x0F), (3, 0x0F), (4, 0x0F)])
def test_a_fault_reacts_by_its_option_code_and_ends_in_fault(option: int, reaction: int) -> None:
    bench = Bench(obedient=False).enable(10)
    bench.wire.write(0x605E, 0, option, 2)
    bench.plant.show(motor_velocity=100.0)
    bench.drive.fault(0x2310)
    assert bench.wire.tick() == ["081 10 23 03 00 00 00 00 00"]
    assert bench.status & 0x4F == reaction
    bench.plant.show(motor_velocity=0.0)
    bench.wire.tick(200)
    assert bench.status & 0x4F == 0x08
    assert bench.command == (AxisMode.OFF, 0.0)


def test_a_fault_in_an_idle_drive_needs_no_reaction() -> None:
    bench = Bench()
    bench.drive.fault(0x3220)
    assert bench.status & 0x4F == 0x08


@pytest.mark.parametrize("index", [0x605A, 0x605B, 0x605C, 0x605E, 0x6007])
def test_option_codes_out_of_range_are_refused(index: int) -> None:
    for value in (-1, 99):
        with pytest.raises(AbortedError, match=r"0609003[12]"):
            Bench().wire.write(index, 0, value, 2)


@pytest.mark.parametrize("field", ["rated_torque", "encoder_counts", "max_speed", "quick_stop_deceleration"])
def test_an_impossible_setting_is_an_error_that_names_it(field: str) -> None:
    with pytest.raises(ModelError, match=field):
        DriveConfig(**{field: 0})

"""The clocks. The real one is only asked for what does not depend on the machine's speed."""

from drivers.clock import RealClock, VirtualClock


class World:
    def __init__(self) -> None:
        self.time = 0.0
        self.asked: list[float] = []

    def advance_to(self, time: float) -> None:
        self.asked.append(time)
        self.time = time


def test_waiting_on_the_virtual_clock_runs_the_world() -> None:
    world = World()
    clock = VirtualClock(world, epoch_ns=5)
    clock.sleep_until(0.25)
    assert clock.now() == 0.25
    assert clock.epoch_ns() == 5


def test_a_deadline_that_has_passed_does_not_move_the_world() -> None:
    world = World()
    world.time = 1.0
    clock = VirtualClock(world, epoch_ns=0)
    clock.sleep_until(0.5)
    clock.sleep_until(1.0)
    assert world.asked == []
    assert clock.now() == 1.0


def test_the_real_clock_starts_near_zero_and_never_goes_back() -> None:
    clock = RealClock()
    readings = [clock.now() for _ in range(100)]
    assert readings[0] >= 0.0
    assert readings == sorted(readings)


def test_the_real_clock_waits_until_an_absolute_deadline() -> None:
    clock = RealClock()
    deadline = clock.now() + 1e-3
    clock.sleep_until(deadline)
    assert clock.now() >= deadline
    clock.sleep_until(deadline - 1.0)


def test_without_an_epoch_the_virtual_clock_takes_todays() -> None:
    year_2020 = 1_577_836_800 * 10**9
    assert VirtualClock(World()).epoch_ns() > year_2020
    assert RealClock().epoch_ns() > year_2020

"""A batch of plants: each ends where it would alone, both cores at work, and an error names its plant."""

import dataclasses
import threading

import pytest

from sim_backend.batch import advance_all
from sim_backend.errors import ModelError
from sim_backend.model.effects import CATALOGUE, ActiveEffect
from sim_backend.model.parameters import PlantConfig
from sim_backend.plant import Plant
from sim_backend.ports import AxisMode
from tests.sim_backend.model.test_parameters import DRIVE


def plant(number: int, plant_class: type[Plant] = Plant) -> Plant:
    """A plant with parameters of its own, locked or free, on its way."""
    drive = dataclasses.replace(DRIVE, K_F0=DRIVE.K_F0 * (1.0 + 0.01 * number))
    error = ActiveEffect(CATALOGUE["kinematic-error"], (1e-5 * number, 2.0, 0.05 * number))
    made = plant_class(PlantConfig(drive), (error,), seed=number)
    made.set_lock(number % 2 == 0)
    made.command("motor", AxisMode.TORQUE, 0.05 + 1e-3 * number)
    return made


@pytest.mark.parametrize("workers", [None, 1, 2, 5])
def test_64_plants_end_where_each_would_alone_to_the_last_bit(workers):
    batch, alone = [plant(k) for k in range(64)], [plant(k) for k in range(64)]
    for time in (0.02, 0.05):
        advance_all(batch, time, workers)
    for one in alone:
        one.advance_to(0.02)
        one.advance_to(0.05)
    assert [one.truth() for one in batch] == [one.truth() for one in alone]
    assert [one.read() for one in batch] == [one.read() for one in alone]
    assert len({one.truth().motor_position for one in batch}) == 64


def test_plants_run_side_by_side():
    """Each of two waits inside its step for the other; one after the other, the first would wait in vain."""
    meet = threading.Barrier(2)

    class Waiting(Plant):
        def advance_to(self, time: float) -> None:
            meet.wait(timeout=10.0)
            super().advance_to(time)

    pair = [plant(k, Waiting) for k in range(2)]
    advance_all(pair, 0.01, workers=2)
    assert [one.time for one in pair] == pytest.approx([0.01, 0.01])


def test_compiled_plants_run_without_the_interpreters_lock():
    """Another thread sees the motor warm up during one call; with the lock held it would see the two ends at most."""
    one, seen, stop = plant(1), set(), threading.Event()

    def look() -> None:
        while not stop.is_set():
            seen.add(one.truth().motor_temperature)

    other = threading.Thread(target=look)
    other.start()
    try:
        one.advance_to(100.0)
    finally:
        stop.set()
        other.join()
    assert len(seen) > 4


@pytest.mark.parametrize("workers", [1, 2])
def test_an_error_names_its_plant_and_the_others_arrive(workers):
    batch = [plant(k) for k in range(5)]
    batch[3].advance_to(0.02)
    with pytest.raises(ModelError, match=r"1 of 5 plants were not advanced to 0.01 s\. Plant 3: time = 0.01 s is in"):
        advance_all(batch, 0.01, workers)
    assert [one.time for one in batch] == pytest.approx([0.01, 0.01, 0.01, 0.02, 0.01])


def test_every_plant_that_fails_is_named():
    batch = [plant(k) for k in range(4)]
    for k in (1, 2):
        batch[k].advance_to(0.02)
    with pytest.raises(ModelError, match=r"2 of 4 plants .*Plant 1: .* Plant 2: "):
        advance_all(batch, 0.01)


@pytest.mark.parametrize("workers", [1, 2])
def test_a_mistake_in_the_program_is_not_told_as_a_plant_s_refusal(workers):
    class Broken(Plant):
        def advance_to(self, time: float) -> None:
            raise KeyError("a mistake")

    with pytest.raises(KeyError, match="a mistake"):
        advance_all([plant(0), plant(1, Broken)], 0.01, workers)


def test_a_time_of_thousands_of_digits_is_refused_in_short():
    with pytest.raises(
        ModelError, match=r"1 of 1 plants were not advanced to about 1e\+5000 s\. Plant 0: time = about"
    ):
        advance_all([plant(0)], 10**5000)


def test_a_plant_cannot_be_in_the_batch_twice():
    first, second = plant(0), plant(1)
    with pytest.raises(ModelError, match="plants 0 and 2 of the batch are one and the same"):
        advance_all([first, second, first], 0.01)
    assert first.time == second.time == 0.0


def test_a_batch_needs_a_worker():
    with pytest.raises(ModelError, match="workers = 0 must be at least 1"):
        advance_all([plant(0)], 0.01, workers=0)


def test_an_empty_batch_is_done_at_once():
    advance_all([], 0.01)

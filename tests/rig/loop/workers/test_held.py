"""What every place where runs are worked on does alike: here, in processes, and on a Dask cluster."""

import os
import pickle
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any

import numpy as np
import pytest

from drivers.errors import ConfigError, Mistake
from rig.loop.campaign import LoopOptions
from rig.loop.trace import trace
from rig.loop.workers import hold as choosing
from rig.loop.workers.held import Held, Here, shares
from rig.loop.workers.hold import cores, hold
from rig.loop.workers.processes import LostProcessError, Processes
from sim_backend.errors import ParameterError
from tests.independent.campaign import Campaign
from tests.independent.draws import draw
from tests.rig.loop.runs import dut, runs_of

pytestmark = pytest.mark.xdist_group("held")  # what was traced is shared

Place = Callable[[list[Any]], AbstractContextManager[Held[Any]]]


@contextmanager
def here(items: list[Any]) -> Iterator[Held[Any]]:
    yield Here(items)


@contextmanager
def processes(items: list[Any]) -> Iterator[Held[Any]]:
    with Processes(items, [1.0] * len(items), 3) as held:
        yield held


@contextmanager
def cluster(items: list[Any]) -> Iterator[Held[Any]]:
    distributed = pytest.importorskip("distributed", reason="needs the extra `cluster`")
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=False, dashboard_address=ANY_PORT, protocol="inproc://"
        ) as local,
        hold(items, [1] * len(items), local.scheduler_address) as held,
    ):
        yield held


ANY_PORT = ":0"
"""Of the cluster's web pages, which it serves whether one wants them or not: tests run side by side."""

PLACES = pytest.mark.parametrize("place", [here, processes, cluster])
slow_to_start = pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning")


def power(item: int, exponent: int) -> int:
    return int(item**exponent)


def as_many(item: int) -> range:
    return range(item)


MISTAKE = Mistake("path", 3, "must not be 3")


def refuse(item: int) -> int:
    raise ConfigError(f"item {item}", [MISTAKE])


def impossible(item: int) -> int:
    raise ParameterError("amplitude", item, "rad", "must be smaller")


def no_answer(_: int) -> Callable[[], int]:
    return lambda: 3


def process_of(_: int) -> int:
    return os.getpid()


@PLACES
@slow_to_start
def test_results_come_in_the_order_of_the_items(place: Place) -> None:
    with place([5, 1, 4, 2, 3]) as held:
        assert held.map(power, 2) == [25, 1, 16, 4, 9]
        assert held.gather() == [5, 1, 4, 2, 3]


@PLACES
@slow_to_start
def test_what_is_kept_is_worked_on_further(place: Place) -> None:
    with place([5, 1, 4, 2, 3]) as held:
        assert held.keep(power, 2).keep(power, exponent=2).map(power, 1) == [625, 1, 256, 16, 81]


@PLACES
@slow_to_start
def test_what_is_spread_follows_its_item_even_where_there_is_none(place: Place) -> None:
    with place([2, 0, 3, 1, 0]) as held:
        spread = held.spread(as_many)
        assert spread.gather() == [0, 1, 0, 1, 2, 0]
        assert spread.keep(power, 3).spread(as_many).gather() == [0, 0, *range(8)]


@PLACES
@slow_to_start
def test_an_error_comes_back_as_it_was_raised(place: Place) -> None:
    with place([7]) as held:
        with pytest.raises(ConfigError) as raised:
            held.map(refuse)
        assert raised.value.source == "item 7"
        assert raised.value.mistakes == (MISTAKE,)
        with pytest.raises(ParameterError, match="amplitude = 7 rad is not possible") as raised_by_model:
            held.keep(impossible).gather()
        assert raised_by_model.value.unit == "rad"
        assert held.map(power, 1) == [7]


def test_an_answer_that_cannot_travel_is_said() -> None:
    with Processes([1], [1.0], 1) as held:
        with pytest.raises((RuntimeError, AttributeError, pickle.PicklingError), match="pickle"):
            held.map(no_answer)
        assert held.map(power, 1) == [1]


def test_items_are_divided_by_their_sizes_and_nobody_is_idle() -> None:
    assert shares([10.0, 1.0, 1.0, 8.0], 2) == [[0], [1, 2, 3]]
    assert shares([1.0, 1.0], 5) == [[0], [1]]


def test_a_pool_works_in_as_many_processes_as_it_was_given() -> None:
    with Processes([1, 2, 3, 4], [1.0] * 4, 2) as held:
        found = held.map(process_of)
    assert len(set(found)) == 2
    assert os.getpid() not in found


def test_leaving_a_pool_ends_its_processes() -> None:
    with Processes([1, 2], [1.0, 1.0], 2) as held:
        children = held.map(process_of)
    for child in children:
        with pytest.raises(ProcessLookupError):
            os.kill(child, 0)


def test_a_process_that_dies_is_said() -> None:
    with Processes([1, 2], [1.0, 1.0], 2) as held:
        for _ in range(2):
            with pytest.raises(LostProcessError, match="ended before its work was done"):
                held.map(end)


def end(item: int) -> None:
    if item == 2:
        os._exit(1)


def test_few_samples_stay_here(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(choosing, "cores", lambda: 4)
    with hold([1, 2], [100, 100]) as held:
        assert held.map(process_of) == [os.getpid()] * 2
    with hold([1, 2], [100_000, 100_000]) as held:
        assert os.getpid() not in held.map(process_of)


def held_within(_: int) -> bool:
    with hold([1, 2], [100_000, 100_000]) as held:
        return bool(held.map(process_of) == [os.getpid()] * 2)


def test_a_process_of_a_pool_makes_no_pool_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(choosing, "cores", cores)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1, 2}, raising=False)
    assert cores() == 3
    with Processes([1], [1.0], 1) as held:
        assert held.map(held_within) == [True]


@pytest.mark.parametrize(
    ("address", "rule"),
    [
        ("tcp://127.0.0.1:9", "no Dask scheduler answers"),
        ("no address", "is no address of a Dask scheduler"),
        ("garbage", "is no address of a Dask scheduler"),
        ("", "is no address of a Dask scheduler"),
    ],
)
def test_a_scheduler_that_does_not_answer_is_said(address: str, rule: str, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed", reason="needs the extra `cluster`")
    from rig.loop.workers import cluster as on_cluster

    monkeypatch.setattr(on_cluster, "PATIENCE", 0.3)
    with pytest.raises(ConfigError, match=f"--scheduler.*{rule}"), hold([1], [1], address):
        pass


@pytest.fixture(scope="module")
def traced() -> dict[str, Any]:
    campaign = Campaign(41, draw("kinematic-error", np.random.default_rng(41)), rate=20.0)
    runs, held_out = runs_of(campaign)
    options = LoopOptions(held_out=held_out)
    return {"runs": runs, "options": options, "here": comparable(trace(runs, dut(), options))}


def comparable(result: Any) -> dict[str, Any]:
    return {**result.to_json(), "elapsed_s": None}


def test_a_campaign_gives_the_same_result_in_processes(traced: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(choosing, "WORTH_A_PROCESS", 1)
    monkeypatch.setattr(choosing, "cores", lambda: 3)
    assert comparable(trace(traced["runs"], dut(), traced["options"])) == traced["here"]


@slow_to_start
def test_a_campaign_gives_the_same_result_on_a_cluster(traced: dict[str, Any]) -> None:
    distributed = pytest.importorskip("distributed", reason="needs the extra `cluster`")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=ANY_PORT) as local:
        options = LoopOptions(held_out=traced["options"].held_out, scheduler=local.scheduler_address)
        assert comparable(trace(traced["runs"], dut(), options)) == traced["here"]

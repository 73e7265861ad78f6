"""Drivers by name, built in and plugged in."""

import re
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from drivers import registry
from drivers.registry import BUILT_IN, DriverEntry, Kind, all_drivers


@dataclass
class Point:
    """An entry point, as importlib.metadata gives it."""

    name: str
    load: Callable[[], object]
    value: str = "package:entry"


def plugged_in(monkeypatch: pytest.MonkeyPatch, *points: Point) -> None:
    monkeypatch.setattr(registry, "entry_points", lambda group: points if group == "rig.drivers" else ())


def test_every_built_in_driver_is_found_and_loads() -> None:
    drivers = all_drivers()
    for entry in BUILT_IN:
        assert drivers[entry.name] is entry
        assert callable(entry.load())


def test_the_three_kinds_of_devices_have_a_driver() -> None:
    assert {entry.kind for entry in BUILT_IN} == set(Kind)


def test_a_plug_in_is_found_by_its_entry_point(monkeypatch: pytest.MonkeyPatch) -> None:
    mine = DriverEntry("mine", Kind.ENCODER, "my_package:open_bus", "an encoder of my own")
    plugged_in(monkeypatch, Point("mine", lambda: mine))
    assert all_drivers()["mine"] is mine


def test_a_plug_in_that_breaks_warns_and_does_not_take_the_others_down(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken() -> object:
        raise RuntimeError("missing library")

    plugged_in(monkeypatch, Point("broken", broken))
    with pytest.warns(UserWarning, match=r"'broken' \(package:entry\) was left out: missing library"):
        drivers = all_drivers()
    assert set(drivers) == {entry.name for entry in BUILT_IN}


@pytest.mark.parametrize(
    "loaded",
    [
        pytest.param("no entry at all", id="of another type"),
        pytest.param(DriverEntry("cia402", Kind.DRIVE, "x:y", "a drive"), id="under a name that is taken"),
    ],
)
def test_a_plug_in_that_cannot_be_used_warns_and_is_left_out(monkeypatch: pytest.MonkeyPatch, loaded: object) -> None:
    plugged_in(monkeypatch, Point("other", lambda: loaded))
    with pytest.warns(UserWarning, match="was left out"):
        drivers = all_drivers()
    assert drivers["cia402"] in BUILT_IN


def test_the_plug_in_of_the_documentation_is_one(monkeypatch: pytest.MonkeyPatch) -> None:
    page = (Path(__file__).parents[2] / "docs/architecture.md").read_text()
    (project,), (code,) = (re.findall(rf"```{kind}\n(.*?)```", page, flags=re.S) for kind in ("toml", "python"))
    ((name, value),) = tomllib.loads(project)["project"]["entry-points"]["rig.drivers"].items()
    written: dict[str, Any] = {}
    exec(code, written)
    plugged_in(monkeypatch, Point(name, lambda: written[value.partition(":")[2]], value))
    assert all_drivers()[name].name == name

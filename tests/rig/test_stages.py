"""What a long command says of its stages."""

import threading

import pytest

from drivers.clock import RealClock
from rig.stages import Stages


def test_a_stage_is_told_at_once_and_again_while_it_lasts():
    said: list[str] = []
    again = threading.Event()

    def say(text: str) -> None:
        said.append(text)
        if "so far" in text:
            again.set()

    with Stages(RealClock(), say, every=0.01) as stage:
        stage("reading the logs")
        assert said == ["reading the logs"]
        assert again.wait(30.0)
        stage("fitting")
    assert said[1].startswith("  reading the logs: ")
    assert said[1].endswith(" s so far")
    assert "fitting" in said


def test_nothing_more_is_said_once_the_work_is_over_or_has_failed():
    said: list[str] = []
    with pytest.raises(ValueError, match="no"), Stages(RealClock(), said.append, every=0.01):
        raise ValueError("no")
    assert said == []
    assert not any(thread.name == "stages" for thread in threading.enumerate())


def test_a_person_at_a_terminal_waits_no_longer_than_5_s():
    assert Stages(RealClock(), terminal=True).every == 5.0
    assert Stages(RealClock(), terminal=False).every == 15.0

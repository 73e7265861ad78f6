"""Every run that the loop can propose is one that the bench can make."""

import dataclasses
import math
import shlex

import pytest

from rig.config.bench import load_bench
from rig.config.dut import default_dut
from rig.facts import bench_facts
from rig.loop.experiment.menu import MENU, SURVEYS, Offer, offers
from tests.rig.loop.experiment.hidden import rig

FACTS = bench_facts(load_bench("sim")[0], default_dut()[0])
ALL = (*MENU, *SURVEYS.values())


def offered(facts=FACTS) -> list[Offer]:
    return list(offers(facts, ALL))


def test_the_shipped_bench_can_make_every_run_of_the_menu():
    assert [offer.entry for offer in offered()] == list(ALL)


@pytest.mark.parametrize("number", [0, 3, 8, 10, 14])
def test_a_dry_run_of_the_printed_command_passes(number):
    offer = offered()[number]
    answer = rig(*shlex.split(offer.command())[1:], "--dry-run", "--seed", 3)
    assert "Dry run: nothing was moved" in answer


def test_a_bench_without_load_drive_is_offered_neither_backdrives_nor_loads():
    alone = dataclasses.replace(FACTS, has_load_drive=False)
    commands = [offer.command() for offer in offered(alone)]
    assert commands
    assert not any("backdrive" in command or "load_torques" in command for command in commands)


@pytest.mark.parametrize("size", [0.1, 10.0])
def test_torques_follow_the_rated_torque_of_the_device(size):
    limits = dataclasses.replace(FACTS.limits, motor_torque=math.inf, output_torque=math.inf, load_torque=math.inf)
    other = dataclasses.replace(
        FACTS,
        limits=limits,
        rated_torque=size * FACTS.rated_torque,
        starting_torque=size * FACTS.starting_torque,
        backdriving_torque=size * FACTS.backdriving_torque,
    )
    wide = dataclasses.replace(FACTS, limits=limits)
    for ours, theirs in zip(offered(wide), offered(other), strict=True):
        for (name, text), (_, other_text) in zip(ours.settings, theirs.settings, strict=True):
            scale = size if name in ("rates", "load_torques", "peak_torque", "bias_torque") else 1.0
            values, scaled = ([float(x) for x in t.split(",")] for t in (text, other_text))
            assert scaled == pytest.approx([scale * value for value in values], rel=0.01), name

"""The breakaway estimate against rotors whose breakaway is known."""

import math

import numpy as np
import pytest

from drivers.errors import DataError
from procedures.breakaway import Breakaway, find_breakaway
from tests.procedures.rotor import C_W, SPRING_END, Rotor, ramp

SWING = math.sqrt(1.0 / (C_W * SPRING_END) / 2.2e-5)
"""246 rad/s: the rotor of the tests on its spring at small torque."""

RESOLUTIONS = (1024, 4096, 16384, 262144)


def estimate(rotor: Rotor, counts: int, **options: float) -> Breakaway:
    time, torque, position, rest = ramp(rotor, counts, **options)
    return find_breakaway(time, torque, position, rest, 2.0 * math.pi / counts, SWING)


def standard_errors(found: Breakaway, truth: float) -> float:
    return abs(found.torque - truth) / found.uncertainty


@pytest.mark.parametrize("counts", RESOLUTIONS)
@pytest.mark.parametrize("start", [0.05, 0.5, 0.95])
def test_the_breakaway_is_found_at_any_resolution_and_phase_of_the_encoder(counts: int, start: float) -> None:
    assert standard_errors(estimate(Rotor(), counts, start=start), 0.012) < 2.0


@pytest.mark.parametrize("counts", [4096, 16384, 262144])
def test_the_stated_uncertainty_is_below_one_percent_with_a_usual_encoder(counts: int) -> None:
    assert estimate(Rotor(), counts).uncertainty < 0.01 * 0.012


def test_the_first_pulse_moves_with_the_resolution_while_the_breakaway_stays() -> None:
    coarse, fine = estimate(Rotor(), 4096, start=0.05), estimate(Rotor(), 16384, start=0.05)
    assert coarse.first_pulse > 3.0 * fine.first_pulse
    assert abs(coarse.torque - fine.torque) < 2.0 * math.hypot(coarse.uncertainty, fine.uncertainty)


@pytest.mark.parametrize(("counts", "printed"), [(4096, 2.2e-3), (16384, 0.52e-3)])
def test_the_first_pulse_comes_no_later_than_the_spring_law_allows(counts: int, printed: float) -> None:
    """One count after a start just past a boundary is the latest: 2.2 and 0.52 mN*m by equation (27)."""
    worst = estimate(Rotor(noise=0.0), counts, start=0.0)
    # the ramp gains 2 uN*m per cycle, and the rotor swings on its spring by less than 3 % of the torque
    assert worst.first_pulse == pytest.approx(printed, rel=0.06)


@pytest.mark.parametrize("counts", [4096, 16384])
@pytest.mark.parametrize("breakaway", [0.0119, 0.01193, 0.012, 0.01207, 0.0121, 0.029])
def test_a_coarse_torque_command_is_covered_by_the_uncertainty(counts: int, breakaway: float) -> None:
    """Steps of 1 per mille of 188 mN*m rated torque, as a CiA 402 drive takes them."""
    found = estimate(Rotor(breakaway=breakaway, step=1.88e-4), counts)
    assert standard_errors(found, breakaway) < 2.0
    assert found.uncertainty > 1.88e-4 / math.sqrt(12.0)


@pytest.mark.parametrize("counts", [4096, 16384])
@pytest.mark.parametrize(
    "rotor",
    [
        Rotor(viscous=0.0),
        Rotor(viscous=1e-3),
        Rotor(viscous=5e-3),
        Rotor(inertia=2e-4),
        Rotor(sliding=0.0115),
        Rotor(sliding=0.010),
        Rotor(noise=1e-3),
    ],
    ids=["no viscous friction", "grease", "cold grease", "heavy rotor", "drop of 4 %", "drop of 17 %", "noisy current"],
)
def test_other_rotors_break_away_where_they_should(rotor: Rotor, counts: int) -> None:
    assert standard_errors(estimate(rotor, counts), 0.012) < 2.0


def test_a_faster_ramp_still_finds_the_breakaway() -> None:
    assert standard_errors(estimate(Rotor(), 4096, rate=0.01), 0.012) < 2.0


def test_backward_ramps_give_the_same_magnitudes() -> None:
    time, torque, position, rest = ramp(Rotor(), 4096)
    resolution = 2.0 * math.pi / 4096
    forward = find_breakaway(time, torque, position, rest, resolution, SWING)
    backward = find_breakaway(time, -torque, -position, -rest, resolution, SWING)
    assert backward.torque == pytest.approx(forward.torque, rel=1e-9)
    assert backward.first_pulse == pytest.approx(forward.first_pulse, rel=1e-9)


def test_an_encoder_that_chatters_at_rest_has_not_given_its_first_pulse() -> None:
    time, torque, position, rest = ramp(Rotor(), 4096)
    resolution = 2.0 * math.pi / 4096
    chatter = rest + resolution * (np.arange(rest.size) % 2)
    calm = find_breakaway(time, torque, position, rest, resolution, SWING)
    unsure = find_breakaway(time, torque, position, chatter, resolution, SWING)
    assert unsure.first_pulse_time > calm.first_pulse_time


def test_a_path_of_too_few_counts_is_refused_with_what_to_do() -> None:
    time, torque, position, rest = ramp(Rotor(), 4096, motion=0.008)
    with pytest.raises(DataError, match="motion"):
        find_breakaway(time, torque, position, rest, 2.0 * math.pi / 4096, SWING)

"""Courses of a setpoint, as plain numbers: no cycle, no bus, no sample."""

import itertools
import math
from collections.abc import Iterator, Sequence

TURN = 2.0 * math.pi

GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0
"""Share of a turn between start angles: no small number of them lines up with an order per turn."""


def start_angles(count: int) -> tuple[float, ...]:
    """Give `count` wave-generator angles, rad in [0, 2 pi), spread over a turn and commensurate with no order."""
    return tuple(TURN * ((k * GOLDEN) % 1.0) for k in range(count))


def nested_triangles(peak: float, amplitudes: Sequence[float], bias: float, rest: float) -> tuple[float, ...]:
    """Give the turning points of nested triangles, from 0 to 0, in the unit of `peak`.

    `amplitudes` are shares of `peak`, largest first. Each triangle runs through both of its turning points and back
    to the first, a closed loop that lies inside the one before. The largest is centred on 0, the others on `bias`.
    `rest` is the level of friction: the last turn goes by that much beyond zero, so that zero leaves nothing behind
    in the gear: output torque = play(ratio * motor torque) is then 0 as well.
    """
    points = [0.0]
    side = 1.0
    for index, share in enumerate(sorted(amplitudes, reverse=True)):
        centre = bias if index else 0.0
        points += [centre + side * share * peak, centre - side * share * peak, centre + side * share * peak]
        side = -side
    points += [math.copysign(rest, -points[-1]), 0.0]
    return tuple(points)


def path_length(points: Sequence[float]) -> float:
    """Give the sum of the distances between successive points."""
    return math.fsum(abs(b - a) for a, b in itertools.pairwise(points))


def cycles(duration: float, cycle_time: float) -> int:
    """Give how many control cycles a duration (s) takes: at least one."""
    return max(1, math.ceil(duration / cycle_time - 1e-6))


def line(start: float, end: float, rate: float, cycle_time: float) -> Iterator[float]:
    """Give the values, one per cycle, from `start` (left out) to `end` (included) at `rate` per second."""
    count = cycles(abs(end - start) / rate, cycle_time)
    for k in range(1, count + 1):
        yield start + (end - start) * k / count


def smooth_step(start: float, end: float, duration: float, cycle_time: float) -> Iterator[float]:
    """Give the values, one per cycle, of a half cosine from `start` to `end`: no jump of speed.

    The largest speed is pi/2 times the mean one.
    """
    count = cycles(duration, cycle_time)
    for k in range(1, count + 1):
        yield start + (end - start) * 0.5 * (1.0 - math.cos(math.pi * k / count))


def nearest_turn(angle: float, position: float) -> float:
    """Give the position nearest to `position` (rad) that shows the wave-generator angle `angle` (rad)."""
    return position + math.remainder(angle - position, TURN)

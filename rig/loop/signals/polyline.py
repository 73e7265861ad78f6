"""A torque that was swept in straight lines, without its noise: knots found, placed and held against the noise.

A play remembers the extremes of its input, so that the noise of a held torque ratchets it on, and a line that runs on
past a corner sets it for good; what rings answers to the corners. Where the whole record is a polyline within its
noise, that is what they get.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_banded
from scipy.ndimage import maximum_filter1d

from rig.loop.signals.noise import MEMORIES, left_in_mean, noise_and_memory
from rig.loop.signals.one_rate import at_one_rate
from rig.loop.signals.smoothing import corners_kept

Floats = NDArray[np.float64]

TOLERANCE, TOLERANCE_COLOURED = 6.3, 4.0
"""By how many standard deviations of the ends of smoothing lines a polyline may miss the smoothed torque before it gets
a further knot; of a noise that remembers, of a sample, because smoothing leaves most of it."""

BENT = 6.0
"""Standard deviations that the slope must change by at a knot, or it is none."""

LEVEL, FLAT = 3.0, 0.1
"""Standard deviations that a piece must rise or fall by, or it is level, where they are less than this share of what
the steeper piece beside it would rise in the same time."""

LEVELLING, TIED = np.array([[1.0, -1.0], [-1.0, 1.0]]), 1e3
"""What holds both ends of a piece at one height, and by how much more than its samples."""

MOST_KNOTS = 200

LONGEST_ARC = 3
"""Bends in a row to the same side of a polyline in a noise that remembers: such a noise hides how far the chords of a
curve miss it. A ramp, a hold and the way back are two."""

SHORTEST, SHORTEST_SAMPLES = 1.0, 25
"""s and samples that a straight piece lasts on average at least; what bends more often is no polyline."""

SPARE = 4
"""How many times as many knots splitting may give first: it cuts corners and ends in pieces, which are taken out."""

LEAST_BLOCK = 10
"""Samples of such a block at least."""

BLOCK, BY_CHANCE, TYPICAL_COLOURED, WORST = 0.5, 4.0, 1.5, 6.0
"""s of the blocks whose means judge the polyline. Their rms, in standard deviations, may exceed one by this many of its
own standard errors; with a noise that remembers, whose size is known less well, it may reach the third. No block may
exceed the last."""

FARTHEST, FEWEST_BLOCKS = 15.0, 4
"""Tolerances by which the polyline may miss the smoothed torque anywhere (a step or a pulse makes it overshoot), and
blocks of a record without which nothing is judged."""

PASSES, PRUNINGS, SPLITS = 5, 30, 4
"""Rounds of placing knots, of taking some out, and of splitting again where the polyline misses."""

LEAST_GAP, CLOSE = 2.0, 20.0
"""Samples between knots at least, and below which two of them may share one corner."""

FAR = 3.0
"""Standard deviations beyond which a sample counts no more against a corner: a few such drew a second knot to them."""

RIDGE = 1e-10

ROUNDS = 3
"""Times that a noise which remembers is measured anew."""


@dataclass(frozen=True, slots=True)
class Polyline:
    """Knots at the samples `knots` (k,), fractions of one too, and their heights (k,), N*m."""

    knots: Floats
    heights: Floats

    def at(self, samples: int) -> Floats:
        """Give the polyline at every sample, N*m, (samples,)."""
        return np.asarray(np.interp(np.arange(samples, dtype=float), self.knots, self.heights))


def polyline(values: Floats, side: int, period: float) -> Floats | None:
    """Give the polyline that `values` (n,), N*m, follow within their noise, shape (n,); None if they follow none.

    side: samples on either side over which they are smoothed to find where they bend. period: s between samples.
    """
    smoothed = corners_kept(values, side)
    block = max(round(BLOCK / period), LEAST_BLOCK)
    if smoothed is values or values.size < FEWEST_BLOCKS * block:
        return None
    most = min(round(values.size / max(SHORTEST / period, SHORTEST_SAMPLES)) + 2, MOST_KNOTS)
    rest = values
    for _ in range(ROUNDS):
        # what corners add to second differences is gone once a first polyline has been taken off
        noise, memory = noise_and_memory(rest, period)
        if not noise.all():
            return None
        tolerance = (TOLERANCE_COLOURED if memory else TOLERANCE * math.sqrt(4.0 / side)) * np.sqrt(noise)
        found = _found(values, smoothed, side, tolerance, noise, memory, SPARE * most)
        if found is None:
            return None
        few = found.knots.size <= most
        if few:
            variance = _variance(noise, memory)
            found = _levelled(values, found, variance)
            alike = at_one_rate(values, found.knots, found.heights, variance)
            found = found if alike is None else Polyline(*alike)
        line = found.at(values.size)
        curved = memory > 0.0 and _longest_arc(found) > LONGEST_ARC
        rest = values - line
        if not memory:
            break
    # what remembers as long as any noise that is tried, and is as large, is the curve that the line misses
    shaped = memory >= MEMORIES[-1] and float(np.mean(rest**2)) >= float(np.mean(noise))
    good = few and not curved and not shaped and _is_noise(rest, noise, memory, block)
    return line if good and np.abs(line - smoothed).max() <= FARTHEST * tolerance.max() else None


def _found(
    values: Floats, smoothed: Floats, side: int, tolerance: Floats, noise: Floats, memory: float, most: int
) -> Polyline | None:
    """Split the record, take superfluous knots out, and split again where the line misses; None beyond `most` knots."""
    knots = _split(smoothed, tolerance)
    if knots.size > most:
        return None
    found = _pruned(values, knots, noise, memory)
    for _ in range(SPLITS):
        missed = _split(corners_kept(values - found.at(values.size), side), tolerance)
        further = [knot for knot in missed if np.abs(found.knots - knot).min() > LEAST_GAP]
        if not further or found.knots.size + len(further) > most:
            break
        found = _pruned(values, np.sort(np.append(found.knots, further)), noise, memory)
    return found


def _longest_arc(line: Polyline) -> int:
    """Give how many bends in a row turn to the same side."""
    sides = np.sign(np.diff(np.diff(line.heights) / np.diff(line.knots)))
    return max((len(list(same)) for _, same in itertools.groupby(sides.tolist())), default=0)


def _is_noise(rest: Floats, noise: Floats, memory: float, block: int) -> bool:
    """Whether the means over `block` samples of what is left (n,) scatter as noise of this variance (n,) would."""
    whole = rest.size // block * block
    means, variance = (x[:whole].reshape(-1, block).mean(axis=1) for x in (rest, noise))
    sizes = np.abs(means) / np.sqrt(variance * left_in_mean(memory, block))
    most_typical = TYPICAL_COLOURED if memory else 1.0 + BY_CHANCE / math.sqrt(2.0 * sizes.size)
    return bool(np.sqrt(np.mean(sizes**2)) <= most_typical and sizes.max() <= WORST)


def _variance(noise: Floats, memory: float) -> Floats:
    """Give the variance (n,) that each sample would have if they were independent: that of the mean of many says it."""
    return noise * (1.0 + memory) / (1.0 - memory)


def _split(smoothed: Floats, tolerance: Floats) -> Floats:
    """Split the record where a straight line misses it most, until none misses it by more than `tolerance` (n,)."""
    found, open_ = {0, smoothed.size - 1}, [(0, smoothed.size - 1)]
    while open_:
        first, last = open_.pop()
        if last - first < 2:
            continue
        inner = smoothed[first : last + 1]
        miss = np.abs(inner - np.linspace(inner[0], inner[-1], inner.size)) / tolerance[first : last + 1]
        worst = int(miss.argmax())
        if miss[worst] > 1.0:
            found.add(first + worst)
            open_ += [(first, first + worst), (first + worst, last)]
    return np.array(sorted(found), dtype=float)


def _pruned(values: Floats, knots: Floats, noise: Floats, memory: float) -> Polyline:
    """Place the knots; take out those at which the line does not bend, and one of two that share a corner."""
    variance = _variance(noise, memory)
    for _ in range(PRUNINGS):
        found = _placed(values, knots)
        bends = _bends(found, variance)
        idle: list[int] = []
        for k in np.argsort(bends).tolist():
            if bends[k] < BENT and all(abs(k - other) > 1 for other in idle):
                idle.append(k)
        if not idle:
            break
        knots = np.delete(found.knots, np.array(idle) + 1)
    return _joined(values, found, variance)


def _joined(values: Floats, found: Polyline, variance: Floats) -> Polyline:
    """Put one knot for a close pair, or none for several close ones, wherever that serves as well.

    Two knots that share a corner hold each other in place, and each is needed as long as the other stays. So do three
    around a few samples that lie off by chance, as those of a noise with heavy tails do.
    """

    def misfit(line: Polyline) -> float:
        return float(np.minimum((values - line.at(values.size)) ** 2 / variance, FAR**2).sum())

    least, tried = misfit(found), 0.0
    while True:
        gaps = np.diff(found.knots)
        close = [k for k in np.argsort(gaps).tolist() if 0 < k < gaps.size - 1 and tried < gaps[k] < CLOSE]
        if not close:
            return found
        k = close[0]
        tried = float(gaps[k])
        for fewer in (_met(found, k), _without(found.knots, k)):
            one = _placed(values, fewer)
            if misfit(one) < least + BENT**2:
                found, least, tried = one, misfit(one), 0.0
                break


def _met(line: Polyline, k: int) -> Floats:
    """Give the knots with one where the lines on either side of the pair `k`, `k` + 1 about meet."""
    bends = np.abs(np.diff(np.diff(line.heights) / np.diff(line.knots)))[k - 1 : k + 1]
    meeting = float(bends @ line.knots[k : k + 2] / bends.sum())
    return np.concatenate([line.knots[:k], [meeting], line.knots[k + 2 :]])


def _without(knots: Floats, k: int) -> Floats:
    """Take out all inner knots that follow each other closely around the pair `k`, `k` + 1."""
    close = np.diff(knots) < CLOSE
    first, last = k, k + 1
    while first > 1 and close[first - 1]:
        first -= 1
    while last < knots.size - 2 and close[last]:
        last += 1
    return np.concatenate([knots[:first], knots[last + 1 :]])


def _placed(values: Floats, knots: Floats) -> Polyline:
    """Fit heights and places of the knots by least squares."""
    for _ in range(PASSES):
        knots = _apart(knots)
        line = _fitted(values, knots)
        if knots.size < 3:
            return line
        knots = _moved(values, line)
    return _fitted(values, _apart(knots))


def _apart(knots: Floats) -> Floats:
    """Take out knots that lie less than `LEAST_GAP` behind the one before or before the last one."""
    kept = [float(knots[0])]
    for knot in knots[1:-1].tolist():
        if knot - kept[-1] >= LEAST_GAP and knots[-1] - knot >= LEAST_GAP:
            kept.append(knot)
    return np.array([*kept, float(knots[-1])])


def _fitted(values: Floats, knots: Floats, tied: Floats | float = 0.0) -> Polyline:
    """Fit the heights of the knots; `tied` (k - 1,): weights by which both ends of a piece are held at one height."""
    squares, products = _sums(values, knots)
    diagonal, beside = _bands(squares + np.multiply.outer(tied, LEVELLING))
    return Polyline(knots, _solved([diagonal, beside], _ends(products)))


def _levelled(values: Floats, line: Polyline, variance: Floats) -> Polyline:
    """Make level what does not rise: of a hold that is a little higher at one end a play would take the higher one."""
    gaps, rises = np.diff(line.knots), np.abs(np.diff(line.heights))
    least = LEVEL * np.sqrt(12.0 * _typical(line, variance) / gaps)
    steeper = maximum_filter1d(rises / gaps, 3, mode="constant") * gaps
    level = (rises < least) & (least < FLAT * steeper)
    if not level.any():
        return line
    tied = np.where(level, TIED * gaps, 0.0)
    line = _fitted(values, line.knots, tied)
    for _ in range(PASSES):
        knots = _moved(values, line, tied)
        if np.diff(knots).min() < LEAST_GAP:
            break
        line = _fitted(values, knots, tied)
    return line


def _moved(values: Floats, line: Polyline, tied: Floats | float = 0.0) -> Floats:
    """Give the knots (k,) moved to where they serve better, the heights being free; `tied`: see `_fitted`."""
    squares, products = _sums(values, line.knots)
    count, gaps = line.knots.size, np.diff(line.knots)
    slopes = -np.diff(line.heights) / gaps
    heights, next_heights = _bands(squares + np.multiply.outer(tied, LEVELLING))
    both, next_both = _bands(slopes[:, None, None] * squares)
    moves, next_moves = _bands(slopes[:, None, None] ** 2 * squares)
    inner = np.array([0.0, *np.ones(count - 2), 0.0])  # the ends stay
    # the unknowns are height and move of one knot after the other
    bands = [
        _in_turn(heights, moves * inner + 1.0 - inner),
        _in_turn(both * inner, np.append(next_both * inner[:-1], 0.0))[:-1],
        _in_turn(next_heights, next_moves * inner[:-1] * inner[1:]),
        _in_turn(next_both * inner[1:], np.zeros(count - 1))[:-1],
    ]
    pulls = _in_turn(_ends(products), _ends(slopes[:, None] * products) * inner)
    found = _solved(bands, pulls)[1::2]
    knots = line.knots.copy()
    knots[1:-1] += np.clip(found[1:-1], -0.3 * gaps[:-1], 0.3 * gaps[1:])
    return knots


def _in_turn(one: Floats, other: Floats) -> Floats:
    return np.column_stack([one, other]).ravel()


def _bands(blocks: Floats) -> tuple[Floats, Floats]:
    """Add up the blocks (k - 1, 2, 2) of the pieces between the k knots: diagonal (k,) and beside it (k - 1,)."""
    return _ends(blocks[:, (0, 1), (0, 1)]), blocks[:, 0, 1]


def _ends(values: Floats) -> Floats:
    """Add up what the pieces (k - 1, 2) give to the k knots between them, (k,)."""
    return np.asarray(np.append(values[:, 0], 0.0) + np.append(0.0, values[:, 1]))


def _sums(values: Floats, knots: Floats) -> tuple[Floats, Floats]:
    """Give the sums of products of the two hat functions of every piece, (k - 1, 2, 2), and with `values`, (k - 1, 2).

    Within a piece the hats are 1 - u and u, with u from 0 to 1.
    """
    first = np.ceil(knots[:-1]).astype(np.intp)
    count = np.diff(np.append(first, values.size)).astype(float)
    index = np.arange(values.size, dtype=float)
    gaps, start = np.diff(knots), first - knots[:-1]
    # of samples at start, start + 1, ... behind the knot
    linear = count * start + 0.5 * count * (count - 1.0)
    square = count * start**2 + start * count * (count - 1.0) + (count - 1.0) * count * (2.0 * count - 1.0) / 6.0
    u, uu = linear / gaps, square / gaps**2
    squares = np.stack([np.stack([count - 2.0 * u + uu, u - uu], -1), np.stack([u - uu, uu], -1)], -2)
    total, moment = np.add.reduceat(values, first), np.add.reduceat(values * index, first)
    rising = (moment - knots[:-1] * total) / gaps
    return squares, np.stack([total - rising, rising], -1)


def _solved(bands: Sequence[Floats], vector: Floats) -> Floats:
    """Solve scaled normal equations for `vector` (k,) or (k, m); a knot on a straight line has no place of its own.

    `bands`: the symmetric matrix's diagonal (k,) and those beside it, (k - 1,), (k - 2,) and so on.
    """
    scale = np.sqrt(np.maximum(bands[0], 1e-300))
    width = len(bands) - 1
    banded = np.zeros((2 * width + 1, scale.size))
    for apart, band in enumerate(bands):
        scaled = band / (scale[: scale.size - apart] * scale[apart:]) + (0.0 if apart else RIDGE)
        banded[width - apart, apart:] = scaled
        banded[width + apart, : scale.size - apart] = scaled
    found = solve_banded((width, width), banded, (vector.T / scale).T)
    return np.asarray((found.T / scale).T)


def _bends(line: Polyline, variance: Floats) -> Floats:
    """Give the change of slope at every inner knot in standard deviations, (k - 2,), for a noise of `variance` (n,)."""
    count, rates = line.knots.size, 1.0 / np.diff(line.knots)
    squares, _ = _sums(variance, line.knots)
    inner = np.arange(1, count - 1)
    change = np.zeros((inner.size, count))
    change[inner - 1, inner - 1] = rates[:-1]
    change[inner - 1, inner + 1] = rates[1:]
    change[inner - 1, inner] = -rates[:-1] - rates[1:]
    spread = _solved(_bands(squares / _typical(line, variance)[:, None, None]), change.T)
    return np.asarray(np.abs(change @ line.heights) / np.sqrt((change * spread.T).sum(axis=1)))


def _typical(line: Polyline, variance: Floats) -> Floats:
    """Give the mean of a `variance` (n,) over every piece, (k - 1,)."""
    squares, products = _sums(variance, line.knots)
    # the two hats add up to one
    return np.asarray(products.sum(axis=1) / squares.sum(axis=(1, 2)))

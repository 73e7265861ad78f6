"""Torque at which a slowly loaded motor breaks away, from one torque ramp.

Two answers, because they are different things. The *first pulse* is the torque at the first change of the
encoder's reading. The wave generator's spring winds up from the very first torque, so that this value measures
the encoder's resolution. The *breakaway* is the torque at which the rotor runs away: a kink in its path.

The path is reduced to the instants at which it crosses the boundaries between two counts, where the angle is
known exactly however coarse the encoder is. Two branches that meet at the kink t_b are fitted to them:

    before   x = x_0 + a_1 u + a_2 u^2                       winding up; u = torque ramp
    after    x = x(t_b) + k_1 h_1(t - t_b) + k_2 h_2(t - t_b)
             x'' + d x' = k_1 + k_2 (t - t_b)                 run-away under the excess torque, with viscous rate d

k_1 > 0 where friction drops as motion begins. All coefficients but t_b and d are linear.
Source: Zhang, Ahmad & Liu 2014, section V (first pulse) and equation (27) (winding up).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.errors import DataError

Floats = NDArray[np.float64]

VISCOUS_RATES = (0.0, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0)
"""Values of d (1/s) that are tried; a rotor's own lies between 1 and 100."""

CROSSING_ERROR = 0.1
"""Standard error of a crossing in counts: half a cycle of time, reading noise."""

PATH_ERROR = 0.01
"""Standard error of the two-branch path as a share of the travel: friction is not quite constant."""

REST_ERROR = 0.29
"""Standard error of the angle at rest in counts: anywhere within one, 1/sqrt(12)."""

MOST_CROSSINGS = 300
"""A path of finer resolution is read at this many equidistant angles."""

STEP_ERROR = 3.0
"""Factor on the torque's scatter: each step of a coarse torque command also sets the wound-up rotor swinging, by
up to a step more, and breaks away up to 1.4 steps early, 0.9 steps rms: three times a step's own 1/sqrt(12)."""

LAG_ERROR, LOST_LAG_ERROR, WOUND = 0.25, 2.0, 12.0
"""The rotor trails a ramp of slope r and swings by r / swing about it. Standard error of the breakaway in that unit:
where winding up lasts at least `WOUND` radians of the swing, and where it is faster, when winding up and running away
blend and the kink may be found anywhere. Ladder of ramp rates on the simulated drive: at most 0.3 and 2.2."""

CANDIDATES, REFINED, REFINEMENTS, BISECTIONS = 50, 13, 3, 12
"""Search for the kink: crossings tried first, then instants between the best one's neighbours, several times over;
halvings of the run in the search for the kink's standard error."""

FEWEST_CROSSINGS = 8
"""Fewer say nothing about two branches: move further, or use a finer encoder."""


@dataclass(frozen=True, slots=True)
class Breakaway:
    """Magnitudes of the torque at first pulse and at breakaway with standard uncertainties, and their instants, s."""

    first_pulse: float
    first_pulse_uncertainty: float
    first_pulse_time: float
    torque: float
    uncertainty: float
    time: float


def find_breakaway(
    time: Floats, torque: Floats, position: Floats, rest: Floats, resolution: float, swing: float
) -> Breakaway:
    """Give first pulse and breakaway of one torque ramp that began at rest.

    time s, torque N*m as measured and position rad as read, all of shape (n,), n >= 2, from the first cycle of the
    ramp to the stop of the run-away; `rest` rad, shape (m,), are the positions read at rest just before;
    `resolution` is the encoder's, rad; `swing` the angular frequency of the rotor on the wave generator's spring,
    rad/s. Raises DataError if the path has too few counts to see two branches.
    """
    sign = np.sign(position[-1] - position[0])
    x = sign * (position - position[0])
    line, scatter = _ramp(time, torque)
    step = max(resolution, float(x[-1]) / MOST_CROSSINGS)
    crossing_time, level = _crossings(time, x, step)
    steps = level.size - 1
    if steps < FEWEST_CROSSINGS:
        raise DataError(
            "breakaway",
            f"the motor moved by {x[-1]:.3g} rad, {steps} steps of its encoder",
            expected=f"at least {FEWEST_CROSSINGS} steps of {resolution:.3g} rad",
            hint="Let the motor move further (parameter motion).",
        )
    kink, kink_error = _kink(crossing_time, level, np.abs(line[0] * crossing_time + line[1]), step)
    rate = abs(line[0])
    cycle = float(np.median(np.diff(time)))
    # An encoder that chatters between two counts at rest has given no pulse yet.
    first = float(time[int(np.argmax(sign * position > np.max(sign * rest) + 0.5 * resolution))])
    found = abs(line[0] * kink + line[1])
    lag = rate / swing * (LAG_ERROR if found * swing >= WOUND * rate else LOST_LAG_ERROR)
    return Breakaway(
        first_pulse=abs(line[0] * first + line[1]),
        first_pulse_uncertainty=float(np.hypot(scatter, rate * cycle)),
        first_pulse_time=first,
        torque=found,
        uncertainty=math.hypot(scatter, rate * kink_error, lag),
        time=kink,
    )


def _ramp(time: Floats, torque: Floats) -> tuple[tuple[float, float], float]:
    """Fit a line to the torque; give slope, intercept and the scatter that averaging over 25 cycles leaves.

    White noise averages out; the steps of a drive's coarse torque command do not: they belong to the uncertainty.
    """
    slope, intercept = np.polyfit(time, torque, 1)
    rest = torque - (slope * time + intercept)
    block = min(25, rest.size)
    smooth = np.convolve(rest, np.full(block, 1.0 / block), mode="valid")
    return (float(slope), float(intercept)), STEP_ERROR * float(np.sqrt(np.mean(smooth**2)))


def _crossings(time: Floats, x: Floats, step: float) -> tuple[Floats, Floats]:
    """Give the times (m,) at which the path passed the levels (m,) half way between multiples of `step`.

    The first is the rest, known to half a step either way.
    A reading that chatters about a boundary crosses it where half of the readings are past: the readings are sorted.
    """
    path = np.sort(x)
    level = np.arange(0.5 * step, path[-1], step)
    after = np.searchsorted(path, level)
    before = after - 1
    share = (level - path[before]) / (path[after] - path[before])
    crossed = time[before] + share * (time[after] - time[before])
    return np.concatenate([time[:1], crossed]), np.concatenate([[0.0], level])


def _kink(time: Floats, level: Floats, torque: Floats, step: float) -> tuple[float, float]:
    """Give the instant of the kink and its standard error, s."""
    weight = 1.0 / np.hypot(CROSSING_ERROR * step, PATH_ERROR * level)
    weight[0] = 1.0 / (REST_ERROR * step)
    chosen = np.unique(np.linspace(0, time.size - 1, CANDIDATES).astype(int))
    grid = time[chosen]
    for _ in range(REFINEMENTS + 1):
        misfit = np.array([_misfit(float(t), time, level, torque, weight, step) for t in grid])
        k = int(np.argmin(misfit))
        best, least = float(grid[k]), float(misfit[k])
        grid = np.linspace(grid[max(0, k - 1)], grid[min(grid.size - 1, k + 1)], REFINED)
    allowed = least + max(1.0, least / max(1, level.size - 6))
    return best, _half_width(best, float(time[-1] - time[0]), allowed, time, level, torque, weight, step)


def _half_width(
    best: float,
    reach: float,
    allowed: float,
    time: Floats,
    level: Floats,
    torque: Floats,
    weight: Floats,
    step: float,
) -> float:
    """Give how far the kink may move until the misfit passes `allowed`: the mean of both sides, s."""
    widths = []
    for side in (-1.0, 1.0):
        near, far = 0.0, reach
        for _ in range(BISECTIONS):
            middle = 0.5 * (near + far)
            inside = _misfit(best + side * middle, time, level, torque, weight, step) <= allowed
            near, far = (middle, far) if inside else (near, middle)
        widths.append(far)
    return float(np.mean(widths))


def _misfit(kink: float, time: Floats, level: Floats, torque: Floats, weight: Floats, step: float) -> float:
    """Give the least weighted sum of squares over all viscous rates with the kink held."""
    return min(_residual(kink, rate, time, level, torque, weight, step) for rate in VISCOUS_RATES)


def _residual(
    kink: float, viscous: float, time: Floats, level: Floats, torque: Floats, weight: Floats, step: float
) -> float:
    wound = np.interp(np.minimum(time, kink), time, torque)
    wound = wound / max(float(wound[-1]), 1e-300)
    first, second = _run_away(np.maximum(time - kink, 0.0), viscous)
    columns = [np.ones_like(time), wound, wound**2]
    for column in (first, second):
        if column[-1] > 0.0:
            columns.append(column / column[-1])
    matrix = np.stack(columns, axis=1) * weight[:, None]
    # A coarse encoder has fewer crossings before the kink than the branch has coefficients: the curvature is then
    # held near zero by this weak prior of ten counts instead of being arbitrary.
    prior = np.zeros((1, len(columns)))
    prior[0, 2] = 0.1 / step
    system = np.concatenate([matrix, prior])
    target = np.concatenate([level * weight, [0.0]])
    solution = np.linalg.lstsq(system, target, rcond=None)[0]
    return float(np.sum((system @ solution - target) ** 2))


def _run_away(x: Floats, viscous: float) -> tuple[Floats, Floats]:
    """Response of x'' + d x' to a unit step and to a unit ramp, after the time `x` (s), shape (n,)."""
    if viscous == 0.0:
        return x**2 / 2.0, x**3 / 6.0
    decay = -np.expm1(-viscous * x) / viscous
    return (x - decay) / viscous, (x**2 / 2.0 - (x - decay) / viscous) / viscous

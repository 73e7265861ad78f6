"""Is there anything left? What replicates share; without replicates, whether the residual remembers.

rho: correlation of the 0.5 s-smoothed residuals of a replicate pair. Noise has none, even coloured noise; missing
physics repeats. Source of the thresholds: synthetic campaigns with 13 repeatable effects (rho > 0.8) and 4 kinds of
noise (rho < 0.11). Without a pair only a quiet dwell can tell coloured noise from structure.
"""

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from rig.config.dut import Dut
from rig.loop.fitting.normal import correlation_length
from rig.loop.model.equations import Law, Piece
from rig.loop.model.prediction import Model
from rig.loop.statements.colour import SMOOTHING, means, slow_noise, slow_square
from rig.loop.statements.dwells import quantisation_square
from rig.loop.statements.residuals import Residual, aligned, by_procedure, pairs

Floats = NDArray[np.float64]

FEWEST_MEANS = 2
"""Means of a pair of runs without which neither tells what is slow from noise."""

NOISE_RHO = 0.15
EXCESS = 1.1
"""Repeatable residual counts if the rms exceeds the floor by this factor."""

UNSTEADY = 1.8
"""Times by which the slow part that runs of a pair do not share must exceed what noise of the dwells' colour leaves."""

ODD = 2.0
"""Times the slow squares of its replicate that those of an odd run are at least."""

STANDS = 1e-3
"""rad that a motor that stands travels in a second at most."""

LAGS = 20
RATE = 10.0
"""Ljung-Box: lags, and samples per second to which the residual is averaged before."""


@dataclass(frozen=True, slots=True)
class Repeats:
    """What replicate pairs of one equation and procedure say.

    `rho`: mean correlation of smoothed residuals; `least_rho`: what noise may reach; `common`: mean square of what
    the runs of a pair share, `own` of what they do not; `allowance`: mean square of what instruments leave that may
    repeat as well; `own_slow`: mean square of the slow part that the runs do not share, `noise` what noise leaves of
    it, None without a dwell that tells its colour; `odd`: runs that leave much more than their replicate;
    `ljung_box`: statistic per lag at 10 Hz, None if not known.
    """

    equation: str
    procedure: str
    pairs: int
    rho: float
    least_rho: float
    common: float
    own: float
    allowance: float
    own_slow: float
    noise: float | None
    odd: tuple[str, ...]
    ljung_box: float | None

    @property
    def structured(self) -> bool:
        """Whether a repeatable part stands out of the noise."""
        material = self.common > max((EXCESS**2 - 1.0) * self.own, EXCESS**2 * self.allowance)
        return self.rho > max(NOISE_RHO, self.least_rho) and material

    @property
    def unsteady(self) -> bool:
        """Whether the larger part is there, does not repeat, and is no noise of the dwells' colour."""
        return self.noise is not None and self.own_slow > max(UNSTEADY**2 * self.noise, self.common)


def repeats(residuals: Sequence[Residual], dut: Dut, model: Model) -> Repeats | None:
    """Judge the residuals of one equation and procedure; None without a replicate pair."""
    rhos, squares, differences, slow, lengths = [], [], [], [], []
    used: list[Residual] = []
    odd: list[str] = []
    for one, two in pairs(residuals):
        time, a, b = aligned(one, two)
        period = one.piece.track.period
        apart = means(a - b, period)
        if time.size < 50 or apart.size < FEWEST_MEANS or not np.any(a) or not np.any(b):
            continue
        window = max(1, round(SMOOTHING / period))
        x, y = uniform_filter1d(a, window), uniform_filter1d(b, window)
        x, y = x - x.mean(), y - y.mean()
        power = float(x @ x) * float(y @ y)
        if power == 0.0:
            continue
        rhos.append(float(x @ y) / math.sqrt(power))
        squares.append(float(np.mean(a**2) + np.mean(b**2)) / 2.0)
        differences.append(float(np.mean((a - b) ** 2)) / 2.0)
        slow.append(float(np.mean((apart - apart.mean() if one.piece.demeaned else apart) ** 2)) / 2.0)
        lengths.append(time.size / window)
        used += [one, two]
        sizes = slow_square(one), slow_square(two)
        if max(sizes) > ODD * min(sizes):
            odd.append((one, two)[int(np.argmax(sizes))].piece.track.name)
    if not rhos:
        return None
    allowance = float(np.mean([_allowance(residual.piece, dut, model.ratio) for residual in used]))
    noise = slow_noise(used, dut, model)
    return Repeats(
        equation=residuals[0].piece.equation.value,
        procedure=residuals[0].piece.track.procedure.value,
        pairs=len(rhos),
        rho=float(np.mean(rhos)),
        least_rho=3.0 / math.sqrt(sum(lengths)),
        common=max(float(np.mean(squares)) - float(np.mean(differences)), 0.0),
        own=float(np.mean(differences)),
        allowance=allowance,
        own_slow=float(np.mean(slow)),
        noise=noise.square if noise.dwells else None,
        odd=tuple(dict.fromkeys(odd)),
        ljung_box=mean_ljung_box(used),
    )


LOUDER, CERTAIN = 1.3, 6.0
"""Times its replicate that a run must leave to be told, and standard deviations by which that is no chance."""

SPREAD_OF_SIZE = 1.25
"""Standard deviation over mean of the size of one value: 0.76 if normal, 1.21 of Student's t with three freedoms."""

REMEMBERS = 10.0
"""Ljung-Box statistic per lag above which a residual without replicates is no white noise."""

QUIETER = 1.5
"""Times by which the slow part of a residual must exceed what noise of the dwells' colour leaves."""


@dataclass(frozen=True, slots=True)
class Memory:
    """What runs without a replicate tell of one equation and procedure.

    `slow`: rms of the residual's means over 0.5 s, in the equation's unit; `noise`: what noise and counts leave in
    it, of the colour that the dwells have, of none where there is no dwell (`dwells`); `ljung_box`: statistic per lag
    at 10 Hz, None if not known.
    """

    equation: str
    procedure: str
    runs: int
    slow: float
    noise: float
    dwells: bool
    ljung_box: float | None

    @property
    def structured(self) -> bool:
        """Whether the residual remembers more than its dwells, or at all where there is no dwell."""
        remembers = self.ljung_box is not None and self.ljung_box > REMEMBERS
        return remembers and self.slow > (QUIETER if self.dwells else EXCESS) * self.noise


@dataclass(frozen=True, slots=True)
class Louder:
    """A run that leaves `times` as much of one equation as its `replicate` does."""

    equation: str
    procedure: str
    run: str
    replicate: str
    times: float


def louder(residuals: Sequence[Residual]) -> list[Louder]:
    """Give the runs that leave far more than their replicate, in size and not only in what is slow."""
    found = []
    for one, two in itertools.chain.from_iterable(map(pairs, by_procedure(residuals).values())):
        sizes = [float(np.mean(np.abs(x.values))) if x.values.size else 0.0 for x in (one, two)]
        if min(sizes) == 0.0:
            continue
        less, more = sorted(zip(sizes, (one, two), strict=True), key=lambda pair: pair[0])
        unsure = SPREAD_OF_SIZE * math.sqrt(sum(correlation_length(x.values) / x.values.size for x in (one, two)))
        times = more[0] / less[0]
        if math.log(times) > max(math.log(LOUDER), CERTAIN * unsure):
            piece = more[1].piece
            place = piece.equation.value, piece.track.procedure.value
            found.append(Louder(*place, piece.track.name, less[1].piece.track.name, times))
    return found


def memory(residuals: Sequence[Residual], dut: Dut, model: Model) -> Memory | None:
    """Judge the residuals of one equation and procedure that has no replicates; None without enough samples."""
    long = [residual for residual in residuals if residual.values.size * residual.piece.track.period > 10 * SMOOTHING]
    if not long:
        return None
    piece = long[0].piece
    noise = slow_noise(long, dut, model)
    slow = np.concatenate([means(residual.values, residual.piece.track.period) for residual in long])
    return Memory(
        equation=piece.equation.value,
        procedure=piece.track.procedure.value,
        runs=len(long),
        slow=math.sqrt(float(np.mean(slow**2))),
        noise=math.sqrt(noise.square + float(np.mean([_allowance(x.piece, dut, model.ratio) for x in long]))),
        dwells=noise.dwells,
        ljung_box=mean_ljung_box(long),
    )


def _allowance(piece: Piece, dut: Dut, ratio: float | None) -> float:
    """Give the mean square that counts of the encoders leave, or a play that ratchets along its noisy input."""
    track = piece.track
    if piece.demeaned:
        return (quantisation_square(piece, dut, ratio) or 0.0) * (1.0 + 2.0 * _held_share(piece))
    if piece.law is Law.BACKDRIVE and track.output_torque is not None and ratio is not None:
        return _white(track.output_torque) / ratio**2
    if piece.law is Law.LOCKED and track.motor_torque is not None and ratio is not None:
        return _white(track.motor_torque) * ratio**2
    return 0.0


def _held_share(piece: Piece) -> float:
    """Give the share of the time at which the motor stands: its angle is then off by one error, up to half a count.

    Over a sweep the errors of counting are spread evenly, with a third of that square.
    """
    angle, step = piece.track.motor_position, max(1, round(1.0 / piece.track.period))
    if angle is None or angle.size <= step:
        return 0.0
    travel = np.abs(angle[step:] - angle[:-step])
    return float(np.mean(travel < STANDS))


def _white(values: Floats) -> float:
    return float(np.mean(np.diff(values) ** 2)) / 2.0


def mean_ljung_box(residuals: Iterable[Residual]) -> float | None:
    """Give the mean of `ljung_box` over those long enough for it; None where none is."""
    found = [box for box in map(ljung_box, residuals) if box is not None]
    return float(np.mean(found)) if found else None


def ljung_box(residual: Residual) -> float | None:
    """Give the Ljung-Box statistic per lag of the residual averaged to 10 Hz at most; about 1 for white noise.

    None of a run too short for it, and of a residual that is zero.
    """
    width = max(1, round(1.0 / (RATE * residual.piece.track.period)))
    count = residual.values.size // width
    if count < 3 * LAGS:
        return None
    x = residual.values[: count * width].reshape(count, width).mean(axis=1)
    x = x - x.mean()
    power = float(x @ x)
    if power == 0.0:
        return None
    total = sum((float(x[lag:] @ x[:-lag]) / power) ** 2 / (count - lag) for lag in range(1, LAGS + 1))
    return count * (count + 2) * total / LAGS

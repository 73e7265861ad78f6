"""What a report draws of a loop: residuals over what explains them, hysteresis loops, spectra over the angle.

Held-out runs are shown; where an equation has none, the fitted ones.
"""

import math
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.signals import BY_NAME
from rig.config.dut import Dut, Rotation
from rig.log.run import Run
from rig.loop.files.views_file import (
    CycleView,
    Means,
    ResidualView,
    RunFacts,
    SpectrumView,
    Stretch,
    Views,
)
from rig.loop.model.curves import ANGLES
from rig.loop.model.equations import Equation
from rig.loop.model.evaluation import Evaluation
from rig.loop.model.frames import NEGATED
from rig.loop.model.prediction import Model, predict
from rig.loop.statements.angle_spectrum import Signal, amplitudes
from rig.loop.statements.residuals import Residual, rms

Floats = NDArray[np.float64]

POINTS = 2000
"""Samples of a residual that a plot shows."""

CYCLE_POINTS = 700
"""Samples of one run in a hysteresis loop."""

MOST_CYCLES = 4
"""Runs in a plot of hysteresis loops: more would hide each other."""

TURNED, SWEPT = ("motor_position", "output_position"), ("output_torque", "motor_torque", "motor_position")
"""What runs that turn and sweeps vary: the first one that is known and varies is shown."""

MOST_VARIABLES = 3
"""Variables over which the residual of one equation and procedure is shown."""

MEANS = 72
"""Intervals of a period of which means are given."""

FEWEST_IN_A_MEAN = 5

LEAST_TRAVEL = 0.05
"""Share of a period, or of the range that a variable has in all runs, that must be covered to be shown."""

LEAST_COVERED = 0.5
"""Share of a turn that the samples of sweeps lie in at least for a spectrum: of two short ones it would show where they
started."""

EXPLAINED = 0.98
"""Ratio of the error after and before above which what was added explains nothing of it."""

SPECTRUM_POINTS = 900
HIGHEST_ORDERS: Mapping[str, float] = {"motor_position": 200.0, "output_position": 400.0}
"""Orders of a spectrum, at most, unless a line above was added: twice the teeth of an output turn are about 320."""

BEYOND_A_LINE = 1.5
"""A spectrum goes on to so many times the highest order that was added."""

SAMPLED = 0.45
"""Cycles per sample up to which an order is shown."""


@dataclass(frozen=True, slots=True)
class Added:
    """One term that was added: its id, its variable, and the orders of its lines, the strongest first."""

    effect: str
    variable: str
    orders: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Pair:
    """One equation of one run on one side: residual before and after, at the same samples."""

    side: str
    before: Residual
    after: Residual

    @property
    def equation(self) -> Equation:
        """What is predicted."""
        return self.after.piece.equation

    @property
    def procedure(self) -> str:
        """What was done."""
        return self.after.piece.track.procedure.value

    @property
    def run(self) -> str:
        """Name of the run."""
        return self.after.piece.track.name


@dataclass(frozen=True, slots=True)
class _Seen:
    """A pair with the model's evaluation at its samples, in the signs of the contract."""

    pair: Pair
    evaluation: Evaluation
    rows: NDArray[np.intp]
    sense: float

    def signal(self, name: str) -> Floats | None:
        """Give a signal at the samples, None where it is not known.

        Without a torque constant the motor's torque is not: what stands in its place is a current.
        """
        current = self.pair.equation is Equation.MOTOR_CURRENT
        values = None if current and name == "motor_torque" else self.evaluation.signals.get(name)
        if values is None:
            return None
        return self._signed(name, values[self.rows])

    @property
    def sign(self) -> float:
        """Sign of the equation's quantity in the contract."""
        return self.sense if self.pair.equation.value.startswith("motor") else 1.0

    @property
    def before(self) -> Floats:
        return self.sign * self.pair.before.values

    @property
    def after(self) -> Floats:
        return self.sign * self.pair.after.values

    def _signed(self, name: str, values: Floats) -> Floats:
        return self.sense * values if name in NEGATED else values


def views_of(pairs: Sequence[Pair], model: Model, added: Sequence[Added], runs: Sequence[RunFacts], dut: Dut) -> Views:
    """Give everything a report draws. `model`: with what was added."""
    groups: dict[tuple[str, str], list[_Seen]] = {}
    for pair in _shown(pairs):
        track = pair.after.piece.track
        rows = np.searchsorted(track.time, pair.after.time)
        sense = -1.0 if dut.gear.rotation is Rotation.SAME else 1.0
        seen = _Seen(pair, predict(pair.after.piece, model), rows, sense)
        groups.setdefault((pair.equation.value, pair.procedure), []).append(seen)
    residuals: list[ResidualView] = []
    cycles, spectra = [], []
    everything = [seen for group in groups.values() for seen in group]
    for group in groups.values():
        residuals += _residuals(group, added, everything)
        cycles.append(_cycle(group))
        spectra.append(_spectrum(group, added))
    return Views(
        runs=tuple(runs),
        residuals=tuple(residuals),
        cycles=tuple(view for view in cycles if view is not None),
        spectra=tuple(view for view in spectra if view is not None),
    )


def facts_of(runs: Sequence[Run], side: str, apart: Set[str] = frozenset()) -> tuple[RunFacts, ...]:
    """Give what a report says of the runs of one side; those `apart` are of another kind, and not counted."""
    return tuple(
        RunFacts(
            name=run.name,
            side=side,
            procedure=run.procedure.value,
            counted=run.name not in apart,
            replicate=run.replicate,
            start_angle=run.start_angle,
            samples=int(run.time.size),
            seconds=float(run.time[-1]) if run.time.size else 0.0,
            operator=run.metadata.get("operator"),
            bench=run.metadata.get("bench"),
            started=run.metadata.get("started"),
            status=run.status,
            software=run.metadata.get("software"),
        )
        for run in runs
    )


def _shown(pairs: Sequence[Pair]) -> list[Pair]:
    """Give the held-out pairs, and the fitted ones of equations that have none."""
    held = {pair.equation for pair in pairs if pair.side == "held_out"}
    return [pair for pair in pairs if (pair.side == "held_out") == (pair.equation in held)]


def _span(variable: str, everything: Sequence[_Seen]) -> float:
    """Give the range of a variable over all equations and runs; of an angle, a turn at most."""
    most = 2.0 * math.pi if variable in ANGLES else math.inf
    known = [x for seen in everything if (x := seen.signal(variable)) is not None and x.size]
    whole = max((float(x.max()) for x in known), default=0.0) - min((float(x.min()) for x in known), default=0.0)
    return min(whole, most)


def _residuals(group: Sequence[_Seen], added: Sequence[Added], everything: Sequence[_Seen]) -> list[ResidualView]:
    """Give the residual over what it was traced to, over what the procedure varies, and, with nothing added, time."""
    before, after = np.concatenate([s.before for s in group]), np.concatenate([s.after for s in group])
    explained = added if rms(after) < EXPLAINED * rms(before) else ()
    traced = list(dict.fromkeys(item.variable for item in explained))
    varied = TURNED if group[0].pair.after.piece.track.moves else SWEPT
    views = {name: _residual(group, name, explained, everything) for name in dict.fromkeys((*traced, *varied, "time"))}
    natural = next((name for name in varied if views[name] is not None), None)
    shown = dict.fromkeys([*traced, natural, None if added else "time"])
    return [view for name in shown if name is not None and (view := views[name]) is not None][:MOST_VARIABLES]


def _residual(
    group: Sequence[_Seen], variable: str, added: Sequence[Added], everything: Sequence[_Seen]
) -> ResidualView | None:
    """Give the residual over one variable; None where it is unknown, or hardly varies beside what it does elsewhere."""
    known = [(seen, x) for seen in group if (x := seen.signal(variable)) is not None]
    if not known:
        return None
    own = [item for item in added if item.variable == variable]
    x = np.concatenate([values for _, values in known])
    before = np.concatenate([seen.before for seen, _ in known])
    after = np.concatenate([seen.after for seen, _ in known])
    order = _fold(variable, x, own)
    period = _span(variable, everything) if order is None else 2.0 * math.pi / order
    if not float(np.ptp(x)) > LEAST_TRAVEL * period:
        return None
    if order is not None:
        x = np.remainder(x, period)
    first, chosen = group[0].pair, _thinned(x.size, POINTS)
    return ResidualView(
        equation=first.equation.value,
        unit=first.equation.unit,
        procedure=first.procedure,
        side=first.side,
        runs=tuple(seen.pair.run for seen, _ in known),
        variable=variable,
        variable_unit=_unit(variable),
        effects=tuple(item.effect for item in own),
        order=order,
        samples=int(x.size),
        rms_before=rms(before),
        rms_after=rms(after),
        x=_numbers(x[chosen]),
        before=_numbers(before[chosen]),
        after=_numbers(after[chosen]),
        means=Means() if order is None else _means(x, before, after, period),
    )


def _fold(variable: str, x: Floats, own: Sequence[Added]) -> float | None:
    """Give how often a revolution an angle is folded: by the strongest line that was added, else once.

    An angle that stays within one period is not folded, nor is what is no angle.
    """
    if variable not in ANGLES:
        return None
    order = next((order for item in own for order in item.orders[:1] if order > 0.0), 1.0)
    return order if float(np.ptp(x)) > 2.0 * math.pi / order else None


def _means(x: Floats, before: Floats, after: Floats, period: float) -> Means:
    place = np.minimum((x / period * MEANS).astype(np.intp), MEANS - 1)
    counts = np.bincount(place, minlength=MEANS)
    kept = counts >= FEWEST_IN_A_MEAN
    centres = (np.flatnonzero(kept) + 0.5) * period / MEANS
    sums = [np.bincount(place, weights=values, minlength=MEANS)[kept] / counts[kept] for values in (before, after)]
    return Means(x=_numbers(centres), before=_numbers(sums[0]), after=_numbers(sums[1]))


def _cycle(group: Sequence[_Seen]) -> CycleView | None:
    """Give the hysteresis loops of runs that do not turn, over the torque that the equation takes."""
    first = group[0].pair
    if first.after.piece.track.moves:
        return None
    variables = ("motor_torque",) if first.equation is Equation.OUTPUT_TORQUE else ("output_torque", "motor_torque")
    variable = next((v for v in variables if group[0].signal(v) is not None), None)
    if variable is None:
        return None
    shown = [seen for seen in group if seen.signal(variable) is not None][:MOST_CYCLES]
    if not any(np.ptp(seen.evaluation.signals[variable]) > 0.0 for seen in shown):
        return None
    return CycleView(
        equation=first.equation.value,
        unit=first.equation.unit,
        procedure=first.procedure,
        side=first.side,
        runs=tuple(seen.pair.run for seen in shown),
        left_out=len(group) - len(shown),
        variable=variable,
        variable_unit=_unit(variable),
        stretches=tuple(stretch for seen in shown for stretch in _stretches(seen, variable)),
    )


def _stretches(seen: _Seen, variable: str) -> list[Stretch]:
    """Cut a run where samples are missing or masked, and thin it."""
    x, model = seen.signal(variable), seen.sign * seen.evaluation.value[seen.rows]
    time, period = seen.pair.after.time, seen.pair.after.piece.track.period
    if x is None:
        return []
    step = max(1, x.size // CYCLE_POINTS)
    found = []
    for part in np.split(np.arange(x.size), np.flatnonzero(np.diff(time) > 3.0 * period) + 1):
        kept = part[::step]
        if kept.size > 1:
            measured = model[kept] + seen.after[kept]
            before = measured - seen.before[kept]
            found.append(
                Stretch(
                    run=seen.pair.run,
                    x=_numbers(x[kept]),
                    measured=_numbers(measured),
                    before=_numbers(before),
                    after=_numbers(model[kept]),
                )
            )
    return found


def _spectrum(group: Sequence[_Seen], added: Sequence[Added]) -> SpectrumView | None:
    """Give the spectrum over the angle (or time) of the first line that was added, else over the motor angle."""
    lined = [item for item in added if item.orders and item.variable in (*ANGLES, "time")]
    wanted = dict.fromkeys([*(item.variable for item in lined), *ANGLES])
    known = {v: [s for s in group if v in s.evaluation.signals] for v in wanted}
    variable = next((v for v in wanted if known[v]), None)
    if variable is None:
        return None
    turn = 2.0 * math.pi if variable == "time" else 1.0
    signals = []
    for seen in known[variable]:
        x = seen.signal(variable)
        if x is not None:
            signals.append(Signal(turn * x, (seen.before, seen.after)))
    phases = np.remainder(np.concatenate([signal.x for signal in signals]), 2.0 * math.pi)
    covered = np.unique((phases / (2.0 * math.pi) * MEANS).astype(np.intp)).size
    if covered < LEAST_COVERED * MEANS and not group[0].pair.after.piece.track.moves:
        return None
    lines = tuple(sorted({order for item in lined if item.variable == variable for order in item.orders}))
    highest = max([HIGHEST_ORDERS.get(variable, math.inf), *(BEYOND_A_LINE * order for order in lines)])
    orders, (before, after) = amplitudes(signals, min(highest, _sampled(signals)))
    if not orders.size:
        return None
    edges = np.unique(np.searchsorted(orders, np.geomspace(orders[0], orders[-1], SPECTRUM_POINTS)))
    tops = [np.maximum.reduceat(values, edges) for values in (before, after)]
    middles = orders[np.minimum((edges + np.append(edges[1:], orders.size)) // 2, orders.size - 1)]
    first = group[0].pair
    return SpectrumView(
        equation=first.equation.value,
        unit=first.equation.unit,
        procedure=first.procedure,
        side=first.side,
        runs=tuple(seen.pair.run for seen in known[variable]),
        variable=variable,
        lines=_numbers(np.array(lines)),
        orders=_numbers(middles),
        before=_numbers(tops[0]),
        after=_numbers(tops[1]),
    )


def _sampled(signals: Sequence[Signal]) -> float:
    """Give the highest order that the samples tell: of neighbouring samples, a quarter are no further apart."""
    steps = np.concatenate([np.abs(np.diff(signal.x)) for signal in signals])
    moving = steps[steps > 0.0]
    return SAMPLED * 2.0 * math.pi / float(np.percentile(moving, 25)) if moving.size else math.inf


def _thinned(size: int, most: int) -> NDArray[np.intp]:
    """Give `most` places at most, evenly spread."""
    return np.unique(np.linspace(0, size - 1, min(size, most)).astype(np.intp))


def _numbers(values: Floats) -> tuple[float, ...]:
    return tuple(float(f"{value:.6g}") for value in values.tolist())


def _unit(variable: str) -> str:
    if variable == "time":
        return "s"
    known = BY_NAME.get(variable)
    return "" if known is None else known.unit

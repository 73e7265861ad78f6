"""How large a hidden effect is: what is left of it once the base model is fitted again, over the floor of its equation.

The floor is what the base model leaves of the same campaign, the same noise draws and all, without the effect. The
effect is measured on pairs of copies with the same noise, by encoders without counts: what differs is the effect. The
oracle, a loop that misses nothing, takes that from the logs themselves; they keep what their encoders make of it.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from rig.config.dut import Dut
from rig.log.run import Run
from rig.loop.fitting.base import fit_base, settled_pieces, start_model
from rig.loop.fitting.fit import Fit, fit, material
from rig.loop.fitting.starts import scaled_to_data
from rig.loop.model.equations import distinct_readings, pieces_of, target_of
from rig.loop.model.prediction import Model
from rig.loop.signals.tracks import Track, make_track, thin_track
from rig.loop.statements.residuals import Residual, residual_of
from rig.loop.workers.held import Here
from sim_backend.model.compliance import Compliance
from tests.challenge.cases import LARGEST, Case, campaign_of, scaled, together
from tests.challenge.outside import OUTSIDE
from tests.independent.campaign import Recording, held_out
from tests.independent.terms import Effects
from tests.rig.loop.runs import dut as default_dut
from tests.rig.loop.runs import make_run

CONTRACT = (
    "motor_position",
    "output_position",
    "motor_torque",
    "motor_current",
    "output_torque",
    "temperature",
    "supply_voltage",
)
"""Columns that are signals of the contract; all others are auxiliary."""

CLOSE = 0.04
"""Relative deviation of the size from what is wanted."""

NOTHING = Effects()

TRIES = 6
PASSES = 6


Errors = Mapping[str, float]
"""rms by equation."""


@dataclass(frozen=True, slots=True)
class BaseFloor:
    """The campaign without what is hidden, base fitted: rms per equation, of the training and of the held-out runs."""

    fit: Fit
    train: Errors
    held_out: Errors


@dataclass(frozen=True, slots=True)
class Hidden:
    """What a case hides, scaled: sizes in floors of their equations, and how many times as large as drawn."""

    effects: tuple[Effects, ...]
    outside_amplitude: float
    sizes: tuple[float, ...]
    equations: tuple[str, ...]
    scales: tuple[float, ...]


def as_runs(recordings: Sequence[Recording], without: Sequence[str] = ()) -> tuple[Run, ...]:
    """Give the logs as the loop reads them: nothing of the truth travels along. `without`: columns left out."""
    return tuple(_as_run(recording, without) for recording in recordings)


def floor_of(case: Case, effects: Effects = NOTHING) -> BaseFloor:
    """Fit the base model to the campaign in which nothing is hidden, or to that with `effects`."""
    recordings = campaign_of(case, effects).recordings()
    return base_floor(as_runs(recordings, case.without), held_out(recordings), default_dut())


def base_floor(runs: Sequence[Run], out: Sequence[str], dut: Dut) -> BaseFloor:
    """Fit the base model to all runs but those to hold out."""
    tracks = [make_track(run, dut) for run in runs if run.name not in out]
    start = start_model(dut, dut.gear.ratio, Compliance.ARCTAN, None)
    thin = [distinct_readings(piece) for track in tracks for piece in pieces_of(thin_track(track), dut.gear.ratio)]
    base = fit_base(material(Here(settled_pieces(thin, start))), start)
    held = [make_track(run, dut) for run in runs if run.name in out]
    return BaseFloor(base, _rms(_residuals(tracks, base.model)), _rms(_residuals(held, base.model)))


def hide(case: Case, floor: BaseFloor) -> Hidden:
    """Scale what the case hides to the size it is to have, each effect by itself."""
    without = _smooth_residuals(case, floor, NOTHING, 0.0)

    def size(effects: Effects, outside_amplitude: float) -> tuple[float, str]:
        left = _difference(_smooth_residuals(case, floor, effects, outside_amplitude), without)
        sizes = {name: rms / floor.train[name] for name, rms in left.items()}
        equation = max(sizes, key=lambda name: sizes[name])
        return sizes[equation], equation

    if case.outside is not None and case.size is not None:
        start = OUTSIDE[case.outside].amplitude
        found = [_search(lambda factor: size(NOTHING, factor * start), case.size, math.inf)]
        return Hidden((), found[0].scale * start, (found[0].size,), (found[0].equation,), (found[0].scale,))
    if case.size is None:
        found = [_Found(1.0, *size(effects, 0.0)) for effects in case.hidden]
    else:
        found = [_search(partial(_scaled_size, size, effects), case.size, LARGEST) for effects in case.hidden]
    return Hidden(
        tuple(scaled(effects, item.scale) for effects, item in zip(case.hidden, found, strict=True)),
        0.0,
        tuple(item.size for item in found),
        tuple(item.equation for item in found),
        tuple(item.scale for item in found),
    )


def logs_of(case: Case, hidden: Hidden) -> tuple[tuple[Run, ...], tuple[str, ...]]:
    """Give the runs with what is hidden in them, and the names of those to hold out."""
    recordings = campaign_of(case, together(hidden.effects), hidden.outside_amplitude).recordings()
    return as_runs(recordings, case.without), held_out(recordings)


def oracle_errors(case: Case, hidden: Hidden, floor: BaseFloor, runs: Sequence[Run], out: Sequence[str]) -> Errors:
    """Give the rms per equation of held-out runs for one who knows the effect exactly, and the base as `floor` does."""
    with_it, without = (
        as_runs(campaign_of(case, *what, countless=True).recordings(), case.without)
        for what in ((together(hidden.effects), hidden.outside_amplitude), (NOTHING, 0.0))
    )
    read, smooth, plain = (
        {
            (item.piece.equation, item.piece.track.name): item
            for item in _residuals([make_track(run, default_dut()) for run in some if run.name in out], floor.fit.model)
        }
        for some in (runs, with_it, without)
    )
    left = []
    for key in read.keys() & smooth.keys() & plain.keys():
        logs = (read[key], smooth[key], plain[key])
        times = np.intersect1d(np.intersect1d(logs[0].time, logs[1].time), logs[2].time)
        here, there, bare = (item.values[np.searchsorted(item.time, times)] for item in logs)
        left.append(replace(read[key], time=times, values=here - (there - bare)))
    return _rms(left)


def _as_run(recording: Recording, without: Sequence[str]) -> Run:
    columns = {name: values for name, values in recording.columns.items() if name not in without}
    signals = {name: values for name, values in columns.items() if name in CONTRACT}
    run = make_run(recording.name, recording.procedure, recording.time, signals, replicate=recording.replicate)
    further = {name: values for name, values in columns.items() if name not in signals}
    return replace(run, auxiliary=further, auxiliary_units=dict.fromkeys(further, "degC"))


@dataclass(frozen=True, slots=True)
class _Found:
    scale: float
    size: float
    equation: str


def _scaled_size(
    size: Callable[[Effects, float], tuple[float, str]], effects: Effects, factor: float
) -> tuple[float, str]:
    return size(scaled(effects, factor), 0.0)


def _search(size_of: Callable[[float], tuple[float, str]], wanted: float, largest: float) -> _Found:
    """Give what comes nearest to the size that is wanted; a bench that cannot follow bounds the scale."""
    scale, best = 1.0, _Found(0.0, 0.0, "")
    for _ in range(TRIES):
        try:
            size, equation = size_of(scale)
        except ValueError:  # the shaft snaps, or the motor saturates
            largest = 0.8 * scale
            scale = math.sqrt(best.scale * largest) if best.scale else 0.25 * scale
            continue
        if not best.scale or _off(size, wanted) < _off(best.size, wanted):
            best = _Found(scale, size, equation)
        if abs(size / wanted - 1.0) < CLOSE or (scale >= largest and size < wanted):
            break
        scale = min(scale * wanted / max(size, 1e-3 * wanted), largest)
    return best


def _off(size: float, wanted: float) -> float:
    return abs(math.log(max(size, 1e-9) / wanted))


def _smooth_residuals(case: Case, floor: BaseFloor, effects: Effects, outside_amplitude: float) -> list[Residual]:
    """Give what the refitted base leaves of the training runs, read by encoders without counts."""
    dut = default_dut()
    recordings = campaign_of(case, effects, outside_amplitude, countless=True).recordings()
    out = held_out(recordings)
    tracks = [make_track(run, dut) for run in as_runs(recordings, case.without) if run.name not in out]
    thin = {track.name: thin_track(track) for track in tracks}
    pieces = []
    for item in floor.fit.linear.gather():
        moved = replace(item.piece, track=thin[item.piece.track.name])
        pieces.append(replace(moved, target=target_of(moved, dut.gear.ratio)[moved.index]))
    near = fit_base(material(Here(pieces)), scaled_to_data(floor.fit.model, list(thin.values()))).model
    again = fit(Here(pieces), near, floor.fit.noise, passes=PASSES, block=floor.fit.block)
    return _residuals(tracks, again.model)


def _difference(one: Sequence[Residual], other: Sequence[Residual]) -> dict[str, float]:
    """Give the rms by which residuals of the same runs and noise differ, per equation."""
    squares: dict[str, list[np.ndarray]] = {}
    known = {(item.piece.equation, item.piece.track.name): item for item in other}
    for item in one:
        same = known.get((item.piece.equation, item.piece.track.name))
        if same is not None:
            _, here, there = np.intersect1d(item.time, same.time, return_indices=True)
            squares.setdefault(item.piece.equation.value, []).append((item.values[here] - same.values[there]) ** 2)
    return {name: float(np.sqrt(np.mean(np.concatenate(values)))) for name, values in squares.items()}


def _residuals(tracks: Sequence[Track], model: Model) -> list[Residual]:
    """Give what the model leaves of every equation of every run, at the full rate of the logs."""
    return [residual_of(piece, model) for track in tracks for piece in pieces_of(track, model.ratio)]


def _rms(residuals: Sequence[Residual]) -> dict[str, float]:
    values: dict[str, list[np.ndarray]] = {}
    for item in residuals:
        values.setdefault(item.piece.equation.value, []).append(item.values)
    return {name: float(np.sqrt(np.mean(np.concatenate(some) ** 2))) for name, some in values.items()}

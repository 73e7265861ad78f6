"""How large a hidden effect is: what is left of it once the base model is fitted again, over the floor of its equation.

The floor is what the base model leaves of the same campaign, the same noise draws and all, without the effect: the
oracle of a loop that misses nothing. The effect is measured on copies by instruments without counts and noise.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rig.config.dut import Dut
from rig.log.run import Run
from rig.loop.fitting.fit import Fit, fit
from rig.loop.model.equations import FEWEST_SAMPLES, Piece, distinct_readings, pieces_of, target_of
from rig.loop.model.prediction import Model, predict
from rig.loop.signals.tracks import make_track, thin_track
from rig.loop.statements.metrics import residual_of
from rig.loop.trace import fit_base, start_model
from sim_backend.model.compliance import Compliance
from tests.challenge.cases import LARGEST, Case, campaign_of, scaled, together
from tests.challenge.outside import OUTSIDE
from tests.independent.campaign import Recording, held_out
from tests.independent.terms import Effects
from tests.rig.loop.runs import dut as default_dut
from tests.rig.loop.runs import make_run

CONTRACT = ("motor_position", "output_position", "motor_torque", "motor_current", "output_torque", "temperature")
"""Columns that are signals of the contract; all others are auxiliary."""

CLOSE = 0.04
"""Relative deviation of the size from what is wanted."""

NOTHING = Effects()

TRIES = 6
PASSES = 6


@dataclass(frozen=True, slots=True)
class Oracle:
    """The campaign without what is hidden, base fitted: rms per equation, of the training and of the held-out runs."""

    fit: Fit
    train: Mapping[str, float]
    held_out: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Hidden:
    """What a case hides, scaled: sizes in floors of their equations, and how many times as large as drawn."""

    effects: tuple[Effects, ...]
    outside_amplitude: float
    sizes: tuple[float, ...]
    equations: tuple[str, ...]
    scales: tuple[float, ...]


def as_runs(recordings: Sequence[Recording]) -> tuple[Run, ...]:
    """Give the logs as the loop reads them: nothing of the truth travels along."""
    return tuple(_as_run(recording) for recording in recordings)


def oracle_of(case: Case, effects: Effects = NOTHING) -> Oracle:
    """Fit the base model to the campaign in which nothing is hidden, or to that with `effects`."""
    recordings = campaign_of(case, effects).recordings()
    dut = default_dut()
    train, out = _sides(recordings)
    start = start_model(dut, dut.gear.ratio, Compliance.ARCTAN, None)
    base = fit_base(_settled(_thin(train, dut), start), start)
    return Oracle(base, _rms(train, base.model, dut), _rms(out, base.model, dut))


def hide(case: Case, oracle: Oracle) -> Hidden:
    """Scale what the case hides to the size it is to have, each effect by itself."""
    if case.size is None:
        sizes = [_size(case, oracle, effects, 0.0) for effects in case.hidden]
        return Hidden(
            case.hidden, 0.0, tuple(s for s, _ in sizes), tuple(e for _, e in sizes), tuple(1.0 for _ in sizes)
        )
    if case.outside is not None:
        start = OUTSIDE[case.outside].amplitude
        scale, size, equation = _search(lambda f: _size(case, oracle, Effects(), f * start), case.size, math.inf)
        return Hidden((), scale * start, (size,), (equation,), (scale,))
    found = []
    for effects in case.hidden:
        scale, size, equation = _search(
            lambda f, effects=effects: _size(case, oracle, scaled(effects, f), 0.0), case.size, LARGEST
        )
        found.append((scaled(effects, scale), size, equation, scale))
    return Hidden(
        tuple(item[0] for item in found),
        0.0,
        tuple(item[1] for item in found),
        tuple(item[2] for item in found),
        tuple(item[3] for item in found),
    )


def logs_of(case: Case, hidden: Hidden) -> tuple[tuple[Run, ...], tuple[str, ...]]:
    """Give the runs with what is hidden in them, and the names of those to hold out."""
    recordings = campaign_of(case, together(hidden.effects), hidden.outside_amplitude).recordings()
    return as_runs(recordings), held_out(recordings)


def _as_run(recording: Recording) -> Run:
    signals = {name: values for name, values in recording.columns.items() if name in CONTRACT or name in _IN_TABLE}
    run = make_run(recording.name, recording.procedure, recording.time, signals, replicate=recording.replicate)
    further = {name: values for name, values in recording.columns.items() if name not in signals}
    return replace(run, auxiliary=further, auxiliary_units=dict.fromkeys(further, "degC"))


_IN_TABLE = ("supply_voltage",)


def _search(size_of: Callable[[float], tuple[float, str]], wanted: float, largest: float) -> tuple[float, float, str]:
    """Give scale, size and equation nearest to the size that is wanted; a bench that cannot follow bounds the scale."""
    scale, best = 1.0, (0.0, 0.0, "")
    for _ in range(TRIES):
        try:
            size, equation = size_of(scale)
        except ValueError:  # the shaft snaps, or the motor saturates
            largest = 0.8 * scale
            scale = largest if not best[0] else math.sqrt(best[0] * largest)
            continue
        if not best[0] or abs(math.log(max(size, 1e-9) / wanted)) < abs(math.log(max(best[1], 1e-9) / wanted)):
            best = (scale, size, equation)
        if abs(size / wanted - 1.0) < CLOSE or (scale >= largest and size < wanted):
            break
        scale = min(scale * wanted / max(size, 1e-3 * wanted), largest)
    return best


def _size(case: Case, oracle: Oracle, effects: Effects, outside_amplitude: float) -> tuple[float, str]:
    """Give the largest size over the equations, and in which."""
    with_it = _quiet_rms(case, oracle, effects, outside_amplitude)
    sizes = {name: rms / oracle.train[name] for name, rms in with_it.items()}
    equation = max(sizes, key=lambda name: sizes[name])
    return sizes[equation], equation


def _quiet_rms(case: Case, oracle: Oracle, effects: Effects, outside_amplitude: float) -> dict[str, float]:
    """Give what the refitted base leaves of a campaign without counts and noise, per equation."""
    dut = default_dut()
    train, _ = _sides(campaign_of(case, effects, outside_amplitude, quiet=True).recordings())
    tracks = {run.name: thin_track(make_track(run, dut)) for run in train}
    ratio = dut.gear.ratio
    pieces = []
    for item in oracle.fit.linear:
        track = tracks[item.piece.track.name]
        moved = replace(item.piece, track=track)
        pieces.append(replace(moved, target=target_of(moved, ratio)[moved.index]))
    again = fit(pieces, oracle.fit.model, oracle.fit.noise, passes=PASSES, block=oracle.fit.block)
    return _rms(train, again.model, dut)


def _sides(recordings: Sequence[Recording]) -> tuple[list[Run], list[Run]]:
    names = held_out(tuple(recordings))
    runs = as_runs(recordings)
    return [run for run in runs if run.name not in names], [run for run in runs if run.name in names]


def _thin(runs: Sequence[Run], dut: Dut) -> list[Piece]:
    ratio = dut.gear.ratio
    return [distinct_readings(piece) for run in runs for piece in pieces_of(thin_track(make_track(run, dut)), ratio)]


def _settled(pieces: Sequence[Piece], start: Model) -> list[Piece]:
    """Leave out samples at which a play is not known to follow, as the loop does."""
    kept = []
    for piece in pieces:
        settled = predict(piece, start).settled[piece.index]
        if settled.sum() >= FEWEST_SAMPLES:
            kept.append(replace(piece, index=piece.index[settled], target=piece.target[settled]))
    return kept


def _rms(runs: Sequence[Run], model: Model, dut: Dut) -> dict[str, float]:
    """Give the rms of what the model leaves, per equation, at the full rate of the logs."""
    squares: dict[str, list[np.ndarray]] = {}
    for run in runs:
        for piece in pieces_of(make_track(run, dut), dut.gear.ratio):
            squares.setdefault(piece.equation.value, []).append(residual_of(piece, model).values)
    return {name: float(np.sqrt(np.mean(np.concatenate(values) ** 2))) for name, values in squares.items()}

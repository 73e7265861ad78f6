"""What the base model leaves of small campaigns of the independent generator, before any term is tried."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rig.log.run import Run
from rig.loop.model.equations import pieces_of
from rig.loop.model.prediction import Model
from rig.loop.signals.tracks import make_track
from rig.loop.statements.residuals import Residual, residual_of
from tests.challenge.sizes import base_floor
from tests.independent.campaign import NESTED_PEAKS, Campaign, Plan, Recording
from tests.independent.instruments import Instruments, NoiseKind
from tests.independent.terms import Effects
from tests.rig.loop.runs import as_run, dut

Floats = NDArray[np.float64]

REPLICATED = Plan(
    locked_angles=4,
    locked_pairs=2,
    backdrives=2,
    backdrive_pairs=1,
    free_runs=2,
    free_run_pairs=1,
    output_turns=0.6,
    peaks=NESTED_PEAKS,
)
"""Replicates of every procedure, and of each a run that can be held out."""


def recorded(seed: int, noise: NoiseKind = NoiseKind.WHITE, effects: Effects | None = None) -> tuple[Recording, ...]:
    """Give the recordings; the same seed gives the same noise, whatever the effects."""
    instruments = Instruments(noise=noise)
    return Campaign(seed, effects or Effects(), instruments=instruments, plan=REPLICATED, rate=100.0).recordings()


def changed(run: Run, name: str, added: Callable[[Floats], Floats]) -> Run:
    """Give the run with what `added` makes of the time (n,) on top of a signal."""
    return replace(run, signals={**run.signals, name: run.signals[name] + added(run.time)})


def left_of(recordings: Sequence[Recording] | Sequence[Run]) -> tuple[list[Residual], Model]:
    """Give the residuals of all runs at the full rate of their logs, and the base model that leaves them."""
    runs = tuple(item if isinstance(item, Run) else as_run(item) for item in recordings)
    model = base_floor(runs, (), dut()).fit.model
    pieces = [piece for run in runs for piece in pieces_of(make_track(run, dut()), model.ratio)]
    return [residual_of(piece, model) for piece in pieces], model


def by_place(residuals: Sequence[Residual]) -> Mapping[tuple[str, str], list[Residual]]:
    """Give the residuals of every equation and procedure."""
    found: dict[tuple[str, str], list[Residual]] = {}
    for residual in residuals:
        found.setdefault((residual.piece.equation.value, residual.piece.track.procedure.value), []).append(residual)
    return found

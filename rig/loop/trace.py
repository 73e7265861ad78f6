"""The loop: fit the base model, look at what it leaves, trace it, and report the error before and after.

Training runs alone decide what is added, named, or withdrawn. Held-out runs are evaluated once, at the end.
"""

from collections.abc import Callable, Mapping, Sequence, Set
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from drivers.clock import Clock, RealClock
from drivers.errors import DataError
from rig.config.dut import Dut
from rig.log.run import ProcedureName, Run, averagings, endings
from rig.loop.campaign import Campaign, LoopOptions, split_runs
from rig.loop.experiment.next import with_next_experiments
from rig.loop.files.views_file import Views
from rig.loop.fitting.base import known_parameters, pieces_to_fit, start_model
from rig.loop.fitting.fit import Fit
from rig.loop.fitting.normal import about
from rig.loop.fitting.odd_run import odd_run
from rig.loop.fitting.starts import scaled_to_data
from rig.loop.model.equations import Piece, pieces_of
from rig.loop.result import LoopResult, Open, Step
from rig.loop.search.decision import Selection
from rig.loop.search.followed import faster_than, known_speed, select_followed
from rig.loop.search.given import given_decisions
from rig.loop.signals.checks import (
    check_each_ratio,
    check_gear,
    check_jumps,
    check_magnitudes,
    check_signs,
    check_torques,
)
from rig.loop.signals.copies import without_copies
from rig.loop.signals.grid import check_counts
from rig.loop.signals.living import living
from rig.loop.signals.recordings import check_recordings, too_short
from rig.loop.signals.sweeps import check_steps, check_sweeps, check_work
from rig.loop.signals.tracks import SMOOTHING, Track, make_track
from rig.loop.statements.before_after import (
    BeforeAfter,
    before_and_after,
    equations_of,
    no_better,
    refuse_leaks,
    untested,
)
from rig.loop.statements.events import events_of
from rig.loop.statements.evidence import louder
from rig.loop.statements.open_statements import open_statements
from rig.loop.statements.remarks import doubts, far_from_prior, of_another_drive, of_the_current, remarks, unadded
from rig.loop.statements.report_steps import model_of, steps_of
from rig.loop.statements.silence import silence_of
from rig.loop.statements.views import Added, Pair, facts_of, views_of
from rig.loop.statements.without_run import Left, fits_better, left_of, shows_nothing_else, unexplained
from rig.loop.statements.wrong_experiment import wrong_experiments
from rig.loop.workers.held import Held
from rig.loop.workers.hold import hold
from rig.provenance import software_version
from rig.terminal import counted

A_RUN = 5_000.0
"""Samples that make as much work as whatever is done for a run however short it is."""

LOOKED_AT_ONCE = 0.1
"""Work of a run that is held out, as a share of that of one that is fitted."""


def trace(
    runs: Sequence[Run],
    dut: Dut,
    options: LoopOptions,
    clock: Clock | None = None,
    on_stage: Callable[[str], None] = lambda _: None,
) -> LoopResult:
    """Trace what the base model lacks on a campaign of runs; `on_stage` is told what is being done.

    Raises DataError where nothing can be held out or fitted, where a signal is physically impossible, where the device
    file contradicts the data, or where the error after falls below the floor (a leak); ConfigError where the scheduler
    of the options is of no use.
    """
    clock = clock or RealClock()
    started = clock.now()
    campaign = split_runs(runs, options)
    check_magnitudes(runs)
    check_jumps(runs)
    recorded = [*campaign.train, *campaign.held_out]
    used, dead = living(recorded)
    used, copied = without_copies(used)
    alive = {run.name for run in used if run.signals}
    runs = [run for run in runs if run.name in alive]
    check_recordings(runs)
    check_sweeps(runs, dut)
    check_steps(runs)
    check_counts(runs, dut)
    fitted = {run.name for run in campaign.train}
    with hold(used, [_work(run, fitted) for run in used], options.scheduler) as held:
        measured = _measured(held, campaign, runs, dut, options)
        chosen = _without_odd(measured, _searched(measured, on_stage), on_stage)
        on_stage(f"looking at {counted(len(campaign.held_out), 'held-out run')}")
        result = _result(measured, chosen, [*dead, *copied, *of_the_current(recorded, used, dut)])
    return replace(result, elapsed=clock.now() - started)


def _work(run: Run, fitted: Set[str]) -> float:
    """Give the work that a run makes, in samples: of a sweep those that are left of its means, and what any run takes.

    A run that is held out is looked at once.
    """
    samples = float(run.time.size)
    if run.procedure is not ProcedureName.FREE_RUN and run.time.size:
        samples = min(samples, float(np.ptp(run.time)) / SMOOTHING)
    return A_RUN + samples if run.name in fitted else LOOKED_AT_ONCE * samples


@dataclass(frozen=True, slots=True)
class _Measured:
    """What is there before anything is fitted. `tracks`: of all runs, those to fit first; `known`: the same, here."""

    campaign: Campaign
    runs: Sequence[Run]
    dut: Dut
    options: LoopOptions
    tracks: Held[Track]
    known: Sequence[Track]
    ratio: float | None

    @property
    def train(self) -> Sequence[Track]:
        """Tracks of the runs to fit."""
        return self.known[: len(self.campaign.train)]

    @property
    def held_out(self) -> Sequence[Track]:
        """Tracks of the runs to look at once."""
        return self.known[len(self.campaign.train) :]


@dataclass(frozen=True, slots=True)
class _Searched:
    """What the training runs gave: those that were fitted, by name, without the one that is `odd`, if one is.

    `base`: the fit without effects; `fastest`: rad/s of the legs whose motor torque is used.
    """

    fitted: frozenset[str]
    odd: str
    base: Fit
    selection: Selection
    fastest: float


def _measured(held: Held[Run], campaign: Campaign, runs: Sequence[Run], dut: Dut, options: LoopOptions) -> _Measured:
    """Make the tracks of the runs that are held, and hold them and the device file against each other."""
    tracks = held.keep(make_track, dut)
    known = tracks.gather()
    check_each_ratio(known)
    ratio = check_gear(known[: len(campaign.train)], dut)
    check_signs(known, ratio)
    check_torques(known, ratio)
    check_work(runs)
    return _Measured(campaign, runs, dut, options, tracks, known, ratio)


def _searched(measured: _Measured, on_stage: Callable[[str], None], odd: str = "") -> _Searched:
    """Fit the training runs but the one that is `odd`, and search what they leave."""
    campaign, options, ratio = measured.campaign, measured.options, measured.ratio
    start = scaled_to_data(start_model(measured.dut, ratio, options.law, options.base), measured.train)
    train = [track for track in measured.train if track.name != odd]
    names = frozenset(track.name for track in train)
    pieces = measured.tracks.spread(pieces_to_fit, names, ratio, start)
    _check_equations(pieces, train, measured.held_out, ratio, campaign)
    on_stage(f"fitting {counted(len(train), 'run')} and searching what they leave")
    known, given = known_parameters(measured.dut, ratio), given_decisions(options.base, start)
    base, selection, fastest = select_followed(pieces, start, options.alpha, known, given, on_stage)
    return _Searched(names, odd, base, selection, min(fastest, known_speed(pieces, selection)))


def _without_odd(measured: _Measured, found: _Searched, on_stage: Callable[[str], None]) -> _Searched:
    """Search again without the run that bends the base model, if one does; the training runs decide which stays."""
    odd = odd_run(found.base)
    if odd is None:
        return found
    if not unexplained(_of_training(measured, found)[0]):
        return found
    on_stage(f"once more without {odd}")
    with suppress(DataError):  # the others alone may not make an equation
        without = _searched(measured, on_stage, odd)
        fastest = min(found.fastest, without.fastest)  # the same legs of both
        _, left = _of_training(measured, replace(found, fastest=fastest))
        said, less = _of_training(measured, replace(without, fastest=fastest))
        adds = any(not decision.given for decision in without.selection.decisions)
        if not adds and shows_nothing_else(said, odd) and fits_better(less, left):
            return without
    return found


def _of_training(measured: _Measured, found: _Searched) -> tuple[tuple[Open, ...], Left]:
    """Give what stays open in the training runs, and how much is left of each."""
    model, train = found.selection.fit.model, [track.name for track in measured.train]
    pairs = _looked_at(measured, found, train)
    fitted = [pair for pair in pairs if pair.run != found.odd]
    wrong = wrong_experiments(
        measured.train, found.fitted, [pair.kept_apart_by for pair in pairs], measured.dut, model, found.odd
    )
    right = [pair for pair in fitted if pair.run not in wrong.told]
    judged = equations_of({"train": right, "held_out": []}, measured.dut, model, wrong.runs)
    said = (*wrong.open, *open_statements(found.selection, right, [], judged, measured.dut))
    return said, left_of([pair.after for pair in fitted])


def _result(measured: _Measured, found: _Searched, dead: Sequence[str]) -> LoopResult:
    """Look at the held-out runs, and say everything. `dead`: what to say of channels left out."""
    campaign, runs, dut = measured.campaign, measured.runs, measured.dut
    selection, base, final = found.selection, found.base, found.selection.fit
    pairs = _looked_at(measured, found, [track.name for track in measured.known])
    sides = {
        "train": [pair for pair in pairs if pair.run in found.fitted],
        "held_out": [pair for pair in pairs if pair.run not in found.fitted and pair.run != found.odd],
    }
    calm, apart_by = [pair.calm for pair in pairs], [pair.kept_apart_by for pair in pairs]
    wrong = wrong_experiments(measured.known, found.fitted, apart_by, dut, final.model, found.odd)
    equations = equations_of(sides, dut, final.model, wrong.runs)
    refuse_leaks(equations, campaign.held_out, {item.equation for item in louder(calm)})
    changes = {
        name: (item.held_out.rms_before, item.held_out.rms_after)
        for name, item in equations.items()
        if item.held_out is not None
    }
    terms = steps_of(selection.decisions, final, base, dut, changes)
    entries = [decision.kind.enters for decision in selection.decisions]
    steps = tuple(term for term, decision in zip(terms, selection.decisions, strict=True) if not decision.given)
    model = model_of(final, terms, entries, dut, software_version(), measured.options.base)
    right = {side: [pair for pair in pairs if pair.run not in wrong.told] for side, pairs in sides.items()}
    judged = equations_of(right, dut, final.model, wrong.runs)
    still_open = (*wrong.open, *open_statements(selection, right["train"], right["held_out"], judged, dut))
    known = known_parameters(dut, measured.ratio)
    steps, still_open = with_next_experiments(steps, selection.added, still_open, final, runs, dut, known)
    quiet = not steps and not still_open
    return LoopResult(
        train=tuple(run.name for run in campaign.train),
        held_out=tuple(run.name for run in campaign.held_out),
        equations=equations,
        steps=steps,
        open=still_open,
        warnings=(
            *endings(runs),
            *averagings(runs),
            *campaign.warnings,
            *dead,
            *too_short(runs),
            *([f"{found.odd}: left out of the fit, as the others agree without it."] if found.odd else []),
            *wrong.warnings,
            *far_from_prior(final, still_open),
            *doubts(final),
            *of_another_drive(measured.options.base, dut),
            *remarks(measured.known, runs, dut, final.model),
            *unadded(selection),
            *_left_out(measured.known, measured.ratio, found.fastest),
            *untested(judged),
            *(no_better(judged) if steps else []),
        ),
        elapsed=0.0,
        model=model,
        views=_views(sides, selection, steps, campaign, wrong.told, dut),
        silence=silence_of(selection, [pair.calm for pair in right["train"]], dut) if quiet else None,
    )


def _check_equations(
    pieces: Held[Piece], train: Sequence[Track], held_out: Sequence[Track], ratio: float | None, campaign: Campaign
) -> None:
    """Raise DataError where the runs that are fitted, or those that are held out, make no equation."""
    if not pieces.map(about):
        raise DataError(
            ", ".join(track.name for track in train[:4]),
            "no equation can be formed from the training runs",
            expected="both positions and the ratio, or a torque or current with a position",
            hint=" ".join(
                [*too_short(campaign.train), "Check the channels in the log, and the ratio in the device file."]
            ),
        )
    tests = {(piece.equation, track.procedure) for track in held_out for piece in pieces_of(track, ratio)}
    fitted = {(known.equation, known.procedure) for known in pieces.map(about)}
    if tests and not tests & fitted:
        raise DataError(
            ", ".join(track.name for track in held_out[:4]),
            f"the held-out runs are {' and '.join(sorted({procedure for _, procedure in tests}))} and none such was "
            "fitted: nothing that was fitted would be tested",
            expected="a held-out run of each procedure, and others of it to fit",
            hint="Hold out other runs with --held-out, or leave it away.",
        )
    if not tests:
        raise DataError(
            ", ".join(track.name for track in held_out[:4]),
            "no equation can be formed from the held-out runs: nothing would test the model",
            expected="a held-out run with the channels of the runs that are fitted, long enough",
            hint=" ".join([*too_short(campaign.held_out), "Hold out another run with --held-out, or record one more."]),
        )


def _looked_at(measured: _Measured, found: _Searched, names: Sequence[str]) -> list[BeforeAfter]:
    """Give what the runs of these `names` leave without and with the effects, at the full rate of their logs."""
    before, after = found.base.model, found.selection.fit.model
    wanted = frozenset(names)
    pairs = measured.tracks.spread(before_and_after, wanted, measured.ratio, found.fastest, before, after).gather()
    events = events_of([pair.after for pair in pairs], measured.dut, after)
    return [replace(pair, events=some) for pair, some in zip(pairs, events, strict=True)]


def _left_out(tracks: Sequence[Track], ratio: float | None, fastest: float) -> list[str]:
    """Say which runs have legs whose motor torque was not used."""
    faster = [track.name for track in tracks if any(faster_than(piece, fastest) for piece in pieces_of(track, ratio))]
    if not faster:
        return []
    text = f"Motor torque of legs faster than {fastest:.4g} rad/s left out: how the drive follows lines is unknown."
    return [f"{text} Runs with such legs: {', '.join(faster)}."]


def _views(
    sides: Mapping[str, Sequence[BeforeAfter]],
    selection: Selection,
    steps: Sequence[Step],
    campaign: Campaign,
    apart: Set[str],
    dut: Dut,
) -> Views:
    pairs = [Pair(side, pair.before, pair.after) for side, pairs in sides.items() for pair in pairs]
    added = [Added(step.effect, step.variable, tuple(line.order for line in step.lines)) for step in steps]
    facts = (*facts_of(campaign.train, "train", apart), *facts_of(campaign.held_out, "held_out", apart))
    return views_of(pairs, selection.fit.model, added, facts, dut)

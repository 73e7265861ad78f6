"""The loop: fit the base model, look at what it leaves, trace it, and report the error before and after.

Training runs alone decide what is added, named, or withdrawn. Held-out runs are evaluated once, at the end.
"""

import math
from collections.abc import Callable, Collection, Mapping, Sequence, Set
from dataclasses import dataclass, replace

import numpy as np

from drivers.clock import Clock, RealClock
from drivers.errors import DataError
from rig.config.dut import Dut
from rig.log.run import ProcedureName, Run, averagings, endings
from rig.loop.campaign import Campaign, LoopOptions, split_runs
from rig.loop.experiment.next import with_next_experiments
from rig.loop.files.model_file import Model as ModelFile
from rig.loop.files.views_file import Views
from rig.loop.fitting.fit import BLOCK, SHORTEST_BLOCK, Fit, Material, fit, fit_stably, material, reweighted
from rig.loop.fitting.normal import about
from rig.loop.fitting.starts import scaled_to_data
from rig.loop.model.curves import curve_of
from rig.loop.model.equations import Equation, Law, Piece, distinct_readings, pieces_of
from rig.loop.model.frames import turned, turned_shape
from rig.loop.model.parameters import parameter_table
from rig.loop.model.prediction import Model, predict
from rig.loop.model.shapes import ShapeTerm, named_effect
from rig.loop.model.terms import Entry, Line, TermClass
from rig.loop.result import EquationResult, Errors, LoopResult, Step
from rig.loop.search.decision import Selection
from rig.loop.search.select import select
from rig.loop.signals.checks import check_gear, check_magnitudes, check_signs, check_torques
from rig.loop.signals.grid import check_counts
from rig.loop.signals.living import living
from rig.loop.signals.recordings import FEWEST_SAMPLES, check_recordings, too_short
from rig.loop.signals.sweeps import check_sweeps, check_work
from rig.loop.signals.tracks import SMOOTHING, Track, make_track, thin_track
from rig.loop.statements.events import Event, events_of, without_events
from rig.loop.statements.metrics import Floor, Residual, errors, floor_of, pooled, residual_of
from rig.loop.statements.open_statements import open_statements
from rig.loop.statements.remarks import doubts, far_from_prior, remarks, unadded
from rig.loop.statements.report_steps import model_of, steps_of
from rig.loop.statements.silence import silence_of
from rig.loop.statements.views import Added, Pair, facts_of, views_of
from rig.loop.statements.wrong_experiment import wrong_experiments
from rig.loop.workers.held import Held
from rig.loop.workers.hold import hold
from rig.provenance import software_version
from rig.terminal import counted
from sim_backend.model.compliance import Compliance

SAME_SPEED = 1.05
"""Ratio below which two legs have the same speed."""

KNOWN_SPEED = 1.5
"""Times the fastest fitted leg up to which a torque line is predicted."""

A_RUN = 5_000.0
"""Samples that make as much work as whatever is done for a run however short it is."""

LOOKED_AT_ONCE = 0.1
"""Work of a run that is held out, as a share of that of one that is fitted."""

MANY_BLOCKS = 200
"""Blocks of time that a short campaign is cut into."""


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
    used, dead = living([*campaign.train, *campaign.held_out])
    check_recordings(runs)
    check_sweeps(runs, dut)
    check_counts(runs, dut)
    fitted = {run.name for run in campaign.train}
    with hold(used, [_work(run, fitted) for run in used], options.scheduler) as held:
        result = _traced(held, campaign, runs, dut, options, dead, on_stage)
    return replace(result, elapsed=clock.now() - started)


def _work(run: Run, fitted: Set[str]) -> float:
    """Give the work that a run makes, in samples: of a sweep those that are left of its means, and what any run takes.

    A run that is held out is looked at once.
    """
    samples = float(run.time.size)
    if run.procedure is not ProcedureName.FREE_RUN and run.time.size:
        samples = min(samples, float(np.ptp(run.time)) / SMOOTHING)
    return A_RUN + samples if run.name in fitted else LOOKED_AT_ONCE * samples


def _traced(
    held: Held[Run],
    campaign: Campaign,
    runs: Sequence[Run],
    dut: Dut,
    options: LoopOptions,
    dead: Sequence[str],
    on_stage: Callable[[str], None],
) -> LoopResult:
    """Trace the runs that are held, those of the campaign in its order. `dead`: what to say of channels left out."""
    tracks = held.keep(make_track, dut)
    known_tracks = tracks.gather()
    train, held_out = known_tracks[: len(campaign.train)], known_tracks[len(campaign.train) :]
    ratio = check_gear(train, dut)
    check_signs(known_tracks, ratio)
    check_torques(known_tracks, ratio)
    check_work(runs)
    start = scaled_to_data(start_model(dut, ratio, options.law, options.base), train)
    names = frozenset(track.name for track in train)
    pieces = tracks.spread(_pieces_to_fit, names, ratio, start)
    if not pieces.map(about):
        raise DataError(
            ", ".join(track.name for track in train[:4]),
            "no equation can be formed from the training runs",
            expected="both positions and the ratio, or a torque or current with a position",
            hint=" ".join(
                [*too_short(campaign.train), "Check the channels in the log, and the ratio in the device file."]
            ),
        )
    if not any(pieces_of(track, ratio) for track in held_out):
        raise DataError(
            ", ".join(track.name for track in held_out[:4]),
            "no equation can be formed from the held-out runs: nothing would test the model",
            expected="a held-out run with the channels of the runs that are fitted, long enough",
            hint=" ".join([*too_short(campaign.held_out), "Hold out another run with --held-out, or record one more."]),
        )
    on_stage(f"fitting {counted(len(campaign.train), 'run')} and searching what they leave")
    known = known_parameters(dut, ratio)
    base, selection, fastest = _selected(pieces, start, options.alpha, known, on_stage)
    on_stage(f"looking at {counted(len(campaign.held_out), 'held-out run')}")
    fastest = min(fastest, _known_speed(pieces, selection))
    final = selection.fit
    pairs = tracks.spread(_before_and_after, ratio, fastest, base.model, final.model).gather()
    events = events_of(_after(pairs), dut, final.model)
    pairs = [replace(pair, events=some) for pair, some in zip(pairs, events, strict=True)]
    sides = {
        "train": [pair for pair in pairs if pair.after.piece.track.name in names],
        "held_out": [pair for pair in pairs if pair.after.piece.track.name not in names],
    }
    wrong = wrong_experiments(train, held_out, [pair.calm for pair in pairs], dut, final.model)
    equations = _equations(sides, dut, final.model, wrong.runs)
    _refuse_leaks(equations, campaign.held_out)
    changes = {
        name: (item.held_out.rms_before, item.held_out.rms_after)
        for name, item in equations.items()
        if item.held_out is not None
    }
    steps = steps_of(selection.decisions, final, base, dut, changes)
    entries = [decision.kind.enters for decision in selection.decisions]
    fitting = {side: [pair for pair in pairs if _run(pair) not in wrong.told] for side, pairs in sides.items()}
    judged = _equations(fitting, dut, final.model, wrong.runs)
    left = [pair.events for side in ("train", "held_out") for pair in fitting[side]]
    still_open = open_statements(selection, _after(fitting["train"]), _after(fitting["held_out"]), left, judged, dut)
    still_open = (*wrong.open, *still_open)
    steps, still_open = with_next_experiments(steps, selection.decisions, still_open, final, runs, dut, known)
    warnings = (
        *endings(runs),
        *averagings(runs),
        *campaign.warnings,
        *dead,
        *too_short(runs),
        *wrong.warnings,
        *far_from_prior(final, still_open),
        *doubts(final),
        *remarks(known_tracks, runs, dut, final.model),
        *unadded(selection),
    )
    faster = [track.name for track in known_tracks if _faster(track, fastest)]
    if faster:
        text = f"Motor torque of legs faster than {fastest:.4g} rad/s left out: how the drive follows lines is unknown."
        warnings = (*warnings, f"{text} Runs with such legs: {', '.join(faster)}.")
    quiet = not steps and not still_open
    return LoopResult(
        train=tuple(run.name for run in campaign.train),
        held_out=tuple(run.name for run in campaign.held_out),
        equations=equations,
        steps=steps,
        open=still_open,
        warnings=warnings,
        elapsed=0.0,
        model=model_of(final, steps, entries, dut, software_version()),
        views=_views(sides, selection, steps, campaign, dut),
        silence=silence_of(selection, [pair.calm for pair in fitting["train"]], dut) if quiet else None,
    )


def known_parameters(dut: Dut, ratio: float | None) -> dict[str, float]:
    """Give what effects take from the device and no fit estimates, by the name of the parameter, SI."""
    given = {
        "ratio": ratio,
        "torque_constant": dut.motor.torque_constant,
        "encoder_counts": dut.motor.encoder_counts,
        "output_encoder_counts": dut.output.encoder_counts,
    }
    return {name: float(value) for name, value in given.items() if value is not None}


def start_model(dut: Dut, ratio: float | None, law: Compliance, base: ModelFile | None) -> Model:
    """Give the model from which the fit starts: the device file's estimates, or a model file's values and effects.

    Of a model file with another law of the flexspline everything but that law's parameters is taken.
    """
    table = parameter_table(dut, ratio, law)
    lines: tuple[Line, ...] = ()
    shapes: tuple[ShapeTerm, ...] = ()
    if base is not None:
        table = table.with_centre({name: value.value for name, value in base.base.parameters.items()})
        lines, shapes = lines_of(base, dut), shapes_of(base, dut)
    return Model(table, table.start(), ratio, lines, shapes)


def lines_of(model: ModelFile, dut: Dut) -> tuple[Line, ...]:
    """Give the lines of a model file's effects, in the frame of computing."""
    found = []
    for effect in model.effects:
        if not effect.lines:
            continue
        entry = Entry(effect.enters)
        named = None if effect.effect.startswith(("unnamed:", "ambiguous:")) else effect.effect
        fixed = effect.lines[0].order if effect.lines and "order" not in effect.parameters else None
        kind = TermClass(named, entry, effect.variable, fixed)
        for item in effect.lines:
            sine, cosine = item.amplitude * np.cos(item.phase), item.amplitude * np.sin(item.phase)
            found.append(turned(Line(kind, item.order, float(sine), float(cosine)), dut))
    return tuple(found)


def shapes_of(model: ModelFile, dut: Dut) -> tuple[ShapeTerm, ...]:
    """Give the effects of a model file that are no lines, in the frame of computing. Raises DataError for others."""
    found = []
    for item in model.effects:
        if item.lines:
            continue
        values = {name: estimate.value for name, estimate in item.parameters.items()}
        effect = named_effect(item.effect, values.keys()) or curve_of(item.effect, item.enters, values.keys(), values)
        missing = [] if effect is None else [p.name for p in effect.parameters if p.name not in item.parameters]
        if effect is None or missing:
            raise DataError(
                "model.json",
                f"the effect '{item.effect}' has no lines and "
                + (f"lacks {', '.join(missing)}" if missing else "is not in the catalogue"),
                expected="a catalogue effect with all its parameters, or lines",
                hint="`rig effects` prints the catalogue; write the model anew with `rig loop`.",
            )
        ordered = tuple(values[parameter.name] for parameter in effect.parameters)
        found.append(turned_shape(ShapeTerm(effect, ordered), dut))
    return tuple(found)


def fit_base(pieces: Held[Piece], start: Model) -> Fit:
    """Fit the base model, with the weights that its own residual calls for."""
    return _fit_base(material(pieces), start)


def _fit_base(pieces: Material, start: Model) -> Fit:
    seconds = dict(pieces.all.map(_duration))
    block = min(BLOCK, max(SHORTEST_BLOCK, sum(seconds.values()) / MANY_BLOCKS))
    rough = reweighted(fit(pieces.all, start, {}, passes=0, block=block))
    return fit_stably(pieces, start, rough.noise, rough.block)


def _duration(piece: Piece) -> tuple[str, float]:
    return piece.track.name, float(np.ptp(piece.track.time))


def _selected(
    pieces: Held[Piece],
    start: Model,
    alpha: float,
    known: Mapping[str, float],
    on_stage: Callable[[str], None],
) -> tuple[Fit, Selection, float]:
    """Fit and select; give the base fit, the selection, and the fastest leg (rad/s) whose torque was used.

    A torque line that shows at slow legs and not at fast ones is one that the drive does not follow there: it stands
    in the speed, not in the torque. The torque of the fastest legs is then left out, as far as it takes.
    """
    every = material(pieces)
    base = _fit_base(every, start)
    whole = select(every, base, alpha, known, on_stage)
    found, fastest = whole, math.inf
    while (followed := _followed(found)) is not None and SAME_SPEED * followed < fastest:
        fastest = SAME_SPEED * followed
        fewer = material(pieces.spread(_up_to, fastest))
        on_stage(f"once more without the torque of legs faster than {fastest:.4g} rad/s")
        slow = _fit_base(fewer, start)
        found = select(fewer, slow, alpha, known, on_stage)
        if len(found.decisions) > len(whole.decisions):
            return slow, found, fastest
    return base, whole, math.inf


def _followed(selection: Selection) -> float | None:
    """Give the speed (rad/s) up to which the largest torque line shows that does not show at every speed."""
    lines = [item for item in selection.unadded if item.followed is not None]
    return max(lines, key=lambda item: item.share).followed if lines else None


def _known_speed(pieces: Held[Piece], selection: Selection) -> float:
    """Give the leg speed up to which a torque line may be predicted, rad/s: not far beyond those it was fitted on."""
    lines = [line for line in selection.fit.model.lines if line.kind.variable == "motor_position"]
    speeds = [speed for some in pieces.map(_free_speeds) for speed in some]
    if not speeds or all(line.kind.entry.is_angle for line in lines):
        return math.inf
    return KNOWN_SPEED * max(speeds)


def _free_speeds(piece: Piece) -> list[float]:
    """Give the speeds of the legs of a torque in a free run, rad/s; none of any other piece."""
    return np.unique(np.abs(piece.track.speed[piece.index])).tolist() if _runs_free(piece) else []


def _faster(track: Track, fastest: float) -> bool:
    return track.procedure is ProcedureName.FREE_RUN and float(np.abs(track.speed).max(initial=0.0)) > fastest


def _runs_free(piece: Piece) -> bool:
    return piece.law is Law.FREE_RUN and piece.equation is not Equation.TORSION


def _up_to(piece: Piece, fastest: float) -> list[Piece]:
    """Leave out the torque of legs faster than `fastest` (rad/s at the motor); none where too few samples are left."""
    if not _runs_free(piece) or not math.isfinite(fastest):
        return [piece]
    slow = np.abs(piece.track.speed[piece.index]) <= fastest
    if slow.sum() < FEWEST_SAMPLES:
        return []
    return [replace(piece, index=piece.index[slow], target=piece.target[slow])]


def _pieces_to_fit(track: Track, training: Collection[str], ratio: float | None, start: Model) -> list[Piece]:
    """Give the thinned pieces of a training run where the law determines them; of any other run none."""
    if track.name not in training:
        return []
    return settled_pieces([distinct_readings(piece) for piece in pieces_of(thin_track(track), ratio)], start)


def settled_pieces(pieces: Sequence[Piece], start: Model) -> list[Piece]:
    """Leave out samples that the law does not determine: an unknown start of a play, a mesh that sticks."""
    kept = []
    for piece in pieces:
        settled = predict(piece, start).settled[piece.index]
        if settled.sum() >= FEWEST_SAMPLES:
            kept.append(replace(piece, index=piece.index[settled], target=piece.target[settled]))
    return kept


@dataclass(frozen=True, slots=True)
class _BeforeAfter:
    before: Residual
    after: Residual
    events: tuple[Event, ...] = ()

    @property
    def calm(self) -> Residual:
        """What is left without steps at single moments, which are no noise."""
        return without_events(self.after, self.events)


def _before_and_after(
    track: Track, ratio: float | None, fastest: float, before: Model, after: Model
) -> list[_BeforeAfter]:
    """Give the residuals of a run without and with the effects, at the full rate of its log."""
    pieces = [kept for piece in pieces_of(track, ratio) for kept in _up_to(piece, fastest)]
    return [_BeforeAfter(residual_of(piece, before, after), residual_of(piece, after)) for piece in pieces]


def _after(pairs: Sequence[_BeforeAfter]) -> list[Residual]:
    return [pair.after for pair in pairs]


def _run(pair: _BeforeAfter) -> str:
    return pair.after.piece.track.name


def _equations(
    sides: dict[str, list[_BeforeAfter]], dut: Dut, model: Model, odd: Set[str]
) -> dict[str, EquationResult]:
    """Give the errors of every equation. `odd`: runs that are no replicates, whatever they are called."""
    found = {}
    known = [pair for pairs in sides.values() for pair in pairs]
    for equation in Equation:
        if not any(pair.after.piece.equation is equation for pair in known):
            continue
        replicates = [pair.calm for pair in known if pair.after.piece.equation is equation and _run(pair) not in odd]
        results = {}
        for side, pairs in sides.items():
            own = [pair for pair in pairs if pair.after.piece.equation is equation]
            results[side] = _errors_of(own, replicates, dut, model) if own else None
        found[equation.value] = EquationResult(equation.unit, results["held_out"], results["train"])
    return found


def _errors_of(pairs: Sequence[_BeforeAfter], known: Sequence[Residual], dut: Dut, model: Model) -> Errors:
    by_procedure = {}
    floors: list[tuple[Floor, int]] = []
    complete = True
    for procedure in dict.fromkeys(pair.after.piece.track.procedure for pair in pairs):
        own = [pair for pair in pairs if pair.after.piece.track.procedure is procedure]
        floor = floor_of([pair.after for pair in own], known, dut, model)
        count = sum(pair.after.values.size for pair in own)
        complete = complete and floor is not None
        if floor is not None:
            floors.append((floor, count))
        by_procedure[procedure.value] = errors([p.before for p in own], [p.after for p in own], floor)
    whole = errors([p.before for p in pairs], [p.after for p in pairs], pooled(floors) if complete else None)
    return replace(whole, by_procedure=by_procedure)


def _refuse_leaks(equations: dict[str, EquationResult], held_out: Sequence[Run]) -> None:
    """Raise DataError where the held-out error lies below what noise alone leaves.

    The procedures are looked at apart only where one of them has no floor, and with it the whole none.
    """
    looked_at = []
    for name, item in equations.items():
        if item.held_out is not None and item.held_out.floor_ci95 is not None:
            looked_at.append((name, item.unit, item.held_out))
        elif item.held_out is not None:
            apart = item.held_out.by_procedure.items()
            looked_at += [(f"{name} in {procedure}", item.unit, errors) for procedure, errors in apart]
    for name, unit, found in looked_at:
        if found.floor_ci95 is not None and found.rms_after < found.floor_ci95[0]:
            raise DataError(
                ", ".join(run.name for run in held_out),
                f"the held-out error of {name} after the fit is {found.rms_after:.4g} {unit}, below the floor "
                f"of the instruments {found.floor_ci95[0]:.4g} to {found.floor_ci95[1]:.4g} {unit}",
                value=found.rms_after,
                expected="an error not below what noise alone leaves",
                hint="A channel that is predicted may leak into a regressor, or replicates are not replicates.",
            )


def _views(
    sides: Mapping[str, Sequence[_BeforeAfter]],
    selection: Selection,
    steps: Sequence[Step],
    campaign: Campaign,
    dut: Dut,
) -> Views:
    pairs = [Pair(side, pair.before, pair.after) for side, pairs in sides.items() for pair in pairs]
    added = [Added(step.effect, step.variable, tuple(line.order for line in step.lines)) for step in steps]
    facts = (*facts_of(campaign.train, "train"), *facts_of(campaign.held_out, "held_out"))
    return views_of(pairs, selection.fit.model, added, facts, dut)

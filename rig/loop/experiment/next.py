"""The next experiment of everything that the loop leaves open: a command where a run helps, a sentence where none does.

Rivals are compared in what they say of every run of the menu (`choice`). What no run of the bench tells apart is said
with what does, by hand. Where nothing names a rival, the odd run is repeated or everything varied that can be.
"""

import json
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np

from drivers.errors import ConfigError
from procedures.plan import BenchFacts, build_parameters
from procedures.registry import PROCEDURES
from rig.config.bench import BenchFile, load_bench
from rig.config.dut import Dut
from rig.config.toml_file import parse_toml
from rig.facts import bench_facts
from rig.log.run import ProcedureName, Run
from rig.loop.campaign import HELD_OUT_SHARE
from rig.loop.experiment.choice import Choice, Plan, choose
from rig.loop.experiment.menu import SURVEYS, offers, planned, settings_of
from rig.loop.experiment.rivals import Contest, absorbed, contest, other_entries, rival_of
from rig.loop.experiment.separation import pieces_to_come
from rig.loop.experiment.sketch import coarse_facts, distinct, sketch
from rig.loop.fitting.fit import Fit, coarse
from rig.loop.model.equations import Equation, Piece
from rig.loop.model.shapes import ShapeClass
from rig.loop.model.terms import Entry, TermClass
from rig.loop.result import NextExperiment, Open, Step, Verdict
from rig.loop.search.decision import Decision
from rig.loop.search.groups import QUOTIENT, SINGLE_ANGLE_SET, TWINS
from rig.loop.search.start_angles import enough, start_angle
from sim_backend.errors import ModelError
from sim_backend.model.effects import CATALOGUE

NO_EFFECT = "no effect"
"""Stands for the rival that there is no such effect."""

AT_ORDER_ONE = 0.05
"""Distance from order 1 within which an encoder's eccentricity and an error of the gear stay twins."""

BY_HAND: Mapping[frozenset[str], str] = {
    frozenset(QUOTIENT): "dead weights on a lever test the torque sensor, the back-EMF the torque constant",
    frozenset(("fixture-compliance", "torque-sensor-gain")): (
        "dead weights on a lever test the torque sensor, a gauge on the fixture its compliance"
    ),
    frozenset(("flexspline-compliance", "torque-sensor-gain")): "dead weights on a lever test the torque sensor",
    **{
        frozenset(pair): "re-clock the motor's encoder against the wave generator and run again: its own error turns"
        " with it"
        for pair in TWINS.items()
    },
}
"""What a person must change for two effects to be told apart, where no run of the bench does."""


@dataclass(frozen=True, slots=True)
class Bench:
    """What the runs to come are planned with; `plans`: the menu, where rivals are to be compared."""

    facts: BenchFacts
    plans: tuple[Plan, ...]


def with_next_experiments(
    steps: Sequence[Step],
    decisions: Sequence[Decision],
    still_open: Sequence[Open],
    final: Fit,
    runs: Sequence[Run],
    dut: Dut,
    known: Mapping[str, float],
) -> tuple[tuple[Step, ...], tuple[Open, ...]]:
    """Give steps and open statements with what to measure next. `decisions`: of the steps, in order.

    `known`: parameters that no fit estimates, by name. Nothing is computed where nothing is open.
    """
    wanted = [step.verdict in (Verdict.AMBIGUOUS, Verdict.UNNAMED) for step in steps]
    facts = _facts(final, runs, dut)
    if facts is None or (not any(wanted) and not still_open):
        bench = None
    else:
        compared = any(wanted) or any(item.group for item in still_open)
        bench = Bench(facts, _plans(facts, final, dut) if compared else ())
    with np.errstate(all="ignore"):  # rivals and parameters that the runs tell nothing of may lie anywhere
        told = tuple(
            replace(step, next_experiment=_of_step(decision, final, dut, known, bench)) if asked else step
            for step, decision, asked in zip(steps, decisions, wanted, strict=True)
        )
        left = [replace(item, next_experiment=_of_open(item, final, runs, dut, known, bench)) for item in still_open]
    return told, tuple(left)


def _facts(final: Fit, runs: Sequence[Run], dut: Dut) -> BenchFacts | None:
    """Give the bench of the logs, or the shipped one; None where the device file says too little to plan a run."""
    if final.model.ratio is None:
        return None
    text = next((run.bench_text for run in runs if run.bench_text), "")
    try:
        file = parse_toml(text, BenchFile, "bench attached to the logs") if text else load_bench("sim")[0]
    except ConfigError:  # written by another version
        file = load_bench("sim")[0]
    try:
        return bench_facts(file, dut)
    except ConfigError:
        return None


def _plans(facts: BenchFacts, final: Fit, dut: Dut) -> tuple[Plan, ...]:
    """Give the menu as this bench can run it, each run with its pieces to come."""
    coarse, plans = coarse_facts(facts), []
    with np.errstate(all="ignore"):
        for offer in offers(facts):
            made = distinct(planned(offer.entry.procedure, offer.settings, coarse))
            tracks = [(sketch(run, offer.entry.procedure, final.model, dut), count) for run, count in made]
            coming = pieces_to_come(tracks, final.model, facts.cycle_time)
            if coming:
                plans.append(Plan(offer, coming))
    return tuple(plans)


def _of_step(
    decision: Decision, final: Fit, dut: Dut, known: Mapping[str, float], bench: Bench | None
) -> NextExperiment:
    kind, members = decision.kind, decision.members
    if isinstance(kind, ShapeClass) and kind.effect is None:
        why = f"See whether the shape over {kind.variable} holds: vary"
        return _survey("locked-output" if kind.is_angle else "free-run", bench, why)
    if "cogging" in members and isinstance(kind, TermClass) and kind.entry is Entry.MOTOR_AGAINST_MOTION:
        return _survey(
            "free-run", bench, "A torque whose angle is read late grows with the speed, a friction does not: vary"
        )
    if not members and isinstance(kind, TermClass):
        members = (kind.id, *other_entries(kind))
    if bench is None:
        return NextExperiment(_too_little(members), "")
    try:
        found = contest(final, (kind,), members, known)
    except (ModelError, np.linalg.LinAlgError):  # no drive is like the model without it
        return NextExperiment(by_hand(members), "")
    orders = [line.order for line in final.model.lines if line.kind == kind]
    never = {frozenset(QUOTIENT)}
    if any(abs(order - 1.0) < AT_ORDER_ONE for order in orders):
        never |= {frozenset(pair) for pair in TWINS.items()}
    plans = bench.plans
    if "kinematic-error" in members and set(members) & set(SINGLE_ANGLE_SET) - {"kinematic-error"}:
        seen = final.pieces.keep(coarse).gather()
        plans = tuple(plan for plan in plans if _covers(seen, [item.piece for item in plan.coming]))
    return experiment_of(members, found, choose(found, plans, dut, never))


def _of_open(
    item: Open, final: Fit, runs: Sequence[Run], dut: Dut, known: Mapping[str, float], bench: Bench | None
) -> NextExperiment | None:
    if item.group and bench is not None:
        try:
            if item.verdict is Verdict.ABSORBED and item.parameter in final.model.table.names:
                found = absorbed(final, item.group, dut, known)
            else:
                found = contest(final, (), item.group, known)
        except (ModelError, np.linalg.LinAlgError):  # no drive is like the catalogue
            return NextExperiment(by_hand(item.group), "")
        if item.verdict is not Verdict.ABSORBED:
            found = replace(found, rivals=(*found.rivals, rival_of(NO_EFFECT, found.without)))
        chosen = choose(found, bench.plans, dut, {pair for pair in BY_HAND if not pair & TWINS.keys()})
        return experiment_of(item.group, found, chosen)
    if item.group:
        return NextExperiment(_too_little(item.group), "")
    if "speeds" in item.evidence:
        return _survey("free-run", bench, "Something changes between the speeds that were run: vary")
    if "odd_runs" in item.evidence:
        return _odd_again(item, runs, bench)
    if "frequency" in item.evidence:
        return _quiet_again(item, runs, bench)
    repeating = float(str(item.evidence.get("replicate_pairs") or 0)) > 0
    procedures = [str(item.evidence["procedure"])] if "procedure" in item.evidence else [run.procedure for run in runs]
    names = [name for name in dict.fromkeys(procedures) if name in PROCEDURES and name != ProcedureName.STARTING_TORQUE]
    if item.verdict is Verdict.UNTRACED and repeating and names:
        return _survey(names[0], bench)
    return _again(names, runs, bench)


def experiment_of(members: Collection[str], found: Contest, chosen: Choice | None) -> NextExperiment:
    """Say which run was chosen and what it does, and what remains for other runs or a change by hand."""
    asked = [rival.effect for rival in found.in_question()]
    if chosen is None:
        return NextExperiment(by_hand(asked if len(asked) > 1 else list(members)), "")
    apart = {frozenset(pair) for pair in chosen.pairs}
    left = [
        pair for pair in (frozenset((a, b)) for k, a in enumerate(asked) for b in asked[k + 1 :]) if pair not in apart
    ]
    settled = " and ".join(f"{_named(a)} from {_named(b)}" for a, b in chosen.pairs[:3])
    more = f" and {len(chosen.pairs) - 3} more pairs" if len(chosen.pairs) > 3 else ""
    why = f"{_sentence(chosen.offer.entry.varies)}: tells {settled}{more}."
    later = [pair for pair in left if pair in chosen.others]
    if later:
        texts = (" and ".join(_named(effect) for effect in sorted(pair)) for pair in later)
        why += f" What remains of {'; '.join(texts)} another run tells: ask again with this one."
    why += "".join(f" {by_hand(pair)}" for pair in left if pair not in chosen.others)
    return NextExperiment(why, chosen.command, chosen.sigma, chosen.minutes)


def _named(effect: str) -> str:
    return effect.replace("unnamed:", "the line as it is now: ") if effect.startswith("unnamed:") else effect


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


def by_hand(effects: Iterable[str]) -> str:
    """Say that no run of this bench tells these apart, and what does, if anything is known."""
    effects = sorted(effects)
    pairs = {frozenset((a, b)) for k, a in enumerate(effects) for b in effects[k + 1 :]}
    known = [text for pair, text in BY_HAND.items() if pair in pairs]
    ways = known or [f"{name}: {CATALOGUE[name].separated_by}" for name in effects if name in CATALOGUE]
    told = f"No run of this bench tells {' | '.join(_named(name) for name in effects)} apart"
    if not ways:
        return f"{told}, and no change by hand is known that does."
    return f"{told}; by hand: {'; '.join(dict.fromkeys(ways))}."


def _too_little(effects: Sequence[str]) -> str:
    ways = [f"{name}: {CATALOGUE[name].separated_by}" for name in effects if name in CATALOGUE]
    text = "; ".join(ways) or "vary angle, load and speed"
    return f"{_sentence(text)}. With gear.ratio and gear.rated_torque in the device file the run is worked out."


def _survey(procedure: str, bench: Bench | None, ask: str = "It repeats, and nothing names it: vary") -> NextExperiment:
    """Vary everything that the procedure can vary."""
    entry = SURVEYS[procedure]
    why = f"{ask} {entry.varies} and see with what it changes."
    if bench is None:
        return NextExperiment(why, f"rig run {procedure}")
    settings = settings_of(entry, bench.facts)
    return _timed(why, procedure, settings, bench)


def _again(procedures: Sequence[str], runs: Sequence[Run], bench: Bench | None) -> NextExperiment | None:
    """Repeat the runs in question as they were recorded."""
    why = "A run repeated under the same conditions tells whether this repeats or is noise."
    if not procedures:
        return NextExperiment(why, "")
    if len(procedures) == 1:
        settings = _as_recorded(procedures[0], runs)
        return _timed(why, procedures[0], settings, bench, repeat=2)
    return NextExperiment(why, f"rig run {' '.join(procedures)} --repeat 2")


def _odd_again(item: Open, runs: Sequence[Run], bench: Bench | None) -> NextExperiment | None:
    """Repeat the odd run as it was recorded; without one, what did not repeat."""
    procedure, odd = str(item.evidence.get("procedure")), item.evidence.get("odd_runs")
    names = [str(name) for name in odd] if isinstance(odd, Sequence) and not isinstance(odd, str) else []
    chosen = [run for run in runs if run.name in names[:1]] or [run for run in runs if run.procedure == procedure]
    which = f"{names[0]} is the odd one" if names else "Its replicates differ"
    others = f" (of {len(names)})" if len(names) > 1 else ""
    look = "the encoder's cable and coupling" if item.evidence.get("events") else "what may have changed between runs"
    why = f"{which}{others}: repeat it. What comes again is no event; what does not asks for a look at {look}."
    if procedure not in PROCEDURES:
        return NextExperiment(why, "")
    return _timed(why, procedure, _as_recorded(procedure, chosen), bench, repeat=2)


def _quiet_again(item: Open, runs: Sequence[Run], bench: Bench | None) -> NextExperiment | None:
    """Repeat a run of the procedure in which it hums, with what may hum switched off."""
    procedure, hertz = str(item.evidence["procedure"]), float(str(item.evidence["frequency"]))
    why = (
        f"Something goes on at {hertz:.4g} Hz: switch off fans, pumps and other drives one after the other, a run each."
    )
    if procedure not in PROCEDURES:
        return NextExperiment(why, "")
    return _timed(why, procedure, _as_recorded(procedure, runs), bench)


def _timed(
    why: str, procedure: str, settings: tuple[tuple[str, str], ...], bench: Bench | None, repeat: int = 1
) -> NextExperiment:
    words = ["rig", "run", procedure, *(f"--set {procedure}.{name}={value}" for name, value in settings)]
    command = " ".join(words + ([f"--repeat {repeat}"] if repeat > 1 else []))
    minutes = None
    if bench is not None:
        try:
            minutes = repeat * sum(run.duration for run in planned(procedure, settings, bench.facts)) / 60.0
        except ConfigError:  # another bench than the one it was recorded on
            return NextExperiment(why, f"rig run {procedure}" + (f" --repeat {repeat}" if repeat > 1 else ""))
    return NextExperiment(why, command, None, minutes)


def _as_recorded(procedure: str, runs: Iterable[Run]) -> tuple[tuple[str, str], ...]:
    """Give the settings, beside the defaults, with which the procedure was run; none where no log tells."""
    chosen = PROCEDURES[procedure]
    text = next(
        (run.metadata["parameters"] for run in runs if run.procedure == procedure and "parameters" in run.metadata), ""
    )
    try:
        recorded = json.loads(text) if text else {}
    except ValueError:
        return ()
    usual = asdict(build_parameters(chosen, {}))
    found = []
    for name, value in recorded.items() if isinstance(recorded, dict) else ():
        default = list(usual[name]) if isinstance(usual.get(name), tuple) else usual.get(name)
        if name in usual and value != default and value is not None:
            found.append((name, ",".join(map(_text, value)) if isinstance(value, list) else _text(value)))
    return tuple(found)


def _text(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else f"{value:.6g}" if isinstance(value, float) else str(value)


def _covers(seen: Sequence[Piece], coming: Sequence[Piece]) -> bool:
    """Whether torsion is then seen over a whole motor turn, or from enough start angles, as naming an angle error asks.

    Some of the runs to come will be held out.
    """
    known, new = _starts(seen), _starts(coming)
    return enough(known | new, max(1, round(HELD_OUT_SHARE * len(new))))


def _starts(pieces: Iterable[Piece]) -> set[float]:
    """Give the start angles of the torsions, see `start_angle`."""
    return {
        start_angle(piece.track.motor_position[piece.index])
        for piece in pieces
        if piece.equation is Equation.TORSION and piece.track.motor_position is not None
    }

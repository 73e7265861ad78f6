"""The rivals: every effect that could be what a statement leaves open, fitted to the training runs in its place.

Each rival is the whole model with base and terms refitted together: what the base takes up in its stead counts for it.
"""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rig.config.dut import Dut
from rig.loop.fitting.fit import Fit, coarse, fit
from rig.loop.fitting.normal import noise_of, solve
from rig.loop.model.equations import Piece
from rig.loop.model.parameters import flexspline_entries
from rig.loop.model.prediction import Model
from rig.loop.model.shapes import ShapeClass
from rig.loop.model.terms import Entry, Line, TermClass, periodic_effects
from rig.loop.search.compliance_form import FORM_ERROR, form_columns
from rig.loop.search.shape_trials import scales_of, shape_trials
from rig.loop.search.trial import Ground, line_gains, prepare, try_line
from rig.loop.workers.held import Held, Here
from sim_backend.errors import ModelError

Floats = NDArray[np.float64]

HELD = 1e-3
"""Relative width of the prior of a stiffness that is held at the catalogue's value."""

PASSES = 6
"""Passes of a rival's fit at most; the final fit is a good start."""

MOST_SAMPLES = 30_000
"""Samples (run by run, of one equation) beyond which rivals are fitted to some of the runs only."""

NEW_ORDERS = tuple(0.5 * k for k in range(2, 21))
"""Orders that are tried for a line where nothing says which (1/rev)."""


LEAST_BEHIND, BEHIND = 25.0, 0.2
"""Weighted squares, and their share of what the best rival explains, by which one that is refuted lies behind it."""


@dataclass(frozen=True, slots=True)
class Form:
    """A flexspline of another form on top of a fit: odd powers of the torque over `largest` (N*m), see `form_columns`.

    `step` (p + 2,): change of the fit's parameters, and the powers' amplitudes; `information` (p + 2, p + 2) on them.
    """

    largest: float
    step: Floats
    information: Floats


@dataclass(frozen=True, slots=True)
class Rival:
    """One effect in the statement's place: the refitted model with its information, on the training runs.

    `squares`: weighted squares that it leaves. `form`: what it has on top of the fit, None for nothing.
    """

    effect: str
    fit: Fit
    squares: float
    form: Form | None = None


def rival_of(effect: str, found: Fit) -> Rival:
    """Give the rival that is this fit."""
    return Rival(effect, found, found.squares)


@dataclass(frozen=True, slots=True)
class Contest:
    """All rivals of one statement, fitted to a part `share` of the training samples, and the fit without any."""

    without: Fit
    rivals: tuple[Rival, ...]
    share: float

    def gain(self, effect: str) -> float:
        """Give the weighted squares that a rival explains, over all training samples."""
        own = next(rival for rival in self.rivals if rival.effect == effect)
        return max(0.0, self.without.squares - own.squares) / self.share

    def in_question(self) -> tuple[Rival, ...]:
        """Give the rivals which the training runs do not refute; of one alone with the one that comes nearest."""
        ordered = sorted(self.rivals, key=lambda rival: rival.squares)
        if not ordered:
            return ()
        best = ordered[0]
        margin = max(LEAST_BEHIND, BEHIND * self.share * self.gain(best.effect))
        kept = [rival for rival in ordered if rival.squares - best.squares <= margin]
        return tuple(kept if len(kept) > 1 else ordered[:2])


def contest(
    final: Fit, kinds: Collection[TermClass | ShapeClass], effects: Sequence[str], known: Mapping[str, float]
) -> Contest:
    """Fit every one of `effects` in place of the terms `kinds` of the final fit; what cannot be fitted is left out.

    `effects`: ids of the catalogue, of the kinds themselves, or of `other_entries`. `known`: parameters that no fit
    estimates, by name.
    """
    gone = set(kinds)
    pieces, share = _few(final)
    removed = [line for line in final.model.lines if line.kind in gone]
    model = replace(
        final.model,
        lines=tuple(line for line in final.model.lines if line.kind not in gone),
        shapes=tuple(term for term in final.model.shapes if term.kind not in gone),
    )
    noise = noise_of(final.about, final.linear)
    without = fit(pieces, model, noise, passes=PASSES, block=final.block)
    ground = prepare(without)
    own = {kind.id for kind in gone}
    shapes = _shapes(ground, known, {effect for effect in effects if effect not in own})
    found = []
    for effect in effects:
        if effect == FORM_ERROR:
            found.append(_other_form(without))
            continue
        starts = final.model if effect in own else _start(effect, ground, removed, shapes)
        if starts is None:
            continue
        try:
            found.append(rival_of(effect, fit(pieces, starts, noise, passes=PASSES, block=final.block)))
        except (ModelError, np.linalg.LinAlgError):  # no drive is like the start
            continue
    return Contest(without, tuple(rival for rival in found if math.isfinite(rival.squares)), share)


def other_entries(kind: TermClass) -> tuple[str, ...]:
    """Give the other ways in which a line without a name could follow the same angle, as `contest` takes them."""
    return tuple(
        entry_id(replace(kind, entry=entry))
        for entry in Entry
        if entry is not kind.entry and entry.is_angle is kind.entry.is_angle
    )


def entry_id(kind: TermClass) -> str:
    """Name a line by where it acts."""
    return f"a line in the {kind.entry}"


def absorbed(final: Fit, group: Sequence[str], dut: Dut, known: Mapping[str, float]) -> Contest:
    """Fit every one of `group` with the flexspline's stiffness held at the catalogue's; left free, it is one too."""
    table = final.model.table
    stiffness = flexspline_entries(dut.gear, table.law)[0]
    held = replace(stiffness, spread=HELD)
    pinned = replace(table, entries=(held, *table.entries[1:]))
    values = final.model.values.copy()
    values[0] = stiffness.centre
    noise = noise_of(final.about, final.linear)
    start = replace(final, model=replace(final.model, table=pinned, values=values), noise=noise)
    found = contest(start, (), [effect for effect in group if effect != FORM_ERROR], known)
    free = fit(_few(final)[0], final.model, noise, passes=PASSES, block=final.block)
    return replace(found, rivals=(*found.rivals, rival_of(FORM_ERROR, free)))


def _few(final: Fit) -> tuple[Held[Piece], float]:
    """Give the pieces of some of the runs, spread over the campaign, with the share of the samples that they hold."""
    thinned = final.pieces.keep(coarse).gather()
    sizes: dict[str, int] = {}
    for piece in thinned:
        sizes[piece.track.name] = sizes.get(piece.track.name, 0) + piece.track.size
    names = list(sizes)
    step = max(1, -(-sum(sizes.values()) // MOST_SAMPLES))
    kept = {piece.track.procedure: piece.track.name for piece in thinned}
    chosen = {*names[::step], *kept.values()}
    few = [piece for piece in thinned if piece.track.name in chosen]
    return Here(few), sum(piece.index.size for piece in few) / sum(item.samples for item in final.about)


def _start(effect: str, ground: Ground, removed: Sequence[Line], shapes: Mapping[str, Model]) -> Model | None:
    """Give the model with the effect from which its fit starts; None where the data tell nothing of it."""
    model = ground.fit.model
    named = {kind.id: kind for kind in periodic_effects()} | {entry_id(kind): kind for kind in _unnamed(removed)}
    kind = named.get(effect)
    if kind is not None:
        fixed = kind.fixed_order
        orders = [line.order for line in removed] if fixed is None else [fixed]
        lines = _lines(ground, kind, orders or [_best_order(ground, kind)])
        return replace(model, lines=(*model.lines, *lines)) if lines else None
    return shapes.get(effect)


def _unnamed(removed: Sequence[Line]) -> list[TermClass]:
    variables = {line.kind.variable for line in removed}
    return [TermClass(None, entry, variable) for entry in Entry for variable in variables]


def _lines(ground: Ground, kind: TermClass, orders: Sequence[float]) -> list[Line]:
    found = []
    for order in orders:
        trial = try_line(ground, kind, order)
        if trial.gain > 0.0:
            sine, cosine = trial.amplitudes.tolist()
            found.append(Line(kind, order, sine, cosine))
    return found


def _best_order(ground: Ground, kind: TermClass) -> float:
    low, high = kind.orders
    orders = [order for order in NEW_ORDERS if low <= order <= high]
    found = line_gains(ground, [(kind, order) for order in orders])
    return max(zip(found, orders, strict=True), default=(0.0, low))[1]


def _shapes(ground: Ground, known: Mapping[str, float], wanted: set[str]) -> dict[str, Model]:
    """Give the model with each of the effects `wanted` that are no lines, at the size that explains most."""
    lines = {kind.effect for kind in periodic_effects()}
    if not wanted - lines - {FORM_ERROR}:
        return {}
    model = ground.fit.model
    scales = scales_of(ground.fit.linear, {**known, "stiffness": model.table.entries[0].centre})
    return {
        item.term.effect.id: replace(model, shapes=(*model.shapes, item.term))
        for item in shape_trials(ground, ground, scales, 0.0)
        if item.term.effect.id in wanted
    }


def _other_form(without: Fit) -> Rival:
    """Give the fit with a flexspline of another form: what it leaves, and how its parameters move with it."""
    largest = scales_of(without.linear, {}).torque
    size = without.columns.size
    A, g = np.zeros((size + 2, size + 2)), np.zeros(size + 2)
    for item in without.linear.gather():
        columns = form_columns(item, largest)
        joint = np.column_stack([item.jacobian, np.zeros((item.residual.size, 2)) if columns is None else columns])
        A += item.weight * joint.T @ joint
        g += item.weight * joint.T @ item.residual
    prior, pull = np.append(without.prior, [0.0, 0.0]), np.append(without.pull, [0.0, 0.0])
    step = solve(A + np.diag(prior), g + pull)
    left = without.squares - 2.0 * float(step @ g) + float(step @ A @ step)
    return Rival(FORM_ERROR, without, left, Form(largest, step, A))

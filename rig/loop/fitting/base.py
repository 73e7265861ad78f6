"""The base model: what a fit starts from, which samples determine it, and its fit."""

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from drivers.errors import DataError
from rig.config.dut import Dut
from rig.loop.files.model_file import Model as ModelFile
from rig.loop.fitting.fit import BLOCK, SHORTEST_BLOCK, Fit, Material, fit, fit_stably, reweighted
from rig.loop.model.curves import curve_of
from rig.loop.model.equations import Piece, distinct_readings, pieces_of
from rig.loop.model.frames import turned, turned_shape
from rig.loop.model.parameters import parameter_table
from rig.loop.model.prediction import Model, predict
from rig.loop.model.shapes import ShapeTerm, named_effect
from rig.loop.model.terms import Entry, Line, TermClass, periodic_effects
from rig.loop.signals.recordings import FEWEST_SAMPLES
from rig.loop.signals.tracks import Track, thin_track
from sim_backend.model.compliance import Compliance

MANY_BLOCKS = 200
"""Blocks of time that a short campaign is cut into."""


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
        fixed = None if "order" in effect.parameters else effect.lines[0].order
        nameless = TermClass(None, entry, effect.variable, fixed)
        kind = next((known for known in periodic_effects() if known.effect == effect.effect), nameless)
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


def fit_base(pieces: Material, start: Model) -> Fit:
    """Fit the base model, with the weights that its own residual calls for."""
    seconds = dict(pieces.all.map(_duration))
    block = min(BLOCK, max(SHORTEST_BLOCK, sum(seconds.values()) / MANY_BLOCKS))
    rough = reweighted(fit(pieces.all, start, {}, passes=0, block=block))
    return fit_stably(pieces, start, rough.noise, rough.block)


def _duration(piece: Piece) -> tuple[str, float]:
    return piece.track.name, float(np.ptp(piece.track.time))


def pieces_to_fit(track: Track, training: Collection[str], ratio: float | None, start: Model) -> list[Piece]:
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

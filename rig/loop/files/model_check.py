"""What a model file must not say: effects against the catalogue, base parameters against their ranges, all at once.

Checked once, where the file is read: what evaluates a model and what runs one then agree on what it can be.
"""

import itertools
import math
import re
from collections.abc import Iterator, Mapping

from drivers.errors import Mistake
from drivers.spelling import did_you_mean
from rig.config.catalogue import beyond_limits
from rig.loop.files.model_file import Model, ModelEffect, ModelEstimate
from rig.loop.model.curves import Curve, Form, curve_of
from rig.loop.model.equations import Equation
from rig.loop.model.parameters import LAW_LIMITS, parameter_table
from rig.loop.model.shapes import ShapeClass, named_effect, units_of
from rig.loop.model.terms import Entry, entry_of, is_line
from sim_backend.model.effects import CATALOGUE, Effect, Enters, Parameter
from sim_backend.model.limits import CATALOGUE as DEVICE
from sim_backend.model.limits import DRIVE, Limit

LARGEST = 1e9
"""In SI: beyond it no base parameter means anything."""

LEAST_A3 = 1e-9
"""N*m/rad^3: a straight line for every torque; a fit takes the logarithm of it."""

FALLING_FRICTION = 0.01
"""s/rad: share of the running friction per speed by which a viscous friction may be negative, as a fit leaves it."""

_RANGES: Mapping[str, Limit] = {
    **LAW_LIMITS,
    "a3": LAW_LIMITS["a3"]._replace(low=LEAST_A3),
    **{name: DEVICE["starting_torque"]._replace(equation="(36)") for name in ("T_fs", "T_fb")},
}
_ANGLES = ("motor_position", "output_position", "time")
_LINE_UNITS = {"order": ("1/rev", "Hz"), "phase": ("rad",)}
_TERM_UNITS = ("rad", "N*m", "A", "rad/(N*m)", "1")
"""What the amplitude of a line is given in: the unit of the equation in which it was found, or that per torque."""

_NUMBERED = re.compile(r"(amplitude|order|phase)(_[2-9]|_[1-9][0-9]+)?")
_RATIO_AGREES = 1e-6


def mistakes_in(model: Model) -> list[Mistake]:
    """Give everything that the model says and that cannot be, with its path in the file."""
    device = [Mistake(f"dut.{m.path}", m.value, m.rule) for m in beyond_limits(model.dut)]
    if device:
        return device
    found = list(_base(model))
    for number, effect in enumerate(model.effects):
        found += [Mistake(f"effects.{number}.{m.path}", m.value, m.rule) for m in _effect(effect, model)]
    return found


def _base(model: Model) -> Iterator[Mistake]:
    ratio, own = model.base.ratio, model.dut.gear.ratio
    if ratio is not None and own is not None and not math.isclose(ratio, own, rel_tol=_RATIO_AGREES):
        yield Mistake("base.ratio", ratio, f"contradicts dut.gear.ratio, which is {own:g}")
    table = parameter_table(model.dut, model.base.ratio, model.base.law)
    units = {entry.name: entry.unit for entry in table.entries}
    given = model.base.parameters
    for name, estimate in given.items():
        path = f"base.parameters.{name}"
        if estimate.ci95 is not None and not estimate.ci95[0] <= estimate.ci95[1]:
            yield Mistake(f"{path}.ci95", str(estimate.ci95), "must go from low to high")
        if name not in units:
            hint = did_you_mean(name, units)
            yield Mistake(
                path, estimate.value, f"is no parameter of the base model{hint}; there are {', '.join(units)}"
            )
        elif estimate.unit != units[name]:
            yield Mistake(f"{path}.unit", estimate.unit, f"must be {units[name]}")
        elif name in _RANGES:
            _, low, high, _ = _RANGES[name]
            yield from _outside(path, estimate.value, low, high, units[name])
        else:
            highest = DRIVE["viscous_friction"].high if name == "b" else LARGEST
            yield from _outside(path, estimate.value, _lowest(name, given), highest, units[name])
    knees = [given[name].value for name in ("T1", "T2") if name in given and name in units]
    if len(knees) == 1 or knees != sorted(set(knees)):
        yield Mistake("base.parameters", knees, "must have both T1 and T2, T1 below T2, or neither")


def _lowest(name: str, given: "Mapping[str, ModelEstimate]") -> float:
    """Give the lowest value of a parameter that may be negative; of the viscous friction, one that does not drive."""
    levels = [abs(given[level].value) for level in ("T_c", "T_fs") if level in given]
    return -FALLING_FRICTION * max(levels) if name == "b" and levels else -LARGEST


def _outside(path: str, value: float, low: float, high: float, unit: str) -> Iterator[Mistake]:
    if not low <= value <= high:
        shown = "" if unit == "1" else f" {unit}"
        yield Mistake(path, value, f"must be {low:g} to {high:g}{shown}")


def _effect(item: ModelEffect, model: Model) -> Iterator[Mistake]:
    """Give the mistakes of one effect, their paths within it."""
    if item.effect.startswith(("unnamed:", "ambiguous:")):
        effect = None if item.lines else named_effect(item.effect, item.parameters.keys())
        if effect is None and not item.lines:
            values = {name: estimate.value for name, estimate in item.parameters.items()}
            curve = curve_of(item.effect, item.enters, values.keys(), values)
            if curve is not None:
                yield from _curve(item, curve)
                return
            rule = "must have lines, or the parameters of one of its effects, or the knots and values of a curve"
            yield Mistake("parameters", ", ".join(item.parameters), rule)
            return
    else:
        effect = CATALOGUE.get(item.effect)
        if effect is None:
            rule = f"is not in the catalogue{did_you_mean(item.effect, CATALOGUE)}; see `rig effects`"
            yield Mistake("effect", item.effect, rule)
            return
    if effect is not None and effect.enters is Enters.BASE:
        yield Mistake("effect", item.effect, "is a term of the base model, whose parameters are in base.parameters")
    elif item.lines:
        yield from _lines(item, effect)
    elif effect is not None and is_line(effect):
        yield Mistake("lines", "none", f"{effect.id} is periodic and needs at least one line")
    elif effect is not None:
        yield from _shape(item, effect, model)


def _lines(item: ModelEffect, effect: Effect | None) -> Iterator[Mistake]:
    if effect is not None and not is_line(effect):
        yield Mistake("lines", f"{len(item.lines)} lines", f"{effect.id} is not periodic and has parameters only")
        return
    entries = [str(entry) for entry in Entry]
    if effect is not None:
        yield from _place(item, [(entry_of(effect).value, effect.variable)])
    elif item.enters not in entries:
        yield Mistake("enters", item.enters, f"must be one of {', '.join(entries)}")
    elif item.variable not in _ANGLES:
        yield Mistake("variable", item.variable, f"must be one of {', '.join(_ANGLES)}")
    ranges = {} if effect is None else {p.name: p for p in effect.parameters}
    for number, line in enumerate(item.lines):
        path = f"lines.{number}"
        yield from _outside(f"{path}.amplitude", line.amplitude, 0.0, _high(ranges, "amplitude"), "1")
        yield from _outside(f"{path}.phase", line.phase, -2.0 * math.pi, 2.0 * math.pi, "rad")
        if effect is not None and "order" not in ranges:
            yield from _outside(f"{path}.order", line.order, 1.0, 1.0, "1/rev")
        else:
            low = ranges["order"].low if "order" in ranges else 0.0
            yield from _outside(f"{path}.order", line.order, low, _high(ranges, "order"), "1/rev")
    for name, estimate in item.parameters.items():
        match = _NUMBERED.fullmatch(name)
        if match is None:
            yield Mistake(f"parameters.{name}", estimate.value, "is no parameter of a line: amplitude, order, phase")
            continue
        own = (ranges[match[1]].unit,) if match[1] in ranges else ()
        units = _LINE_UNITS.get(match[1], (*_TERM_UNITS, *own))
        if estimate.unit not in units:
            yield Mistake(f"parameters.{name}.unit", estimate.unit, f"must be {' or '.join(dict.fromkeys(units))}")


def _high(ranges: Mapping[str, Parameter], name: str) -> float:
    return ranges[name].high if name in ranges else LARGEST


def _shape(item: ModelEffect, effect: Effect, model: Model) -> Iterator[Mistake]:
    members = item.effect.removeprefix("ambiguous:").split("|")
    kinds = [
        ShapeClass(CATALOGUE[name])
        for name in members
        if name in CATALOGUE and CATALOGUE[name].enters is not Enters.BASE
    ]
    yield from _place(item, [(kind.enters, kind.variable) for kind in kinds])
    known, by_current = {p.name: p for p in effect.parameters}, units_of(effect, Equation.MOTOR_CURRENT)
    for name in item.parameters.keys() - known.keys():
        rule = f"is no parameter of {effect.id}{did_you_mean(name, known)}; it has {', '.join(known)}"
        yield Mistake(f"parameters.{name}", item.parameters[name].value, rule)
    for name, parameter in known.items():
        path, estimate = f"parameters.{name}", item.parameters.get(name)
        if estimate is None:
            yield Mistake(path, None, f"missing; {effect.id} has {', '.join(known)}; {effect.equation} needs it")
        elif estimate.unit not in (parameter.unit, by_current[name]):
            yield Mistake(f"{path}.unit", estimate.unit, f"must be {parameter.unit}")
        elif not parameter.low <= estimate.value <= parameter.high:
            yield from _outside(path, estimate.value, parameter.low, parameter.high, parameter.unit)
        elif parameter.known:
            yield from _contradiction(path, name, estimate.value, model)


def _curve(item: ModelEffect, curve: Curve) -> Iterator[Mistake]:
    """Give the mistakes of a shape without a name."""
    if item.variable != curve.variable:
        yield Mistake("variable", item.variable, f"must be '{curve.variable}' for {item.effect}")
    if item.shape != curve.shape:
        yield Mistake("shape", item.shape, f"must be '{curve.shape}' for {item.effect}")
    known, by_current = {p.name: p for p in curve.parameters}, units_of(curve, Equation.MOTOR_CURRENT)
    for name in item.parameters.keys() - known.keys():
        yield Mistake(f"parameters.{name}", item.parameters[name].value, f"is none of {', '.join(known)}")
    for name, parameter in known.items():
        estimate = item.parameters.get(name)
        if estimate is None:
            yield Mistake(f"parameters.{name}", None, f"missing; such a curve has {', '.join(known)}")
        elif estimate.unit not in (parameter.unit, by_current[name]):
            yield Mistake(f"parameters.{name}.unit", estimate.unit, f"must be {parameter.unit}")
        else:
            yield from _outside(f"parameters.{name}", estimate.value, -LARGEST, LARGEST, parameter.unit)
    at = [item.parameters[name].value for name in known if name.startswith("at_") and name in item.parameters]
    if curve.form is Form.CURVE and (len(at) < 2 or any(b <= a for a, b in itertools.pairwise(at))):
        yield Mistake(
            "parameters.at_1", at[0] if at else None, "the knots at_1, at_2, ... must be two or more, ascending"
        )
    if curve.form is not Form.CURVE and any(value <= 0.0 for value in at):
        yield Mistake("parameters.at_1", min(at), "must be above 0: a radius, a time constant or an order")


def _contradiction(path: str, name: str, value: float, model: Model) -> Iterator[Mistake]:
    """Give the mistake of an effect that was given another ratio, torque constant or count than the device has."""
    own = {
        "ratio": model.base.ratio or model.dut.gear.ratio,
        "torque_constant": model.dut.motor.torque_constant,
        "encoder_counts": model.dut.motor.encoder_counts,
    }.get(name)
    if own is not None and not math.isclose(value, own, rel_tol=_RATIO_AGREES):
        yield Mistake(path, value, f"contradicts the device, which has {own:g}")


def _place(item: ModelEffect, places: list[tuple[str, str]]) -> Iterator[Mistake]:
    """Give the mistakes of where an effect is said to act, and on what it depends."""
    if (item.enters, item.variable) in places:
        return
    enters, variable = places[0]
    if item.enters != enters:
        yield Mistake("enters", item.enters, f"must be '{enters}' for {item.effect}")
    if item.variable != variable:
        yield Mistake("variable", item.variable, f"must be '{variable}' for {item.effect}")

"""From the fit to the statements of the result: steps with intervals, model file, open statements."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from rig.config.dut import Dut
from rig.loop.files.model_file import BASE_MODELS, Model, ModelBase, ModelEffect, ModelEstimate, ModelLine
from rig.loop.fitting.fit import Fit
from rig.loop.fitting.intervals import covariance, quantile
from rig.loop.fitting.normal import LinearPiece
from rig.loop.model.equations import Equation
from rig.loop.model.frames import turned, turned_shape, wrapped
from rig.loop.model.shapes import ShapeClass, ShapeTerm, units_of
from rig.loop.model.terms import Line, TermClass
from rig.loop.result import Estimate, LineResult, Shift, Step
from rig.loop.search.decision import Decision, lines_decided

Floats = NDArray[np.float64]


def steps_of(
    decisions: Sequence[Decision],
    final: Fit,
    base: Fit,
    dut: Dut,
    held_out: Mapping[str, tuple[float, float]],
) -> tuple[Step, ...]:
    """Give one step per decision, its lines joined, with 95 % intervals."""
    spread, factor = covariance(final), quantile(final)
    made = []
    for decision in decisions:
        numbers = lines_decided(decision, decisions, final.model.lines)
        numbers.sort(key=lambda n: -final.model.lines[n].amplitude)
        equation = primary_equation(decision.kind, final)
        parameters: dict[str, Estimate] = {}
        lines = []
        for rank, number in enumerate(numbers, start=1):
            line = final.model.lines[number]
            shown = turned(line, dut)
            suffix = "" if rank == 1 else f"_{rank}"
            columns = spread[final.columns.of_line(number), final.columns.of_line(number)]
            unit = line.kind.entry.unit_in(equation)
            estimates = line_estimates(line, shown, columns, factor, unit, _index_error(final, line, dut))
            parameters |= {name + suffix: value for name, value in estimates.items()}
            lines.append(LineResult(line.order, line.amplitude, wrapped(shown.phase)))
        for number, term in enumerate(final.model.shapes):
            if term.kind == decision.kind:
                place = final.columns.of_shape(number)
                units = units_of(term.effect, equation)
                parameters |= shape_estimates(turned_shape(term, dut), spread[place, place], factor, units)
        made.append(
            Step(
                verdict=decision.verdict,
                effect=decision.effect,
                members=decision.members,
                variable=decision.kind.variable,
                shape=decision.kind.shape,
                lines=tuple(lines),
                equation=equation.value,
                parameters=parameters,
                candidates=decision.candidates,
                p_value=decision.p_value,
                held_out=held_out,
                shift=shifts(base, final),
            )
        )
    return tuple(made)


def primary_equation(kind: TermClass | ShapeClass, final: Fit) -> Equation:
    """Give the equation in which the term is reported: the one of its balance that the logs allow."""
    present = {item.equation for item in final.about}
    wanted = kind.equation
    if wanted in present:
        return wanted
    for other in (Equation.MOTOR_CURRENT, Equation.MOTOR_TORQUE, Equation.OUTPUT_TORQUE):
        if other in present:
            return other
    return wanted


def _index_error(final: Fit, line: Line, dut: Dut) -> tuple[float, float]:
    """Give what an angle known to one count only does to a line: largest error of its phase, rad, spread of its order.

    Where in its count a shaft stands is unknown and common to all runs; in which count a run's zero was found is not,
    and tilts the order over the spread of the angles.
    """
    if line.kind.variable == "time":
        return 0.0, 0.0
    counts = dut.motor.encoder_counts if line.kind.variable == "motor_position" else dut.output.encoder_counts
    seen = zip(final.about, final.linear.map(_moments, line.kind.variable), strict=True)
    known = {about.run: moments for about, moments in seen if moments is not None}
    if counts is None or not known:
        return 0.0, 0.0
    total, angles, squares = np.sum(list(known.values()), axis=0)
    spread = max(math.sqrt(max(squares / total - (angles / total) ** 2, 0.0)), 1e-9)
    count = line.order * 2.0 * math.pi / counts
    return 0.5 * count, count / math.sqrt(12.0 * len(known)) / spread


def _moments(item: LinearPiece, variable: str) -> tuple[float, float, float] | None:
    """Give how many values of an angle a piece has, their sum and the sum of their squares."""
    angle = item.evaluation.positions.get(variable)
    return None if angle is None else (float(angle.size), float(angle.sum()), float(angle @ angle))


def line_estimates(
    line: Line, shown: Line, columns: Floats, factor: float, unit: str, index: tuple[float, float]
) -> dict[str, Estimate]:
    """Give amplitude, order (unless fixed) and phase with intervals from the covariance (2, 2) or (3, 3).

    `index`: what an angle known to one count only adds, to the phase (rad) at most and to the order's variance.
    """
    phase_bound, order_error = index
    size = max(line.amplitude, 1e-300)
    by_amplitude = np.zeros(columns.shape[0])
    by_phase = np.zeros(columns.shape[0])
    by_amplitude[:2] = line.sine / size, line.cosine / size
    by_phase[:2] = -line.cosine / size**2, line.sine / size**2
    half = factor * math.sqrt(max(float(by_amplitude @ columns @ by_amplitude), 0.0))
    # which side of its count a shaft is read on is no chance that evens out: the bound is added whole
    turn = factor * math.sqrt(max(float(by_phase @ columns @ by_phase), 0.0)) + phase_bound
    phase = wrapped(shown.phase)
    found = {"amplitude": Estimate(line.amplitude, (line.amplitude - half, line.amplitude + half), unit)}
    if columns.shape[0] == 3:
        wide = factor * math.sqrt(max(float(columns[2, 2]), 0.0) + order_error**2)
        found["order"] = Estimate(line.order, (line.order - wide, line.order + wide), order_unit(line))
    found["phase"] = Estimate(phase, (phase - turn, phase + turn), "rad")
    return found


def order_unit(line: Line) -> str:
    """Give the unit of a line's order."""
    return "Hz" if line.kind.variable == "time" else "1/rev"


def shape_estimates(term: ShapeTerm, columns: Floats, factor: float, units: Mapping[str, str]) -> dict[str, Estimate]:
    """Give every parameter of an effect that is no line: fitted ones with intervals from their covariance (k, k).

    `units`: of the parameters, by name.
    """
    found = {
        parameter.name: Estimate(value, None, units[parameter.name])
        for parameter, value in zip(term.effect.parameters, term.values, strict=True)
    }
    for number, k in enumerate(term.free):
        parameter, value = term.effect.parameters[k], term.values[k]
        half = factor * math.sqrt(max(float(columns[number, number]), 0.0))
        if term.is_logarithmic(k):
            interval = (value * math.exp(-min(half, 50.0)), value * math.exp(min(half, 50.0)))
        else:
            interval = (value - half, value + half)
        found[parameter.name] = Estimate(value, interval, units[parameter.name])
    return found


def base_estimates(final: Fit) -> dict[str, Estimate]:
    """Give the base parameters that the data touched, with intervals."""
    spread, factor = covariance(final), quantile(final)
    found = {}
    for number, name in enumerate(final.columns.base):
        entry = final.model.table.entries[final.model.table.names.index(name)]
        value = final.model.value(name)
        half = factor * math.sqrt(max(float(spread[number, number]), 0.0))
        if entry.logarithmic:
            interval = (value * math.exp(-min(half, 50.0)), value * math.exp(min(half, 50.0)))
        else:
            interval = (value - half, value + half)
        found[name] = Estimate(value, interval, entry.unit)
    return found


def shifts(base: Fit, final: Fit) -> dict[str, Shift]:
    """Give how every fitted base parameter moved from `base` to `final`."""
    units = {entry.name: entry.unit for entry in final.model.table.entries}
    return {
        name: Shift(base.model.value(name), final.model.value(name), units[name])
        for name in final.columns.base
        if name in base.columns.base
    }


def model_of(
    final: Fit, steps: Sequence[Step], enters: Sequence[str], dut: Dut, software: str, start: Model | None
) -> Model:
    """Give the content of `model.json`: of the base parameters that no run tells about, those of `start`."""
    runs = final.normal.runs
    known = {} if start is None else start.base.parameters
    parameters = {name: value for name, value in known.items() if name in final.model.table.names}
    parameters |= {name: _as_model(value) for name, value in base_estimates(final).items()}
    effects = tuple(
        ModelEffect(
            effect=step.effect,
            enters=entry,
            variable=step.variable,
            shape=step.shape,
            lines=tuple(ModelLine(order=x.order, amplitude=x.amplitude, phase=x.phase) for x in step.lines),
            parameters={name: _as_model(value) for name, value in step.parameters.items()},
        )
        for step, entry in zip(steps, enters, strict=True)
    )
    base = ModelBase(model=BASE_MODELS[final.model.table.law], ratio=final.model.ratio, parameters=parameters)
    return Model(schema="rig.model/1", dut=dut, base=base, effects=effects, runs=runs, software=software)


def _as_model(estimate: Estimate) -> ModelEstimate:
    return ModelEstimate(value=estimate.value, ci95=estimate.ci95, unit=estimate.unit)

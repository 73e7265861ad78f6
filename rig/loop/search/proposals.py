"""What a peak in the spectrum of the residual could be: the classes to try, and at which order.

Every kind of piece is scanned over the angle that it has, also for lines that flip with the direction. Which classes a
peak proposes depends on the equation, the angle and the order; how well they explain it is for others to say.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rig.loop.fitting.normal import Kind, LinearPiece
from rig.loop.model.equations import Equation
from rig.loop.model.terms import Entry, TermClass, periodic_effects
from rig.loop.search.acceptance import FAMILIES
from rig.loop.search.lines import Peak, Spectrum, Times, one_speed, peaks, scan
from rig.loop.search.trial import Ground, line_gains

LOW_ORDERS = 12.0
"""Orders up to which every one is tried where only start angles tell them apart."""

PEAKS_BY_HEIGHT = 3
PEAKS_BY_POWER = 3
MOST_MODULATIONS = 6
"""Cycles of the stiffness per motor turn that are looked for; whole ones, as mesh zone and ellipse turn with the plug,
are tried in any case: few start angles make a spectrum of aliases."""

LOWEST_FREQUENCY, FEWEST_PERIODS = 0.3, 5.0
"""Hz above which a line over the time is looked for, and its periods in the longest run at least: what is slower may
be anything that a sweep does in time."""

_BALANCE = {Equation.TORSION: Entry.ANGLE_ONLY, Equation.OUTPUT_TORQUE: Entry.OUTPUT}

KINEMATIC_ERROR, USUAL_ERRORS = "kinematic-error", (2.0, 4.0)
"""Cycles per motor turn of a strain wave gear's kinematic error: twice, as the wave generator has two lobes, and its
harmonic. They are tried whatever stands out more: counts that beat with the samples do so at any order.
Source: Castejon 2009, (17) to (19), whose largest coefficient is b_2; T. D. Tuttle, MIT AI-TR 1365 (1992)."""

SUBDIVISION = "encoder-subdivision-error"
LEAST_LINES = 16
"""Lines a turn that an encoder has at least."""


@dataclass(frozen=True, slots=True)
class Proposal:
    """A class to try at an order (1/rev); `resolution`: width of the peak, 1/rev; `height`: how far it stands out.

    `expected`: whether the order is tried whatever the spectrum shows.
    """

    kind: TermClass
    order: float
    resolution: float
    height: float = 0.0
    expected: bool = False


def propose(ground: Ground, known: Mapping[str, float]) -> tuple[list[Proposal], float, float]:
    """Scan every kind of piece and give the classes to try at each peak, and the tests among free and fixed orders.

    Kinds are scanned apart: a few start angles of a sweep would otherwise hide a line that a turning run shows clearly.
    """
    effects = periodic_effects()
    proposed = []
    for kind in dict.fromkeys(item.kind for item in ground.fit.about):
        has_motor = any(ground.fit.linear.map(_has_motor, kind))
        variable = "motor_position" if has_motor else "output_position"
        if has_motor:
            proposed.append(_of_sweeps(ground, kind, effects))
        proposed.append(_of_angle(ground, kind, variable, effects, known.get("output_encoder_counts")))
        proposed.append(_of_time(ground, kind))
    fixed = [Proposal(effect, effect.fixed_order, 0.0) for effect in effects if effect.fixed_order is not None]
    found = [proposal for some in proposed for proposal in some.found]
    free_tests = max(sum(some.free for some in proposed), 1.0)
    fixed_tests = max(len(fixed) + sum(some.fixed for some in proposed), 1)
    return found + fixed, FAMILIES * free_tests, FAMILIES * fixed_tests


@dataclass(frozen=True, slots=True)
class _Proposed:
    """What one scan proposes, and among how many tests of free and of fixed order."""

    found: list[Proposal]
    free: float
    fixed: int = 0


_NOTHING = _Proposed([], 0.0)


def _of_sweeps(ground: Ground, kind: Kind, effects: Sequence[TermClass]) -> _Proposed:
    """Propose lines of the start angle that are multiplied by the swept torque."""
    equation, _, moves = kind
    if equation is not Equation.TORSION or moves:
        return _NOTHING
    swept = scan(ground.fit, kind, "motor_position", times=Times.TORQUE)
    if swept is None:
        return _NOTHING
    modulations = _up_to(swept, MOST_MODULATIONS)
    found = _modulations(tops(modulations), swept.resolution, effects)
    return _Proposed(found, modulations.tests, sum(proposal.expected for proposal in found))


def _of_angle(
    ground: Ground, kind: Kind, variable: str, effects: Sequence[TermClass], counts: float | None
) -> _Proposed:
    """Propose lines of an angle, those of a torque also against the motion. `counts`: of the output's encoder."""
    equation, _, moves = kind
    found: list[Proposal] = []
    tests, fixed_tests = 0.0, 0
    ratio = ground.fit.model.ratio
    for times in (Times.NOTHING, Times.DIRECTION) if equation is not Equation.TORSION else (Times.NOTHING,):
        spectrum = scan(ground.fit, kind, variable, times=times)
        if spectrum is None:
            continue
        against = times is Times.DIRECTION
        most = 1
        highest = tops(spectrum)
        if equation is Equation.TORSION and not any(item.moves for item in ground.fit.about):
            highest += _low_orders(ground, effects, spectrum.resolution)
        for peak in highest:
            classes = _classes(equation, variable, peak.order, spectrum.resolution, ratio, effects, against=against)
            if not moves:
                # in a sweep the angle follows the torque: a line that does not act back is any compliance
                classes = [proposal for proposal in classes if not is_nameless_angle(proposal.kind)]
            found += [replace(proposal, height=peak.height) for proposal in classes]
            most = max(most, len(classes))
        tests += most * spectrum.tests  # every order may be any of the classes
        if equation is Equation.TORSION and variable == "motor_position" and moves:
            usual = [effect for effect in effects if effect.effect == KINEMATIC_ERROR]
            orders = [order for order in USUAL_ERRORS if order > spectrum.resolution]
            found += [Proposal(effect, n, spectrum.resolution, expected=True) for effect in usual for n in orders]
            fixed_tests += len(usual) * len(orders)
            subdivisions, tried = _subdivisions(spectrum, ratio, counts, effects) if ratio is not None else ([], 0)
            found += subdivisions
            fixed_tests += tried
    return _Proposed(found, tests, fixed_tests)


def _of_time(ground: Ground, kind: Kind) -> _Proposed:
    """Propose lines over the time in runs that turn at several speeds.

    A sweep is the same function of the time in every run: there nothing tells the time from what is swept.
    """
    hum = None if one_speed(ground.fit, kind) else scan(ground.fit, kind, "time", turning_only=True)
    if hum is None:
        return _NOTHING
    slowest = max(LOWEST_FREQUENCY, FEWEST_PERIODS * hum.resolution)
    over_time = TermClass(None, _BALANCE.get(kind[0], Entry.MOTOR), "time")
    found = [Proposal(over_time, p.order, hum.resolution, p.height) for p in tops(hum) if p.order > slowest]
    return _Proposed(found, hum.tests)


def _up_to(spectrum: Spectrum, highest: float) -> Spectrum:
    """Leave out higher orders."""
    keep = spectrum.orders <= highest
    tests = max(1.0, 2.0 * highest / spectrum.resolution)
    return replace(spectrum, orders=spectrum.orders[keep], power=spectrum.power[keep], tests=tests)


def _modulations(highest: Sequence[Peak], resolution: float, effects: Sequence[TermClass]) -> list[Proposal]:
    """Give what makes a torsion larger at some angles than at others."""
    kinds = [kind for kind in effects if kind.entry is Entry.TORSION_TIMES_TORQUE]
    whole = [float(order) for order in range(1, MOST_MODULATIONS + 1)]
    found = [Proposal(kind, order, resolution, expected=True) for kind in kinds for order in whole]
    return found + [Proposal(kind, peak.order, resolution, peak.height) for kind in kinds for peak in highest]


def _has_motor(item: LinearPiece, kind: Kind) -> bool:
    return item.piece.kind == kind and "motor_position" in item.evaluation.positions


def _low_orders(ground: Ground, effects: Sequence[TermClass], resolution: float) -> list[Peak]:
    """Give the low orders that explain most as an angle error, however the start angles make the spectrum look.

    Sweeps from a few angles see short pieces of a turn, and the base model takes up what is slow in each of them: the
    spectrum then peaks at aliases.
    """
    kind = next((kind for kind in effects if kind.entry is Entry.TORSION and kind.fixed_order is None), None)
    if kind is None:
        return []
    orders = np.arange(resolution, LOW_ORDERS, 0.5 * resolution).tolist()
    scored = sorted(zip(line_gains(ground, [(kind, order) for order in orders]), orders, strict=True), reverse=True)
    found: list[float] = []
    for _, order in scored:
        if len(found) < PEAKS_BY_POWER and all(abs(order - other) > resolution for other in found):
            found.append(order)
    return [Peak(order, 0.0) for order in found]


def tops(spectrum: Spectrum) -> list[Peak]:
    """Give the peaks that stand out most and those with most power; a slow strong line need not stand out."""
    found = list(peaks(spectrum, PEAKS_BY_HEIGHT))
    powerful = 0
    for place in np.argsort(spectrum.power)[::-1]:
        order = float(spectrum.orders[place])
        if all(abs(order - other.order) > spectrum.resolution for other in found):
            found.append(Peak(order, 0.0))
            powerful += 1
        if powerful == PEAKS_BY_POWER:
            break
    return found


def _classes(
    equation: Equation,
    variable: str,
    order: float,
    resolution: float,
    ratio: float | None,
    effects: Sequence[TermClass],
    *,
    against: bool,
) -> list[Proposal]:
    """Give what a line seen in `equation` could be. Slow lines of the motor angle belong to the output angle."""
    if variable == "motor_position" and order < 0.5 and ratio is not None:
        variable, order, resolution = "output_position", order * ratio, resolution * ratio
    current = equation is Equation.MOTOR_CURRENT
    motor = equation in (Equation.MOTOR_TORQUE, Equation.MOTOR_CURRENT)
    flips = (Entry.MOTOR_AGAINST_MOTION, Entry.OUTPUT_AGAINST_MOTION)
    kinds = [
        kind
        for kind in effects
        if kind.variable == variable
        and kind.fixed_order is None
        and kind.orders[0] - resolution <= order <= kind.orders[1] + resolution
        and (kind.entry in flips or (against and kind.entry is Entry.MOTOR_TIMES_TORQUE)) == against
        and kind.effect != SUBDIVISION
        # twice a turn an encoder errs tens of times less than a strain wave gear
        and not (kind.entry is Entry.MOTOR_ANGLE and order > 1.5)
        # mesh zone and ellipse turn with the plug; a faster product imitates anything within a sweep
        and not (kind.entry is Entry.TORSION_TIMES_TORQUE and order > MOST_MODULATIONS)
    ]
    if against:
        entry = Entry.MOTOR_AGAINST_MOTION if motor else Entry.OUTPUT_AGAINST_MOTION
        same = [kind for kind in kinds if kind.entry is entry] or [TermClass(None, entry, variable)]
        # while nothing loads the motor its torque is friction, and flips as friction does
        same += [kind for kind in kinds if motor and not current and kind.entry is Entry.MOTOR_TIMES_TORQUE]
        return [Proposal(kind, order, resolution) for kind in same]
    if current:
        kinds = [kind for kind in kinds if kind.entry is Entry.MOTOR]
    if variable == "output_position" or not kinds or equation is Equation.TORSION:
        # an angle error of the motor's angle acts back on the motor, unless it is none of the catalogue's
        entry = Entry.ANGLE_ONLY if equation is Equation.TORSION else Entry.MOTOR if motor else Entry.OUTPUT
        kinds.append(TermClass(None, entry, variable))
        if entry is Entry.ANGLE_ONLY and variable == "output_position":
            kinds.append(TermClass(None, Entry.OUTPUT, variable))
    return [Proposal(kind, order, resolution) for kind in kinds]


def _subdivisions(
    spectrum: Spectrum, ratio: float, counts: float | None, effects: Sequence[TermClass]
) -> tuple[list[Proposal], int]:
    """Give the output encoder's subdivision error at those orders that show most, and among how many they were chosen.

    A line count divides the counts a turn, so that few orders come into question, which need not stand out among all.
    `spectrum`: over the motor's angle (orders 1/rev of the motor); `ratio` of the gear; `counts` of the output encoder
    a turn. The orders that are given are 1/rev of the output.
    """
    whole = round(counts or 0.0)
    seen = np.arange(LEAST_LINES, float(spectrum.orders.max(initial=0.0)) * ratio)
    orders = seen[whole % seen == 0] if whole else seen[:0]
    kinds = [kind for kind in effects if kind.effect == SUBDIVISION]
    if not orders.size:
        return [], 0
    near = spectrum.orders.searchsorted(orders[:, None] / ratio + 0.5 * spectrum.resolution * np.array([-1.0, 1.0]))
    power = np.array([spectrum.power[low : high + 1].max(initial=0.0) for low, high in near])
    best = orders[np.argsort(power)[::-1][:PEAKS_BY_POWER]].tolist()
    width = spectrum.resolution * ratio
    return [Proposal(kind, order, width, expected=True) for kind in kinds for order in best], orders.size


def is_nameless_angle(kind: TermClass) -> bool:
    """Whether it is an error of the motor's angle that does not act back on the motor."""
    return kind.effect is None and kind.entry is Entry.ANGLE_ONLY and kind.variable == "motor_position"


def same_place(ratio: float, one: Proposal, other: Proposal) -> bool:
    """Whether two proposals are about the same line, be it of the motor or of the output angle; `ratio` of the gear."""
    if (one.kind.variable == "time") != (other.kind.variable == "time"):
        return False
    a, b = ((p.order * (1.0 if p.kind.variable == "motor_position" else 1.0 / ratio)) for p in (one, other))
    width = max(p.resolution * (1.0 if p.kind.variable == "motor_position" else 1.0 / ratio) for p in (one, other))
    return abs(a - b) <= 1.5 * width

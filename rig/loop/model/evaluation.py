"""How terms reach the prediction of a piece: what they add to angle, balances and friction, and how that shows."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.loop.model.curves import ANGLES, Curve
from rig.loop.model.shapes import CORNERS, Place, ShapeTerm, added_late, addition, derivatives, place_of
from rig.loop.model.terms import Derivative, Entry, LineValues, TermClass
from rig.loop.signals.play import PlayPath
from sim_backend.model.effects import Effect

Floats = NDArray[np.float64]
Rows = NDArray[np.intp]

FLEXSPLINE_TORQUE = "flexspline_torque"
"""Name of the torque by which an angle error acts on the motor, beside the signals of the contract."""


@dataclass(frozen=True, slots=True)
class Route:
    """How an addition to a balance reaches the prediction: times `weight` (n,), taken at the samples `rows` (n,).

    `rows` None: at the same sample; a play passes it on only from the last sample at which it slipped.
    """

    weight: Floats
    rows: Rows | None = None


@dataclass(frozen=True, slots=True)
class Evaluation:
    """Prediction (n,) of a piece over its whole track.

    `base`: derivative (n,) by base parameter. `angle`: whether an addition to the torsion shows; `motor`, `load`,
    `friction`: how additions to the motor and the output balance and to the level of friction show. `signals`: what
    terms may use, by name; `positions`: the angles among them. `torque`: output torque by which an angle error acts on
    the motor. `play`: the play that the law follows, None if none. `ratio`: of the gear, 1 where it is unknown.
    `averaged`: whether the output torque is the mean of its reading over the run.
    """

    value: Floats
    base: dict[str, Floats]
    angle: bool
    motor: Route | None
    load: Route | None
    friction: Route | None
    signals: dict[str, Floats]
    torque: Floats
    play: PlayPath | None
    ratio: float
    averaged: bool = False

    @property
    def settled(self) -> NDArray[np.bool_]:
        """Whether the law determines the value (n,), however a play began and whatever a servo does within friction."""
        return np.ones(self.value.size, dtype=bool) if self.play is None else self.play.settled & self.play.sliding

    @property
    def positions(self) -> dict[str, Floats]:
        """What lines may follow, by signal: the angles, and the time in turns of 2 pi a second."""
        return with_time({name: self.signals[name] for name in ANGLES if name in self.signals}, self.signals["time"])

    @property
    def direction(self) -> Floats:
        """Sign of the speed, shape (n,)."""
        return self.signals["direction"]

    def columns(self, kind: TermClass, derivatives: Sequence[Derivative], rows: Rows) -> list[Floats]:
        """Give what each of the `derivatives` of a line of this kind does at the samples `rows`, each (m,)."""
        found = []
        for plain, sloped in derivatives:
            column = np.zeros(rows.size)
            angle = angle_addition(kind.entry, plain, self.torque, self.ratio)
            if self.angle and angle is not None:
                column += angle[rows]
            motor = motor_addition(kind.entry, plain, sloped, self.torque, self.signals)
            if self.motor is not None and motor is not None:
                column += through(self.motor, motor, rows)
            load = load_addition(kind.entry, plain, self.direction)
            if self.load is not None and load is not None:
                column += through(self.load, load, rows)
            if self.friction is not None and kind.entry is Entry.MOTOR_AGAINST_MOTION:
                column += through(self.friction, plain, rows)
            found.append(column)
        return found

    def shape_columns(self, term: ShapeTerm, rows: Rows, step: float) -> list[Floats] | None:
        """Give the derivatives at the samples `rows` (m,) by every free parameter; None if the term does not act.

        `step`: s between the track's samples.
        """
        if not self.shows(term.effect):
            return None
        added = derivatives(term, self.signals, step)
        if added is None:
            return None
        return [self.shown(term.effect, value, rows) for value in added]

    def shows(self, effect: Effect | Curve) -> bool:
        """Whether the effect can change the prediction."""
        match place_of(effect):
            case Place.ANGLE:
                return self.angle
            case Place.MOTOR:
                return self.motor is not None
            case Place.LOAD:
                return self.load is not None
            case Place.FRICTION:
                return self.friction is not None

    def shown(self, effect: Effect | Curve, added: Floats, rows: Rows) -> Floats:
        """Give what an addition (n,) of an effect that shows does to the prediction at the samples `rows`, (m,)."""
        route = {Place.MOTOR: self.motor, Place.LOAD: self.load, Place.FRICTION: self.friction}.get(place_of(effect))
        added = as_read(effect, added, averaged=self.averaged)
        return added[rows] / _gear_of(effect, self.ratio) if route is None else through(route, added, rows)


def as_read(effect: Effect | Curve, added: Floats, *, averaged: bool) -> Floats:
    """Give what a wrong reading of the output torque adds (n,) to what is taken for it: a mean where a mean is."""
    return np.full(added.size, added.mean()) if averaged and effect.reads == "output_torque" else added


def _gear_of(effect: Effect | Curve, ratio: float) -> float:
    """Give what an angle is divided by before it counts at the output."""
    return ratio if effect.reads == "motor_position" else 1.0


def with_time(angles: Mapping[str, Floats], time: Floats) -> dict[str, Floats]:
    """Give the angles and, beside them, the time (s) as an angle that turns once a second: an order is then in Hz."""
    return {**angles, "time": 2.0 * math.pi * time}


def angle_addition(entry: Entry, value: Floats, torque: Floats, ratio: float) -> Floats | None:
    """Give what a term adds to the torsion (rad, shape (n,)), None if nothing."""
    match entry:
        case Entry.TORSION | Entry.ANGLE_ONLY:
            return value
        case Entry.MOTOR_ANGLE:
            return value / ratio
        case Entry.TORSION_TIMES_TORQUE:
            return torque * value
        case _:
            return None


def motor_addition(
    entry: Entry, value: Floats, slope: Floats, torque: Floats, signals: Mapping[str, Floats]
) -> Floats | None:
    """Give what a term adds to the motor balance (N*m, shape (n,)), None if nothing."""
    match entry:
        case Entry.MOTOR:
            return value
        case Entry.TORSION:
            return -torque * slope
        case Entry.TORSION_TIMES_TORQUE:
            return -0.5 * torque**2 * slope
        case Entry.MOTOR_TIMES_TORQUE:
            return signals["motor_torque"] * value if "motor_torque" in signals else None
        case _:
            return None


def load_addition(entry: Entry, value: Floats, direction: Floats) -> Floats | None:
    """Give what a term adds to the output balance (N*m, shape (n,)), None if nothing."""
    match entry:
        case Entry.OUTPUT:
            return value
        case Entry.OUTPUT_AGAINST_MOTION:
            return direction * value
        case _:
            return None


def through(route: Route, addition: Floats, rows: Rows) -> Floats:
    """Give what an addition (n,) to a balance does to the prediction at the samples `rows`, (m,)."""
    return route.weight[rows] * addition[rows if route.rows is None else route.rows[rows]]


@dataclass(frozen=True, slots=True)
class Added:
    """What the model's terms add on a track: its lines at the run's angles, its shapes, and the signals they take."""

    lines: tuple[tuple[Entry, LineValues], ...]
    shapes: tuple[ShapeTerm, ...]
    step: float
    ratio: float

    def angle(self, signals: Mapping[str, Floats]) -> Floats:
        """Give the sum added to the torsion, rad, shape (n,)."""
        torque = signals[FLEXSPLINE_TORQUE]
        parts = [angle_addition(entry, values.value, torque, self.ratio) for entry, values in self.lines]
        parts += [
            added / _gear_of(term.effect, self.ratio)
            for term in self._at(Place.ANGLE)
            if (added := addition(term, signals, self.step)) is not None
        ]
        return _sum(torque.size, parts)

    def load(self, signals: Mapping[str, Floats], *, averaged: bool = False) -> Floats:
        """Give the sum added to the output balance, N*m, shape (n,). `averaged`: see `Evaluation`."""
        parts = [load_addition(entry, values.value, signals["direction"]) for entry, values in self.lines]
        parts += [
            as_read(term.effect, added, averaged=averaged)
            for term in self._at(Place.LOAD)
            if (added := addition(term, signals, self.step)) is not None
        ]
        return _sum(signals["direction"].size, parts)

    def load_of_play(self, load: Floats, signals: Mapping[str, Floats], fine: int) -> Floats:
        """Give `load` (n,), what `load()` gives, at each of the `fine` values a sample that a play takes, (n * fine,).

        A play keeps its input's extremes, and there a late reading is wrong by less than around them.
        """
        found = np.repeat(load, fine)
        for term in self._at(Place.LOAD):
            late = added_late(term, signals, self.step)
            if late is not None:
                found += late - np.repeat(late.reshape(-1, fine).mean(axis=1), fine)
        return found

    def corners(self, signals: Mapping[str, Floats]) -> dict[str, Floats]:
        """Give, by name, the lines whose corners set things ringing, N*m, at the times the torque had them; {} if none.

        Its reading may show them late.
        """
        if CORNERS not in signals:
            return {}
        late = [added_late(term, signals, self.step, CORNERS) for term in self._at(Place.LOAD)]
        return {CORNERS: signals[CORNERS] - _sum(signals[CORNERS].size, late)}

    def motor(self, signals: Mapping[str, Floats]) -> Floats:
        """Give the sum added to the motor balance, N*m, shape (n,)."""
        torque = signals[FLEXSPLINE_TORQUE]
        parts = [motor_addition(entry, values.value, values.slope, torque, signals) for entry, values in self.lines]
        parts += [addition(term, signals, self.step) for term in self._at(Place.MOTOR)]
        return _sum(torque.size, parts)

    def friction(self, signals: Mapping[str, Floats]) -> Floats | None:
        """Give the sum added to the level of friction, N*m at the motor, shape (n,); None where nothing is."""
        parts: list[Floats | None] = [
            values.value for entry, values in self.lines if entry is Entry.MOTOR_AGAINST_MOTION
        ]
        parts += [addition(term, signals, self.step) for term in self._at(Place.FRICTION)]
        return _sum(signals["direction"].size, parts) if parts else None

    def misreads(self, signal: str) -> bool:
        """Whether a term makes this signal read otherwise, by what the signal itself is at that moment.

        What makes it late undoes itself, see `rig.loop.model.shapes.added_late`.
        """
        own = [term for term in self.shapes if term.effect.reads == signal and signal in term.effect.signals]
        return any(not term.is_late for term in own)

    def _at(self, place: Place) -> list[ShapeTerm]:
        return [term for term in self.shapes if place_of(term.effect) is place]


def _sum(size: int, parts: Sequence[Floats | None]) -> Floats:
    total = np.zeros(size)
    for part in parts:
        total = total if part is None else total + part
    return total

"""The model of one piece: base law and lines together, and how a further term would act on it.

    torsion        f(T - c_T) + g(M - c_M)/N + e                                               (28)
                   + J_l (k w)^2 e (f' + g'/N^2) when turning, for a line e of order k: the output's inertia
    turning        f(T - c_T) + g((T - c_T)/N + sgn(w) (T_c - T_cr) + (b - b_r) w)/N + e;
                   without motor torque f(T - c_T) + sgn(w) windup + e
    backdrive      M = play((T - c_T)/N; T_fb/N) + c_M + M_0
    free run       M = (T - c_T)/N + sgn(w) T_c + b w + c_M + M_0 + J_r a + K_r p  (a, p: acceleration and position of
                   the rotor's ripple; K_r: the springs behind it)
    locked output  T = play(N (M - c_M - J_r a); N T_fs) + c_T + T_0  (a: acceleration of the rotor on its springs)
    held still     M = M_0 + c_M
    motion at the output without motor torque  T = sgn(w) T_co + b_o w + J_o a + c_T + T_0  (a: acceleration)

c_T and c_M are what the terms add to the output and the motor balance, e what they add to the torsion. No regressor
contains the channel it predicts: where the angle is the target itself (torsion of a run that does not turn), the
angle that the model predicts stands in for the measured one; in the locked output torque the play's output stands
in for the measured torque. In a turning run detent torque, inertia and the friction T_cr, b_r of the rotor itself
stay in the rotor: the wave generator carries the load and the rest of the running friction.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.log.run import ProcedureName
from rig.loop.equations import Equation, Law, Piece
from rig.loop.parameters import ParameterTable
from rig.loop.play import play_path
from rig.loop.terms import Entry, Line, LineValues, TermClass, line_values
from rig.loop.tracks import Track
from sim_backend.model.compliance import (
    flexspline_stiffness,
    flexspline_torsion,
    wave_generator_stiffness,
    wave_generator_torsion,
)
from sim_backend.model.effects.inertia import inertia
from sim_backend.model.effects.viscous_friction import viscous_friction

Floats = NDArray[np.float64]
Rows = NDArray[np.intp]

ANGLE_PASSES = 2
"""Rounds in which the predicted angle takes up what the lines add; an error of 1e-4 rad is then known to 1e-8."""


@dataclass(frozen=True, slots=True)
class Model:
    """Base parameters in the order of `table`, the lines added to them, and the gear ratio (None: unknown)."""

    table: ParameterTable
    values: Floats
    ratio: float | None
    lines: tuple[Line, ...] = ()

    def value(self, name: str) -> float:
        """Give one base parameter, SI."""
        return float(self.values[self.table.names.index(name)])


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

    `base`: derivative (n,) by base parameter. `angle`: whether an addition to the torsion shows; `motor`, `load`:
    how additions to the motor and the output balance show. `positions`: the angles that terms may use, by signal.
    `torque`: output torque by which an angle error acts on the motor. `settled`: the law determines it,
    whatever the start of a play was and whatever a servo does within the friction.
    """

    value: Floats
    base: dict[str, Floats]
    angle: bool
    motor: Route | None
    load: Route | None
    positions: dict[str, Floats]
    torque: Floats
    direction: Floats
    settled: NDArray[np.bool_]

    def columns(self, kind: TermClass, values: LineValues, rows: Rows) -> tuple[Floats, Floats, Floats]:
        """Give the derivatives at the samples `rows` (m,) by sine, cosine and order of a line of this kind.

        `values`: the line at every sample of the track.
        """
        found = []
        for plain, sloped in (
            (values.by_sine, values.slope_by_sine),
            (values.by_cosine, values.slope_by_cosine),
            (values.by_order, values.slope_by_order),
        ):
            column = np.zeros(rows.size)
            if self.angle and kind.entry.is_angle:
                column += plain[rows]
            motor = motor_addition(kind.entry, plain, sloped, self.torque, self.direction)
            if self.motor is not None and motor is not None:
                column += _through(self.motor, motor, rows)
            load = load_addition(kind.entry, plain, self.direction)
            if self.load is not None and load is not None:
                column += _through(self.load, load, rows)
            found.append(column)
        return found[0], found[1], found[2]


def motor_addition(entry: Entry, value: Floats, slope: Floats, torque: Floats, direction: Floats) -> Floats | None:
    """Give what a term adds to the motor balance (N*m, shape (n,)), None if nothing."""
    match entry:
        case Entry.MOTOR:
            return value
        case Entry.TORSION:
            return -torque * slope
        case Entry.MOTOR_AGAINST_MOTION:
            return direction * value
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


def predict(piece: Piece, model: Model) -> Evaluation:
    """Evaluate the model for the piece's equation at every sample of its track."""
    match piece.law:
        case Law.TORSION:
            return _torsion(piece.track, model)
        case Law.BACKDRIVE:
            return _backdrive(piece.track, model)
        case Law.LOCKED:
            return _locked(piece.track, model)
        case Law.FREE_RUN | Law.HELD:
            return _motor(piece, model)
        case Law.OUTPUT_MOTION:
            return _output(piece.track, model)


def _through(route: Route, addition: Floats, rows: Rows) -> Floats:
    return route.weight[rows] * addition[rows if route.rows is None else route.rows[rows]]


def _ratio(model: Model) -> float:
    if model.ratio is None:
        raise ValueError("this equation needs the gear ratio")
    return model.ratio


@dataclass(frozen=True, slots=True)
class _Additions:
    """Sums over the model's lines, each (n,): to the torsion, to the output balance; values for the motor balance."""

    angle: Floats
    load: Floats
    evaluated: tuple[tuple[Entry, LineValues], ...]

    def motor(self, torque: Floats, direction: Floats) -> Floats:
        total = np.zeros(torque.size)
        for entry, values in self.evaluated:
            addition = motor_addition(entry, values.value, values.slope, torque, direction)
            total = total if addition is None else total + addition
        return total


def _additions(track: Track, model: Model, positions: dict[str, Floats]) -> _Additions:
    angle, load = np.zeros(track.size), np.zeros(track.size)
    evaluated = []
    for line in model.lines:
        position = positions.get(line.kind.variable)
        if position is None:
            continue
        values = line_values(line, position)
        evaluated.append((line.kind.entry, values))
        if line.kind.entry.is_angle:
            angle = angle + values.value
        addition = load_addition(line.kind.entry, values.value, track.direction)
        load = load if addition is None else load + addition
    return _Additions(angle, load, tuple(evaluated))


def _positions(track: Track, ratio: float | None) -> dict[str, Floats]:
    """Give the measured angles; one that was not recorded follows from the other through the gear."""
    found = {}
    if track.motor_position is not None:
        found["motor_position"] = track.motor_position
        if track.output_position is None and ratio is not None:
            found["output_position"] = -track.motor_position / ratio
    if track.output_position is not None:
        found["output_position"] = track.output_position
    return found


def _everywhere(track: Track) -> NDArray[np.bool_]:
    return np.ones(track.size, dtype=bool)


def _torsion(track: Track, model: Model) -> Evaluation:
    """Evaluate (28); where the angle must be predicted, first without the lines, then with them."""
    N = _ratio(model)
    if track.moves:
        return _torsion_at(track, model, _positions(track, N))
    value = _torsion_at(track, Model(model.table, model.values, N), {}).value
    for _ in range(ANGLE_PASSES if model.lines else 0):
        value = _torsion_at(track, model, _predicted_positions(track, value, N)).value
    return _torsion_at(track, model, _predicted_positions(track, value, N))


def _predicted_positions(track: Track, torsion: Floats, N: float) -> dict[str, Floats]:
    """Give theta_m = N (torsion - theta_o) about the run's mean angles; in a backdrive the motor is held."""
    motor, output = track.motor_position, track.output_position
    if motor is None or output is None:
        raise ValueError("torsion needs both positions")
    held = track.procedure is ProcedureName.BACKDRIVE
    yielding = np.zeros(track.size) if held else _yield_of_lock(track, output)
    wound = np.zeros(track.size) if held else N * (torsion - float(torsion.mean()) - yielding)
    return {
        "motor_position": float(motor.mean()) + wound,
        "output_position": float(output.mean()) + yielding,
    }


def _yield_of_lock(track: Track, output: Floats) -> Floats:
    """Give how far the lock lets the output go (rad, shape (n,)), as the part of its angle that follows the torque.

    A lock that gives way by a twentieth of the torsion makes the motor travel that much further. Only the torque enters
    it: the measured angle is part of the target.
    """
    if track.T is None:
        return np.zeros(track.size)
    torque = track.T - float(track.T.mean())
    power = float(torque @ torque)
    return torque * (float(torque @ output) / power if power > 0.0 else 0.0)


def _torsion_at(track: Track, model: Model, positions: dict[str, Floats]) -> Evaluation:
    N = _ratio(model)
    K_F0, C_F, K_w0, C_w = (model.value(name) for name in ("K_F0", "C_F", "K_w0", "C_w"))
    additions = _additions(track, model, positions)
    T = _load(track) - additions.load
    compliance = 1.0 / flexspline_stiffness(T, K_F0, C_F)
    flexspline = flexspline_torsion(T, K_F0, C_F)
    value = additions.angle + flexspline
    base: dict[str, Floats] = {}
    if track.T is not None or np.any(additions.load):
        base = {"K_F0": -flexspline / K_F0, "C_F": (T * compliance - flexspline) / C_F}
    motor_route, load_weight = None, -compliance
    if track.M is not None:
        sign = np.sign(track.speed)
        if track.moves:
            M = T / N + sign * (model.value("T_c") - model.value("T_cr"))
            M = M + viscous_friction(track.speed, model.value("b") - model.value("b_r"))
        else:
            M = track.M - additions.motor(T, track.direction)
        wound = wave_generator_torsion(M, K_w0, C_w) / N
        softness = 1.0 / (wave_generator_stiffness(M, K_w0, C_w) * N)
        value = value + wound
        base["K_w0"] = -wound / K_w0
        base["C_w"] = (M * softness - wound) / C_w
        if track.moves:
            base |= {"T_c": softness * sign, "T_cr": -softness * sign}
            base |= {"b": softness * track.speed, "b_r": -softness * track.speed}
            load_weight = load_weight - softness / N
        else:
            motor_route = Route(-softness)
    elif track.moves:
        sign = np.sign(track.speed)
        value = value + model.value("windup") * sign
        base["windup"] = sign
    if track.moves and model.lines:
        swing = -load_weight * _swing(track, model, positions)
        value = value + model.value("J_l") * swing
        base["J_l"] = swing
    return Evaluation(
        value, base, True, motor_route, Route(load_weight), positions, T, track.direction, _everywhere(track)
    )


def _swing(track: Track, model: Model, positions: dict[str, Floats]) -> Floats:
    """Give what an angle error adds to the output's acceleration, with the sign turned, rad/s^2.

    An inertia at the output does not follow an error that turns fast: the springs take up the difference, the
    flexible part of the error, which grows with the square of the speed (Castejon et al. 2009, section 4).
    """
    total = np.zeros(track.size)
    for line in model.lines:
        position = positions.get(line.kind.variable)
        if line.kind.entry is Entry.TORSION and position is not None:
            turns = track.speed if line.kind.variable == "motor_position" else track.speed / _ratio(model)
            total = total + (line.order * turns) ** 2 * line_values(line, position).value
    return total


def _load(track: Track) -> Floats:
    return np.zeros(track.size) if track.T is None else track.T


def _backdrive(track: Track, model: Model) -> Evaluation:
    N = _ratio(model)
    positions = _positions(track, N)
    additions = _additions(track, model, positions)
    T = _load(track) - additions.load
    ones = np.ones(track.size)
    play_load = np.zeros(track.size * track.fine) if track.play_load is None else track.play_load
    path = play_path((play_load - np.repeat(additions.load, track.fine)) / N, model.value("T_fb") / N, track.fine)
    value = path.output + additions.motor(T, track.direction) + model.value("M_0")
    base = {"T_fb": -path.side / N, "M_0": ones}
    carried = Route(np.where(path.slip >= 0, -1.0 / N, 0.0), np.maximum(path.slip, 0))
    # While the mesh sticks any motor torque within the friction holds the shaft: there the servo decides, not the law.
    known = path.settled & path.sliding
    return Evaluation(value, base, False, Route(ones), carried, positions, T, track.direction, known)


def _locked(track: Track, model: Model) -> Evaluation:
    N = _ratio(model)
    positions = _positions(track, N)
    additions = _additions(track, model, positions)
    drive = np.zeros(track.size * track.fine) if track.play_drive is None else track.play_drive
    radius = N * model.value("T_fs")
    path = play_path(N * drive, radius, track.fine)
    stand_in = path.output
    if model.lines:
        reaction = np.repeat(additions.motor(stand_in, track.direction), track.fine)
        path = play_path(N * (drive - reaction), radius, track.fine)
    ones = np.ones(track.size)
    carried = Route(np.where(path.slip >= 0, -N, 0.0), np.maximum(path.slip, 0))
    inertial = _through(carried, track.acceleration, np.arange(track.size))
    value = path.output + additions.load + model.value("T_0") + model.value("J_r") * inertial
    base = {"T_fs": -N * path.side, "T_0": ones}
    if np.any(track.acceleration):
        base["J_r"] = inertial
    return Evaluation(value, base, False, carried, Route(ones), positions, stand_in, track.direction, path.settled)


def _motor(piece: Piece, model: Model) -> Evaluation:
    track = piece.track
    current = piece.equation is Equation.MOTOR_CURRENT
    coulomb, viscous, constant = ("i_c", "i_v", "i_0") if current else ("T_c", "b", "M_0")
    positions = _positions(track, model.ratio)
    additions = _additions(track, model, positions)
    T = _load(track) - additions.load
    ones = np.ones(track.size)
    value = additions.motor(T, track.direction) + model.value(constant)
    base = {constant: ones}
    load = None
    if piece.law is Law.FREE_RUN:
        sign = np.sign(track.speed)
        value = value + sign * model.value(coulomb) + viscous_friction(track.speed, model.value(viscous))
        base[coulomb], base[viscous] = sign, track.speed
        if track.ripple is not None and not current and np.any(track.ripple.position):
            swinging = inertia(track.ripple.acceleration, model.value("J_r"))
            value = value + swinging + model.value("K_r") * track.ripple.position
            # as long as no term stands for the disturbance, the rotor's answer to it would be taken for it
            if any(line.kind.entry in (Entry.MOTOR, Entry.MOTOR_AGAINST_MOTION) for line in model.lines):
                base |= {"J_r": track.ripple.acceleration, "K_r": track.ripple.position}
        if model.ratio is not None and not current:
            value = value + T / model.ratio
            load = Route(-ones / model.ratio)
    return Evaluation(value, base, False, Route(ones), load, positions, T, track.direction, _everywhere(track))


def _output(track: Track, model: Model) -> Evaluation:
    positions = _positions(track, model.ratio)
    additions = _additions(track, model, positions)
    sign, ones = np.sign(track.speed), np.ones(track.size)
    friction = sign * model.value("T_co") + viscous_friction(track.speed, model.value("b_o"))
    value = additions.load + friction + inertia(track.acceleration, model.value("J_o")) + model.value("T_0")
    base = {"T_co": sign, "b_o": track.speed, "J_o": track.acceleration, "T_0": ones}
    nothing = np.zeros(track.size)
    return Evaluation(value, base, False, None, Route(ones), positions, nothing, track.direction, _everywhere(track))

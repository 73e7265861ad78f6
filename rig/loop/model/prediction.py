"""The model of one piece: base law, lines and shapes together, and how a further term would act on it.

    torsion        f(T - c_T) + g(M - c_M)/N + e   with f after (24), (10) or (11)             (28)
                   + J_l (k w)^2 e (f' + g'/N^2) when turning, for a line e of order k: the output's inertia
    turning        f(T - c_T) + g((T - c_T)/N + sgn(w) (T_c - T_cr) + (b - b_r) w)/N + e;
                   without motor torque f(T - c_T) + sgn(w) windup + e
    backdrive      M = play((T - c_T)/N; T_fb/N) + c_M + M_0
    free run       M = (T - c_T)/N + sgn(w) T_c + b w + c_M + M_0 + J_r a + K_r p  (a, p: acceleration and position of
                   the rotor's ripple; K_r: the springs behind it)
    locked output  T = play(N (M - c_M - J_r a); N T_fs) + c_T + T_0  (a: acceleration of the rotor on its springs)
    held still     M = M_0 + c_M
    motion at the output without motor torque  T = sgn(w) T_co + b_o w + J_o a + c_T + T_0  (a: acceleration)

c_T and c_M are what the terms add to the output and the motor balance, e what they add to the torsion. What they add
to the level of the friction goes with T_fs, T_fb and T_c, also in the windup of a turning run. No regressor
contains the channel it predicts: where the angle is the target itself (torsion of a run that does not turn), the
angle that the model predicts stands in for the measured one; in the locked output torque the play's output stands
in for the measured torque. In a turning run detent torque, inertia and the friction T_cr, b_r of the rotor itself
stay in the rotor: the wave generator carries the load and the rest of the running friction.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.log.run import ProcedureName
from rig.loop.model.curves import TURNING_LOAD
from rig.loop.model.equations import Equation, Law, Piece
from rig.loop.model.evaluation import FLEXSPLINE_TORQUE, Added, Evaluation, Route, through, with_time
from rig.loop.model.hum import with_hums
from rig.loop.model.parameters import ParameterTable
from rig.loop.model.shapes import CORNERS, FAST_MOTOR_TORQUE, SWEPT_TORQUE, ShapeTerm
from rig.loop.model.terms import Entry, Line, line_values
from rig.loop.signals.play import play_output, play_path
from rig.loop.signals.tracks import Track
from sim_backend.model.compliance import LAWS, Compliance, wave_generator_stiffness, wave_generator_torsion
from sim_backend.model.effects.inertia import inertia
from sim_backend.model.effects.viscous_friction import viscous_friction

Floats = NDArray[np.float64]
Rows = NDArray[np.intp]

ANGLE_PASSES = 2
"""Rounds in which an angle takes up what the lines add; an error of 1e-4 rad is then known to 1e-8."""

READING_ERRORS = {"output_position": Entry.ANGLE_ONLY, "motor_position": Entry.MOTOR_ANGLE}
LEAST_SHIFT = 1e-3
"""Where an encoder's own error enters, and the shift of its phase, rad, from which it matters that it shifts itself."""

LEAST_LOAD = 0.05
"""Part of the running friction by which the torque of a turning run must vary before it is a load and not noise."""

LEAST_LEVEL, MOST_LEVEL = 1e-3, 1e6
"""Share of the base level of friction that is left whatever is taken from it, and how often it may be multiplied."""

LEVEL_PASSES, SETTLED = 40, 1e-6
"""Rounds at most in which a friction takes up the torque that grows with it, and the relative change that ends them."""

READING_PASSES = 3
"""Rounds in which a current takes up the reading that it makes."""

LEAST_SLOPE = -0.5
"""Least slope of what is misread of a torque over the torque, by which the torque is looked for."""

LOG_STEP = 1e-4
"""Relative change of a parameter over which a law's torsion is differenced: right to 1e-8."""


@dataclass(frozen=True, slots=True)
class Model:
    """Base parameters in the order of `table`, lines and shapes added to them, and the gear ratio (None: unknown)."""

    table: ParameterTable
    values: Floats
    ratio: float | None
    lines: tuple[Line, ...] = ()
    shapes: tuple[ShapeTerm, ...] = ()

    def value(self, name: str) -> float:
        """Give one base parameter, SI."""
        return float(self.values[self.table.names.index(name)])

    @property
    def flexspline(self) -> tuple[float, ...]:
        """The parameters of the flexspline's law, in its order, SI."""
        return tuple(self.value(name) for name in LAWS[self.table.law].parameters)

    def flexspline_torsion(self, T: Floats) -> Floats:
        """Give the torsion of the flexspline, rad, under the torque T, N*m."""
        return LAWS[self.table.law].torsion(T, *self.flexspline)

    def flexspline_stiffness(self, T: Floats) -> Floats:
        """Give the local stiffness of the flexspline, N*m/rad, under the torque T, N*m."""
        return LAWS[self.table.law].stiffness(T, *self.flexspline)


def predict(piece: Piece, model: Model) -> Evaluation:
    """Evaluate the model for the piece's equation at every sample of its track."""
    track = with_hums(piece.track, model.lines)
    match piece.law:
        case Law.TORSION:
            return _torsion(track, model)
        case Law.BACKDRIVE:
            return _backdrive(track, model)
        case Law.LOCKED:
            return _locked(track, model)
        case Law.FREE_RUN | Law.HELD:
            return _motor(piece, track, model)
        case Law.OUTPUT_MOTION:
            return _output(track, model)


def _ratio(model: Model) -> float:
    if model.ratio is None:
        raise ValueError("this equation needs the gear ratio")
    return model.ratio


def _added(track: Track, model: Model, positions: Mapping[str, Floats]) -> Added:
    followed = with_time(positions, track.time) if model.lines else positions
    lines = tuple(
        (line.kind.entry, line_values(line, followed[line.kind.variable]))
        for line in model.lines
        if line.kind.variable in followed
    )
    return Added(lines, model.shapes, track.step, model.ratio or 1.0)


def _signals(
    track: Track, model: Model, positions: Mapping[str, Floats], T: Floats, M: Floats | None
) -> dict[str, Floats]:
    """Give what terms may use: T and M are the torques at the flexspline and of the motor, as far as known."""
    found = {**track.auxiliary, **positions, "time": track.time, "direction": track.direction}
    found["locked"] = np.full(track.size, float(track.procedure is ProcedureName.LOCKED_OUTPUT))
    of_motor = any(x is not None for x in (track.motor_position, track.motor_torque, track.motor_current))
    found["motor_velocity" if of_motor else "output_velocity"] = track.speed
    found["base_friction"] = np.abs(model.value("T_c")) + np.abs(model.value("b") * track.speed)
    # a sweep of the locked output winds the motor on; in a backdrive and at rest it is held
    found["turning"] = np.full(track.size, float(track.moves or track.procedure is ProcedureName.LOCKED_OUTPUT))
    if track.swept_torque is not None:
        found[SWEPT_TORQUE] = track.swept_torque
    if track.corners is not None:
        found[CORNERS] = track.corners
    if M is not None:
        found["motor_torque"] = M
        if track.torque_constant is not None:
            found["motor_current"] = M / track.torque_constant
    return _loaded(found, T, model.flexspline_torsion(T))


def _loaded(signals: dict[str, Floats], T: Floats, torsion: Floats | None = None) -> dict[str, Floats]:
    """Give the signals with another torque at the flexspline (N*m), and its torsion (rad) where that is known."""
    found = signals | {FLEXSPLINE_TORQUE: T, "output_torque": T, TURNING_LOAD: signals["turning"] * np.abs(T)}
    return found if torsion is None else found | {"flexspline_torsion": torsion}


def _positions(track: Track, model: Model) -> dict[str, Floats]:
    """Give the angles; one that was not recorded follows from the other through the gear."""
    found = {}
    if track.motor_position is not None:
        found["motor_position"] = _without_reading_error(track.motor_position, "motor_position", model)
        if track.output_position is None and model.ratio is not None:
            found["output_position"] = -track.motor_position / model.ratio
    if track.output_position is not None:
        found["output_position"] = _without_reading_error(track.output_position, "output_position", model)
    return found


def _without_reading_error(reading: Floats, name: str, model: Model) -> Floats:
    """Take from an encoder's reading (n,) its own error, which goes with the true angle and not with the reading."""
    own = [
        line
        for line in model.lines
        if line.kind.variable == name
        and line.kind.entry is READING_ERRORS[name]
        and line.order * line.amplitude > LEAST_SHIFT
    ]
    angle = reading
    for _ in range(ANGLE_PASSES if own else 0):
        angle = reading - sum((line_values(line, angle).value for line in own), np.zeros(reading.size))
    return angle


def _torsion(track: Track, model: Model) -> Evaluation:
    """Evaluate (28); where the angle must be predicted, first without the lines, then with them."""
    N = _ratio(model)
    if track.moves:
        return _torsion_at(track, model, _positions(track, model))
    value = _torsion_at(track, Model(model.table, model.values, N), {}).value
    for _ in range(ANGLE_PASSES if model.lines else 0):
        value = _torsion_at(track, model, _predicted_positions(track, value, N)).value
    return _torsion_at(track, model, _predicted_positions(track, value, N))


def _predicted_positions(track: Track, torsion: Floats, N: float) -> dict[str, Floats]:
    """Give theta_m = N (torsion - theta_o) about the run's mean angles; in a backdrive the output turns."""
    motor, output = track.motor_position, track.output_position
    if motor is None or output is None:
        raise ValueError("torsion needs both positions")
    wound = torsion - float(torsion.mean())
    if track.procedure is ProcedureName.BACKDRIVE:
        moved, turned = wound, np.zeros(track.size)
    else:
        moved = _yield_of_lock(track, output)
        turned = N * (wound - moved)
    return {"motor_position": float(motor.mean()) + turned, "output_position": float(output.mean()) + moved}


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


def _misread(reading: Floats, of_true: Callable[[Floats], Floats], *, misreads: bool) -> Floats:
    """Give what a torque (n,) that reads `reading` is added, where `of_true` gives that of the torque itself.

    By secants: a gain is solved at once, what bends in a few rounds.
    """
    error = of_true(reading)
    for _ in range(READING_PASSES if misreads else 0):
        torque = reading - error
        added, power = of_true(torque), float(torque @ torque)
        slope = max(float(added @ torque) / power, LEAST_SLOPE) if power > 0.0 else 0.0
        error = error - (reading - added - torque) / (1.0 + slope)
    return error


def _load_added(track: Track, model: Model, added: Added, signals: dict[str, Floats], *, averaged: bool) -> Floats:
    """Give what is added to the output's balance, N*m, (n,): the sensor's own error is that of the true torque."""
    return _misread(
        _load(track, model),
        lambda torque: added.load(signals | {"output_torque": torque}, averaged=averaged),
        misreads=added.misreads("output_torque"),
    )


def _motor_added(reading: Floats, added: Added, signals: dict[str, Floats]) -> Floats:
    """Give what is added to the motor's balance, N*m, (n,), where the motor torque reads `reading` (n,)."""
    fast = signals.get(FAST_MOTOR_TORQUE)

    def of_true(torque: Floats) -> Floats:
        true = {"motor_torque": torque}
        if fast is not None:
            true[FAST_MOTOR_TORQUE] = fast - np.repeat(reading - torque, fast.size // reading.size)
        return added.motor(signals | true)

    return _misread(reading, of_true, misreads=added.misreads("motor_torque"))


def _torsion_at(track: Track, model: Model, positions: dict[str, Floats]) -> Evaluation:
    N = _ratio(model)
    K_w0, C_w = model.value("K_w0"), model.value("C_w")
    added = _added(track, model, positions)
    signals = _signals(track, model, positions, _load(track, model), track.M)
    if track.M is not None and track.play_drive is not None:
        signals[FAST_MOTOR_TORQUE] = track.play_drive
    averaged = not _is_loaded(track, model)
    load = _load_added(track, model, added, signals, averaged=averaged)
    T = _load(track, model) - load
    compliance = 1.0 / model.flexspline_stiffness(T)
    flexspline = model.flexspline_torsion(T)
    signals = _loaded(signals, T, flexspline) | added.corners(signals)
    value = added.angle(signals) + flexspline
    base: dict[str, Floats] = {}
    if track.T is not None or np.any(load):
        base = _flexspline_columns(T, flexspline, compliance, model)
    motor_route, friction, load_weight = None, None, -compliance
    if track.M is not None:
        sign = np.sign(track.speed)
        if track.moves:
            level = added.friction(signals)
            M = T / N + sign * (model.value("T_c") - model.value("T_cr") + (0.0 if level is None else level))
            M = M + viscous_friction(track.speed, model.value("b") - model.value("b_r"))
        else:
            M = track.M - _motor_added(track.M, added, signals)
        wound = wave_generator_torsion(M, K_w0, C_w) / N
        softness = 1.0 / (wave_generator_stiffness(M, K_w0, C_w) * N)
        value = value + wound
        base["K_w0"] = -wound / K_w0
        base["C_w"] = (M * softness - wound) / C_w
        if track.moves:
            base |= {"T_c": softness * sign, "T_cr": -softness * sign}
            base |= {"b": softness * track.speed, "b_r": -softness * track.speed}
            load_weight, friction = load_weight - softness / N, Route(softness * sign)
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
    return Evaluation(value, base, True, motor_route, Route(load_weight), friction, signals, T, None, N, averaged)


def _flexspline_columns(T: Floats, torsion: Floats, compliance: Floats, model: Model) -> dict[str, Floats]:
    """Give the derivatives (n,) of the flexspline's torsion by its law's parameters; `torsion`, `compliance`: at T."""
    law, values = LAWS[model.table.law], model.flexspline
    if model.table.law is Compliance.ARCTAN:
        K_F0, C_F = values
        return {"K_F0": -torsion / K_F0, "C_F": (T * compliance - torsion) / C_F}
    found = {}
    for k, name in enumerate(law.parameters):
        up, down = (
            law.torsion(T, *values[:k], values[k] * math.exp(step), *values[k + 1 :]) for step in (LOG_STEP, -LOG_STEP)
        )
        found[name] = (up - down) / (2.0 * LOG_STEP * values[k])
    return found


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


def _load(track: Track, model: Model) -> Floats:
    """Give the torque at the output, N*m; of a turning run without a load its mean, because the rest is noise."""
    if track.T is None:
        return np.zeros(track.size)
    return track.T if _is_loaded(track, model) else np.full(track.size, float(track.T.mean()))


def _is_loaded(track: Track, model: Model) -> bool:
    if track.T is None or not track.moves:
        return True
    return float(np.std(track.T)) > LEAST_LOAD * (model.ratio or 1.0) * abs(model.value("T_c"))


def _backdrive(track: Track, model: Model) -> Evaluation:
    N = _ratio(model)
    positions = _positions(track, model)
    added = _added(track, model, positions)
    signals = _signals(track, model, positions, _load(track, model), None)
    signals["base_friction"] = np.full(track.size, abs(model.value("T_fb")) / N)
    load = _load_added(track, model, added, signals, averaged=False)
    play_load = np.zeros(track.size * track.fine) if track.play_load is None else track.play_load
    play_load = play_load - added.load_of_play(load, signals, track.fine)
    T = _load(track, model) - load
    signals = _loaded(signals, T)
    radius = _radius(model.value("T_fb") / N, added.friction(signals), track.fine)
    path = play_path(play_load / N, radius, track.fine)
    value = _motor_reading(track, added, signals, path.output) + model.value("M_0")
    ones = np.ones(track.size)
    base = {"T_fb": -path.side / N, "M_0": ones}
    slipped, last = path.slip >= 0, np.maximum(path.slip, 0)
    carried = Route(np.where(slipped, -1.0 / N, 0.0), last)
    # While the mesh sticks any motor torque within the friction holds the shaft: there the servo decides, not the law.
    return Evaluation(value, base, False, Route(ones), carried, Route(-path.side, last), signals, T, path, N)


def _locked(track: Track, model: Model) -> Evaluation:
    N = _ratio(model)
    positions = _positions(track, model)
    added = _added(track, model, positions)
    drive = np.zeros(track.size * track.fine) if track.play_drive is None else track.play_drive
    pushed, radius = N * drive, np.asarray(N * model.value("T_fs"))
    stand_in = play_output(pushed, radius, track.fine)
    signals = _signals(track, model, positions, stand_in, track.M)
    signals["base_friction"] = np.full(track.size, abs(model.value("T_fs")))
    for _ in range(LEVEL_PASSES if model.lines or model.shapes else 0):
        own = added.motor(signals) if track.M is None else _motor_added(track.M, added, signals)
        pushed = N * (drive - np.repeat(own, track.fine))
        radius = np.asarray(N * _radius(model.value("T_fs"), added.friction(signals), track.fine))
        before, stand_in = stand_in, play_output(pushed, radius, track.fine)
        change = np.abs(stand_in - before).max(initial=0.0)
        signals = _loaded(signals, stand_in)
        if change <= SETTLED * np.abs(stand_in).max(initial=0.0):
            break
    path = play_path(pushed, radius, track.fine)
    ones = np.ones(track.size)
    slipped, last = path.slip >= 0, np.maximum(path.slip, 0)
    carried = Route(np.where(slipped, -N, 0.0), last)
    inertial = through(carried, track.acceleration, np.arange(track.size))
    value = stand_in + added.load(signals) + model.value("T_0") + model.value("J_r") * inertial
    base = {"T_fs": -N * path.side, "T_0": ones}
    if np.any(track.acceleration):
        base["J_r"] = inertial
    friction = Route(-N * path.side, last)
    # While the mesh sticks the torque keeps what the rotor's ringing and the gear's own errors made of it.
    return Evaluation(value, base, False, carried, Route(ones), friction, signals, stand_in, path, N)


def _motor_reading(track: Track, added: Added, signals: dict[str, Floats], torque: Floats) -> Floats:
    """Give what the motor torque reads where the mesh asks for `torque`, N*m, (n,); puts the motor into `signals`.

    The current follows from the reading that it makes.
    """
    signals["motor_torque"] = torque
    reading = torque + added.motor(signals)
    for _ in range(READING_PASSES if added.shapes and track.torque_constant is not None else 1):
        if track.torque_constant is not None:
            signals["motor_current"] = reading / track.torque_constant
            reading = torque + added.motor(signals)
    return reading


def _radius(level: float, added: Floats | None, fine: int) -> Floats | float:
    """Give the radius of a play whose level grows by `added` (n,), one value for every fine sample."""
    return level if added is None else np.repeat(np.clip(level + added, LEAST_LEVEL * level, MOST_LEVEL * level), fine)


def _motor(piece: Piece, track: Track, model: Model) -> Evaluation:
    current = piece.equation is Equation.MOTOR_CURRENT
    coulomb, viscous, constant = ("i_c", "i_v", "i_0") if current else ("T_c", "b", "M_0")
    positions = _positions(track, model)
    added = _added(track, model, positions)
    signals = _signals(track, model, positions, _load(track, model), None)
    averaged = not _is_loaded(track, model)
    load = _load_added(track, model, added, signals, averaged=averaged)
    T = _load(track, model) - load
    signals = _loaded(signals, T)
    ones = np.ones(track.size)
    running = np.zeros(track.size)
    base = {constant: ones}
    load_route = friction = None
    if piece.law is Law.FREE_RUN:
        sign = np.sign(track.speed)
        level = added.friction(signals)
        running = sign * (model.value(coulomb) + (0.0 if level is None else level))
        running = running + viscous_friction(track.speed, model.value(viscous))
        base[coulomb], base[viscous] = sign, track.speed
        friction = Route(sign)
        if model.ratio is not None and not current:
            running = running + T / model.ratio
            load_route = Route(-ones / model.ratio)
    else:
        # held from angle to angle, the shaft was last moved in this direction
        level = added.friction(signals)
        running = running if level is None else track.direction * level
        friction = Route(track.direction)
    value = _motor_reading(track, added, signals, running) + model.value(constant)
    if piece.law is Law.FREE_RUN and track.ripple is not None and not current and np.any(track.ripple.position):
        value = (
            value + inertia(track.ripple.acceleration, model.value("J_r")) + model.value("K_r") * track.ripple.position
        )
        # as long as no term stands for the disturbance, the rotor's answer to it would be taken for it
        if any(line.kind.entry.equation is Equation.MOTOR_TORQUE for line in model.lines):
            base |= {"J_r": track.ripple.acceleration, "K_r": track.ripple.position}
    ratio = model.ratio or 1.0
    return Evaluation(value, base, False, Route(ones), load_route, friction, signals, T, None, ratio, averaged)


def _output(track: Track, model: Model) -> Evaluation:
    positions = _positions(track, model)
    added = _added(track, model, positions)
    sign, ones, nothing = np.sign(track.speed), np.ones(track.size), np.zeros(track.size)
    signals = _signals(track, model, positions, nothing, None)
    friction = sign * model.value("T_co") + viscous_friction(track.speed, model.value("b_o"))
    value = added.load(signals) + friction + inertia(track.acceleration, model.value("J_o")) + model.value("T_0")
    base = {"T_co": sign, "b_o": track.speed, "J_o": track.acceleration, "T_0": ones}
    return Evaluation(value, base, False, None, Route(ones), None, signals, nothing, None, model.ratio or 1.0)

"""Which equation a run allows, and by which base law (the contract's table of equations)."""

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from rig.log.run import ProcedureName
from rig.loop.signals.recordings import FEWEST_SAMPLES
from rig.loop.signals.tracks import Track

Floats = NDArray[np.float64]


SAME_READING = 1e-11
"""rad within which a torsion reads the same: what rounding leaves of equal counts."""


class Equation(StrEnum):
    """What is predicted, as in the loop's result."""

    TORSION = "torsion"
    MOTOR_TORQUE = "motor-torque"
    MOTOR_CURRENT = "motor-current"
    OUTPUT_TORQUE = "output-torque"

    @property
    def unit(self) -> str:
        """Unit of target and residual."""
        return {"torsion": "rad", "motor-current": "A"}.get(self.value, "N*m")

    @property
    def column(self) -> str:
        """Name of the predicted quantity in prediction files."""
        return self.value.replace("-", "_")


class Law(StrEnum):
    """Base law by which a run predicts an equation."""

    TORSION = "torsion"
    BACKDRIVE = "backdrive play"
    FREE_RUN = "running friction"
    HELD = "held still"
    LOCKED = "locked play"
    OUTPUT_MOTION = "friction at the output"


@dataclass(frozen=True, slots=True)
class Piece:
    """One equation of one run: `target` at the samples `index` (m,) of the track, in the equation's unit.

    An angle's constant offset is a nuisance of the run, so that torsion is used with its mean removed.
    """

    track: Track
    equation: Equation
    law: Law
    index: NDArray[np.intp]
    target: Floats

    @property
    def demeaned(self) -> bool:
        """Whether the run's own constant is projected out."""
        return self.equation is Equation.TORSION

    @property
    def kind(self) -> tuple[Equation, Law, bool]:
        """Pieces of one kind share their noise."""
        return self.equation, self.law, self.track.moves


def pieces_of(track: Track, ratio: float | None) -> tuple[Piece, ...]:
    """Give the equations which the run allows. `ratio`: of the gear, None if unknown."""
    found: list[Piece] = []
    for equation, law, target in _laws(track, ratio):
        moving = law in (Law.FREE_RUN, Law.OUTPUT_MOTION) or (law is Law.TORSION and track.moves)
        use = track.usable & track.steady if moving else track.usable
        index = np.flatnonzero(use)
        if index.size >= FEWEST_SAMPLES:
            found.append(Piece(track, equation, law, index, target[index]))
    return tuple(found)


def distinct_readings(piece: Piece) -> Piece:
    """Keep the middle one of the samples over which the angles of a drive that does not turn read the same.

    A held encoder gives one count over and over: its error, up to half a count, does not average out, and a hold of a
    minute would outweigh the sweep.
    """
    if piece.equation is not Equation.TORSION or piece.track.moves:
        return piece
    edges = np.flatnonzero(np.abs(np.diff(piece.target)) > SAME_READING) + 1
    bounds = np.concatenate([[0], edges, [piece.target.size]])
    # of an even number of samples the earlier and the later middle in turn: always one of them would be a delay
    middle = (bounds[:-1] + bounds[1:] - 1 + np.arange(bounds.size - 1) % 2) // 2
    if middle.size < FEWEST_SAMPLES:
        return piece
    return replace(piece, index=piece.index[middle], target=piece.target[middle])


def target_of(piece: Piece, ratio: float | None) -> Floats:
    """Give the target at every sample of the piece's track, shape (n,)."""
    return next(target for equation, _, target in _laws(piece.track, ratio) if equation is piece.equation)


def _laws(track: Track, ratio: float | None) -> list[tuple[Equation, Law, Floats]]:
    found: list[tuple[Equation, Law, Floats]] = []
    if track.procedure is ProcedureName.STARTING_TORQUE:
        return found
    if track.motor_position is not None and track.output_position is not None and ratio is not None:
        found.append((Equation.TORSION, Law.TORSION, track.output_position + track.motor_position / ratio))
    motor = _motor_law(track, ratio)
    if motor is not None and track.motor_torque is not None:
        found.append((Equation.MOTOR_TORQUE, motor, track.motor_torque))
    if motor is not None and motor is not Law.BACKDRIVE and track.motor_current is not None:
        found.append((Equation.MOTOR_CURRENT, motor, track.motor_current))
    output = _output_law(track, ratio)
    if output is not None and track.output_torque is not None:
        found.append((Equation.OUTPUT_TORQUE, output, track.output_torque))
    return found


def _motor_law(track: Track, ratio: float | None) -> Law | None:
    if track.procedure is ProcedureName.LOCKED_OUTPUT:
        return None
    if track.procedure is ProcedureName.BACKDRIVE:
        return Law.BACKDRIVE if track.T is not None and ratio is not None and not track.moves else None
    if track.held:
        return Law.HELD
    return Law.FREE_RUN if bool(track.steady.any()) else None


def _output_law(track: Track, ratio: float | None) -> Law | None:
    if track.procedure is ProcedureName.LOCKED_OUTPUT:
        return Law.LOCKED if track.M is not None and ratio is not None else None
    if track.procedure is ProcedureName.BACKDRIVE:
        return None
    no_motor = track.motor_torque is None and track.motor_current is None
    moving = bool(track.steady.any()) and track.output_position is not None
    return Law.OUTPUT_MOTION if no_motor and moving else None

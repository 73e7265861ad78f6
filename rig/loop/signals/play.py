"""The play operator as the fit needs it: output, where it slips, and where its unknown start no longer matters."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim_backend.model.friction import play

Floats = NDArray[np.float64]

NEAR_THE_WALL = 0.9
"""Part of the radius from which on a play with a noisy input counts as sliding."""

SLIDING_TRAVEL = 0.5
"""Radii by which the output must have moved since it stuck, until what happened while it stuck is forgotten."""

AT_THE_WALL = 1e-9
"""Distance from the wall, relative to the radius, at which the play counts as slipping."""


@dataclass(frozen=True, slots=True)
class PlayPath:
    """A play of +-`radius` (n * fine,) followed through its `inputs` (n * fine,): `output` (n,) and where it slipped.

    `slip`: index of the last sample at which the play slipped, -1 before the first; an output follows a change of
    its input only through that sample. `side`: +1 where it slipped with a rising input, -1 with a falling one, 0
    before the first.
    """

    inputs: Floats
    radius: Floats
    fine: int
    output: Floats
    slip: NDArray[np.intp]
    side: Floats

    @property
    def settled(self) -> NDArray[np.bool_]:
        """Whether the output no longer depends on the unknown start, (n,)."""
        first, reach = float(self.inputs[0]), float(self.radius[0])
        ends = [play(self.inputs, self.radius, start=first + side * reach) for side in (1.0, -1.0)]
        return self._joined(ends[0] - ends[1] <= AT_THE_WALL * self.radius)

    @property
    def sliding(self) -> NDArray[np.bool_]:
        """Whether the output follows its input and has done so for a while, (n,)."""
        output = play(self.inputs, self.radius)
        at_the_wall = np.abs(self.inputs - output) >= NEAR_THE_WALL * self.radius
        stuck = np.maximum.accumulate(np.where(at_the_wall, 0, np.arange(output.size)))
        return self._joined(at_the_wall & (np.abs(output - output[stuck]) >= SLIDING_TRAVEL * self.radius))

    def _joined(self, flags: NDArray[np.bool_]) -> NDArray[np.bool_]:
        return np.asarray(flags.reshape(-1, self.fine).all(axis=1))


def play_path(inputs: Floats, radius: Floats | float, fine: int = 1) -> PlayPath:
    """Follow `inputs` (n * fine,) from the equilibrium of a drive that was at rest without torque before.

    A play remembers the peaks of its input, so that it is followed sample by sample; only then are `fine` samples
    joined to one, by their mean. `radius`: one value, or one for every input.
    """
    radius = np.broadcast_to(np.asarray(radius, dtype=float), inputs.shape)
    output = play(inputs, radius)
    away = inputs - output
    slips = np.abs(away) >= radius * (1.0 - AT_THE_WALL)
    slip = np.maximum.accumulate(np.where(slips, np.arange(inputs.size), -1))
    side = np.where(slip >= 0, np.sign(away[np.maximum(slip, 0)]), 0.0)
    if fine > 1:
        output, side = output.reshape(-1, fine).mean(axis=1), side.reshape(-1, fine).mean(axis=1)
        slip = slip[fine - 1 :: fine] // fine  # -1 stays -1
    return PlayPath(inputs, radius, fine, output, slip, side)


def play_output(inputs: Floats, radius: Floats | float, fine: int = 1) -> Floats:
    """Give the output of `play_path` alone, shape (n,)."""
    output = play(inputs, radius)
    return output if fine == 1 else np.asarray(output.reshape(-1, fine).mean(axis=1))

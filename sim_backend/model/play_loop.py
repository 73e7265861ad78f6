"""The play operator over an array, as scalar code for compilation; see `friction`."""

import numpy as np
from numpy.typing import NDArray


def play_loop(
    inputs: NDArray[np.float64], radii: NDArray[np.float64], state: float, outputs: NDArray[np.float64]
) -> None:
    """Write the play of `inputs` with `radii` into `outputs`; all shape (n,)."""
    for i in range(len(inputs)):
        state = min(max(state, inputs[i] - radii[i]), inputs[i] + radii[i])
        outputs[i] = state
